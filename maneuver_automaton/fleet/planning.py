"""Plans for a fleet: each alone, then one after another past those that meet it, then better ones.

A vehicle that holds a plan is a moving obstacle whose future is known to the last digit, so nobody
has to agree on anything but who goes first. Vehicles that meet nobody need nothing more than their
way alone.
"""

from __future__ import annotations

import functools
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from maneuver_automaton._arrays import as_number, as_whole, check_range
from maneuver_automaton._interrupts import patient
from maneuver_automaton._parallel import gathered
from maneuver_automaton.budget import Budget
from maneuver_automaton.costs import Cost, terms_of
from maneuver_automaton.fleet.coordination import DRAWS, HeldPlans, is_short, one_at_a_time
from maneuver_automaton.fleet.courses import FleetCourse
from maneuver_automaton.fleet.meetings import components, meetings
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.result import FleetResult
from maneuver_automaton.fleet.vehicle import FleetMember, OwnPlan, courses_of, vehicles_of
from maneuver_automaton.fleet.verdict import STANDS, verified
from maneuver_automaton.fleet.workers import How, PoolTask, WorkerPool

Objective = Literal["sum", "last"]

ALONE_SHARE = 0.5  # of the time, for all ways alone
ORDERS_SHARE = 0.7  # of the time left, for one order of the vehicles before they drive by turns
SEARCH = 1000  # expansions that take as long as the rest of a search
WORTH = 1e-6  # share of the objective that another plan has to save
LARGEST_GROUP = 4  # vehicles that are planned anew together
AT_ONCE: tuple[How, ...] = ("in turn", "by priorities", "by conflicts")
MOST_OF: dict[How, int] = {"in turn": LARGEST_GROUP, "by priorities": 4, "by conflicts": 3}
LOST_BY: dict[How, float] = {"in turn": 0.0, "by priorities": WORTH, "by conflicts": 0.05}
VEHICLES_A_GROUP = 12  # of which one group is planned anew at a time, and one by itself


def plan_fleet(
    fleet: FleetProblem,
    *,
    time_limit: float = 10.0,
    objective: Objective = "sum",
    orders: int = 8,
    seed: int = 0,
    max_rounds: int | None = None,
    on_better: Callable[[float, float], None] | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
) -> FleetResult:
    """Plans for all vehicles of a fleet that keep apart at all times.

    Parameters
    ----------
    fleet : FleetProblem
    time_limit : float
        Upper bound [s] for search and improvement; the checks of the answer come after it.
    objective : {"sum", "last"}
        What is improved: the sum of the costs, or when the last vehicle arrives.
    orders : int
        Orders of the vehicles that are tried, where one does not do.
    seed : int
        Of the random choices; the same seed, the same sequence of improvements.
    max_rounds : int, optional
        Attempts at improvement; as many as there is time for if omitted.
    on_better : callable, optional
        Called with seconds and objective when a better fleet is found.
    jobs : int
        Processes that plan vehicles, orders and groups at a time; 1 means none beside this one.
        They begin before the time counts. With a limit of work instead of time (`max_rounds`) the
        plans are the same for any number.
    scheduler : str, optional
        Address of a Dask scheduler, or "local": the same work is sent there, in `jobs` pieces.

    Returns
    -------
    FleetResult
        Every plan checked past static obstacles, and every pair of vehicles proven apart, now and
        after all have arrived, by two libraries.

    Raises
    ------
    ValueError
        If a number is out of its range, or there is no such scheduler.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> robot = Automaton.of_controls(
    ...     Unicycle(), {"rest": (0, 0), "on": (1, 0), "left": (0, 1), "right": (0, -1)}
    ... )
    >>> there = Problem(robot, [0, 0, 0], [4, 0, 0], footprint=Disc(0.3))
    >>> across = Problem(robot, [2, -2, 0], [2, 2, 0], footprint=Disc(0.3))
    >>> result = plan_fleet(FleetProblem([there, across]), time_limit=60.0, max_rounds=3)
    >>> result.status.value, result.clearance_m > 0.0
    ('found', True)
    """
    time_limit, seed = as_number("time_limit", time_limit), as_whole("seed", seed)
    orders, jobs = as_whole("orders", orders), as_whole("jobs", jobs)
    max_rounds = None if max_rounds is None else as_whole("max_rounds", max_rounds)
    check_range("time_limit", time_limit, unit="s", infinite=True)
    check_range("orders", orders, least=1)
    check_range("jobs", jobs, least=1)
    if objective not in ("sum", "last"):
        raise ValueError(f"objective must be 'sum' or 'last', got {objective!r}")
    apart = jobs > 1 or scheduler is not None
    workers = gathered(jobs=jobs, scheduler=scheduler) if apart else nullcontext()
    with workers as run, patient():
        pool = WorkerPool(fleet, vehicles_of(fleet), jobs, run)
        pool.load()
        search = _FleetSearch(pool, objective, Budget.from_now(time_limit), seed, on_better)
        return search.run(orders, max_rounds)


@dataclass(slots=True, eq=False)
class _FleetSearch:
    """One search for the plans of a fleet."""

    pool: WorkerPool
    objective: Objective
    budget: Budget
    seed: int
    on_better: Callable[[float, float], None] | None
    held: HeldPlans = field(default_factory=dict)
    reasons: dict[int, str] = field(default_factory=dict)
    order: list[int] = field(default_factory=list)
    improvements: list[tuple[float, float]] = field(default_factory=list)
    queries: int = 0
    rounds: int = 0
    whole: list[tuple[tuple[int, ...], How]] = field(default_factory=list)  # groups to begin with
    tried: Counter[tuple[int, ...]] = field(default_factory=Counter)  # orders, and how often
    versions: Counter[int] = field(default_factory=Counter)  # of what is known of each vehicle
    asked: set[tuple[object, ...]] = field(default_factory=set)  # groups, how, and versions of all

    @property
    def fleet(self) -> FleetProblem:
        """What is to be planned."""
        return self.pool.fleet

    @property
    def vehicles(self) -> list[FleetMember]:
        """Those of the fleet."""
        return self.pool.vehicles

    def run(self, orders: int, max_rounds: int | None) -> FleetResult:
        """The whole search, and the checks of what it found."""
        tasks = [PoolTask((one.number,), {}, "alone") for one in self.vehicles]
        for _ in self.pool.each(tasks, self.budget.stage(ALONE_SHARE)):
            pass
        for one in self.vehicles:
            if one.alone is None:
                self.reasons[one.number] = f"it has no path even alone: {one.why_none}"
        alone = self.budget.elapsed
        able = [one.number for one in self.vehicles if one.number not in self.reasons]
        self._plan_together(able, orders, max_rounds)
        first = self.budget.elapsed
        if self.held:
            self._tell()
            self._improve(able, max_rounds)
        searched = self.budget.elapsed
        result = self._result()
        timing = {"alone": alone, "first_plan": first, "search": searched}
        timing["audit"] = self.budget.elapsed - searched
        return replace(result, timing_s=timing)

    def _plan_together(self, able: Sequence[int], orders: int, max_rounds: int | None) -> None:
        """Plans that keep apart: those alone where nobody meets, the others one after another."""
        alone = {k: found for k in able if (found := self.vehicles[k].alone) is not None}
        met = meetings(courses_of(self.vehicles, alone), keep=self.fleet.margin)
        groups = components(sorted(alone), [m for m in met if m.one in alone and m.other in alone])
        stuck = {k for m in met for k in (m.one, m.other) if k not in alone}
        hit = {m.one if m.other in stuck else m.other for m in met if {m.one, m.other} & stuck}
        self.held = {
            group[0]: alone[group[0]] for group in groups if len(group) == 1 and group[0] not in hit
        }
        for how in AT_ONCE[1:]:
            self.whole += [(group, how) for group in groups if 2 <= len(group) <= MOST_OF[how]]
        rest = [k for group in groups for k in group if k not in self.held]
        # Who does not switch at will holds a first plan, which nothing has improved yet.
        self.whole += [((k,), "in turn") for k in rest if not self.vehicles[k].ways]
        if not rest:
            self.order = sorted(able)
            return
        short = is_short(self.budget, len(rest))  # to drive by turns takes longer than one order
        until = self.budget if short else self.budget.stage(ORDERS_SHARE)
        rng = np.random.default_rng(self.seed)
        drawn = list(dict.fromkeys(self._order_of(rest, rng, n_th) for n_th in range(orders)))
        order_of = functools.partial(self._order_of, able, rng)
        by_turns = one_at_a_time(self.vehicles, order_of, self.fleet.margin, self.budget)
        before = self._work
        best, to_come, n_th = self._in_orders(drawn[:1], until), drawn[1:], 0
        if short and (first := [k for k in rest if k not in best]):
            again = (*first, *(k for k in drawn[0] if k not in first))
            best = self._in_orders([again], until, best)
        # All the time there is for those that have no plan, in turn by both ways, with about the
        # same work; ever more orders stand between, however many processes there are.
        due = self._work - before
        while len(best) < len(able) and not self.budget.is_over:
            before = self._work
            if due >= 0:
                driven, legs = next(by_turns)
                self.queries += legs
                best = min(best, driven, key=self._rank)
                due -= self._work - before
                continue
            if not (to_come or max_rounds is None):
                break
            n_th += 1
            some, to_come = to_come[: 2**n_th], to_come[2**n_th :]
            if not some:
                more = [self._order_of(rest, rng, n_th) for _ in range(DRAWS * self.pool.jobs)]
                some = sorted(more, key=self.tried.__getitem__)[: self.pool.jobs]
            best = self._in_orders(some, self.budget, best)
            due += self._work - before
        self.held = best
        for k in able:
            if k not in best:
                self.reasons[k] = self._who_is_in_the_way(k)

    def _in_orders(
        self, drawn: Sequence[tuple[int, ...]], until: Budget, best: HeldPlans | None = None
    ) -> HeldPlans:
        """The best plans of some orders past those that are held: the first that are complete."""
        for begin in range(0, len(drawn), self.pool.jobs):
            if until.is_over and best is not None:
                break
            chosen = drawn[begin : begin + self.pool.jobs]
            times, self.tried = self.tried, self.tried + Counter(chosen)
            tasks = [PoolTask(one, self.held, "in order", times=times[one]) for one in chosen]
            for order, done in zip(chosen, self.pool.each(tasks, until), strict=True):
                planned = done.held or {}
                self.queries += done.queries
                if best is None or self._rank(planned) < self._rank(best):
                    best, self.order = planned, list(order)
            if len(best or ()) == len(self.vehicles) - len(self.reasons):
                break
        return best or {}

    @property
    def _work(self) -> int:
        """What all searches have taken so far, in expansions."""
        return SEARCH * self.queries + sum(one.expansions for one in self.vehicles)

    def _order_of(
        self, numbers: Sequence[int], rng: np.random.Generator, n_th: int
    ) -> tuple[int, ...]:
        """The more important first, then the shortest way first; later orders are shuffled."""

        def key(k: int) -> tuple[float, float]:
            cost = float(f"{self._alone_cost(k):.9g}")  # equal ones stay so in a moved problem
            blur = float(rng.uniform(0.3, 1.7)) ** n_th if n_th else 1.0
            return -self.fleet.priority[k], blur * cost

        return tuple(sorted(numbers, key=key))

    def _rank(self, held: Mapping[int, OwnPlan]) -> tuple[int, float]:
        """How good plans are: as many as can be, then by the objective."""
        return -len(held), self._value(held)

    def _value(self, held: Mapping[int, OwnPlan]) -> float:
        if self.objective == "last":
            # Among equal arrivals the one with the lesser sum.
            last = max((one.arrival for one in held.values()), default=0.0)
            return last + 1e-6 * math.fsum(one.cost for one in held.values())
        return math.fsum(one.cost for one in held.values())

    def _improve(self, able: Sequence[int], max_rounds: int | None) -> None:
        """Plan groups anew, those with the most to gain first, as long as there is time."""
        rng = np.random.default_rng([self.seed, 1])
        unseen = sorted(able, key=lambda k: -self._excess(k))
        whole = [row for row in self.whole if set(row[0]) <= self.held.keys()]
        self.whole = sorted(whole, key=lambda row: (AT_ONCE.index(row[1]), -self._lost(row[0])))
        idle, most_idle = 0, 40 + 8 * len(able)
        at_once = max(1, len(able) // VEHICLES_A_GROUP)
        while not self.budget.is_over and idle <= most_idle:
            left = at_once if max_rounds is None else max_rounds - self.rounds
            tasks = self._groups(min(at_once, left), rng, longer=2 * idle >= most_idle)
            idle += at_once - len(tasks)
            ways = unseen[: min(at_once, left - len(tasks) if max_rounds is not None else left)]
            del unseen[: len(ways)]
            tasks += [PoolTask((k,), {}, "better alone") for k in ways]
            if left <= 0 or not (tasks or self._losing(set())):
                return
            self.rounds += len(tasks)
            taken: set[int] = set()
            known = {k: self._known(k) for k in ways}
            for task, done in zip(tasks, self.pool.each(tasks, self.budget), strict=True):
                self.queries += done.queries
                if task.how == "better alone":
                    self.versions.update(k for k in task.numbers if self._known(k) != known[k])
                elif done.held is not None and self._is_taken(done.held, taken):
                    taken |= set(task.numbers)
                    idle = 0
                else:
                    idle += 1

    def _groups(self, most: int, rng: np.random.Generator, *, longer: bool) -> list[PoolTask]:
        """Groups to plan anew, no vehicle twice."""
        tasks: list[PoolTask] = []
        busy: set[int] = set()
        for _ in range(most):
            task = self._task(rng, busy, longer=longer)
            if task is not None:
                tasks.append(task)
                busy.update(task.numbers)
        return tasks

    def _task(self, rng: np.random.Generator, busy: set[int], *, longer: bool) -> PoolTask | None:
        """A group and how to plan it, unless that was asked of the same plans before."""
        # Where the quick searches hardly gain any more, what was asked before is improved for
        # longer.
        open_ = [row for row in self.whole if not busy & set(row[0])]
        first = next((row for row in open_ if self._lost(row[0]) > LOST_BY[row[1]]), None)
        if first is not None:
            self.whole.remove(first)
            group, how = first
        else:
            group, how = self._group(rng, busy), AT_ONCE[int(rng.integers(len(AT_ONCE)))]
        if not group:
            return None
        now = tuple(self.versions[k] for k in range(len(self.vehicles)))
        suits = 2 <= len(group) <= MOST_OF[how] and self._lost(group) > LOST_BY[how]
        if not suits or (how, *sorted(group), now) in self.asked:
            how = "in turn"
        asked = (how, *(group if how == "in turn" else sorted(group)), now)
        if longer and asked in self.asked and any(self.vehicles[k].ways for k in group):
            how = "with time"  # their words were improved but at once
            asked = (how, *group, now)
        if asked in self.asked:
            return None
        self.asked.add(asked)
        others = {k: one for k, one in self.held.items() if k not in group}
        priced = math.fsum(self.held[k].cost for k in group)
        return PoolTask(group, others, how, priced if self.objective == "sum" else math.inf)

    def _is_taken(self, now: HeldPlans, taken: set[int]) -> bool:
        """Take plans of a group if they are better, and keep apart from those taken before."""
        if not self._value({**self.held, **now}) < self._value(self.held) * (1.0 - WORTH):
            return False
        if taken:
            courses = {k: self.held[k].course for k in taken}
            courses |= {k: one.course for k, one in now.items()}
            met = meetings(courses, keep=self.fleet.margin, among=list(now))
            if any(len({m.one, m.other} & now.keys()) == 1 for m in met):
                return False
        self.held = {**self.held, **now}
        self.versions.update(list(now))
        self._tell()
        return True

    def _group(self, rng: np.random.Generator, busy: set[int]) -> tuple[int, ...]:
        """Vehicles to be planned anew: one that loses by others, and some that are in its way."""
        losing = self._losing(busy)
        if not losing:
            return ()
        weights = np.array(list(losing.values()))
        first = int(rng.choice(list(losing), p=weights / weights.sum()))
        size = int(rng.integers(1, LARGEST_GROUP + 1))
        alone = self.vehicles[first].alone
        courses: dict[int, FleetCourse] = {k: one.course for k, one in self.held.items()}
        if alone is not None:
            courses[first] = alone.course
        met = meetings(courses, keep=self.fleet.margin, among=[first])
        near = [k for k in (m.other_than(first) for m in met) if k not in busy]
        rng.shuffle(near)
        group = [first, *near[: size - 1]]
        if rng.random() < 0.5:
            rng.shuffle(group)
        return tuple(group)

    def _known(self, k: int) -> list[float]:
        """What tells whether something new is known of a vehicle by itself."""
        return [self._alone_cost(k), *(way.cost for way in self.vehicles[k].ways)]

    def _lost(self, group: Sequence[int]) -> float:
        """What the vehicles of a group lose by others, as a share of their ways alone."""
        alone = math.fsum(self._alone_cost(k) for k in group)
        return math.fsum(self._excess(k) for k in group) / alone if alone > 0.0 else 0.0

    def _losing(self, but: set[int]) -> dict[int, float]:
        """What those lose whose plans cost more than their ways alone."""
        excess = {k: self._excess(k) for k in self.held if k not in but}
        return {k: lost for k, lost in excess.items() if lost > WORTH * self.held[k].cost}

    def _alone_cost(self, k: int) -> float:
        known = self.vehicles[k].alone
        return known.cost if known is not None else math.inf

    def _excess(self, k: int) -> float:
        """What a vehicle's plan costs more than its way alone."""
        return self.held[k].cost - self._alone_cost(k) if k in self.held else 0.0

    def _tell(self) -> None:
        value = self._value(self.held)
        self.improvements.append((self.budget.elapsed, value))
        if self.on_better is not None:
            self.on_better(*self.improvements[-1])

    def _who_is_in_the_way(self, k: int) -> str:
        """Why a vehicle has no plan, and whom its way alone would meet, when and where."""
        alone = self.vehicles[k].alone
        if alone is None:
            return "it has no path even alone"
        driven = courses_of(self.vehicles, {**self.held, k: alone})
        rows = []
        for one in meetings(driven, keep=self.fleet.margin, among=[k]):
            j = one.other_than(k)
            other = self.vehicles[j].name + ("" if j in self.held else STANDS)
            x, y = alone.plan.pose_at(max(one.time, alone.plan.start_time))[:2]
            rows.append(f"{other} at {one.time:.4g} s near ({x:.4g}, {y:.4g})")
        spent = f" within {self.budget.seconds:.4g} s" if self.budget.is_over else ""
        listed = ", ".join(rows) or "nobody"
        return f"no path was found past the others{spent}; alone it would meet {listed}"

    def _last_at_least(self) -> float:
        """No fleet arrives sooner [s]: each vehicle by itself, where its cost is its time."""
        times = [one.problem.start_time for one in self.vehicles]
        for k, one in enumerate(self.vehicles):
            cost = terms_of(one.problem.cost)
            timed = cost and cost.time > 0.0 and cost == Cost(time=cost.time)
            if one.bound is not None and cost and timed:
                times[k] += one.bound.value / cost.time
        return max(times)

    def _result(self) -> FleetResult:
        """The answer: the plans checked, each alone and each pair."""
        result = verified(self.fleet, self.vehicles, self.held, self.reasons)
        lower = [one.bound.value for one in self.vehicles if one.bound is not None]
        bound = math.fsum(lower) if self.objective == "sum" else self._last_at_least()
        counts = {
            "expansions": sum(one.expansions for one in self.vehicles),
            "queries": self.queries,
            "rounds": self.rounds,
        }
        return replace(
            result,
            objective=self.objective,
            lower_bound=bound,
            alone_cost=math.fsum(one.alone.cost for one in self.vehicles if one.alone is not None),
            order=tuple(self.vehicles[k].name for k in self.order),
            improvements=tuple(self.improvements),
            counts=counts,
        )
