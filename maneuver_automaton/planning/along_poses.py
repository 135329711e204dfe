"""Plans along poses on the way: one search over what was passed and how the vehicle arrived there.

An arrival is a pose at which a pose on the way is passed, and the trim in which it is: one, or many
where the heading, the place or the trim is free. Between two arrivals lies a leg: a problem without
poses on the way, whose exact plan `answer` finds. Legs are estimated at first. The cheapest way
through the arrivals, by dynamic programming over what was passed, has its legs planned; what they
cost takes the place of the estimates, until the cheapest way is all planned. Then free headings and
places are varied continuously, both neighbouring legs planned again, and each leg gets more time.
Plans are checked and priced as a whole: prices of switches count once.

Source: Dellin, Srinivasa (2016), *A unifying formalism for shortest path problems with expensive
edge evaluations via lazy best-first search over paths with edge selectors*; Held, Karp (1962), *A
dynamic programming approach to sequencing problems*.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import joined
from maneuver_automaton.budget import Budget
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning.arrivals import (
    VALLEYS,
    Arrival,
    BetterArrivals,
    LegCosts,
    arrivals_of,
    first_least,
    freedoms,
    set_bound,
)
from maneuver_automaton.planning.blocked import blocked_ends, goals_off_lattice, why_goal_blocked
from maneuver_automaton.planning.incumbents import LEAST_TIME, Incumbents, PlanningStep
from maneuver_automaton.planning.on_the_way import goal_around
from maneuver_automaton.planning.polishing import polish_on_the_way
from maneuver_automaton.planning.result import Answer, LowerBound, PlanResult, PlanStatus
from maneuver_automaton.problem import Goal, Problem, Via
from maneuver_automaton.words.library import moving_trims

LEAST_WORK = 3  # expansions that a leg counts for at least: one by words takes none
LEG_SHARE = 0.2  # of the time left, for a leg that is planned for the first time
IMPROVED = 0.15  # of the time, for arrivals that are better by estimates
SEARCHED = 0.4  # of the time, for the search over arrivals
POLISHED = 0.7  # of the time left, for polishing the plan as a whole
VARIED = 0.6  # of the time left then, for free headings and places
THINNED = 3  # of so many arrivals one stays where improved ones come in
SECTORS = 12  # of headings, in each of which the best arrival is improved
TURNED = 0.03  # [rad] of their borders, off headings that lie on them but for rounding
ALIKE = 1e-6  # [m, rad] between arrivals that are one
FINE = 1e-4  # of a heading or place, as a share of where it was looked for, at the last
NARROWER = 0.3  # of a step in which a heading or place gained nothing
GAIN = 1e-7  # share of a cost that is a gain
GUESS_SHARE = 0.2  # of the time for polishing, for a plan with the headings that are stated
QUITE = 1.0  # [rad] from which on a heading is quite another one
GOAL = -1  # number of the goal among poses on the way


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """A plan from the start through some arrivals; with the goal at its end it is whole."""

    plan: Plan
    cost: float = 0.0
    passed: tuple[int, ...] = ()  # numbers of the poses on the way, in order
    arrivals: tuple[Arrival, ...] = ()
    legs: tuple[PlanResult, ...] = ()
    goal_index: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class AlongPoses(PlanningStep):
    """Plans that pass the poses on the way of a problem, by `answer` to problems without."""

    answer: Answer

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
        legs = _Legs(found, between, self.answer)
        search = _Search(found, legs, ways)
        if search.estimated.by_words and search.is_free:
            search = _Search(found, legs, search.improved(budget.part(IMPROVED)))
        best = search.best(budget.before((1.0 - SEARCHED) * budget.left))
        if best is not None and found.wants_more:
            whole = found.for_better.part(POLISHED)
            better = polish_on_the_way(found, search.guesses(best, whole), whole)
            if not better or any(via.stop for via in problem.via):  # whose legs are more alone
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
    def is_free(self) -> bool:
        """Whether a heading or a place may be chosen."""
        return self.via.free_heading or self.via.radius > 0.0


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
        automaton, stays = self.between.automaton, replace(self.between.horizon, stay=False)
        # Each leg names its trims; of a vehicle that cannot stand still, one must be named before.
        some = automaton.trim_names[0] if automaton.rest is None else None
        self.last = replace(self.between, start_trim=some, start_state=None)
        to = Goal(self.between.start, trim=some)
        self.middle = replace(self.last, goals=(to,), horizon=stays)

    @property
    def is_timed(self) -> bool:
        """Whether a leg depends on what was driven before it."""
        horizon = self.between.horizon
        return self.between.moves or horizon.max_time is not None or horizon.max_trims is not None

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
            spent = plan.duration + (self._after(chain, to) if to else 0.0)
            horizon = replace(horizon, max_time=max(horizon.max_time - spent, LEAST_TIME))
        if horizon.max_trims is not None and plan.trims:
            left = horizon.max_trims - int((plan.durations > 0.0).sum()) + 1  # of equal ones one
            horizon = replace(horizon, max_trims=max(left, 1))
        leg = base.starting_at(
            pose,
            time=plan.start_time + plan.duration,
            goals=goals,
            trim=trim,
            horizon=horizon if self.is_timed else None,
        )
        state = self.between.start_state if here is None else None
        return leg if state is None else replace(leg, start_trim=None, start_state=state)

    def _after(self, chain: Chain, to: Arrival) -> float:
        """Least time [s] that a plan needs beyond an arrival, which its leg there must leave."""
        problem, timed = self.found.problem, replace(self.middle, cost=Cost(time=1.0))
        left = [one for k, one in enumerate(problem.via) if k not in chain.passed]  # and this one
        way = [Goal(to.pose), *map(goal_around, left[1:] if problem.order == "given" else ())]
        legs = [set_bound(timed, *pair) for pair in itertools.pairwise(way)]
        last = min(set_bound(timed, way[-1], goal) for goal in problem.goals)
        return math.fsum([*legs, last, *(one.stay_s for one in left)])

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
        part = part._replace(shows=None, watch=None, expansions=most)
        result = self.answer(question, part, self.found.workspace, alternatives=0)
        self.spent += max(result.counts.get("expansions", 0), LEAST_WORK)
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
    is_proven: bool = False  # no other arrivals of those searched are cheaper
    numbers: dict[tuple[int, object], int] = field(init=False)  # of arrivals, by way and key
    arrivals: list[tuple[int, Arrival]] = field(init=False)  # all of them, with their way
    costs: Array = field(init=False)  # (A + 1, A + 1) of legs: estimates until they are planned
    bounds: Array = field(init=False)  # (n + 1, n + 1) the same between ways: nothing is cheaper
    direct: float = field(init=False)  # from the start to the goal nothing is cheaper either
    estimated: LegCosts = field(init=False)

    def __post_init__(self) -> None:
        n, middle, goals = len(self.ways), self.legs.middle, self.legs.between.goals
        self.estimated = LegCosts(middle)
        self.arrivals = [(k, to) for k, way in enumerate(self.ways) for to in way.arrivals]
        self.numbers = {(k, to.key): a for a, (k, to) in enumerate(self.arrivals)}
        self.bounds = np.zeros((n + 1, n + 1))
        # a maneuver from a state of no trim is no word of the library
        between = self.legs.between
        bounded = replace(between, horizon=middle.horizon) if between.has_states else middle
        self.direct = min(set_bound(bounded, None, goal) for goal in goals)
        for i, k in self._pairs():
            ends = goals if k == n else (goal_around(self.ways[k].via),)
            begin = None if i == n else goal_around(self.ways[i].via)
            self.bounds[i, k] = min(set_bound(bounded, begin, end) for end in ends)
        self.costs = np.full((len(self.arrivals) + 1,) * 2, np.inf)
        rows: list[list[int]] = [[] for _ in range(n)]
        for a, (k, _) in enumerate(self.arrivals):
            rows[k].append(a)
        rows.append([len(self.arrivals)])
        poses = [*(to.pose for _, to in self.arrivals), self.found.problem.start]
        for i, k in self._pairs():
            begins = np.array([poses[a] for a in rows[i]])
            aims = [*goals] if k == n else [Goal(poses[a]) for a in rows[k]]
            priced = self.estimated.to(begins, aims)
            if k == n:
                priced = priced.min(axis=1, keepdims=True)
            self.costs[np.ix_(rows[i], rows[k])] = np.maximum(priced, self.bounds[i, k])
            if self.estimated.are_least and self._are_sole(i, k):
                self.bounds[i, k] = self.costs[np.ix_(rows[i], rows[k])].item()

    def _pairs(self) -> Iterator[tuple[int, int]]:
        """Which ways may follow each other; n is the start of a pair, or the goal at its end."""
        n = len(self.ways)
        for i, k in itertools.product(range(n + 1), repeat=2):
            if (k == (i + 1) % (n + 1)) if self.in_order else (i != k or n == 0):
                yield i, k

    def _are_sole(self, *ways: int) -> bool:
        """Whether each of these is passed in one way and no other, within a maneuver neither."""
        passed = [self.ways[k] for k in ways if k not in (GOAL, len(self.ways))]
        inertia = self.legs.between.has_inertia
        return all(
            len(way.arrivals) == 1 and not way.is_free and (way.via.stop or not inertia)
            for way in passed
        )

    @property
    def is_free(self) -> bool:
        """Whether any heading or place may be chosen."""
        return any(way.is_free for way in self.ways)

    def improved(self, budget: Budget) -> list[Way]:
        """The ways with arrivals that cost less by estimates, in the order that seems best."""
        # The best chain through each sector of headings at each pose is improved, cheapest first.
        problem = self.found.problem
        order = [k for k, _ in self._cheapest()[1]]
        rows = [np.flatnonzero([k == number for k, _ in self.arrivals]) for number in order]
        ahead = [self.costs[-1, rows[0]]]
        back = [self.costs[rows[-1], -1]]
        for one, other in itertools.pairwise(rows):
            ahead.append((ahead[-1][:, None] + self.costs[np.ix_(one, other)]).min(axis=0))
        for one, other in itertools.pairwise(rows[::-1]):
            back.insert(0, (self.costs[np.ix_(other, one)] + back[0]).min(axis=1))
        chains: dict[tuple[int, ...], float] = {}
        for n, row in enumerate(rows):
            through = ahead[n] + back[n]
            headings = np.array([self.arrivals[a][1].pose[2] for a in row]) - problem.start[2]
            sectors = (
                np.floor((headings + TURNED) * SECTORS / (2.0 * math.pi)).astype(int) % SECTORS
            )
            for sector in set(sectors.tolist()):
                at = first_least(np.where(sectors == sector, through, np.inf))
                picked = [at]
                for m in range(n, 0, -1):
                    into = self.costs[rows[m - 1], rows[m][picked[0]]]
                    picked.insert(0, first_least(ahead[m - 1] + into))
                for m in range(n, len(rows) - 1):
                    on = self.costs[rows[m][picked[-1]], rows[m + 1]]
                    picked.append(first_least(on + back[m + 1]))
                chains[tuple(picked)] = float(through[at])
        better = BetterArrivals(problem, self.estimated, order)
        more: list[list[Arrival]] = [[] for _ in self.ways]
        for chain in sorted(chains, key=chains.__getitem__)[:VALLEYS]:
            poses = [self.arrivals[row[at]][1].pose for row, at in zip(rows, chain, strict=True)]
            for k, pose in zip(order, better.chain(poses, lambda: budget.is_over), strict=True):
                if not why_goal_blocked(problem, Goal(pose)):
                    more[k].append(Arrival(pose))
        return [
            replace(way, arrivals=_distinct((*more[k], *way.arrivals[::THINNED])))
            if way.is_free
            else way
            for k, way in enumerate(self.ways)
        ]

    @property
    def in_order(self) -> bool:
        """Whether the poses on the way are passed in the order given."""
        return self.found.problem.order == "given"

    def best(self, budget: Budget) -> Chain | None:
        """Cheapest whole chain of the arrivals, as far as the time lets their legs be planned."""
        # The cheapest by what is known and estimated is planned; what that takes is known then.
        best: Chain | None = None
        while not self.legs.is_over(budget) or best is None:
            least, chosen = self._cheapest()
            if least == math.inf or (best and least >= best.cost * (1.0 - GAIN)):
                self.is_proven = best is not None
                break
            before = self.costs.copy()
            chain = self.driven(chosen, self.found.budget if best is None else budget)
            if (
                chain is not None
                and (best is None or chain.cost < best.cost)
                and self._offer(chain)
            ):
                best = chain
            if np.array_equal(before, self.costs):
                self.is_proven = best is not None
                break
            if not self.found.wants_more and (best or self.legs.is_over(self.found.budget)):
                break
        return best

    def _cheapest(self) -> tuple[float, list[tuple[int, Arrival]]]:
        """The cheapest way through the arrivals by what legs cost or are estimated to."""
        of_way = np.array([k for k, _ in self.arrivals])
        remains = _remaining(self.costs, of_way, self._stays, in_order=self.in_order)
        at, mask, chosen = len(self.arrivals), 0, list[tuple[int, Arrival]]()
        while len(chosen) < len(self.ways):
            after = _following(remains, mask, of_way, self._stays, in_order=self.in_order)
            at = first_least(self.costs[at, :-1] + after)
            chosen.append(self.arrivals[at])
            mask |= 1 << int(of_way[at])
        return float(remains[0][-1]), chosen

    @functools.cached_property
    def _stays(self) -> Array:
        """Cost (n,) of standing at each pose on the way."""
        problem = self.found.problem
        rate = moving_trims(problem.automaton, problem.cost).rest_rate
        return np.array([rate * way.via.stay_s for way in self.ways])

    def _extended(self, chain: Chain, k: int, to: Arrival | None, budget: Budget) -> Chain | None:
        """A chain and one leg more, to a pose on the way or the goal; None where there is none."""
        result = self.legs.planned(chain, to, budget)
        if result is None:
            return None
        self._learn(chain, k, to, result)
        if result.plan is None:
            last = chain.passed[-1] if chain.passed else GOAL
            self.failed.setdefault((last, k), result)
            return None
        return self._with_leg(chain, k, to, result)

    def _learn(self, chain: Chain, k: int, to: Arrival | None, result: PlanResult) -> None:
        """Keep what a leg costs, and its bound if it is that of all plans between two ways."""
        n, every = len(self.ways), len(self.arrivals)
        last = chain.passed[-1] if chain.passed else n
        row = self.numbers.get((last, chain.arrivals[-1].key)) if chain.arrivals else every
        column = every if to is None else self.numbers.get((k, to.key))
        if row is not None and column is not None:
            self.costs[row, column] = math.inf if result.cost is None else result.cost
        known = result.lower_bound is not None and not self.legs.is_timed
        if known and self._are_sole(last, k):
            at = last, n if to is None else k
            self.bounds[at] = max(self.bounds[at], result.lower_bound)

    def _with_leg(self, chain: Chain, k: int, to: Arrival | None, result: PlanResult) -> Chain:
        assert result.plan is not None
        plan = _joined(chain.plan, result.plan)
        if to is not None and (stay := self.ways[k].via.stay_s):
            plan = _joined(plan, self._standing(plan, stay))
        cost, legs = self.legs.between.cost_of(plan), (*chain.legs, result)
        chain = replace(chain, plan=plan, cost=cost, legs=legs)
        if to is None:
            return replace(chain, goal_index=result.goal_index)
        return replace(chain, passed=(*chain.passed, k), arrivals=(*chain.arrivals, to))

    def _standing(self, plan: Plan, seconds: float) -> Plan:
        """A plan that stands where another one ends."""
        problem, automaton = self.found.problem, self.found.problem.automaton
        cheapest = moving_trims(automaton, problem.cost).rest
        at = automaton.rest if problem.has_inertia else cheapest
        rests = plan.trims and plan.trims[-1].is_rest
        rest = plan.trims[-1] if rests else automaton.trims[at or 0]
        return Plan(plan.end, (rest,), durations=[seconds])

    def _offer(self, chain: Chain) -> bool:
        """Offer a whole chain; whether it passes the checks."""
        assert chain.goal_index is not None
        if self.found.may_check and self.found.offer(chain.plan, chain.goal_index):
            return True
        again = self._from_its_ends(chain)
        return again is not None and self.found.offer(again, chain.goal_index)

    def _from_its_ends(self, chain: Chain) -> Plan | None:
        """The legs planned once more, each from the very end of the one before it."""
        # What each misses its end by, some 1e-12, would turn what follows.
        goal, plan = self.found.problem.goals[chain.goal_index or 0], chain.plan
        if max(goal.off(plan.end)) <= max(goal.tolerance_m, goal.tolerance_rad, 1e-10):
            return None
        begun = self._begun()
        for k, to in (*zip(chain.passed, chain.arrivals, strict=True), (GOAL, None)):
            if begun.arrivals:
                here = replace(begun.arrivals[-1], pose=begun.plan.end)
                begun = replace(begun, arrivals=(*begun.arrivals[:-1], here))
            result = self.legs.planned(begun, to, self.found.budget)
            if result is None or result.plan is None:
                return None
            begun = self._with_leg(begun, k, to, result)
        return begun.plan

    def _begun(self) -> Chain:
        """A chain of nothing, at the start."""
        problem = self.found.problem
        return Chain(Plan(problem.start, (), durations=[], start_time=problem.start_time))

    def driven(self, chosen: Sequence[tuple[int, Arrival]], budget: Budget) -> Chain | None:
        """The whole chain through some arrivals; None where a leg is not found."""
        found: Chain | None = self._begun()
        for k, to in (*chosen, (GOAL, None)):
            assert found is not None
            found = self._extended(found, k, to, budget)
            if found is None:
                return None
        return found

    def guesses(self, best: Chain, budget: Budget) -> Iterator[tuple[Plan, int]]:
        """Plans to be polished, each with its goal: the best, others where headings are free."""
        # These pass with the headings that are stated, or each pose in turn with quite another one.
        known = self.found.plans[0]
        yield known.plan, known.goal_index
        free = [n for n, k in enumerate(best.passed) if self.ways[k].via.free_heading]
        if not free:
            return
        stated = [replace(via, free_heading=False) for via in self.found.problem.via]
        problem = replace(self.found.problem, via=tuple(stated))
        ways = [Way(via, arrivals_of(problem, k)[0]) for k, via in enumerate(stated)]
        if all(way.arrivals for way in ways):
            chain = _Search(self.found, self.legs, ways).best(budget.part(GUESS_SHARE))
            if chain is not None:
                yield chain.plan, chain.goal_index or 0
        every = self.costs
        for n in free:
            k, pose = best.passed[n], best.arrivals[n].pose
            near = [
                way == k and abs(math.remainder(to.pose[2] - pose[2], 2.0 * math.pi)) < QUITE
                for way, to in self.arrivals
            ]
            self.costs = np.where([*near, False], np.inf, every)
            cost, chosen = self._cheapest()
            self.costs = every
            if cost < math.inf and not self.legs.is_over(budget):
                chain = self.driven(chosen, budget)
                if chain is not None:
                    yield chain.plan, chain.goal_index or 0

    def varied(self, chain: Chain, budget: Budget) -> Chain:
        """The chain with other arrivals, then with headings and places varied continuously."""
        best, gained, first = chain, True, True
        while gained and not self.legs.is_over(budget):
            before = best.cost
            for n in range(len(best.passed)):
                if first and not self.is_proven:
                    best = self._other_arrival(best, n, budget)
                best = self._varied_at(best, n, budget)
            gained = best.cost < before * (1.0 - GAIN)
            first = False
            if gained:
                self._offer(best)
        return best

    def _other_arrival(self, best: Chain, n: int, budget: Budget) -> Chain:
        """The cheapest chain in which one arrival may be another of the same trim, or pose."""
        here = best.arrivals[n]
        others = [
            to
            for to in self.ways[best.passed[n]].arrivals
            if (to.trim == here.trim) != np.array_equal(to.pose, here.pose)
        ]
        for to in sorted(others, key=here.off):
            if self.legs.is_over(budget):
                break
            best = _cheaper(best, self._with(best, n, to, budget))
        return best

    def _with(self, chain: Chain, n: int, to: Arrival, budget: Budget) -> Chain | None:
        """A chain with another arrival."""
        arrivals = (*chain.arrivals[:n], to, *chain.arrivals[n + 1 :])
        return self.driven(list(zip(chain.passed, arrivals, strict=True)), budget)

    def _varied_at(self, best: Chain, n: int, budget: Budget) -> Chain:
        """The chain with one arrival varied along each direction in which it is free."""
        problem, way = self.found.problem, self.ways[best.passed[n]]
        if problem.automaton.lattice is not None or problem.automaton.translated is not None:
            return best
        for moved, reach in freedoms(problem, way.via):
            step = reach
            while step > FINE * reach and not self.legs.is_over(budget):
                here = best.arrivals[n]
                before = best.cost
                for by in (step, -step):
                    to = replace(here, pose=moved(here.pose, by))
                    best = _cheaper(best, self._with(best, n, to, budget))
                step *= 1.0 if best.cost < before else NARROWER
        return best

    def with_more_time(self, chain: Chain) -> None:
        """Offer the chain with its legs planned once more, each with its share of the time left."""
        ends = (*zip(chain.passed, chain.arrivals, strict=True), (GOAL, None))
        begun, gained = self._begun(), False
        for n, ((k, to), leg) in enumerate(zip(ends, chain.legs, strict=True)):
            left = self.found.for_better
            better: PlanResult | None = leg
            if leg.bound is None or not leg.bound.optimal:
                part = left.part(1.0 / (len(ends) - n), at_least=LEAST_TIME)
                better = self.legs.planned(begun, to, part, more=True)
            if better is None or better.plan is None:
                better = leg
            gained |= better is not leg
            self._learn(begun, k, to, better)
            begun = self._with_leg(begun, k, to, better)
        if gained:
            self._offer(begun)

    def bound(self) -> LowerBound:
        """No plan is cheaper: the sum of the bounds of legs, in the best order, or of none."""
        ways = np.arange(len(self.ways))
        remains = _remaining(self.bounds, ways, self._stays, in_order=self.in_order)
        direct = self.direct + float(self._stays.sum())  # may be more: a gate counts as a disc
        return LowerBound(value=max(0.0, direct, float(remains[0][-1])), kind="distance")

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
        sole = self._are_sole(last, k) and self.in_order
        sole &= last == GOAL or not self.legs.is_timed  # what was driven before may be another
        status = result.status if sole else PlanStatus.NO_PLAN
        if any(one.status is PlanStatus.OUT_OF_BUDGET for one in self.failed.values()):
            status = PlanStatus.OUT_OF_BUDGET
        return status, f"from {begin} to {end}: {result.reason}"


def _distinct(arrivals: Iterable[Arrival]) -> tuple[Arrival, ...]:
    """Arrivals without those that come after one like them."""
    found: list[Arrival] = []
    for one in arrivals:
        if not any(one.trim == other.trim and one.off(other) <= ALIKE for other in found):
            found.append(one)
    return tuple(found)


def _cheaper(chain: Chain, other: Chain | None) -> Chain:
    return chain if other is None or chain.cost * (1.0 - GAIN) <= other.cost else other


def _remaining(costs: Array, of_way: IntArray, stays: Array, *, in_order: bool) -> dict[int, Array]:
    """Least cost (A + 1,) from every arrival to the goal, by what was passed: the last, start."""
    # Costs (A + 1, A + 1) are those of legs from arrivals, the last row from the start, to
    # arrivals, the last column to the goal; what was passed is written in bits.
    n = len(stays)
    remains = {(1 << n) - 1: costs[:, -1]}
    masks = [(1 << k) - 1 for k in range(n)] if in_order else range((1 << n) - 1)
    for mask in reversed(masks):
        after = _following(remains, mask, of_way, stays, in_order=in_order)
        last = np.flatnonzero(mask >> of_way & 1) if mask else np.array([len(of_way)])
        coming = np.flatnonzero(after < np.inf)
        remains[mask] = np.full(len(of_way) + 1, np.inf)
        if coming.size:
            sums = costs[np.ix_(last, coming)] + after[coming]
            remains[mask][last] = sums.min(axis=1)
    return remains


def _following(
    remains: dict[int, Array], mask: int, of_way: IntArray, stays: Array, *, in_order: bool
) -> Array:
    """What follows (A,) once each arrival comes next; inf for one that may not."""
    after = np.full(len(of_way), np.inf)
    left = [k for k in range(len(stays)) if not mask >> k & 1]
    for k in left[:1] if in_order else left:
        rows = of_way == k
        after[rows] = stays[k] + remains[mask | 1 << k][:-1][rows]
    return after


def _joined(first: Plan, second: Plan) -> Plan:
    """One plan after another; either may be nothing at all."""
    if not second.trims:
        return first
    if not first.trims:
        return replace(second, start=first.start, start_time=first.start_time)
    return joined(first, second)
