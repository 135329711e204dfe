"""The answer of a planner."""

from __future__ import annotations

import enum
import functools
import math
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

from maneuver_automaton import bounds
from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton._display import Played
from maneuver_automaton._kept import RECENT, Prepared
from maneuver_automaton.audit import Audit, Surroundings, TerminalError, surroundings_around
from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import AnyObstacle, Shape, fcl_checker
from maneuver_automaton.planning.on_the_way import Passed, passed_on_the_way
from maneuver_automaton.problem import Problem

_Map: TypeAlias = tuple[tuple[AnyObstacle, ...], tuple[float, float]]


@dataclass(frozen=True, slots=True, eq=False)
class Workspace:
    """One map, as searches, FCL and the audit see it, and what searches know of their vehicle.

    What FCL and the audit know stays as long as it is held; searches keep what was made last.
    """

    obstacles: tuple[AnyObstacle, ...]
    prepared: Prepared = field(default_factory=Prepared)  # libraries, worlds, and tables
    _checkers: dict[tuple[tuple[Shape, ...], _Map, float, float], fcl_checker.FclChecker] = field(
        default_factory=dict, init=False
    )
    _surroundings: dict[_Map, Surroundings] = field(default_factory=dict, init=False)

    __repr__ = brief

    def on(self, obstacles: tuple[AnyObstacle, ...]) -> Workspace:
        """The workspace of these obstacles: itself if they are its own, otherwise a new one."""
        return self if obstacles == self.obstacles else Workspace(obstacles, self.prepared)

    def checker(
        self,
        footprint: tuple[Shape, ...],
        obstacles: tuple[AnyObstacle, ...],
        margin: float,
        origin: tuple[float, float],
        *,
        proven: float,
    ) -> fcl_checker.FclChecker:
        """FCL's view of some obstacles of the map, counted from an origin [m].

        What it reports as hit comes closer than ``margin + proven`` [m].
        """
        key = (footprint, (obstacles, origin), margin, proven)
        if key not in self._checkers:
            self._checkers[key] = fcl_checker.FclChecker(
                footprint, obstacles, margin=margin, origin=origin, proven=proven
            )
        return self._checkers[key]

    def surroundings(
        self, obstacles: tuple[AnyObstacle, ...], origin: tuple[float, float]
    ) -> Surroundings:
        """The audit's view of some obstacles of the map, counted from an origin [m]."""
        key = (obstacles, origin)
        if key not in self._surroundings:
            self._surroundings[key] = surroundings_around(obstacles, origin)
        return self._surroundings[key]


@functools.lru_cache(maxsize=8)
def workspace_of(obstacles: tuple[AnyObstacle, ...]) -> Workspace:
    """A workspace for callers that hold none: of the last maps, each once."""
    return Workspace(obstacles, RECENT)


class PlanStatus(enum.Enum):
    """How planning ended; the values are those of plan.json."""

    FOUND = "found"
    START_BLOCKED = "start_blocked"
    GOAL_BLOCKED = "goal_blocked"
    UNREACHABLE = "unreachable"
    NO_PLAN = "no_plan"
    OUT_OF_BUDGET = "out_of_budget"


@dataclass(frozen=True, slots=True, kw_only=True)
class LowerBound:
    """No plan of a problem costs less than `value`.

    What proves it is its `kind`: ``exhaustive`` a search of all words or of all nodes of a lattice
    of primitives, ``open`` the most promising node that such a search has left, ``cells`` a
    function on cells of poses, ``incumbent`` that no cheaper plan is left, ``disc`` the path of the
    inscribed disc, ``shortest`` that of a car in free space, and formulas: ``distance``, ``turn``,
    ``effort``, ``time``.
    """

    value: float
    kind: str
    optimal: bool = False  # whether a plan of this cost is known
    history: tuple[tuple[float, float], ...] = ()  # seconds, value
    work: int = 0  # steps times cells of linear programs

    __repr__ = brief

    def gap(self, cost: float) -> float:
        """Share of a cost that is at most to be saved."""
        if cost == math.inf:
            return 1.0
        return max(0.0, (cost - self.value) / cost) if cost > 0.0 else 0.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Alternative:
    """Another locally optimal plan, costlier than the best."""

    plan: Plan
    cost: float
    terminal_error: TerminalError

    __repr__ = brief


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanResult(Played):
    """The answer to a problem; without a plan the numbers are None and the tuples empty."""

    problem: Problem
    status: PlanStatus
    reason: str  # one line; empty if found
    plan: Plan | None = None
    goal_index: int | None = None  # which of the problem's goals it reaches
    cost: float | None = None
    lower_bound: float | None = None
    gap: float | None = None  # (cost - lower_bound) / cost
    bound: LowerBound | None = None  # what proves it, and since when
    certificate: float | None = None  # smallest reduced cost over the library and all times
    terminal_error: TerminalError | None = None
    clearance_m: float | None = None
    audit: Audit | None = None
    alternatives: tuple[Alternative, ...] = ()
    timing_s: dict[str, float] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    improvements: tuple[tuple[float, float], ...] = ()  # seconds since the start, cost
    narrowest: bounds.Narrowest | None = None  # the passage that is too narrow, of a proof
    reached: Array | None = None  # (n, 4, 2) squares that the pose never leaves, of that proof
    nodes: Array | None = None  # (n, 4) x, y, heading, cost of what was expanded, if asked for
    notes: tuple[str, ...] = ()  # what was left out or done otherwise, and why: a sentence each

    __repr__ = brief

    @property
    def via(self) -> tuple[Passed, ...]:
        """When the plan passes the poses on the way, in its order; empty without a plan."""
        return () if self.plan is None else passed_on_the_way(self.problem, self.plan)


class Answer(Protocol):
    """A planner, of all problems or of simpler ones."""

    def __call__(
        self, problem: Problem, budget: Budget, workspace: Workspace, /, *, alternatives: int
    ) -> PlanResult:
        """The cheapest plan found, and so many costlier ones."""
        ...
