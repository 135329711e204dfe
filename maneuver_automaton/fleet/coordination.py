"""Plans of several vehicles past one another: in turn, of a group at once, or one at a time.

*In turn* each is planned past the plans of those before it, and past the starts of those to come,
so that nobody is ever enclosed by them. *At once* both searches for a group look at a tree whose
root is everybody's plan past the vehicles outside of it: where two of the group meet, one child has
the first of them give way, the other child the second. *One at a time* each drives past all others
where they stand; where nobody has a way to its goal, those in one's way drive aside first, and home
later: also those that stand at their goals. No search in time is needed, and every leg begins as
soon as the legs before it allow.

Source: Čáp, Novák, Kleiner, Selecký (2015), *Prioritized Planning Algorithms for Trajectory
Coordination of Multiple Mobile Robots*, IEEE T-ASE 12(3), for orders, and for fleets in which
everybody has a way past all starts and goals; Ma, Harabor, Stuckey, Li, Koenig (2019), *Searching
with Consistent Prioritization for Multi-Agent Path Finding*, AAAI 33; Andreychuk, Yakovlev,
Surynek, Atzmon, Stern (2022), *Multi-agent pathfinding with continuous time*, Artificial
Intelligence 305, here with bodies in place of edges, so that what is left out of a child may hold a
better plan: what comes out is the best of these searches, not of all plans; Luna, Bekris (2011),
*Push and Swap: Fast Cooperative Path-Finding with Completeness Guarantees*, IJCAI 22, for those
that make room.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.advancement import clearances
from maneuver_automaton.collision.shapes import Obstacle
from maneuver_automaton.collision.world import world_of
from maneuver_automaton.fleet.courses import FleetCourse
from maneuver_automaton.fleet.meetings import Meeting, meetings
from maneuver_automaton.fleet.vehicle import AT_ONCE, LONG, QUICK, FleetMember, OwnPlan, courses_of
from maneuver_automaton.problem import Goal
from maneuver_automaton.refinement.improve import WordSchedule

HeldPlans: TypeAlias = dict[int, OwnPlan]
"""Plans by the numbers of their vehicles."""

MOST_EVICTED = 8  # times that plans are given up for one vehicle
MOST_QUERIES = 30  # searches for one vehicle, of one tree
EACH = 0.05  # [s] for one vehicle: with less its first plan is taken as it is found
AS_LONG = 20  # vehicles whose first plans take as long as one thorough search
LOOKS = 400  # at a conflict, to see how long it lasts
WORTH = 1e-6  # share of the value that another leaf has to save
DRAWS = 8  # of an order, until one is new
MOST_ASIDE = 3  # times that one vehicle makes room for others
MOST_PLACES = 8  # aside, of which one with a way home from there is looked for
BEGINS, HALVINGS = 24, 6  # of a leg that are tried, and how far the first free one is refined


def is_short(budget: Budget, count: int) -> bool:
    """Whether the time hardly suffices for the first plans of so many vehicles."""
    return budget.left < EACH * count


@dataclass(slots=True, eq=False)
class Turns:
    """Searches for one vehicle after another, within a budget."""

    vehicles: Sequence[FleetMember]
    margin: float  # [m] that any two bodies keep
    budget: Budget
    schedule: WordSchedule = AT_ONCE  # by which words are improved
    most: int = LONG  # expansions where nothing else helps
    queries: int = 0

    def one_after_another(self, order: Sequence[int], held: HeldPlans) -> HeldPlans:
        """Plans in an order, past those that are held; who fails goes before those it hits.

        Where the time is short, plans are taken as they are found, and who fails is not searched
        for thoroughly first: the others hardly take longer to be planned again.
        """
        held, waiting, evicted = dict(held), list(order), 0
        failed: set[int] = set()
        hurried = False
        while waiting and not self.budget.is_over:
            k = waiting.pop(0)
            to_come = [*waiting, *self.without_plan(held, {k, *waiting})]
            hurried = hurried or is_short(self.budget, 1 + len(waiting))
            found = self.past(k, held, to_come, hurried=hurried)
            may_evict = k not in failed and (hurried or evicted < MOST_EVICTED)
            hurried = hurried or (found is None and is_short(self.budget, AS_LONG + len(waiting)))
            if found is None and not (hurried and may_evict):
                found = self.past(k, held, self.without_plan(held, {k, *waiting}), most=self.most)
            if found is None and may_evict:
                failed.add(k)
                found, out = self._before_those_it_hits(k, held, hurried=hurried)
                for other in out:
                    del held[other]
                waiting = [*out, *waiting]
                evicted += len(out)
            if found is not None:
                held[k] = found
        return held

    def anew(self, group: Sequence[int], held: Mapping[int, OwnPlan]) -> HeldPlans | None:
        """Better plans of a group, one after another, past all others; None if one has none."""
        now, others = dict(held), self.without_plan(held, set(group))
        for n, k in enumerate(group):
            if self.budget.is_over:
                return None
            found = self.past(k, now, [*group[n + 1 :], *others], again=True)
            if found is None and n + 1 < len(group):
                found = self.past(k, now, others, again=True)
            if found is None:
                return None
            now[k] = found
        return {k: now[k] for k in group}

    def without_plan(self, held: Mapping[int, OwnPlan], but: set[int]) -> list[int]:
        """Vehicles that stand at their starts for ever."""
        return [k for k in range(len(self.vehicles)) if k not in held and k not in but]

    def _before_those_it_hits(
        self, k: int, held: HeldPlans, *, hurried: bool
    ) -> tuple[OwnPlan | None, list[int]]:
        """A way past those that have no plan, and whose plans it needs to be given up."""
        over = self._hit(self.vehicles[k].standing, k, held)  # those that drive over its start
        left = {other: one for other, one in held.items() if other not in over}
        tries = [(left, self.without_plan(left, {k}))] if hurried and over else []
        for those, standing in (*tries, ({}, self.without_plan(held, {k})), ({}, [])):
            found = self.past(k, those, standing, hurried=hurried)
            if found is not None:
                return found, self._hit(found.course, k, held)
        return None, []

    def _hit(self, course: FleetCourse, k: int, held: HeldPlans) -> list[int]:
        """Whom a vehicle meets on a course."""
        courses = {k: course, **{other: one.course for other, one in held.items()}}
        return sorted(m.other_than(k) for m in meetings(courses, keep=self.margin, among=[k]))

    def past(
        self,
        k: int,
        held: Mapping[int, OwnPlan],
        standing: Sequence[int],
        *,
        most: int = QUICK,
        again: bool = False,
        hurried: bool = False,
        besides: Sequence[Obstacle] = (),
    ) -> OwnPlan | None:
        """A way past plans, those at their starts, and more; better `again`, or the first found."""
        self.queries += 1
        others: list[Obstacle] = []
        for other in sorted({*held, *standing} - {k}):
            course = held[other].course if other in held else self.vehicles[other].standing
            others += course.obstacles
        others += besides
        schedule = None if hurried else self.schedule
        return self.vehicles[k].past(others, self.budget, most=most, again=again, schedule=schedule)


def by_priorities(
    turns: Turns, group: Sequence[int], held: HeldPlans, known: float
) -> HeldPlans | None:
    """The cheapest plans of a group over who gives way to whom; None if none costs less than known.

    Depth first, the cheaper child first; what is not cheaper than the best leaf is left out. Who
    gives way does so to the whole plan of the other, and to those to whom that one gives way.
    """
    return _Priorities(turns, tuple(group), held, known).run()


@dataclass(slots=True, eq=False)
class _Priorities:
    turns: Turns
    group: tuple[int, ...]
    held: HeldPlans
    known: float
    best: HeldPlans | None = None
    asked: dict[tuple[int, tuple[int, ...]], OwnPlan | None] = field(default_factory=dict)
    kept: list[OwnPlan] = field(default_factory=list)  # as long as their ids are asked for

    def run(self) -> HeldPlans | None:
        plans: HeldPlans = {}
        for k in self.group:
            found = self._past(k, {})
            if found is None:
                return None
            plans[k] = found
        self._descend(plans, frozenset())
        return self.best

    def _descend(self, plans: HeldPlans, before: frozenset[tuple[int, int]]) -> None:
        if not _cost(plans) < self.known * (1.0 - WORTH):
            return
        met = _first_meeting(plans, self.turns.margin)
        if met is None:
            self.best, self.known = plans, _cost(plans)
            return
        children = []
        for first, second in ((met.one, met.other), (met.other, met.one)):
            pairs = _closed(before | {(first, second)})
            # Who gave way already and meets the other all the same has no way past it.
            if (first, second) in before or (second, first) in pairs:
                continue
            child = self._replanned(plans, second, pairs)
            if child is not None:
                children.append((_cost(child), child, pairs))
        for _, child, pairs in sorted(children, key=lambda row: row[0]):
            self._descend(child, pairs)

    def _replanned(
        self, plans: HeldPlans, first: int, pairs: frozenset[tuple[int, int]]
    ) -> HeldPlans | None:
        """Plans in which one, and all behind it that meet those before them, give way."""
        plans = dict(plans)
        # Those before others first.
        turn = [first, *sorted({k for one, k in pairs if one == first})]
        for k in sorted(turn, key=lambda k: (sum(other == k for _, other in pairs), k)):
            above = {one: plans[one] for one, other in sorted(pairs) if other == k}
            courses = {j: plans[j].course for j in (k, *above)}
            if k != first and not meetings(courses, keep=self.turns.margin, among=[k]):
                continue
            found = self._past(k, above)
            if found is None:
                return None
            plans[k] = found
        return plans

    def _past(self, k: int, above: HeldPlans) -> OwnPlan | None:
        key = k, tuple(sorted(id(one) for one in above.values()))
        if key not in self.asked:
            if len(self.asked) >= MOST_QUERIES or self.turns.budget.is_over:
                return None
            outside, past = self.turns.without_plan(self.held, set(self.group)), self.turns.past
            found = past(k, {**self.held, **above}, outside, again=True)
            if found is None:
                found = past(k, {**self.held, **above}, outside, most=LONG)
            self.asked[key] = found
            self.kept += [] if found is None else [found]
        return self.asked[key]


def _closed(pairs: frozenset[tuple[int, int]]) -> frozenset[tuple[int, int]]:
    """Who gives way to whom, and to whom those give way."""
    closed = set(pairs)
    while True:
        more = {(a, d) for a, b in closed for c, d in closed if b == c} - closed
        if not more:
            return frozenset(closed)
        closed |= more


def _cost(plans: Mapping[int, OwnPlan]) -> float:
    return math.fsum(one.cost for one in plans.values())


def _first_meeting(plans: HeldPlans, margin: float) -> Meeting | None:
    found = meetings({k: one.course for k, one in plans.items()}, keep=margin)
    return found[0] if found else None


class _Node(NamedTuple):
    cost: float
    number: int  # of equal ones the first
    plans: HeldPlans
    avoided: dict[int, tuple[Obstacle, ...]]


def by_conflicts(
    turns: Turns, group: Sequence[int], held: HeldPlans, known: float
) -> HeldPlans | None:
    """The cheapest plans of a group, conflict by conflict; None if none cost less than `known`.

    Best first. Whoever gives way keeps clear of the other's body as it is now, while the two are
    too near to each other, and is free before and after.
    """
    outside = turns.without_plan(held, set(group))
    queries, numbers = 0, itertools.count()

    def past(k: int, avoided: tuple[Obstacle, ...]) -> OwnPlan | None:
        nonlocal queries
        queries += 1
        return turns.past(k, held, outside, again=True, besides=avoided)

    root: HeldPlans = {}
    for k in group:
        found = past(k, ())
        if found is None:
            return None
        root[k] = found
    frontier = [_Node(_cost(root), next(numbers), root, {})]
    while frontier and queries < MOST_QUERIES and not turns.budget.is_over:
        node = heapq.heappop(frontier)
        if not node.cost < known * (1.0 - WORTH):
            return None
        met = _first_meeting(node.plans, turns.margin)
        if met is None:
            return node.plans
        for k, other in ((met.one, met.other), (met.other, met.one)):
            mine, its = node.plans[k].course, node.plans[other].course
            more = _within(its.obstacles, (met.time, _until(mine, its, met.time, turns.margin)))
            avoided = {**node.avoided, k: (*node.avoided.get(k, ()), *more)}
            found = past(k, avoided[k])
            if found is not None:
                plans = {**node.plans, k: found}
                heapq.heappush(frontier, _Node(_cost(plans), next(numbers), plans, avoided))
    return None


def _within(bodies: Sequence[Obstacle], window: tuple[float, float]) -> list[Obstacle]:
    """Bodies that are there in a window of time [s], during that alone."""
    rows = []
    for one in bodies:
        first, last = max(one.presence[0], window[0]), min(one.presence[1], window[1])
        if first < last:
            rows.append(replace(one, present_s=(first, last)))
    return rows


def _until(one: FleetCourse, other: FleetCourse, begin: float, keep: float) -> float:
    """Until when two bodies are too near to each other [s], from a time on; inf if for ever."""
    last = max(one.quiet_after, other.quiet_after)
    times = np.linspace(begin, last, LOOKS) if last > begin else np.array([begin])
    near = np.zeros(times.size, dtype=np.bool_)
    for shapes, motion in zip(one.shapes, one.motions, strict=True):
        poses: Array = motion.at(times)
        world = world_of(other.bodies, shapes, tuple(poses[0].tolist()), keep=keep)
        near |= clearances(world, world.into(poses), times=times) <= keep
    clear = np.flatnonzero(~near[1:])
    return float(times[clear[0] + 1]) if clear.size else math.inf


def one_at_a_time(
    vehicles: Sequence[FleetMember],
    order_of: Callable[[int], tuple[int, ...]],
    margin: float,
    budget: Budget,
) -> Iterator[tuple[HeldPlans, int]]:
    """Plans of those that arrive, each past others where they stand, and of how many searches.

    In one order after another: who does not arrive goes first in the next one, and strictly so, as
    long as that order is new. An order that comes again is tried with twice the work.
    """
    tried: Counter[tuple[int, ...]] = Counter()
    order, strictly = order_of(0), False
    while True:
        key = strictly, *order
        floor = _Floor(vehicles, margin, budget, QUICK << tried[key])
        yield floor.in_order(order, strictly=strictly), floor.legs
        tried[key] += 1
        first = floor.waiting[:1]
        order = *first, *(k for k in order if k not in first)
        strictly = (True, *order) not in tried
        if not strictly:
            drawn = (order_of(len(tried) + n) for n in range(DRAWS))
            order = next((one for one in drawn if (False, *one) not in tried), order)


@dataclass(slots=True, eq=False)
class _Floor:
    vehicles: Sequence[FleetMember]
    margin: float  # [m] that any two bodies keep
    budget: Budget
    most: int = QUICK  # expansions of a leg
    legs: int = 0  # that were searched
    driven: HeldPlans = field(default_factory=dict)  # so far
    waiting: list[int] = field(default_factory=list)  # who is not at its goal
    asides: Counter[int] = field(default_factory=Counter)

    def in_order(self, order: Sequence[int], *, strictly: bool) -> HeldPlans:
        """The plans of those that arrive, without help if not all do."""
        # Room is made for the first of an order that needs it; unless `strictly` in order only
        # where none of those that wait can drive home without: who is home may be in the way of
        # others.
        self.waiting = list(order)
        unaided: HeldPlans = {}
        while self.waiting and not self.budget.is_over:
            unaided = unaided if self.asides else dict(self.driven)
            ways, waiting = (self._drives_home, self._is_made_room_for), tuple(self.waiting)
            tries = [(way, k) for way in ways for k in waiting]
            if strictly:
                tries.sort(key=lambda row: waiting.index(row[1]))
            if not any(way(k) for way, k in tries):
                break
        if self.waiting and self.asides:
            return unaided
        for k in self.asides:
            self.vehicles[k].keep_aside(self.driven[k])
        return {k: found for k, found in self.driven.items() if k not in self.waiting}

    def _drives_home(self, k: int) -> bool:
        """Whether a vehicle has a way to its goal past all others, which it drives then."""
        leg = self._leg(k, self._standing(but=k))
        if leg is not None:
            self.waiting.remove(k)
            self._drive(k, leg, leaves=self.vehicles[k].leaves)
        return leg is not None

    def _is_made_room_for(self, k: int) -> bool:
        """Whether those in the way of a vehicle drive aside, so that it arrives."""
        way = self._leg(k, [])
        if way is None:
            return False
        there = {j: one for j, one in self._courses().items() if j != k}
        for row in meetings({**there, k: way.course}, keep=self.margin, among=[k]):
            j = row.other_than(k)
            if self.asides[j] == MOST_ASIDE or not self._drives_aside(j, k, way):
                return False
        return self._drives_home(k)

    def _drives_aside(self, j: int, k: int, way: OwnPlan) -> bool:
        """Whether a vehicle finds a place off the way of another one, to which it drives then."""
        vehicle, before = self.vehicles[j], self.driven.get(j)
        if vehicle.problem.automaton.rest is None:
            return False
        others = self._standing(but=j)
        there = {i: one.arrived for i, one in self._courses().items() if i not in (j, k)}
        beside = list(itertools.chain(*there.values()))
        homes = (bodies for i, bodies in there.items() if i not in self.waiting)
        arrived, found, tried = [*way.course.arrived, *itertools.chain(*homes)], None, 0
        for goal in vehicle.refuges(before, way, beside, self._clock):
            if self.budget.is_over or tried == MOST_PLACES:
                break
            leg = self._leg(j, others, aim=goal)
            if leg is None:
                continue
            stays = replace(leg.course, until=math.inf).after(leg.arrival)
            if meetings({j: stays, k: way.course}, keep=self.margin):
                continue
            found, tried = found or leg, tried + 1
            if vehicle.leg(leg, arrived, self._clock, self.budget) is not None:  # home from there
                found = leg
                break
        if found is not None:
            self.asides[j] += 1
            self.waiting += [] if j in self.waiting else [j]
            self._drive(j, found, leaves=False)
        return found is not None

    def _drive(self, k: int, leg: OwnPlan, *, leaves: bool) -> None:
        """Drive a leg, as soon as all that was driven before allows."""
        vehicle, before, clock = self.vehicles[k], self.driven.get(k), leg.plan.start_time
        others = {j: one for j, one in self._courses().items() if j != k}
        first = vehicle.problem.start_time if before is None else before.arrival

        def begun(time: float) -> OwnPlan:
            found = vehicle.then(before, leg, time)
            return replace(
                found, course=replace(found.course, until=found.arrival if leaves else math.inf)
            )

        def is_free(time: float) -> bool:
            return not meetings({**others, k: begun(time).course}, keep=self.margin, among=[k])

        begins = [clock] if vehicle.problem.moves else np.linspace(first, clock, BEGINS).tolist()
        n = next((n for n, time in enumerate(begins[:-1]) if is_free(time)), len(begins) - 1)
        soonest = begins[n]
        late = begins[max(n - 1, 0)]
        for _ in range(HALVINGS if n else 0):
            middle = 0.5 * (late + soonest)
            late, soonest = (late, middle) if is_free(middle) else (middle, soonest)
        self.driven[k] = begun(soonest)

    def _leg(self, k: int, others: Sequence[Obstacle], aim: Goal | None = None) -> OwnPlan | None:
        self.legs += 1
        before, vehicle = self.driven.get(k), self.vehicles[k]
        return vehicle.leg(before, others, self._clock, self.budget, aim=aim, most=self.most)

    def _courses(self) -> dict[int, FleetCourse]:
        """What everybody has driven so far."""
        return courses_of(self.vehicles, self.driven)

    def _standing(self, *, but: int) -> list[Obstacle]:
        """All others where they stand now."""
        return [body for k, one in self._courses().items() if k != but for body in one.arrived]

    @property
    def _clock(self) -> float:
        """When all that was driven so far is over [s]."""
        starts = [one.problem.start_time for one in self.vehicles]
        return max([*starts, *(one.arrival for one in self.driven.values())])
