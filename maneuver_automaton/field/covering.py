"""Cover a field by swaths at a working width, joined by turns inside its headland."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

import numpy as np
import shapely

from maneuver_automaton._arrays import Array, IntArray, freeze, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton.audit import terminal_error
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import joined
from maneuver_automaton.collision import Disc, Obstacle, Polygon
from maneuver_automaton.collision.outline import outlines, united
from maneuver_automaton.collision.shapes import reach_of
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2, LieGroup
from maneuver_automaton.planning import Planner, PlanResult, PlanStatus
from maneuver_automaton.planning.checking import check_plan
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Bounds, Goal

NEAREST = 8  # swaths to which turns are planned at first, from each end
SAME = 11  # digits [m, rad] in which turns that are planned once agree
PEAR = 2.75  # radii that a turn forwards alone takes, to a swath beside
ROUND = 1e-9  # share of a width by which a field may be wider than so many swaths
MOST_DIRECTIONS = 64  # that are tried, those of the longest edges
MOST_SWATHS = 400
MOST_EXACT = 12  # swaths whose orders are all looked at; the table has 2^n rows
STARTS = 8  # tours that are improved
DIGITS = 9  # of a cost: equal ones are told apart by their numbers alone, wherever the field is


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
                raise ValueError(f"field: {name} must be at least {least:g} m, got {value}")
        planner, automaton = self.planner, self.planner.automaton
        if not all(isinstance(one, Obstacle) and one.motion is None for one in planner.obstacles):
            raise ValueError("field: an obstacle moves or is a map, need shapes that stand")
        if automaton.model.group is not SE2 or automaton.lattice is not None:
            raise ValueError(
                f"field: the {automaton.model.name} flies or is bound to a lattice, need a vehicle "
                "that drives in every direction of the plane"
            )
        if self.radius == math.inf:
            raise ValueError("field: no trim turns, need some for the turns between swaths")
        if self.straight and not self.headland:
            backs = (automaton.body_velocities[:, 0] < 0.0).any()
            room = (1.0 if backs else PEAR) * self.radius + self._reach + planner.margin
            widths = max(1, math.ceil(room / self.width - ROUND))
            object.__setattr__(self, "headland", widths * self.width)

    @property
    def straight(self) -> Trim:
        """The trim of the swaths: the one straight ahead that costs least a metre."""
        automaton = self.planner.automaton
        twists = automaton.body_velocities
        ahead = (twists[:, 0] > 0.0) & ~twists[:, 1:].any(axis=1)
        if not ahead.any():
            raise ValueError("field: no trim leads straight ahead, need one for the swaths")
        cheapest: Trim = automaton.trims[np.argmin(np.where(ahead, self._rates, np.inf))]
        return cheapest

    @property
    def radius(self) -> float:
        """Least radius [m] of the bends of the trims; inf if none turns."""
        twists = self.planner.automaton.body_velocities
        turning = twists[twists[:, 2] != 0.0]
        radii = np.hypot(turning[:, 0], turning[:, 1]) / np.abs(turning[:, 2])
        return float(radii.min(initial=math.inf))

    @property
    def _rates(self) -> Array:  # what a metre costs by each trim; inf by those that do not move
        automaton = self.planner.automaton
        twists = automaton.body_velocities
        speeds = np.hypot(twists[:, 0], twists[:, 1])
        rates = self.planner.cost.rates(automaton.controls, twists)
        metre = np.full(speeds.shape, np.inf)
        return np.asarray(np.divide(rates, speeds, out=metre, where=speeds > 0.0))

    @property
    def _reach(self) -> float:  # [m] of the body from its pose; what it carries aside
        return max(map(reach_of, self.planner.footprint), default=0.0)

    @property
    def whole(self) -> Any:
        """The field as a polygon of shapely."""
        return shapely.Polygon(self.shape.corners, self.shape.holes)

    @property
    def inner(self) -> Any:
        """What swaths are to cover: the field without its headland, as geometry of shapely."""
        inner = self.whole
        for one in self.planner.obstacles:
            shape: Any = one.shape  # type: ignore[union-attr]  # each is an `Obstacle`
            disc = isinstance(shape, Disc) and shapely.Point(*shape.center).buffer(shape.radius)
            inner -= disc or united(outlines(shape))
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
        """The field moved by a planar pose, with all that stands in it; bounds must be open."""
        there = self.planner.problem(np.zeros(3), np.zeros(3)).moved(by)
        around = {name: getattr(there, name) for name in ("obstacles", "zones", "place_costs")}
        return replace(
            self,
            planner=replace(self.planner, **around),
            shape=self.shape.moved(by),
            direction=None if self.direction is None else self.direction + float(by.pose[2]),
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldResult:
    """How a field is covered: swaths in the order in which they are driven, and one plan."""

    problem: FieldProblem
    swaths: Array  # (n, 2, 3) poses at begin and end, in order
    turns: tuple[Plan, ...]  # between them; fewer where one is missing
    result: PlanResult  # of the whole; without a plan it says between which swaths no turn is
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
        in_metres = replace(self.result.problem, cost=Cost(length=1.0))
        return float(_lengths(self.swaths).sum()), sum(map(in_metres.cost_of, self.turns))


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
    planner, angles = problem.inside, [] if problem.direction is None else [problem.direction]
    if not angles:
        edges = np.roll(problem.shape.corners, -1, axis=0) - problem.shape.corners
        longest = np.argsort(-np.round(np.linalg.norm(edges, axis=1), 6), kind="stable")
        angles = np.arctan2(edges[longest, 1], edges[longest, 0])[:MOST_DIRECTIONS].tolist()
    found = [_swaths_along(problem, angle) for angle in angles]
    swaths = min(found, key=lambda one: (len(one), round(float(_lengths(one).sum()), 6)))
    both = np.stack([swaths, swaths[:, ::-1] + [0.0, 0.0, math.pi]], axis=1).reshape(-1, 2, 3)
    ends, begins, swath = both[:, None, 1], both[:, 0], np.arange(len(both)) // 2
    costs = problem._rates.min() * np.linalg.norm((ends - begins)[..., :2], axis=-1)  # at least
    costs[swath[:, None] == swath] = np.inf
    near = np.argsort(np.round(costs, 6), axis=1, kind="stable")[:, :NEAREST]
    wanted = [(s, t) for s, row in enumerate(near.tolist()) for t in row if costs[s, t] < np.inf]
    known: dict[tuple[int, int], Plan | None] = {}
    order, bound, pairs = [0], 0.0, list[tuple[int, int]]()  # one swath takes no turn
    while wanted:
        goals = [Goal(both[t, 0], trim=planner.start_trim) for _, t in wanted]
        starts = both[[s for s, _ in wanted], 1]
        turns = _turns(planner, starts, goals, time_limit=time_limit, jobs=jobs)
        known |= zip(wanted, turns, strict=True)
        for pair, start, goal, turn in zip(wanted, starts, goals, turns, strict=True):
            costs[pair] = np.inf if turn is None else planner.problem(start, goal).cost_of(turn)
        order, bound = cheapest_order(costs)
        pairs = list(itertools.pairwise(order))
        wanted = [pair for pair in pairs if pair not in known]
    driven = [known[pair] for pair in pairs]
    return FieldResult(
        problem=problem,
        swaths=both[order],
        turns=tuple(turn for turn in driven if turn is not None),
        result=_as_one(problem, planner, both[order], driven),
        turns_cost=sum((float(costs[pair]) for pair in pairs), 0.0),
        order_bound=bound if planner.automaton.is_kinematic else None,
    )


def _lengths(swaths: Array) -> Array:
    return np.asarray(np.hypot(*(swaths[:, 1, :2] - swaths[:, 0, :2]).T))


def _swaths_along(problem: FieldProblem, angle: float) -> Array:
    """Swaths (n, 2, 3) in a direction [rad]: side by side, as far as the field reaches in each."""
    turned, width = SE2(np.array([0.0, 0.0, angle])), problem.width
    inner = shapely.transform(problem.inner, turned.inverse().act)
    left, low, right, high = inner.bounds
    count = max(1, math.ceil((high - low) / width - ROUND))
    if count > MOST_SWATHS:
        raise ValueError(f"field: takes {count} swaths, need at most {MOST_SWATHS}: a wider width")
    inset = min(0.5 * width, 0.5 * (high - low))
    rows = []
    for y in np.linspace(low + inset, high - inset, count).tolist():
        strip = shapely.box(left - 1.0, y - 0.5 * width, right + 1.0, y + 0.5 * width)
        parts = shapely.get_parts(strip.intersection(inner))
        x = shapely.bounds(parts[shapely.area(parts) > 4e-4 * inset * inset])[:, ::2]
        united_x = shapely.union_all(shapely.box(x[:, 0], 0.0, x[:, 1], 1.0))
        spans = shapely.bounds(shapely.get_parts(united_x))[:, ::2]
        rows += [[[x, y, 0.0] for x in span] for span in sorted(spans.tolist())]
    return np.asarray((turned @ SE2(np.array(rows))).pose)


def _turns(planner: Planner, starts: Array, goals: Sequence[Goal], **how: Any) -> list[Plan | None]:
    """A plan from each start to its goal: that of free space where it stays inside, or another."""
    how["take"] = attrgetter("plan")
    leads = (SE2(starts).inverse() @ SE2(np.array([goal.pose for goal in goals]))).pose
    keys = list(map(tuple, np.round(leads, SAME).tolist()))
    alike = {key: replace(goals[0], pose=lead) for key, lead in zip(keys, leads, strict=True)}
    away = replace(planner, obstacles=(), zones=(), bounds=Bounds(), place_costs=())
    free = dict(zip(alike, away.plan_many(np.zeros(3), [*alike.values()], **how), strict=True))
    found: list[Plan | None] = []
    for start, goal, key in zip(starts, goals, keys, strict=True):
        turn = free[key] and free[key].moved(SE2(start))
        asked = planner.problem(start, goal)
        inside = turn and check_plan(asked, turn, goal, planner.workspace).passed
        found.append(turn if inside and not planner.place_costs else None)
    left = [k for k, turn in enumerate(found) if turn is None]
    among = left and planner.plan_many(starts[left], [goals[k] for k in left], **how)
    for k, turn in zip(left, among, strict=True):
        found[k] = turn
    return found


def _as_one(
    problem: FieldProblem, planner: Planner, swaths: Array, turns: Sequence[Plan | None]
) -> PlanResult:
    """Swaths and turns as one plan, checked and audited like any other."""
    straight, goal = problem.straight, Goal(swaths[-1, 1], trim=planner.start_trim)
    asked = planner.problem(swaths[0, 0], goal)
    if None in turns:
        x, y = swaths[turns.index(None), 1, :2].tolist()
        reason = (
            f"no turn was found from the end of a swath at ({x:.4g}, {y:.4g}) inside a headland of "
            f"{problem.headland:g} m; need a wider headland, a vehicle that turns within less than "
            f"{problem.radius:.3g} m, or more time for each turn"
        )
        return PlanResult(problem=asked, status=PlanStatus.NO_PLAN, reason=reason)
    times = _lengths(swaths) / straight.body_velocity[0]
    plan = Plan(asked.start, (straight,), durations=times[:1])
    for swath, time, turn in zip(swaths[1:], times[1:], turns, strict=True):
        if turn is not None and turn.trims:
            plan = joined(plan, turn)
        plan = joined(plan, Plan(swath[0], (straight,), durations=[time]))
    found = check_plan(asked, plan, goal, planner.workspace)
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


def cheapest_order(costs: Array) -> tuple[list[int], float]:
    """States in their order, and a cost that the turns of no order are below.

    State 2 i + d is swath i in direction d; `costs` (2 n, 2 n) are those of the turn from the end
    of one to the begin of another, inf where there is none.

    Up to 12 swaths by dynamic programming over the sets of swaths driven. Beyond that from the
    nearest next one on by reversals of a part and moves of a swath, until none gains, beside the
    bound of an assignment: each swath has one next, or is the last.

    Source: Held, Karp (1962), *A Dynamic Programming Approach to Sequencing Problems*; Croes
    (1958), *A Method for Solving Traveling-Salesman Problems*.

    Examples
    --------
    >>> far = np.full((4, 4), np.inf)
    >>> far[2, 1] = 3.0  # from the second, driven forwards, to the first, driven backwards
    >>> cheapest_order(far)
    ([2, 1], 3.0)
    """
    from scipy.optimize import linear_sum_assignment

    there, n = np.isfinite(costs), len(costs) // 2
    finite = np.where(there, costs, 1.0 + 2.0 * float(costs[there].sum()))  # more than all others
    known = np.round(finite / finite.max(), DIGITS)
    if n <= MOST_EXACT:
        order = _by_sets(known)
        return order, float(costs[order[:-1], order[1:]].sum())
    tours = []
    for first in range(2 * n):
        order, left = [first], known.copy()
        while len(order) < n:
            left[:, [order[-1], order[-1] ^ 1]] = np.inf
            order.append(int(np.argmin(left[order[-1]])))
        tours.append((_price(known, np.array(order)), order))
    _, best = min(_improved(known, *one) for one in sorted(tours)[:STARTS])
    table = np.pad(finite.reshape(n, 2, n, 2).min(axis=(1, 3)), (0, 1))  # the last are the ends
    table[n, n] = table.max()
    return best, float(table[linear_sum_assignment(table)].sum())


def _by_sets(costs: Array) -> list[int]:
    """The cheapest of all orders, by the least cost to each set of swaths and last state."""
    states = np.arange(len(costs))
    bits, whole = 1 << states // 2, (1 << len(costs) // 2) - 1
    best = np.full((whole + 1, len(costs)), np.inf)
    before = np.full(best.shape, -1)
    best[bits, states] = 0.0
    for driven in range(1, whole):
        after = states[(driven & bits) == 0]
        through = best[driven][:, None] + costs[:, after]
        before[driven | bits[after], after] = through.argmin(axis=0)
        best[driven | bits[after], after] = through.min(axis=0)
    order, driven = [int(np.argmin(best[whole]))], whole
    while (last := int(before[driven, order[0]])) >= 0:
        driven ^= int(bits[order[0]])
        order.insert(0, last)
    return order


def _improved(costs: Array, price: float, order: list[int]) -> tuple[float, list[int]]:
    """The price of an order that no reversal of a part and no move of one swath makes cheaper."""
    states, n, before = np.array(order), len(order), np.inf
    while price < before:
        before = price
        for i, j in itertools.combinations(range(n + 1), 2):
            turned = np.concatenate([states[:i], states[i:j][::-1] ^ 1, states[j:]])
            if (less := _price(costs, turned)) < price:
                states, price = turned, less
        for i, j, flip in itertools.product(range(n), range(n), (0, 1)):
            moved = np.insert(np.delete(states, i), j, states[i] ^ flip)
            if (less := _price(costs, moved)) < price:
                states, price = moved, less
    return price, states.tolist()


def _price(costs: Array, order: IntArray) -> float:
    return round(float(costs[order[:-1], order[1:]].sum()), DIGITS)
