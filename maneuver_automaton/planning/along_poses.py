"""Plans along poses on the way: one search over what was passed and how the vehicle arrived there.

An arrival is a pose at which a pose on the way is passed, and the trim in which it is: one, or many
where the heading, the place or the trim is free. Between two arrivals lies a leg: a problem without
poses on the way, whose exact plan `answer` finds. The search is best-first over (what was passed,
arrival). A leg enters the queue with a bound of its cost, and is planned when it comes out.
Afterwards free headings and places are varied continuously, both neighbouring legs planned again,
and each leg gets more time. Plans are checked and priced as a whole: prices of switches count once.

Source: Cohen, Phillips, Likhachev (2014), *Planning single-arm manipulations with n-arm robots*,
for edges that are planned when they come out of the queue; Held, Karp (1962), *A dynamic
programming approach to sequencing problems*, for what remains in the best order.
"""

from __future__ import annotations

import functools
import heapq
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import joined
from maneuver_automaton.automaton.headings import posed
from maneuver_automaton.budget import Budget
from maneuver_automaton.planning.blocked import (
    blocked_ends,
    goals_off_lattice,
    why_goal_blocked,
    why_off_lattice,
)
from maneuver_automaton.planning.bounds import straight_bound
from maneuver_automaton.planning.incumbents import LEAST_TIME, Incumbents, Step
from maneuver_automaton.planning.result import Answer, LowerBound, PlanResult, PlanStatus
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal, Problem, Via
from maneuver_automaton.search.lattice_goals import nodes_within
from maneuver_automaton.search.limits import closed_bound

HEADINGS = 12  # that stand for a free one at first, beside those along the lines to neighbours
ALONG_GATE = (0.5, 0.2, 0.8)  # shares of a gate at which it is crossed at first
AROUND = 4  # places at the rim of a tolerance
MOST_SPEEDS = 3  # straight trims in which a vehicle with inertia passes, beside rest
HURRY = 3.0  # weight of what remains, in the search for a first plan
LEG_SHARE = 0.2  # of the time left, for a leg that is planned for the first time
SEARCHED = 0.4  # of the time, for the search over arrivals
VARIED = 0.6  # of the time left then, for free headings and places
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
FINE = 1e-4  # of a heading or place, as a share of where it was looked for, at the last
GAIN = 1e-7  # share of a cost that is a gain
GOAL = -1  # number of the goal among poses on the way


@dataclass(frozen=True, slots=True, eq=False)
class Arrival:
    """How a pose on the way is passed: where, and in which trim."""

    pose: Array  # (dof,)
    trim: str | None = None  # rest, or any for a vehicle that switches at will

    @property
    def key(self) -> tuple[bytes, str | None]:
        """Equal for equal arrivals."""
        return self.pose.tobytes(), self.trim


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """A plan from the start through some arrivals; with the goal at its end it is whole."""

    plan: Plan
    cost: float = 0.0
    passed: tuple[int, ...] = ()  # numbers of the poses on the way, in order
    arrivals: tuple[Arrival, ...] = ()
    legs: tuple[PlanResult, ...] = ()
    goal_index: int | None = None

    @property
    def mask(self) -> int:
        """The poses on the way that were passed, as bits."""
        return sum(1 << k for k in self.passed)


@dataclass(frozen=True, slots=True, eq=False)
class AlongPoses(Step):
    """Plans that pass the poses on the way of a problem, by `answer` to problems without."""

    answer: Answer

    def is_due(self, found: Incumbents) -> bool:
        """Always: each leg has a moment."""
        return True

    def offer(self, found: Incumbents) -> None:
        """Offer a first plan, then the best of the search, then what varying it gains."""
        problem, budget, ended = found.problem, found.budget, found.ended
        ended.is_complete = True
        between = replace(problem, via=(), order="given")
        for why in (blocked_ends, goals_off_lattice):
            verdict = None if problem.has_tolerance else why(between)
            if verdict is not None:
                ended.verdict = replace(verdict, problem=problem)
                return
        ways = []
        for k, via in enumerate(problem.via):
            arrivals, said = arrivals_of(problem, k)
            if said is not None:
                ended.why = said[0], f"pose {k + 1} on the way: {said[1]}"
                return
            ways.append(Way(via, arrivals))
        search = _Search(found, _Legs(found, between, self.answer), ways)
        first = search.best(HURRY, budget)
        if first is not None and found.wants_more:
            part = budget.before((1.0 - SEARCHED) * budget.left)
            best = search.best(1.0, part, below=first) or first
            best = search.varied(best, budget.before((1.0 - VARIED) * budget.left))
            search.with_more_time(best)
        if not found.plans:
            ended.why = search.why_none()
            return
        ended.bound = search.bound()


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """A pose on the way, and the arrivals that stand for it in the search."""

    via: Via
    arrivals: tuple[Arrival, ...]

    @property
    def is_sole(self) -> bool:
        """Whether there is one way to pass it, and no other."""
        return len(self.arrivals) == 1 and not (self.via.free_heading or self.via.radius)

    @property
    def around(self) -> Goal:
        """A goal that is met wherever and however it is passed."""
        free = self.via.free_heading
        return Goal(pose=self.via.pose, free_heading=free, tolerance_m=self.via.radius)


@dataclass(slots=True, eq=False)
class _Legs:
    """Plans between arrivals, each planned once."""

    found: Incumbents
    between: Problem  # without poses on the way
    answer: Answer
    known: dict[tuple[object, ...], PlanResult] = field(default_factory=dict)
    spent: int = 0  # expansions
    middle: Problem = field(init=False)  # of a leg to a pose on the way
    last: Problem = field(init=False)  # of the leg to a goal

    def __post_init__(self) -> None:
        stays = replace(self.between.horizon, stay=False)
        self.middle = replace(self.between, start_trim=None, horizon=stays)
        self.last = replace(self.between, start_trim=None)

    @property
    def is_timed(self) -> bool:
        """Whether a leg depends on what was driven before it."""
        horizon = self.between.horizon
        limited = horizon.max_time is not None or horizon.max_trims is not None
        return self.between.moves or limited

    def is_over(self, budget: Budget) -> bool:
        """Whether no leg may be planned any more."""
        most = self.between.search.max_expansions
        return budget.is_over or (most is not None and self.spent >= most)

    def question(self, chain: Chain, to: Arrival | None) -> Problem:
        """The problem of a leg from the end of a chain to an arrival, or to the goals."""
        here = chain.arrivals[-1] if chain.arrivals else None
        base = self.last if to is None else self.middle
        pose = self.between.start if here is None else here.pose
        trim = self.between.start_trim if here is None else here.trim
        goals = self.between.goals if to is None else (Goal(to.pose, trim=to.trim),)
        horizon, plan = base.horizon, chain.plan
        if horizon.max_time is not None:
            horizon = replace(horizon, max_time=max(horizon.max_time - plan.duration, LEAST_TIME))
        if horizon.max_trims is not None and plan.trims:
            left = horizon.max_trims - int((plan.durations > 0.0).sum()) + 1  # of equal ones one
            horizon = replace(horizon, max_trims=max(left, 1))
        return base.starting_at(
            pose,
            time=plan.start_time + plan.duration,
            goals=goals,
            trim=trim,
            horizon=horizon if self.is_timed else None,
        )

    def planned(
        self, chain: Chain, to: Arrival | None, budget: Budget, *, more: bool = False
    ) -> PlanResult | None:
        """The answer for a leg; None where there is no time for it. It looks for `more`."""
        ends = (chain.arrivals[-1].key if chain.arrivals else None, to and to.key)
        before = (chain.plan.duration, len(chain.plan.trims)) if self.is_timed else ()
        key = (*ends, *before)
        known = self.known.get(key)
        if known is not None and not more:
            return known
        if self.is_over(budget):
            return known
        question = self.question(chain, to)
        most = self.between.search.max_expansions
        if most is not None:
            most = max(1, most // (1 + len(self.found.problem.via)))
        search = replace(question.search, improve=more and question.search.improve)
        question = replace(question, search=replace(search, max_expansions=most))
        part = budget if more else budget.part(LEG_SHARE, at_least=LEAST_TIME)
        part = replace(part, shows=None, watch=None, expansions=most)
        result = self.answer(question, part, self.found.workspace, alternatives=0)
        self.spent += result.counts.get("expansions", 0)
        self.found.counts.update(result.counts)
        if known is None or known.cost is None or (result.cost or math.inf) < known.cost:
            self.known[key] = result
        return self.known[key]


@dataclass(eq=False)
class _Search:
    """The search over what was passed and how."""

    found: Incumbents
    legs: _Legs
    ways: Sequence[Way]
    failed: dict[tuple[int, int], PlanResult] = field(default_factory=dict)
    is_proven: bool = False  # nothing in the queue is cheaper than the best
    bounds: Array = field(init=False)  # (n + 1, n + 1) of legs: from the start or i, to k or goal
    wanted: dict[tuple[int, int], float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.ways)
        self.bounds = np.zeros((n + 1, n + 1))
        problem = self.legs.middle
        for i, k in itertools.product(range(-1, n), range(n + 1)):
            if i == k:
                continue
            goals = self.legs.between.goals if k == n else (self.ways[k].around,)
            from_way = self.ways[i].around if i >= 0 else None
            self.bounds[i, k] = min(_set_bound(problem, from_way, goal) for goal in goals)
        self._price_what_remains()

    @property
    def in_order(self) -> bool:
        """Whether the poses on the way are passed in the order given."""
        return self.found.problem.order == "given"

    def _next(self, mask: int) -> list[int]:
        """The poses on the way that may be passed next."""
        left = [k for k in range(len(self.ways)) if not mask >> k & 1]
        return left[:1] if self.in_order else left

    def _price_what_remains(self) -> None:
        """No plan on from a pose on the way costs less, by what was passed: Held and Karp's sum."""
        n, self.wanted = len(self.ways), {}
        for mask in range((1 << n) - 1, -1, -1):
            given = self.in_order
            if given and mask & (mask + 1):
                continue  # in order, those that were passed are the first ones
            left = self._next(mask)
            here = [k for k in range(n) if mask >> k & 1] if mask else [GOAL]
            for i in here[-1:] if given else here:
                costs = [
                    self.bounds[i, k] + self._stay(k) + self.wanted[mask | 1 << k, k] for k in left
                ]
                self.wanted[mask, i] = min(costs, default=float(self.bounds[i, n]))

    @functools.cached_property
    def _rest_rate(self) -> float:
        problem = self.found.problem
        rest = problem.automaton.rest
        return 0.0 if rest is None else float(problem.rates[rest])

    def _stay(self, k: int) -> float:
        return self._rest_rate * self.ways[k].via.stay_s

    def best(self, weight: float, budget: Budget, *, below: Chain | None = None) -> Chain | None:
        """The cheapest whole chain of the arrivals, or the first where what remains has a weight.

        Each leg is in the queue by a bound until it comes out; then it is planned, and is in by its
        cost. What costs no less than the chain `below` is left out.
        """
        problem, n = self.found.problem, len(self.ways)
        start = Chain(Plan(problem.start, (), durations=[], start_time=problem.start_time))
        count, settled = itertools.count(), dict[tuple[int, int, object], float]()
        most = math.inf if below is None else below.cost * (1.0 - GAIN)
        queue: list[tuple[float, int, Chain, tuple[int, Arrival | None] | None]] = []
        heapq.heappush(queue, (0.0, next(count), start, None))
        while queue:
            estimate, _, chain, leg = heapq.heappop(queue)
            if weight == 1.0 and estimate >= most:
                self.is_proven = True
                return None
            if leg is None and chain.goal_index is not None:
                if self._offer(chain):
                    self.is_proven = weight == 1.0
                    return chain
                continue
            mask = chain.mask
            if leg is not None:  # planned only now that nothing else is more promising
                k, to = leg
                if k != GOAL and settled.get((mask | 1 << k, k, to and to.key)) is not None:
                    continue
                longer = self._extended(chain, k, to, budget)
                if longer is None:
                    if self.legs.is_over(budget):
                        return None
                    continue
                remains = 0.0 if k == GOAL else self.wanted[longer.mask, k]
                heapq.heappush(queue, (longer.cost + weight * remains, next(count), longer, None))
                continue
            last = chain.passed[-1] if chain.passed else GOAL
            label = mask, last, chain.arrivals[-1].key if chain.arrivals else None
            if label in settled:
                continue
            settled[label] = chain.cost
            following = self._next(mask)
            for k in following:
                for to in self.ways[k].arrivals:
                    least = self._leg_bound(chain, k, to)
                    remains = least + self._stay(k) + self.wanted[mask | 1 << k, k]
                    entry = (chain.cost + weight * remains, next(count), chain, (k, to))
                    heapq.heappush(queue, entry)
            if not following:
                remains = float(self.bounds[last, n])
                entry = (chain.cost + weight * remains, next(count), chain, (GOAL, None))
                heapq.heappush(queue, entry)
        self.is_proven = weight == 1.0
        return None

    def _leg_bound(self, chain: Chain, k: int, to: Arrival) -> float:
        """No leg from the end of a chain to an arrival costs less."""
        last = chain.passed[-1] if chain.passed else GOAL
        pose = chain.arrivals[-1].pose if chain.arrivals else self.found.problem.start
        here = self.legs.middle.starting_at(pose, time=0.0)
        return max(float(self.bounds[last, k]), _least(here, Goal(to.pose)))

    def _extended(self, chain: Chain, k: int, to: Arrival | None, budget: Budget) -> Chain | None:
        """A chain and one leg more, to a pose on the way or the goal; None where there is none."""
        result = self.legs.planned(chain, to, budget)
        if result is None:
            return None
        if result.plan is None or result.cost is None:
            last = chain.passed[-1] if chain.passed else GOAL
            self.failed.setdefault((last, k), result)
            return None
        self._learn(chain, k, result)
        return self._with_leg(chain, k, to, result)

    def _learn(self, chain: Chain, k: int, result: PlanResult) -> None:
        """Raise the bound of a leg between poses that are passed in one way only."""
        last, n = (chain.passed[-1] if chain.passed else GOAL), len(self.ways)
        soles = [self.ways[i].is_sole for i in (last, k) if i != GOAL]
        if all(soles) and result.lower_bound is not None and not self.legs.is_timed:
            to = n if k == GOAL else k
            self.bounds[last, to] = max(self.bounds[last, to], result.lower_bound)

    def _with_leg(self, chain: Chain, k: int, to: Arrival | None, result: PlanResult) -> Chain:
        assert result.plan is not None
        plan = _joined(chain.plan, result.plan)
        if to is None:
            return replace(
                chain,
                plan=plan,
                cost=self.legs.between.cost_of(plan),
                legs=(*chain.legs, result),
                goal_index=result.goal_index,
            )
        stay = self.ways[k].via.stay_s
        if stay:
            plan = _joined(plan, self._standing(plan, stay))
        return Chain(
            plan,
            self.legs.between.cost_of(plan),
            (*chain.passed, k),
            (*chain.arrivals, to),
            (*chain.legs, result),
        )

    def _standing(self, plan: Plan, seconds: float) -> Plan:
        """A plan that stands where another one ends."""
        automaton = self.found.problem.automaton
        rests = plan.trims and plan.trims[-1].is_rest
        rest = plan.trims[-1] if rests else automaton.trims[automaton.rest or 0]
        return Plan(plan.end, (rest,), durations=[seconds])

    def _offer(self, chain: Chain) -> bool:
        """Offer a whole chain; whether it passes the checks."""
        assert chain.goal_index is not None
        passed = self.found.may_check and self.found.offer(chain.plan, chain.goal_index)
        if passed:
            return True
        again = self._from_its_ends(chain)
        return again is not None and self.found.offer(again, chain.goal_index)

    def _from_its_ends(self, chain: Chain) -> Plan | None:
        """The legs planned once more, each from the very end of the one before it.

        What each misses its end by, some 1e-12, would turn what follows.
        """
        goal, plan = self.found.problem.goals[chain.goal_index or 0], chain.plan
        if max(goal.off(plan.end)) <= max(goal.tolerance_m, goal.tolerance_rad, 1e-10):
            return None
        begun = Chain(Plan(plan.start, (), durations=[], start_time=plan.start_time))
        for k, to in (*zip(chain.passed, chain.arrivals, strict=True), (GOAL, None)):
            if begun.arrivals:
                here = replace(begun.arrivals[-1], pose=begun.plan.end)
                begun = replace(begun, arrivals=(*begun.arrivals[:-1], here))
            result = self.legs.planned(begun, to, self.found.budget)
            if result is None or result.plan is None:
                return None
            begun = self._with_leg(begun, k, to, result)
        return begun.plan

    def driven(self, chain: Chain, arrivals: Sequence[Arrival], budget: Budget) -> Chain | None:
        """A chain through other arrivals in the same order; None where a leg is not found."""
        start = self.found.problem.start
        found: Chain | None = Chain(
            Plan(start, (), durations=[], start_time=self.found.problem.start_time)
        )
        for k, to in (*zip(chain.passed, arrivals, strict=True), (GOAL, None)):
            assert found is not None
            found = self._extended(found, k, to, budget)
            if found is None:
                return None
        return found

    def varied(self, chain: Chain, budget: Budget) -> Chain:
        """The chain with other arrivals, then with headings and places varied continuously."""
        best, gained = chain, True
        while gained and not self.legs.is_over(budget):
            before = best.cost
            for n in range(len(best.passed)):
                if not self.is_proven:
                    best = self._other_arrival(best, n, budget)
                best = self._varied_at(best, n, budget)
            gained = best.cost < before * (1.0 - GAIN)
            if gained:
                self._offer(best)
        return best

    def _other_arrival(self, best: Chain, n: int, budget: Budget) -> Chain:
        """The cheapest chain in which one arrival may be another one of those searched."""
        for to in self.ways[best.passed[n]].arrivals:
            if to.key != best.arrivals[n].key and not self.legs.is_over(budget):
                arrivals = (*best.arrivals[:n], to, *best.arrivals[n + 1 :])
                other = self.driven(best, arrivals, budget)
                if other is not None and other.cost < best.cost * (1.0 - GAIN):
                    best = other
        return best

    def _varied_at(self, best: Chain, n: int, budget: Budget) -> Chain:
        """The chain with one arrival varied along each direction in which it is free."""
        problem, way = self.found.problem, self.ways[best.passed[n]]
        if problem.automaton.lattice is not None or problem.automaton.translated is not None:
            return best
        for moved, reach in _freedoms(problem, way.via):
            if self.legs.is_over(budget):
                break
            here, tried = best, dict[float, Chain | None]()

            def price(by: float) -> float:
                to = replace(here.arrivals[n], pose=moved(here.arrivals[n].pose, by))  # noqa: B023
                arrivals = (*here.arrivals[:n], to, *here.arrivals[n + 1 :])  # noqa: B023
                tried[by] = self.driven(here, arrivals, budget)  # noqa: B023
                one = tried[by]  # noqa: B023
                return math.inf if one is None else one.cost

            at = golden_section(price, -reach, reach, lambda: self.legs.is_over(budget))
            one = tried.get(at)
            if one is not None and one.cost < best.cost:
                best = one
        return best

    def with_more_time(self, chain: Chain) -> None:
        """Offer the chain with its legs planned once more, each with its share of the time left."""
        ends = (*zip(chain.passed, chain.arrivals, strict=True), (GOAL, None))
        problem = self.found.problem
        begun = Chain(Plan(problem.start, (), durations=[], start_time=problem.start_time))
        gained = False
        for n, ((k, to), leg) in enumerate(zip(ends, chain.legs, strict=True)):
            left = self.found.for_better
            better: PlanResult | None = leg
            if leg.bound is None or not leg.bound.optimal:
                part = left.part(1.0 / (len(ends) - n), at_least=LEAST_TIME)
                better = self.legs.planned(begun, to, part, more=True)
            if better is None or better.plan is None:
                better = leg
            gained |= better is not leg
            self._learn(begun, k, better)
            begun = self._with_leg(begun, k, to, better)
        if gained:
            self._offer(begun)

    def bound(self) -> LowerBound:
        """No plan is cheaper: the sum of the bounds of legs, in the best order."""
        self._price_what_remains()
        least = self.wanted[0, GOAL]
        return LowerBound(value=max(0.0, least), kind="distance")

    def why_none(self) -> tuple[PlanStatus, str]:
        """How it ended without a plan, and why."""
        found = self.found
        if found.why_refused and not self.failed:
            return PlanStatus.NO_PLAN, f"every plan found was refused: {found.why_refused}"
        if not self.failed or found.budget.is_over:
            late = found.why_unchecked or f"no plan within {found.budget.seconds:.4g} s"
            return PlanStatus.OUT_OF_BUDGET, late
        (last, k), result = max(self.failed.items(), key=lambda one: one[0][0])
        begin = "the start" if last == GOAL else f"pose {last + 1} on the way"
        end = "the goal" if k == GOAL else f"pose {k + 1} on the way"
        sole = all(self.ways[i].is_sole for i in (last, k) if i != GOAL) and self.in_order
        status = result.status if sole else PlanStatus.NO_PLAN
        return status, f"from {begin} to {end}: {result.reason}"


def arrivals_of(
    problem: Problem, number: int
) -> tuple[tuple[Arrival, ...], tuple[PlanStatus, str] | None]:
    """The arrivals that stand for a pose on the way, or why there is none: a status, a sentence."""
    via, automaton = problem.via[number], problem.automaton
    around = Goal(via.pose, free_heading=via.free_heading, tolerance_m=via.radius)
    if automaton.lattice is not None:
        nodes = [one for one in nodes_within(problem, around) if max(via.off(one.pose)) <= 1e-9]
        if not nodes:
            said = why_off_lattice(problem, replace(around, tolerance_m=via.tolerance_m))
            return (), (PlanStatus.NO_PLAN, _about(said or "no node of the lattice is on it"))
        found = [Arrival(one.pose, one.trim) for one in nodes]
    elif automaton.translated is not None:
        found = [
            Arrival(pose, trim)
            for place in _places(via)
            for pose, trim in posed(automaton, place, "via", free=via.free_heading)
        ]
    else:
        poses = [
            _with_heading(place, heading)
            for place in _places(via)
            for heading in _headings(problem, number)
        ]
        found = [Arrival(pose, trim) for pose in poses for trim in _trims(problem, via)]
    said = [why_goal_blocked(problem, Goal(one.pose, trim=one.trim)) for one in found]
    if all(said):
        proven = len(found) == 1 and not via.radius
        status = PlanStatus.GOAL_BLOCKED if proven else PlanStatus.NO_PLAN
        return (), (status, _about(said[0]))
    free = (one for one, why in zip(found, said, strict=True) if not why)
    return tuple(free), None


def _about(said: str) -> str:
    """What is said of a goal, said of a pose on the way."""
    return said.replace("at the goal ", "").replace("the goal is", "it is")


def _places(via: Via) -> Iterator[Array]:
    """Poses (dof,) at its places, with the heading that is stated; its own pose first."""
    places = [0, 1, *range(3, via.pose.size)]
    if via.gate is None:
        yield via.pose
    else:
        for share in ALONG_GATE:
            pose = np.array(via.pose)
            pose[places] = via.gate[0] + share * (via.gate[1] - via.gate[0])
            yield pose
    for k in range(AROUND if via.tolerance_m else 0):
        angle = 2.0 * math.pi * k / AROUND
        pose = np.array(via.pose)
        pose[:2] += (1.0 - GAIN) * via.tolerance_m * np.array([math.cos(angle), math.sin(angle)])
        yield pose


def _with_heading(pose: Array, heading: float) -> Array:
    turned = np.array(pose)
    turned[2] = heading
    return turned


def _headings(problem: Problem, number: int) -> list[float]:
    """Headings at a pose on the way: its own, or along the lines to neighbours and all around."""
    via = problem.via[number]
    if not via.free_heading:
        return [float(via.pose[2])]
    automaton = problem.automaton
    turns = automaton.body_velocities[:, 2].any() or any(
        one.displacement[2] for one in automaton.maneuvers
    )
    if not turns:
        return [float(problem.start[2])]
    ends = [problem.start, *(one.pose for one in problem.via), problem.goals[0].pose]
    before, here, after = ends[number : number + 3]
    lines = [after - before, here - before, after - here]
    angles = [math.atan2(line[1], line[0]) for line in lines if line[:2].any()]
    if problem.order == "free":
        angles = angles[:1]
    first = angles[0] if angles else float(problem.start[2])
    angles += [first + 2.0 * math.pi * k / HEADINGS for k in range(HEADINGS)]
    return list(dict.fromkeys(math.remainder(angle, 2.0 * math.pi) for angle in angles))


def _trims(problem: Problem, via: Via) -> list[str | None]:
    """Trims in which a pose on the way may be passed, None for rest, or for switching at will."""
    automaton = problem.automaton
    if not problem.has_inertia or via.stop:
        return [None]
    moving = [trim for trim in automaton.trims if not trim.is_rest]
    straight = [trim for trim in moving if not trim.body_velocity[2]] or moving

    def speed(trim: Trim) -> float:
        return float(np.linalg.norm(trim.body_velocity[[0, 1, *range(3, problem.start.size)]]))

    ahead = sorted((one for one in straight if one.body_velocity[0] >= 0.0), key=speed)
    few = ahead[:: -max(1, math.ceil(len(ahead) / MOST_SPEEDS))]
    rest: list[str | None] = [None] if automaton.rest is not None else []
    return rest + [trim.name for trim in few]


def _freedoms(
    problem: Problem, via: Via
) -> Iterator[tuple[Callable[[Array, float], Array], float]]:
    """How a pose may be moved within what a pose on the way admits, and how far at first."""
    places = [0, 1, *range(3, via.pose.size)]

    def turned(pose: Array, by: float) -> Array:
        return _with_heading(pose, pose[2] + by)

    def along(direction: Array) -> Callable[[Array, float], Array]:
        def shifted(pose: Array, by: float) -> Array:
            to = np.array(pose)
            to[places] += by * direction
            if via.gate is not None and not via.tolerance_m:
                way = via.gate[1] - via.gate[0]
                share = min(1.0, max(0.0, float((to[places] - via.gate[0]) @ way / (way @ way))))
                to[places] = via.gate[0] + share * way
                return to
            beyond = via.offs(to)[0]
            off = to[places] - via.place
            if beyond > 0.0 and via.gate is None:
                to[places] = via.place + off * (
                    (1.0 - GAIN) * via.tolerance_m / np.linalg.norm(off)
                )
            return pose if beyond > 0.0 and via.gate is not None else to

        return shifted

    if via.free_heading and problem.automaton.body_velocities[:, 2].any():
        yield turned, 2.0 * math.pi / HEADINGS
    if via.gate is not None:
        length = float(np.linalg.norm(via.gate[1] - via.gate[0]))
        yield along((via.gate[1] - via.gate[0]) / length), length / 2.0
    if via.tolerance_m:
        for direction in np.eye(len(places)):
            yield along(direction), via.tolerance_m


def golden_section(
    price: Callable[[float], float], low: float, high: float, is_over: Callable[[], bool]
) -> float:
    """Where a function of one number is least, as far as it falls and then rises.

    Examples
    --------
    >>> round(golden_section(lambda x: (x - 0.3) ** 2, -1.0, 1.0, lambda: False), 3)
    0.3
    """
    width = FINE * (high - low)
    one, other = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    prices = price(one), price(other)
    while high - low > width and not is_over():
        if prices[0] <= prices[1]:
            high, other = other, one
            one = high - GOLDEN * (high - low)
            prices = price(one), prices[0]
        else:
            low, one = one, other
            other = low + GOLDEN * (high - low)
            prices = prices[1], price(other)
    return one if prices[0] <= prices[1] else other


def _set_bound(problem: Problem, way: Goal | None, goal: Goal) -> float:
    """No leg costs less that begins within the tolerance of a pose, or at the start."""
    if way is None:
        return _least(problem, goal)
    free = goal.free_heading or way.free_heading
    to = replace(goal, free_heading=free, tolerance_m=goal.tolerance_m + way.tolerance_m)
    return _least(problem.starting_at(way.pose, time=problem.start_time), to)


def _least(problem: Problem, goal: Goal) -> float:
    """No plan to a goal costs less, whatever its trims: by distance and turn alone."""
    if problem.has_inertia:
        return straight_bound(problem, (goal,))
    return closed_bound(problem, goal)


def _joined(first: Plan, second: Plan) -> Plan:
    """One plan after another; either may be nothing at all."""
    if not second.trims:
        return first
    if not first.trims:
        return replace(second, start=first.start, start_time=first.start_time)
    return joined(first, second)
