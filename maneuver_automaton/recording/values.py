"""Who moved where and when, among what: all that pictures, pages, exports and tables need."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import carried
from maneuver_automaton.automaton.plan_arrays import PlanArrays, arrays_at, joined, step_times
from maneuver_automaton.collision import AnyObstacle, Obstacle, Shape
from maneuver_automaton.collision.zones import Zone
from maneuver_automaton.models import Model
from maneuver_automaton.places import Ground
from maneuver_automaton.problem import Bounds, Goal, Problem, Via

MOST_DIGITS = 6  # of a number in a heading
MOST_PAIRS = 3  # that are named, the nearest first
TIGHT_M = 1e-3  # [m] a clearance that is smaller is remarked on
NAMELESS = ("Plan", "Closed loop", "Fleet", "Closed loop of a fleet")  # titles that name nothing


def few(names: Sequence[str], most: int = 4) -> str:
    """The first names in a row, and how many more there are."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


@dataclass(frozen=True, slots=True, kw_only=True)
class Fact:
    """One line of a heading, a table of the terminal, or a folder's row.

    Examples
    --------
    >>> Fact(label="duration", value=3.14159265, unit="s").text
    '3.14159 s'
    >>> Fact(label="cost", value=2.00000001, bound=1.98765432, more=", at once").in_full
    '2.00000001 (proven: at least 1.98765432), at once'
    """

    label: str
    value: float | str
    unit: str = ""
    digits: int = 9  # of a number; a heading has at most six of them
    bound: float | None = None  # proven below the value, or the value itself if it is optimal
    note: str = ""  # said behind both, in brackets
    more: str = ""  # said behind that, where there is a line for each fact
    heads: bool = True  # whether headings of pictures and pages have it

    @property
    def text(self) -> str:
        """The value with its unit and the note, for a heading."""
        return self._shown(min(self.digits, MOST_DIGITS))

    @property
    def in_full(self) -> str:
        """All that is said, with all digits."""
        return self._shown(self.digits) + self.more

    def _shown(self, digits: int) -> str:
        value = self.value
        said = value if isinstance(value, str) else f"{value:.{digits}g} {self.unit}".rstrip()
        note = self.note
        if self.bound is not None:
            optimal = self.bound == value
            note = f"proven{' optimal' if optimal else f': at least {self.bound:.{digits}g}'}{note}"
        return f"{said} ({note})" if note else said


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Rows of a table of the terminal: of a word, of steps, of vehicles."""

    title: str = ""
    columns: tuple[str, ...]
    rows: list[list[str]]
    numbers: tuple[int, ...] = ()  # columns that hold numbers
    instead: str = ""  # said where there is no row


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """What happened at a time: a plan made anew, an exchange, a guarantee broken."""

    time: float  # [s]
    kind: str  # replanned | exchanged | void | broken | disturbed
    text: str = ""
    mover: str = ""  # whom it concerns; empty: all


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Curve:
    """A number over time, which holds until the next; nan where it is not known."""

    label: str
    unit: str = ""
    time: Array  # (n,) [s]
    value: Array  # (n,)
    mover: str = ""  # whose it is; empty: of all together

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "time")
        value = np.array(self.value, dtype=np.float64)  # nan included
        value.setflags(write=False)
        object.__setattr__(self, "value", value)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Mover:
    """A vehicle: what it is, where it was to go, and what it drives, piece after piece.

    Between two pieces of a closed loop a disturbance may have moved it. Without any piece it
    stands at its start.

    Examples
    --------
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0])
    >>> one = Mover(pieces=(Plan([0.0, 0.0, 0.0], (ahead,), durations=[3.0]),))
    >>> one.pose_at([1.0, 9.0]).tolist(), one.duration
    ([[1.0, 0.0, 0.0], [3.0, 0.0, 0.0]], 3.0)
    """

    name: str = ""
    pieces: tuple[Plan, ...]  # at least one; of one that stands: it lasts no time
    end: Array | None = None  # (dof,) where it ends, noise included; the last piece's end if None
    model: Model | None = None  # None: it is not known, as in a file alone
    bodies: Mapping[str, tuple[Shape, ...]] = field(default_factory=dict)  # "": its own; its parts'
    problem: Problem | None = None  # that it was to solve; None: on roads, or not known
    has_plan: bool = True
    reached: bool = True  # whether it ends at a goal
    arrived_s: float | None = None  # [s]; None: at the end of the last piece, if at all
    reason: str = ""  # why it has no plan, or did not arrive
    cost: float | None = None
    there: tuple[float, float] = (-math.inf, math.inf)  # [s] when it appears, and is gone
    held: tuple[tuple[float, Plan], ...] = ()  # the plan held from a time on [s]
    names: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())  # of state and control, by a file
    road: Any = None  # the RoadPlanner of one that drives on roads

    __repr__ = brief

    def __post_init__(self) -> None:
        if not self.pieces:
            raise ValueError("mover: got no piece, need at least one; who stands has one of 0 s")
        if self.end is None:
            object.__setattr__(self, "end", self.pieces[-1].end)
        freeze(self, "end", last=(3, 4))

    @property
    def goals(self) -> tuple[Goal, ...]:
        """Where it was to go; empty if that is not known, or a region."""
        return () if self.problem is None else self.problem.goals

    @property
    def via(self) -> tuple[Via, ...]:
        """What it was to pass on its way."""
        return () if self.problem is None else self.problem.via

    @property
    def regions(self) -> tuple[Shape, ...]:
        """Places of goals on roads."""
        goals = () if self.road is None else self.road.scene.goals
        return tuple(place for goal in goals for place in goal.places or ())

    @property
    def start(self) -> Array:
        """Pose (dof,) at the beginning."""
        return self.pieces[0].start

    @property
    def start_time(self) -> float:
        """Time at the beginning [s]."""
        return self.pieces[0].start_time

    @property
    def end_time(self) -> float:
        """Time at the end of the last piece [s]."""
        return float(self.pieces[-1].start_time + self.pieces[-1].duration)

    @property
    def arrival(self) -> float:
        """When it arrived [s]; the end of the last piece if it did not."""
        return self.end_time if self.arrived_s is None else self.arrived_s

    @property
    def duration(self) -> float:
        """From the beginning to the end [s]."""
        return self.end_time - self.start_time

    @property
    def goal_index(self) -> int | None:
        """Which of its goals it ends at; None if at none."""
        if not (self.goals and self.reached and self.has_plan):
            return None
        return int(np.argmin([sum(goal.off(self.pieces[-1].end)) for goal in self.goals]))

    def pose_at(self, time: ArrayLike, /) -> Array:
        """Poses (..., dof) at times (...,) [s], held before the begin and after the end."""
        times = as_array("time", time, infinite=True)
        flat = times.ravel()
        begins = np.array([one.start_time for one in self.pieces])
        which = np.maximum(np.searchsorted(begins, flat, side="right") - 1, 0)
        found = np.empty((flat.size, self.start.size))
        for k in np.unique(which).tolist():
            rows = which == k
            found[rows] = self.pieces[k].pose_at(flat[rows])
        return found.reshape(*times.shape, -1)

    def carried(self, part: str) -> Mover:
        """A part of it, say its trailer, as one that moves by itself."""
        assert self.model is not None
        pieces = tuple(carried(one, self.model, part) for one in self.pieces)
        return replace(
            self, name=part, pieces=pieces, end=None, model=None, bodies={"": self.bodies[part]}
        )

    @property
    def parts(self) -> tuple[Mover, ...]:
        """The vehicle, then all that it carries, each as one that moves by itself."""
        return (self, *(self.carried(name) for name in self.bodies if name))

    def is_there(self, time: float) -> bool:
        """Whether it has appeared by a time [s], and not left."""
        return self.there[0] <= time <= self.there[1]

    def rows(self, *, step: float | None = None) -> PlanArrays:
        """One row an instant, as `Plan.as_arrays` has them; the last row is the end.

        Parameters
        ----------
        step : float, optional
            Time between rows [s]; rows are at most 0.05 m and 0.05 rad apart if left out.

        Raises
        ------
        ValueError
            If `step` is not positive, or a maneuver has no course.
        """
        times = None if step is None else step_times(self.start_time, self.duration, step)
        parts = [
            one.as_arrays(model=self.model) if times is None else self._at(one, times)
            for one in self.pieces
        ]
        whole = joined([one for one in parts if one.word and one.time.size] or parts[:1])
        pose = whole.pose.copy()
        pose[-1] = self.end
        whole = replace(whole, pose=pose)
        if self.model is not None:
            return whole
        states, controls = self.names  # those of a file, where no model has named them
        fits = len(states) == len(whole.reduced_names), len(controls) == len(whole.control_names)
        return replace(
            whole,
            reduced_names=states if fits[0] else whole.reduced_names,
            control_names=controls if fits[1] else whole.control_names,
        )

    def _at(self, piece: Plan, times: Array) -> PlanArrays:
        """Rows of a piece at those of the times that lie within it, its end included."""
        end = float(piece.start_time + piece.duration)
        inside = times[(times >= piece.start_time) & (times < end)]
        return arrays_at(piece, np.append(inside, end), model=self.model)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Environment:
    """What stands and moves around those who drive, and what they have to keep to."""

    obstacles: tuple[AnyObstacle, ...] = ()
    zones: tuple[Zone, ...] = ()
    ground: tuple[Ground, ...] = ()
    bounds: Bounds = field(default_factory=Bounds)
    lanes: tuple[Array, ...] = ()  # outlines (n, 2) of pieces of road [m]
    margin: float = 0.0  # [m] that any two movers keep
    source: str = ""  # who recorded it
    fleeting: bool = False  # what moves is there only while its motion lasts, as on roads

    __repr__ = brief

    def is_there(self, obstacle: Obstacle, time: float) -> bool:
        """Whether an obstacle is there at a time [s]."""
        first, last = obstacle.lasts(fleeting=self.fleeting)
        return first - 1e-9 <= time <= last + 1e-9


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Search:
    """How a search went on, and what it looked at if that was asked for."""

    improvements: tuple[tuple[float, float], ...] = ()  # [s], cost
    bounds: tuple[tuple[float, float], ...] = ()  # [s], proven
    cost: float | None = None
    bound: float | None = None
    kind: str = ""  # of the bound
    nodes: Array | None = None  # (n, 3 or 4) places that were expanded, and cost
    reached: Array | None = None  # (n, 4, 2) places that a pose may get to, if there is no plan
    narrowest: Array | None = None  # (2,) place it could not pass
    missing_m: float = 0.0  # by which that is too narrow

    __repr__ = brief


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Recording:
    """Movers, the world around them, and what is to be said of them; one value for every kind.

    Kinds of result differ by data: events, plans held, lanes, many movers.
    """

    kind: str  # plan | closed_loop | fleet | fleet_loop | road_plan | road_drive | road_fleet | ...
    title: str
    status: str = "found"
    reason: str = ""  # empty if all is as asked
    ending: str = ""  # how it ended, in words
    facts: tuple[Fact, ...] = ()
    movers: tuple[Mover, ...]
    world: Environment = field(default_factory=Environment)
    alternatives: tuple[Mover, ...] = ()  # the first mover's other plans, costlier
    events: tuple[Event, ...] = ()
    curves: tuple[Curve, ...] = ()
    search: Search | None = None

    __repr__ = brief

    @property
    def heading(self) -> tuple[Fact, ...]:
        """The facts that head pictures and pages."""
        return tuple(one for one in self.facts if one.heads)

    @property
    def drivers(self) -> tuple[Mover, ...]:
        """Those who have a plan."""
        return tuple(one for one in self.movers if one.has_plan)

    def name_in(self, path: Path | str) -> str:
        """What a file calls its content: the scenario, or the file's own name."""
        return Path(path).stem if self.title in ("", *NAMELESS) else self.title

    def texts(self, kind: str, time: float) -> list[str]:
        """What is said of the events of a kind at a time [s]."""
        return [one.text for one in self.events if one.kind == kind and one.time == time]

    @property
    def begin(self) -> float:
        """When the first may leave its start [s]."""
        return min(one.start_time for one in self.movers)

    @property
    def end(self) -> float:
        """When the last arrives [s]."""
        return max(one.end_time for one in self.movers)


def mover_of(problem: Problem, plan: Plan | None, **more: Any) -> Mover:
    """Who solves a problem, with what it drives; without a plan it stands, and did not arrive."""
    if plan is None:
        plan = Plan(problem.start, (), durations=[], start_time=problem.start_time)
        more = {"has_plan": False, "reached": False} | more
    its = {"pieces": (plan,), "model": problem.automaton.model, "bodies": bodies_of(problem)}
    return Mover(**{**its, "problem": problem, **more})


def bodies_of(problem: Problem) -> dict[str, tuple[Shape, ...]]:
    """The shapes of a problem's vehicle, and those of what it carries."""
    return {"": tuple(problem.footprint)} | {
        name: tuple(shapes) for name, shapes in problem.parts.items()
    }


def world_of(*problems: Problem, margin: float = 0.0) -> Environment:
    """What is around vehicles on one floor, each thing once; bounds that hold all of theirs."""
    around: dict[tuple[int, ...], AnyObstacle] = {}
    for one in (one for problem in problems for one in problem.obstacles):
        # problems made alike hold the same shapes and maps
        same = (id(one.shape), id(one.motion)) if isinstance(one, Obstacle) else (id(one),)
        around.setdefault(same, one)
    sides = {}
    for axis in ("x", "y"):
        known = [side for one in problems if (side := getattr(one.bounds, axis)) is not None]
        if len(known) == len(problems):
            sides[axis] = (min(low for low, _ in known), max(high for _, high in known))
    return Environment(
        obstacles=tuple(around.values()),
        zones=tuple({id(zone): zone for one in problems for zone in one.zones}.values()),
        ground=tuple(
            {
                id(cost): cost
                for one in problems
                for cost in one.place_costs
                if isinstance(cost, Ground)
            }.values()
        ),
        bounds=problems[0].bounds if len(problems) == 1 else Bounds(**sides),
        margin=margin,
    )


def asked_for(distance: float, margin: float) -> str:
    """What is to be said of a least distance [m]: the margin, or that there is next to none."""
    if margin:
        return f", {margin:g} m asked for"
    return ": less than 1 mm, as margin_m is 0" if distance < TIGHT_M else ""


def times_of(solve_s: Iterable[float]) -> str:
    """What steps took [s], in words; empty if there is none."""
    milliseconds = [1e3 * one for one in solve_s]
    if not milliseconds:
        return ""
    return f"{np.median(milliseconds):.2f} ms median, {max(milliseconds):.2f} ms at most"


def effort_facts(timing_s: Mapping[str, float], counts: Mapping[str, int]) -> list[Fact]:
    """What an answer took, by the keys of its file as people say them."""

    def spoken(key: str) -> str:
        return key.replace("_", " ").replace("fcl", "FCL")

    times = ", ".join(f"{spoken(key)} {seconds:.3f} s" for key, seconds in timing_s.items())
    numbers = ", ".join(f"{spoken(key)} {count}" for key, count in counts.items())
    return [
        Fact(label="timing", value=times, heads=False),
        Fact(label="counts", value=numbers, heads=False),
    ]


def shown(value: float | None, digits: int) -> str:
    """A number in a cell; empty where it is none, or infinite."""
    return "" if value is None or math.isinf(value) else f"{value:.{digits}g}"


def nearest_fact(pairs: Sequence[Any]) -> Fact:
    """Who come nearest to each other, a few pairs; each has two names, a distance and a time."""
    said = "; ".join(map(pair_text, pairs[:MOST_PAIRS]))
    return Fact(label="nearest", value=said, heads=False)


def pair_text(one: Any) -> str:
    """Who come nearest to each other, how near, and when."""
    return f"{' and '.join(one.pair)} {one.distance_m:.3g} m at {one.time_s:.4g} s"
