"""A planner that keeps what can be used again: many queries on one map, changed obstacles."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import as_number, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.headings import origin_of
from maneuver_automaton.budget import Watch
from maneuver_automaton.collision import (
    AnyObstacle,
    AnyShape,
    Shape,
    Zone,
    as_footprint,
    as_obstacles,
)
from maneuver_automaton.costs import Cost, StageCost
from maneuver_automaton.places import PlaceCost, check_place_costs
from maneuver_automaton.planning.many import Asked, answers, queries_of
from maneuver_automaton.planning.plan import plan_in, prepare
from maneuver_automaton.planning.result import PlanResult, Workspace
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem, SearchSettings, Via


@dataclass(frozen=True, eq=False)
class Planner:
    """An automaton, a cost and a map, ready for any start and goal.

    Making one compiles or loads the kernels, makes or loads the table of the cost to go, and
    prepares the map for the search, for FCL and for the audit; a query pays for none of it.

    Examples
    --------
    >>> from maneuver_automaton import Box, Unicycle
    >>> controls = {"ahead": (1, 0), "left": (0, 1), "right": (0, -1)}
    >>> robot = Automaton.of_controls(Unicycle(), controls)
    >>> planner = Planner(robot, obstacles=[Box([1, 4], [3, 0])], footprint=Box([0.4, 0.4]))
    >>> planner.plan([0, 0, 0], [6, 0, 0], time_limit=2.0).audit.passed
    True
    >>> planner.with_obstacles([]).plan([0, 0, 0], [6, 0, 0]).plan.word
    ('ahead',)
    """

    automaton: Automaton
    cost: StageCost = field(default_factory=lambda: Cost(time=1.0), kw_only=True)
    horizon: Horizon = field(default_factory=Horizon, kw_only=True)
    bounds: Bounds = field(default_factory=Bounds, kw_only=True)
    search: SearchSettings = field(default_factory=SearchSettings, kw_only=True)
    obstacles: tuple[AnyObstacle, ...] = field(default=(), kw_only=True)
    footprint: tuple[Shape, ...] = field(default=(), kw_only=True)
    parts: Mapping[str, tuple[Shape, ...]] = field(default_factory=dict, kw_only=True)  # carried
    body_height: tuple[float, float] = field(default=(0.0, 0.0), kw_only=True)  # [m] about z
    margin: float = field(default=0.0, kw_only=True)  # [m]
    zones: tuple[Zone, ...] = field(default=(), kw_only=True)
    place_costs: tuple[PlaceCost, ...] = field(default=(), kw_only=True)
    start_trim: str | None = field(default=None, kw_only=True)  # of queries that name none
    workspace: Workspace = field(init=False)  # what its queries share
    _first: Problem = field(init=False)  # a query whose every value was checked

    __repr__ = brief

    if TYPE_CHECKING:

        def __init__(
            self,
            automaton: Automaton,
            *,
            cost: StageCost = ...,
            horizon: Horizon = ...,
            bounds: Bounds = ...,
            search: SearchSettings = ...,
            obstacles: AnyObstacle | AnyShape | Sequence[AnyObstacle | AnyShape] = (),
            footprint: AnyShape | Sequence[AnyShape] = (),
            parts: Mapping[str, AnyShape | Sequence[AnyShape]] = ...,
            body_height: tuple[float, float] = (0.0, 0.0),
            margin: float = 0.0,
            zones: Sequence[Zone] = (),
            place_costs: PlaceCost | Sequence[PlaceCost] = (),
            start_trim: str | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        plain_numbers(self)
        object.__setattr__(self, "obstacles", as_obstacles(self.obstacles))
        object.__setattr__(self, "footprint", as_footprint(self.footprint))
        object.__setattr__(self, "zones", tuple(self.zones))
        object.__setattr__(self, "place_costs", check_place_costs(self.place_costs))
        object.__setattr__(self, "workspace", Workspace(self.obstacles))
        automaton = self.automaton
        # With inertia, without a rest, it has to be given a trim to end in; any will do here.
        named = automaton.has_inertia and automaton.rest is None
        last = automaton.trim_names[0] if named else None
        here = origin_of(automaton, automaton.trims[0])
        aim = Goal(pose=np.where(np.arange(here.size) == 2, here, 1.0), trim=last)
        asked = {"start": here, "goals": aim, "start_trim": self.start_trim or last}
        first = Problem(**self.stated | asked)
        object.__setattr__(self, "_first", first)
        prepare(first, self.workspace)

    def __reduce__(self) -> tuple[Callable[[], Planner], tuple[()]]:
        """What makes the like of it: what is prepared is made again, in another process too."""
        return functools.partial(Planner, **self.stated), ()

    @property
    def stated(self) -> dict[str, Any]:
        """What it is made of, by the names of its arguments."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.init}

    def problem(
        self,
        start: ArrayLike,
        goals: ArrayLike | Goal | Sequence[Goal],
        *,
        start_time: float = 0.0,
        start_trim: str | None = None,
        start_state: ArrayLike | Mapping[str, float] | None = None,
        via: Via | ArrayLike | Sequence[Via] = (),
        order: str = "given",
    ) -> Problem:
        """The problem of one query; `start_trim` or `start_state` goes before the planner's own."""
        if start_trim is None and start_state is None:
            start_trim = self.start_trim
        if start_trim is None and start_state is None and self._first.start_trim is not None:
            asked = {"start": start, "goals": goals, "start_time": start_time, "start_trim": None}
            one = Problem(**self.stated | asked)
        else:
            one = self._first.starting_at(
                start, time=start_time, goals=goals, trim=start_trim, state=start_state
            )
        on_the_way: Any = via
        passes = bool(via) if isinstance(via, tuple) else len(np.atleast_1d(on_the_way)) > 0
        return replace(one, via=on_the_way, order=order) if passes else one

    def plan(
        self,
        start: ArrayLike,
        goals: ArrayLike | Goal | Sequence[Goal],
        *,
        time_limit: float = 5.0,
        alternatives: int = 0,
        start_time: float = 0.0,
        start_trim: str | None = None,
        start_state: ArrayLike | Mapping[str, float] | None = None,
        via: Via | ArrayLike | Sequence[Via] = (),
        order: str = "given",
        gap: float | None = None,
        watch: Watch | None = None,
    ) -> PlanResult:
        """Plan as `plan` does for the problem from `start` (dof,) to `goals`, at `start_time` [s].

        It starts in `start_trim`, or in the reduced state `start_state`, or else in the planner's
        own trim; a `Goal` names the last one. It passes `via` in their `order`. What is proven for
        a `gap` is kept, and known at once from other starts to the same goals.
        """
        problem = self.problem(
            start,
            goals,
            start_time=start_time,
            start_trim=start_trim,
            start_state=start_state,
            via=via,
            order=order,
        )
        return plan_in(
            self.workspace,
            problem,
            time_limit=time_limit,
            alternatives=alternatives,
            gap=gap,
            watch=watch,
        )

    def plan_many(
        self,
        starts: ArrayLike,
        goals: ArrayLike | Sequence[Goal],
        *,
        time_limit: float = 5.0,
        jobs: int = 1,
        scheduler: str | None = None,
        take: Callable[[PlanResult], Any] | None = None,
        journal: str | Path | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> Iterator[Any]:
        """Plan from many `starts` (n, dof) to as many `goals`; one of either serves all.

        The answers come in the order of the queries, as soon as they are known, each that of
        `plan` to the last bit where the clock decides nothing: with ``search.max_expansions``, or
        with ``search.improve`` off. Each process keeps the map ready for all of its queries.
        The arguments are those of `maneuver_automaton.plan_many`.

        Examples
        --------
        >>> from maneuver_automaton import Unicycle
        >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (0, 1)})
        >>> answers = Planner(robot).plan_many([0, 0, 0], [[1, 0, 0], [2, 0, 0]])
        >>> [round(result.cost, 6) for result in answers]
        [1.0, 2.0]
        """
        queries = queries_of(self, starts, goals)
        asked = Asked(self, queries, as_number("time_limit", time_limit), take)
        return answers(asked, jobs, scheduler, journal, progress)

    def with_obstacles(
        self, obstacles: AnyObstacle | AnyShape | Sequence[AnyObstacle | AnyShape]
    ) -> Planner:
        """A planner like this one on another map."""
        return replace(self, obstacles=as_obstacles(obstacles))
