"""Cover a field by swaths at a working width, joined by turns inside its headland."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

import numpy as np
import shapely

from maneuver_automaton._arrays import Array, freeze, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton.audit import terminal_error
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import joined
from maneuver_automaton.collision import (
    Disc,
    Obstacle,
    Polygon,
)
from maneuver_automaton.collision.outline import outlines, united
from maneuver_automaton.costs import Cost
from maneuver_automaton.field.ordering import cheapest_order, least_order_cost
from maneuver_automaton.groups import SE2, LieGroup
from maneuver_automaton.places import moved
from maneuver_automaton.planning import Planner, PlanResult, PlanStatus, plan_many
from maneuver_automaton.planning.checking import check_plan
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal

NEAREST = 8  # swaths to which turns are planned at first, from each end
SAME = 1e-11  # [m, rad] turns that differ by less are one
PEAR = 2.75  # radii that a turn forwards alone takes, to a swath beside
ROUND = 1e-9  # share of a width by which a field may be wider than so many swaths
MOST_DIRECTIONS = 64  # that are tried, those of the longest edges
MOST_SWATHS = 400


@dataclass(frozen=True, eq=False)
class FieldProblem:
    """A field that a vehicle is to cover, and the room that it has to turn.

    Parameters
    ----------
    planner : Planner
        The vehicle: its automaton, body, cost; and what stands in the field. Swaths are driven
        forwards in the straight trim that costs least, and keep the headland from obstacles.
    shape : Polygon, shapely geometry or corners
        The field. The whole body stays inside, and out of its holes.
    width : float
        Working width [m].
    headland : float, optional
        Width [m] of the strip along the boundary, and around holes and obstacles, to turn in; if
        left out, as many working widths as turns take.
    direction : float, optional
        Of the swaths [rad]; if left out, that of the edge that leads to the fewest of them.

    Raises
    ------
    ValueError
        If the field is no simple polygon, a number is out of its range, an obstacle moves or is a
        map, or the vehicle cannot drive straight ahead, or not in every direction of the plane.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Car
    >>> car = Car(wheelbase=2.0, max_steering=0.5)
    >>> controls = {"ahead": (2, 0), "left": (2, 0.5), "right": (2, -0.5), "back": (-2, 0)}
    >>> tractor = Planner(Automaton.of_controls(car, controls))
    >>> one = FieldProblem(tractor, [[0, 0], [60, 0], [60, 40], [0, 40]], width=4.0)
    >>> one.straight.name, one.headland, round(one.radius, 2)
    ('ahead', 4.0, 3.66)
    """

    planner: Planner
    shape: Any  # a Polygon, once it is made
    width: float = field(kw_only=True)  # [m]
    headland: float = field(default=0.0, kw_only=True)  # [m]; 0: chosen
    direction: float | None = field(default=None, kw_only=True)  # [rad]

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        if not isinstance(self.shape, Polygon):
            object.__setattr__(self, "shape", Polygon(self.shape))
        if not self.whole.is_valid:
            why = shapely.is_valid_reason(self.whole)
            raise ValueError(f"field: {why[:1].lower()}{why[1:]}, need a simple polygon")
        for name, least in (("width", 1e-3), ("headland", 0.0)):
            if not least <= (value := getattr(self, name)) < math.inf:
                raise ValueError(f"field: {name} must be a positive number, got {value}")
        planner, model = self.planner, self.planner.automaton.model
        if not all(isinstance(one, Obstacle) and one.motion is None for one in planner.obstacles):
            raise ValueError("field: an obstacle moves or is a map, need shapes that stand")
        if model.group is not SE2 or planner.automaton.lattice is not None:
            raise ValueError(
                f"field: the {model.name} flies or is bound to a lattice, need a vehicle that "
                "drives in every direction of the plane"
            )
        if self.radius == math.inf:
            raise ValueError("field: no trim turns, need some for the turns between swaths")
        backs = bool((planner.automaton.body_velocities[:, 0] < 0.0).any())
        if not self.headland and self.straight:
            room = (1.0 if backs else PEAR) * self.radius + self._reach + planner.margin
            widths = max(1, math.ceil(room / self.width - ROUND))
            object.__setattr__(self, "headland", widths * self.width)

    @property
    def straight(self) -> Trim:
        """The trim of the swaths: the one straight ahead that costs least a metre."""
        automaton = self.planner.automaton
        twists = automaton.body_velocities
        ahead = np.flatnonzero((twists[:, 0] > 0.0) & ~twists[:, 1:].any(axis=1))
        if not ahead.size:
            raise ValueError("field: no trim leads straight ahead, need one for the swaths")
        cheapest: Trim = automaton.trims[ahead[np.argmin(self._rates[ahead])]]
        return cheapest

    @property
    def radius(self) -> float:
        """Least radius [m] of the bends of the trims; inf if none turns."""
        twists = self.planner.automaton.body_velocities
        turning = twists[twists[:, 2] != 0.0]
        radii = np.hypot(turning[:, 0], turning[:, 1]) / np.abs(turning[:, 2])
        return float(radii.min(initial=math.inf))

    @property
    def _rates(self) -> Array:
        """What a metre costs by each trim; inf by those that do not move."""
        automaton = self.planner.automaton
        twists = automaton.body_velocities
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = self.planner.cost.rates(automaton.controls, twists)
            rates = rates / np.hypot(twists[:, 0], twists[:, 1])
        return np.where(twists[:, :2].any(axis=1), rates, np.inf)

    @property
    def _reach(self) -> float:
        """How far [m] the body reaches from its pose; what it carries aside."""
        ends = [
            np.hypot(*one.center) + one.radius
            if isinstance(one, Disc)
            else np.hypot(*one.corners.T)
            for one in self.planner.footprint
        ]
        return float(max(map(np.max, ends), default=0.0))

    @property
    def whole(self) -> Any:
        """The field as a polygon of shapely."""
        return shapely.Polygon(self.shape.corners, self.shape.holes)

    @property
    def inner(self) -> Any:
        """What swaths are to cover: the field without its headland, as geometry of shapely."""
        inner = self.whole
        for one in self.planner.obstacles:
            assert isinstance(one, Obstacle)
            if isinstance(one.shape, Disc):
                inner -= shapely.Point(*one.shape.center).buffer(one.shape.radius)
            else:
                inner -= united(outlines(one.shape))
        inner = inner.buffer(-self.headland, join_style="mitre")
        if inner.is_empty:
            room = shapely.maximum_inscribed_circle(self.whole).length
            raise ValueError(
                f"field: nothing is left of it inside a headland of {self.headland:g} m: the "
                f"largest circle in it has a radius of {room:.3g} m; need a wider field, or a "
                f"smaller headland (the vehicle turns within {self.radius:.3g} m)"
            )
        return inner

    @property
    def inside(self) -> Planner:
        """The planner that keeps the vehicle inside the field, and out of its holes."""
        outer = shapely.Polygon(self.shape.corners)
        around = outer.buffer(self._reach + 2.0 * self.width, join_style="mitre") - outer
        rings = [Obstacle(Polygon(around), name="boundary")]
        rings += [Obstacle(Polygon(hole), name="hole") for hole in self.shape.holes]
        named = None if self.planner.automaton.is_kinematic else self.straight.name
        obstacles = (*rings, *self.planner.obstacles)
        return replace(self.planner, obstacles=obstacles, start_trim=named)

    def moved(self, by: LieGroup) -> FieldProblem:
        """The field moved by a planar pose, with all that stands in it."""
        if not self.planner.bounds.are_open:
            raise ValueError("field: bounds do not move with the symmetry")
        direction = None if self.direction is None else self.direction + float(by.pose[2])
        there = replace(
            self.planner,
            obstacles=tuple(one.moved(by) for one in self.planner.obstacles),
            zones=tuple(one.moved(by) for one in self.planner.zones),
            place_costs=tuple(moved(one, by) for one in self.planner.place_costs),
        )
        return replace(self, planner=there, shape=self.shape.moved(by), direction=direction)


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldResult:
    """How a field is covered: swaths in the order in which they are driven, and one plan."""

    problem: FieldProblem
    swaths: Array  # (n, 2, 3) poses at begin and end, in order
    turns: tuple[Plan, ...]  # between them; fewer where one is missing
    result: PlanResult  # of the whole, as of any problem: `plan`, `cost`, `audit`, `status`
    order_bound: float | None = None  # no order of these swaths has cheaper turns; None: not known
    turns_cost: float | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "swaths", last=3)

    @property
    def strips(self) -> Any:
        """The geometry of shapely that is worked: all swaths at the working width."""
        lines = shapely.linestrings(self.swaths[:, :, :2])
        return shapely.union_all(shapely.buffer(lines, 0.5 * self.problem.width, cap_style="flat"))

    @property
    def covered(self) -> float:
        """Share of the field inside the headland that is worked."""
        inner = self.problem.inner
        return float(self.strips.intersection(inner).area / inner.area)

    @property
    def lengths(self) -> tuple[float, float]:
        """Metres of all swaths, and of all turns between them."""
        swaths = float(np.linalg.norm(np.diff(self.swaths[:, :, :2], axis=1), axis=-1).sum())
        in_metres = replace(self.result.problem, cost=Cost(length=1.0))
        return swaths, sum(in_metres.cost_of(turn) for turn in self.turns)


def cover(problem: FieldProblem, *, time_limit: float = 1.0, jobs: int = 1) -> FieldResult:
    """Swaths that cover a field, in the order with the cheapest turns, as one plan.

    Swaths lie side by side in the direction of the edge that leads to the fewest, of as many to the
    shortest; together they cover all inside the headland. A turn is the plan of free space, which
    is planned once for all that are alike, where that stays inside the field, and one among
    obstacles elsewhere. Turns are planned to the nearest swaths and to all that an order would use,
    until the cheapest order uses none that is not known. Up to 12 swaths it is the cheapest of all
    orders by these turns; of more it is the best of a local search, beside a bound.

    Parameters
    ----------
    problem : FieldProblem
    time_limit : float
        [s] for each turn.
    jobs : int
        Processes at a time.

    Returns
    -------
    FieldResult
        Its ``result`` has no plan where swaths cannot be joined; the reason says which.

    Raises
    ------
    ValueError
        If nothing is left inside the headland, or the field would take more than 400 swaths.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Car
    >>> car = Car(wheelbase=2.0, max_steering=0.6)
    >>> controls = {"ahead": (2, 0), "left": (2, 0.6), "right": (2, -0.6)}
    >>> tractor = Planner(Automaton.of_controls(car, controls))
    >>> meadow = [[0, 0], [40, 0], [40, 34], [0, 34]]
    >>> done = cover(FieldProblem(tractor, meadow, width=3.0, headland=12.0))
    >>> len(done.swaths), done.covered, done.result.audit.passed
    (4, 1.0, True)
    """
    turns = _Turns(problem, _swaths(problem), time_limit=time_limit, jobs=jobs)
    turns.plan(turns.nearest())
    while True:
        order, proven = cheapest_order(turns.costs)
        pairs = list(itertools.pairwise(order))
        if not (missing := [pair for pair in pairs if not turns.known[pair]]):
            break
        turns.plan(missing)
    cost = sum(float(turns.costs[pair]) for pair in pairs)
    bound = cost if proven else least_order_cost(turns.costs)
    return FieldResult(
        problem=problem,
        swaths=turns.states[order],
        turns=tuple(turns.plans[pair] for pair in pairs if pair in turns.plans),
        result=turns.joined(order),
        turns_cost=cost,
        order_bound=bound if problem.planner.automaton.is_kinematic else None,
    )


def _swaths(problem: FieldProblem) -> Array:
    """Swaths (n, 2, 3) in the best direction, from one side to the other."""
    if problem.direction is not None:
        return _swaths_along(problem, problem.direction)
    ring = problem.shape.corners
    edges = np.roll(ring, -1, axis=0) - ring
    long = np.argsort(-np.round(np.linalg.norm(edges, axis=1), 6), kind="stable")
    tried: list[float] = []
    for angle in np.arctan2(edges[long, 1], edges[long, 0]).tolist():
        if all(abs(math.remainder(angle - one, math.pi)) > 1e-9 for one in tried):
            tried.append(angle)
    found = [_swaths_along(problem, angle) for angle in tried[:MOST_DIRECTIONS]]
    return min(
        found,
        key=lambda one: (
            len(one), round(float(np.linalg.norm(one[:, 1] - one[:, 0], axis=1).sum()), 6)
        ),
    )  # fmt: skip


def _swaths_along(problem: FieldProblem, angle: float) -> Array:
    """Swaths (n, 2, 3) in a direction [rad]: side by side, as far as the field reaches in each."""
    turned, width = SE2(np.array([0.0, 0.0, angle])), problem.width
    inner = shapely.transform(problem.inner, turned.inverse().act)
    left, low, right, high = inner.bounds
    count = max(1, math.ceil((high - low) / width - ROUND))
    if count > MOST_SWATHS:
        raise ValueError(f"field: takes {count} swaths, need at most {MOST_SWATHS}: a wider width")
    apart = (high - low - width) / (count - 1) if count > 1 else 0.0
    first = low + 0.5 * width if count > 1 else 0.5 * (low + high)
    rows = []
    for y in (first + apart * np.arange(count)).tolist():
        strip = shapely.box(left - 1.0, y - 0.5 * width, right + 1.0, y + 0.5 * width)
        parts = shapely.get_parts(strip.intersection(inner))
        spans = sorted(one.bounds[::2] for one in parts if one.area > 1e-4 * width * width)
        rows += [[[x, y, 0.0] for x in span] for span in _united(spans)]
    return np.asarray((turned @ SE2(np.array(rows))).pose)


def _united(spans: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Intervals in their order, those that overlap or touch as one."""
    whole: list[tuple[float, float]] = []
    for low, high in spans:
        if whole and low <= whole[-1][1]:
            whole[-1] = (whole[-1][0], max(high, whole[-1][1]))
        else:
            whole.append((low, high))
    return whole


class _Turns:
    """Turns from the end of each swath to the begin of each other, as far as they are planned."""

    def __init__(
        self, problem: FieldProblem, swaths: Array, *, time_limit: float, jobs: int
    ) -> None:
        back = swaths[:, ::-1] + [0.0, 0.0, math.pi]
        self.states = np.stack([swaths, back], axis=1).reshape(-1, 2, 3)  # (2 n, 2, 3)
        self.problem, self.planner = problem, problem.inside
        self.how: dict[str, Any] = {
            "time_limit": time_limit,
            "jobs": jobs,
            "take": attrgetter("plan"),
        }
        self.alike: list[tuple[Array, Plan | None]] = []  # in free space, by where they lead
        self.plans: dict[tuple[int, int], Plan] = {}
        here, there, swath = (
            self.states[:, 1, :2],
            self.states[:, 0, :2],
            np.arange(len(back) * 2) // 2,
        )
        self.costs = problem._rates.min() * np.linalg.norm(here[:, None] - there, axis=-1)
        self.known = swath[:, None] == swath
        self.costs[self.known] = np.inf

    def goal(self, state: int, end: int) -> Goal:
        """The begin (0) or end (1) of a swath, in its trim where that matters."""
        return Goal(self.states[state, end], trim=self.planner.start_trim)

    def nearest(self) -> list[tuple[int, int]]:
        """From each end to the begins that may be cheapest."""
        near = np.argsort(np.round(self.costs, 6), axis=1, kind="stable")[:, :NEAREST]
        return [(s, t) for s in range(len(near)) for t in near[s].tolist() if not self.known[s, t]]

    def plan(self, pairs: Sequence[tuple[int, int]]) -> None:
        """Plan the turns of some pairs of states, all that are alike once."""
        leads = [(SE2(self.states[s, 1]).inverse() @ SE2(self.states[t, 0])).pose for s, t in pairs]
        new: list[Array] = []
        for lead in leads:
            if not any(_alike(lead, one) for one in (*new, *(one for one, _ in self.alike))):
                new.append(lead)
        away = self.planner.problem(np.zeros(3), self.goal(0, 0))
        problems = [
            replace(away, goals=(replace(away.goals[0], pose=lead),), obstacles=()) for lead in new
        ]
        self.alike += zip(new, plan_many(problems, **self.how), strict=True)
        hit = []
        for (s, t), lead in zip(pairs, leads, strict=True):
            self.known[s, t], self.costs[s, t] = True, np.inf
            free = next(plan for one, plan in self.alike if _alike(lead, one))
            if free is None:
                continue
            plan, goal = free.moved(SE2(self.states[s, 1])), self.goal(t, 0)
            asked = self.planner.problem(plan.start, goal)
            if check_plan(asked, plan, goal, self.planner.workspace).passed:
                self._keep((s, t), plan)
            else:
                hit.append((s, t))
        if hit:
            starts, goals = [self.states[s, 1] for s, _ in hit], [self.goal(t, 0) for _, t in hit]
            for pair, found in zip(
                hit, self.planner.plan_many(starts, goals, **self.how), strict=True
            ):
                if found is not None:
                    self._keep(pair, found)

    def _keep(self, pair: tuple[int, int], plan: Plan) -> None:
        self.plans[pair] = plan
        self.costs[pair] = self.planner.problem(plan.start, self.goal(pair[1], 0)).cost_of(plan)

    def joined(self, order: Sequence[int]) -> PlanResult:
        """Swaths and turns as one plan, checked and audited like any other."""
        goal, straight = self.goal(order[-1], 1), self.problem.straight
        asked = self.planner.problem(self.states[order[0], 0], goal)
        lost = [pair for pair in itertools.pairwise(order) if pair not in self.plans]
        if lost:
            x, y = self.states[lost[0][0], 1, :2].tolist()
            return PlanResult(
                problem=asked,
                status=PlanStatus.NO_PLAN,
                reason=f"no turn was found from the end of a swath at ({x:.4g}, {y:.4g}) inside a "
                f"headland of {self.problem.headland:g} m; need a wider headland, a vehicle that "
                f"turns within less than {self.problem.radius:.3g} m, or more time for each turn",
            )
        lasting = np.linalg.norm(self.states[:, 1] - self.states[:, 0], axis=1)
        lasting /= straight.body_velocity[0]
        plan = Plan(asked.start, (straight,), durations=lasting[order[:1]])
        for s, t in itertools.pairwise(order):
            if (turn := self.plans[s, t]).trims:
                plan = joined(plan, turn)
            plan = joined(plan, Plan(self.states[t, 0], (straight,), durations=lasting[[t]]))
        found = check_plan(asked, plan, goal, self.planner.workspace)
        if not found.passed or found.audit is None:
            return PlanResult(problem=asked, status=PlanStatus.NO_PLAN, reason=found.reason)
        return PlanResult(
            problem=asked,
            status=PlanStatus.FOUND,
            reason="",
            plan=plan,
            goal_index=0,
            cost=asked.cost_of(plan),
            terminal_error=terminal_error(plan, goal),
            clearance_m=found.audit.min_clearance_m,
            audit=found.audit,
        )


def _alike(one: Array, other: Array) -> bool:
    """Whether two turns lead to the same place."""
    off = one - other
    return bool(np.abs(off[:2]).max() < SAME and abs(math.remainder(off[2], math.tau)) < SAME)
