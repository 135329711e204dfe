"""Plans for a fleet: each alone, then one after another past those that meet it, then better ones.

A vehicle that holds a plan is a moving obstacle whose future is known to the last digit, so nobody
has to agree on anything but who goes first. Vehicles that meet nobody need nothing more than their
way alone.

Source: Čáp, Novák, Kleiner, Selecký (2015), *Prioritized Planning Algorithms for Trajectory
Coordination of Multiple Mobile Robots*, IEEE T-ASE 12(3): planned past the starts of those to come,
nobody is ever enclosed by them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from maneuver_automaton._interrupts import patient
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.shapes import Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.fleet.conflicts import Course, components, load_meetings, meetings
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.result import FleetResult
from maneuver_automaton.fleet.vehicle import LONG, QUICK, Found, Vehicle
from maneuver_automaton.fleet.verdict import verified
from maneuver_automaton.planning.plan import prepare
from maneuver_automaton.planning.workspace import Workspace
from maneuver_automaton.refinement.ready import load_lattice
from maneuver_automaton.search.prepared import Prepared

Objective = Literal["sum", "last"]
Held = dict[int, Found]  # plans by the numbers of their vehicles

MOST_EVICTED = 8  # times that plans are given up for one vehicle
ALONE_SHARE = 0.5  # of the time, for all ways alone
ORDERS_SHARE = 0.7  # of the time left, for orders of the vehicles before they drive by turns
LARGEST_GROUP = 4  # vehicles that are planned anew together
WORTH = 1e-6  # share of the objective that another plan has to save


def plan_fleet(
    fleet: FleetProblem,
    *,
    time_limit: float = 10.0,
    objective: Objective = "sum",
    orders: int = 8,
    seed: int = 0,
    max_rounds: int | None = None,
    on_better: Callable[[float, float], None] | None = None,
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

    Returns
    -------
    FleetResult
        Every plan checked past static obstacles, and every pair of vehicles proven apart, now and
        after all have arrived, by two libraries.

    Raises
    ------
    ValueError
        If a number is out of its range.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> robot = Automaton.of_controls(
    ...     Unicycle(), {"rest": (0, 0), "on": (1, 0), "left": (0, 1), "right": (0, -1)}
    ... )
    >>> there = Problem(robot, [0, 0, 0], [4, 0, 0], footprint=Disc(0.3))
    >>> across = Problem(robot, [2, -2, 0], [2, 2, 0], footprint=Disc(0.3))
    >>> result = plan_fleet(FleetProblem([there, across]), time_limit=2.0, max_rounds=3)
    >>> result.status.value, result.clearance_m > 0.0
    ('found', True)
    """
    if not time_limit > 0.0:
        raise ValueError(f"time_limit must be positive, got {time_limit} s")
    if objective not in ("sum", "last"):
        raise ValueError(f"objective must be 'sum' or 'last', got {objective!r}")
    if orders < 1:
        raise ValueError(f"orders must be at least 1, got {orders}")
    vehicles = vehicles_of(fleet)
    prepare_vehicles(vehicles)
    with patient():
        return _FleetSearch(
            fleet, vehicles, objective, Budget.from_now(time_limit), seed, on_better
        ).run(orders, max_rounds)


@dataclass(slots=True, eq=False)
class _FleetSearch:
    """One search for the plans of a fleet."""

    fleet: FleetProblem
    vehicles: list[Vehicle]
    objective: Objective
    budget: Budget
    seed: int
    on_better: Callable[[float, float], None] | None
    held: Held = field(default_factory=dict)
    reasons: dict[int, str] = field(default_factory=dict)
    order: list[int] = field(default_factory=list)
    improvements: list[tuple[float, float]] = field(default_factory=list)
    queries: int = 0
    rounds: int = 0
    until: Budget = field(init=False)  # of the part of the search that is under way

    def __post_init__(self) -> None:
        self.until = self.budget

    def run(self, orders: int, max_rounds: int | None) -> FleetResult:
        """The whole search, and the checks of what it found."""
        self._plan_alone()
        alone = self.budget.elapsed
        able = [one.number for one in self.vehicles if one.number not in self.reasons]
        self._plan_together(able, orders)
        first = self.budget.elapsed
        if self.held:
            self._tell()
            self._improve(able, max_rounds)
        searched = self.budget.elapsed
        result = self._result()
        timing = {"alone": alone, "first_plan": first, "search": searched}
        timing["audit"] = self.budget.elapsed - searched
        return replace(result, timing_s=timing)

    def _plan_alone(self) -> None:
        """The way of each by itself."""
        for one in self.vehicles:
            one.plan_alone(self.budget.stage(ALONE_SHARE))
            if one.alone is None:
                self.reasons[one.number] = f"it has no way even alone: {one.why_none}"

    def _plan_together(self, able: Sequence[int], orders: int) -> None:
        """Plans that keep apart: those alone where nobody meets, the others one after another."""
        alone = {k: found for k in able if (found := self.vehicles[k].alone) is not None}
        courses = {k: one.course for k, one in alone.items()}
        for one in self.vehicles:
            if one.number not in alone:
                courses[one.number] = one.standing
        met = meetings(courses, keep=self.fleet.margin)
        groups = components(sorted(alone), [m for m in met if m.one in alone and m.other in alone])
        stuck = {k for m in met for k in (m.one, m.other) if k not in alone}
        hit = {m.one if m.other in stuck else m.other for m in met if {m.one, m.other} & stuck}
        self.held = {
            group[0]: alone[group[0]] for group in groups if len(group) == 1 and group[0] not in hit
        }
        rest = [k for group in groups for k in group if k not in self.held]
        if not rest:
            self.order = sorted(able)
            return
        best: Held | None = None
        rng, self.until = np.random.default_rng(self.seed), self.budget.stage(ORDERS_SHARE)
        for n_th in range(orders):
            order = self._order_of(rest, n_th, rng)
            planned = self._one_after_another(order, dict(self.held))
            better = best is None or self._rank(planned) < self._rank(best)
            if better:
                best, self.order = planned, order
            if len(planned) == len(able) or self.until.is_over:
                break
        assert best is not None
        self.until = self.budget
        if len(best) < len(able):
            by_turns = self._by_turns(sorted(able, key=self._alone_cost))
            best = by_turns if self._rank(by_turns) < self._rank(best) else best
        self.held = best
        for k in able:
            if k not in best:
                self.reasons[k] = self._who_is_in_the_way(k)

    def _order_of(self, numbers: Sequence[int], n_th: int, rng: np.random.Generator) -> list[int]:
        """The more important first, then the shortest way first; later orders are shuffled."""

        def key(k: int) -> tuple[float, float]:
            cost = float(f"{self._alone_cost(k):.9g}")  # equal ones stay so in a moved problem
            blur = 1.0 if n_th == 0 else float(rng.uniform(0.3, 1.7))
            return -self.fleet.priority[k], blur * cost

        return sorted(numbers, key=key)

    def _rank(self, held: Mapping[int, Found]) -> tuple[int, float]:
        """How good plans are: as many as can be, then by the objective."""
        return -len(held), self._value(held)

    def _value(self, held: Mapping[int, Found]) -> float:
        if self.objective == "last":
            # Among equal arrivals the one with the lesser sum.
            last = max((one.arrival for one in held.values()), default=0.0)
            return last + 1e-6 * math.fsum(one.cost for one in held.values())
        return math.fsum(one.cost for one in held.values())

    def _one_after_another(self, order: Sequence[int], held: Held) -> Held:
        """Plans in an order, past those that are held; who fails goes before those it hits."""
        waiting, evicted = list(order), 0
        failed: set[int] = set()
        while waiting and not self.until.is_over:
            k = waiting.pop(0)
            to_come = [*waiting, *self._without_plan(held, {k, *waiting})]
            found = self._past(k, held, to_come)
            if found is None:
                found = self._past(k, held, self._without_plan(held, {k, *waiting}), most=LONG)
            if found is None and evicted < MOST_EVICTED and k not in failed:
                failed.add(k)
                found, out = self._before_those_it_hits(k, held)
                for other in out:
                    del held[other]
                waiting = [*out, *waiting]
                evicted += len(out)
            if found is not None:
                held[k] = found
        return held

    def _by_turns(self, order: Sequence[int]) -> Held:
        """One vehicle at a time, past all others where they stand: no search in time is needed.

        Whoever has a way past all starts and goals has a plan then (well-formed, in the words of
        the source). It takes as long as all together, and is what improvement begins with.
        """
        held: Held = {}
        waiting, clock = list(order), max(one.problem.start_time for one in self.vehicles)
        while waiting:
            for k in waiting:
                if self.budget.is_over:
                    return held
                there = {
                    other: self.vehicles[other].standing for other in self._without_plan(held, {k})
                }
                there |= {other: one.course for other, one in held.items()}
                arrived = [body for course in there.values() for body in course.arrived]
                found = self.vehicles[k].past_arrived(arrived, clock, self.budget)
                if found is not None:
                    held[k], clock = found, found.arrival
                    waiting.remove(k)
                    break
            else:
                return held
        return held

    def _without_plan(self, held: Mapping[int, Found], but: set[int]) -> list[int]:
        """Vehicles that stand at their starts for ever."""
        return [k for k in range(len(self.vehicles)) if k not in held and k not in but]

    def _before_those_it_hits(self, k: int, held: Held) -> tuple[Found | None, list[int]]:
        """A way past those that have no plan, and whose plans it needs to be given up."""
        found = self._past(k, {}, self._without_plan(held, {k}))
        if found is None:
            found = self._past(k, {}, [])
        if found is None:
            return None, []
        courses = {other: one.course for other, one in held.items()}
        met = meetings({**courses, k: found.course}, keep=self.fleet.margin, among=[k])
        return found, sorted({m.one if m.other == k else m.other for m in met})

    def _past(
        self,
        k: int,
        held: Mapping[int, Found],
        standing: Sequence[int],
        *,
        most: int = QUICK,
        known: float = math.inf,
    ) -> Found | None:
        """A way of one vehicle past plans, and past others at their starts."""
        self.queries += 1
        others: list[Obstacle] = []
        for other in sorted({*held, *standing} - {k}):
            course = held[other].course if other in held else self.vehicles[other].standing
            others += course.obstacles
        return self.vehicles[k].past(others, self.until, most=most, known=known)

    def _improve(self, able: Sequence[int], max_rounds: int | None) -> None:
        """Plan groups anew, those with the most to gain first, as long as there is time."""
        rng = np.random.default_rng([self.seed, 1])
        unseen = sorted(able, key=lambda k: -self._excess(k))
        idle, most_idle = 0, 40 + 8 * len(able)
        while not self.budget.is_over and (max_rounds is None or self.rounds < max_rounds):
            self.rounds += 1
            if unseen and self.rounds % 2:
                self.vehicles[unseen.pop(0)].look_for_better_ways(self.budget)
                continue
            group = self._group(rng)
            if not group and unseen:
                continue
            if not group or idle > most_idle:
                return
            others = {k: one for k, one in self.held.items() if k not in group}
            before = self._value(self.held)
            now = self._anew(group, others)
            if now is not None and self._value(now) < before * (1.0 - WORTH):
                self.held, idle = now, 0
                self._tell()
            else:
                idle += 1

    def _anew(self, group: Sequence[int], held: Held) -> Held | None:
        """Plans of a group, one after another, past all others; None if one has none."""
        for n, k in enumerate(group):
            if self.budget.is_over:
                return None
            found = self._past(k, held, [*group[n + 1 :], *self._without_plan(held, set(group))])
            if found is None and n + 1 < len(group):
                found = self._past(k, held, self._without_plan(held, set(group)))
            if found is None:
                return None
            held = {**held, k: found}
        return held

    def _group(self, rng: np.random.Generator) -> list[int]:
        """Vehicles to be planned anew: one that loses by others, and some that are in its way."""
        excess = {k: self._excess(k) for k in self.held}
        losing = [k for k, lost in excess.items() if lost > WORTH * self.held[k].cost]
        if not losing:
            return []
        weights = np.array([excess[k] for k in losing])
        first = int(rng.choice(losing, p=weights / weights.sum()))
        size = int(rng.integers(1, LARGEST_GROUP + 1))
        alone = self.vehicles[first].alone
        courses: dict[int, Course] = {k: one.course for k, one in self.held.items()}
        if alone is not None:
            courses[first] = alone.course
        met = meetings(courses, keep=self.fleet.margin, among=[first])
        near = [m.one if m.other == first else m.other for m in met]
        rng.shuffle(near)
        group = [first, *near[: size - 1]]
        if rng.random() < 0.5:
            rng.shuffle(group)
        return group

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
        """Why a vehicle has no plan, and whom its way alone would meet."""
        if self.budget.is_over:
            return f"no time was left to plan it within {self.budget.seconds:.4g} s"
        alone = self.vehicles[k].alone
        if alone is None:
            return "it has no way even alone"
        courses: dict[int, Course] = {
            one.number: self.held[one.number].course if one.number in self.held else one.standing
            for one in self.vehicles
        }
        met = meetings({**courses, k: alone.course}, keep=self.fleet.margin, among=[k])
        names = [self.vehicles[m.one if m.other == k else m.other].name for m in met]
        listed = ", ".join(names) or "nobody"
        return f"no way was found past the others; alone it would meet {listed}"

    def _last_at_least(self) -> float:
        """No fleet arrives sooner [s]: each vehicle by itself, where its cost is its time."""
        times = [0.0]
        for one in self.vehicles:
            cost = one.problem.cost
            timed = isinstance(cost, Cost) and cost.time > 0.0 and cost == Cost(time=cost.time)
            if one.bound is not None and isinstance(cost, Cost) and timed:
                times.append(one.problem.start_time + one.bound.value / cost.time)
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


def prepare_vehicles(vehicles: Sequence[Vehicle]) -> None:
    """Have ready what every search of a fleet needs, once for each kind and map."""
    kinds = {(id(one.problem.automaton), id(one.workspace)): one for one in vehicles}
    for one in kinds.values():
        prepare(one.problem, one.workspace)
    load_lattice()
    load_meetings()


def vehicles_of(fleet: FleetProblem) -> list[Vehicle]:
    """The vehicles of a fleet; those of one map share what is prepared for it."""
    prepared = Prepared()
    workspaces: dict[tuple[int, ...], Workspace] = {}
    keeps = [problem.margin for problem in fleet.problems]
    # Every search keeps its own margin from what it must not touch: what that lacks of the fleet's,
    # the others are larger by.
    grown = max(fleet.margin - min(keeps), 0.0)
    vehicles = []
    for k, problem in enumerate(fleet.problems):
        key = tuple(map(id, problem.obstacles))
        workspace = workspaces.setdefault(key, Workspace(problem.obstacles, prepared))
        settings = replace(problem.search, improve=False)
        # Obstacles of its own may move too, and pass where it stays.
        horizon = replace(problem.horizon, stay=not fleet.leaves[k])
        own = replace(problem, search=settings, obstacles=workspace.obstacles, horizon=horizon)
        vehicles.append(Vehicle(k, fleet.names[k], own, fleet.leaves[k], grown, workspace))
    return vehicles
