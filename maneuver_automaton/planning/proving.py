"""Better and better bounds of what plans cost, alone or beside a search, until the gap is closed.

What was proven of one start is kept for others: one map, many queries.
"""

from __future__ import annotations

import functools
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton._kept import RECENT, kept_with
from maneuver_automaton.bounds import CostToGo, Proof, besides, cell_proofs
from maneuver_automaton.budget import Budget, Watch
from maneuver_automaton.costs import terms_of
from maneuver_automaton.planning.blocked import blocked_ends
from maneuver_automaton.planning.bounds import bound_along_paths, formula_bound, lattice_bound
from maneuver_automaton.planning.result import LowerBound, PlanResult, Workspace
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement.stop_and_steer import extreme_automaton, follows_paths
from maneuver_automaton.search.lattice_query import lattice_query

GLANCE = 0.002  # [s] between two looks whether there is one
POLISHING = 0.85  # share of the time after which what there is gets polished
MOST = 4  # functions of the same goals
WORK_PER_EXPANSION = 5_000  # steps times cells of the proof where expansions are counted
LOOK = 0.02  # [s] between two looks at the proof once the search is over


def kept_bounds(problem: Problem, workspace: Workspace) -> deque[CostToGo] | None:
    """The last functions that were proven for the same goals, costs and body on a planner's map.

    None for callers that hold no planner: a call on its own does the same work at every call.
    """
    if workspace.prepared is RECENT:
        return None
    from maneuver_automaton.bounds.cells import lasting_obstacles

    aims = tuple(
        (tuple(goal.pose[:3].tolist()), goal.tolerance_m, goal.tolerance_rad, goal.free_heading)
        for goal in problem.goals
    )
    given = (problem.automaton, problem.cost, lasting_obstacles(problem), problem.footprint)
    limits = (problem.margin, problem.bounds.x, problem.bounds.y)
    key = aims, given, limits, problem.horizon.time is not None
    return kept_with(workspace.prepared, key, lambda: deque[CostToGo](maxlen=MOST))


@dataclass(slots=True, eq=False)
class Proving:
    """Better and better bounds of a problem, until the gap is closed or the budget is over."""

    problem: Problem
    budget: Budget
    watch: Watch
    max_work: int | None = None  # steps times cells
    kept: deque[CostToGo] | None = None  # proven of other starts
    best: LowerBound = field(default_factory=lambda: LowerBound(value=0.0, kind="distance"))
    history: list[tuple[float, float]] = field(default_factory=list)  # seconds, value
    work: int = 0
    functions: list[CostToGo] = field(default_factory=list)  # of all levels

    def run(self, *, after_a_plan: bool = False) -> None:
        """Prove what can be proven; `after_a_plan` cells wait for one, without which they are many.

        Where there is none, all the time is for the search, and the proof that there is none.
        """
        self._better(known_bound(self.problem))
        if self.kept is not None:
            here = (one.anywhere(self.problem.start[:3]) for one in self.kept)
            value = in_costs(self.problem, max(here, default=0.0))
            self._better(LowerBound(value=value, kind="cells"))
        while after_a_plan and self.watch.cost == math.inf:
            if self._over():
                return
            time.sleep(GLANCE)
        if self._over():
            return
        for proof in proofs_of(
            self.problem, incumbent=lambda: self.watch.cost, ends=self._late, over=self._over
        ):
            self.work = proof.work
            if proof.function is not None:  # for poses on the way, and for other starts
                self.functions.append(proof.function)
                if self.kept is not None:
                    self.kept.append(proof.function)
            kind = "incumbent" if proof.optimal and proof.value >= self.watch.cost else "cells"
            self._better(LowerBound(value=proof.value, kind=kind))
            if self._over():
                return

    def bound(self, cost: float) -> LowerBound:
        """The best bound, which is no greater than the cost of a plan that is known."""
        value = min(self.best.value, cost)
        history = tuple((at, min(one, cost)) for at, one in self.history)
        return replace(
            self.best, value=value, optimal=value == cost, history=history, work=self.work
        )

    def _better(self, bound: LowerBound) -> None:
        if bound.value > self.best.value or not self.history:
            self.best = bound
            self.history.append((self.budget.elapsed, bound.value))
            self.watch.bound = bound.value

    def _over(self) -> bool:
        return self.watch.is_abandoned or self.watch.is_closed or self.budget.is_over

    def _late(self, work: int) -> bool:
        """Whether to polish what there is: time for that is kept back."""
        late = self.budget.elapsed > POLISHING * self.budget.seconds or self._over()
        return late or (self.max_work is not None and work >= self.max_work)


def known_bound(problem: Problem) -> LowerBound:
    """The best bound that takes no search: a formula, or the path of the inscribed disc."""
    if problem.has_inertia:
        return bound_along_paths(problem)
    if blocked_ends(problem) is not None or problem.automaton.lattice is not None:
        return formula_bound(problem)
    return lattice_bound(lattice_query(problem, tuple(range(len(problem.goals)))))


def proofs_of(
    problem: Problem,
    *,
    incumbent: Callable[[], float],
    ends: Callable[[int], bool],
    over: Callable[[], bool] = lambda: False,
) -> Iterator[Proof]:
    """Better and better bounds by cells, as `cell_proofs`, in costs of the problem itself."""
    ramp = _ramp(problem)

    def limit() -> float:
        return ramp.without(incumbent())

    for proof in cell_proofs(problem, incumbent=limit, ends=ends, over=over):
        yield replace(proof, value=ramp.added(proof.value))


def in_costs(problem: Problem, value: float) -> float:
    """What a function on cells proves of a problem's start, in costs of the problem itself."""
    return _ramp(problem).added(value + besides(problem))


@dataclass(frozen=True, slots=True)
class _Ramp:
    """What it costs to start from rest and to stop, on a path of a cost at full speed."""

    seconds: float = 0.0  # the speed that all limits admit over greatest acceleration
    rate: float = 0.0  # cost per second
    share: float = 0.0  # seconds at full speed for a unit of cost

    def added(self, cost: float) -> float:
        """Least cost from rest to rest along a path of a cost at full speed."""
        seconds = self.share * cost
        if seconds >= self.seconds:
            return cost + self.rate * self.seconds
        return cost + self.rate * (2.0 * math.sqrt(seconds * self.seconds) - seconds)

    def without(self, cost: float) -> float:
        """Greatest cost at full speed of a path that is driven from rest to rest for a cost."""
        if cost == math.inf or not self.seconds:
            return cost
        if cost >= self.added(self.seconds / self.share):
            return cost - self.rate * self.seconds
        low, high = 0.0, self.seconds / self.share
        while (middle := 0.5 * (low + high)) not in (low, high):
            low, high = (middle, high) if self.added(middle) <= cost else (low, middle)
        return high


def _ramp(problem: Problem) -> _Ramp:
    """Of a vehicle that turns only as it drives; nothing for others, whose turns need none."""
    model, cost = problem.automaton.model, terms_of(problem.cost)
    if not (follows_paths(model) and problem.rests_at_both_ends):
        return _Ramp()
    twists = extreme_automaton(problem.automaton).body_velocities
    if cost is None or not cost.time or (twists[:, 0] == 0.0).any():
        return _Ramp()
    speeds = np.abs(twists[:, 0])  # slower in reverse, and in turns within a lateral limit
    slowest, fastest = float(speeds.min()), float(speeds.max())
    seconds = slowest / float(model.control_limits[0, 1])
    return _Ramp(seconds, cost.time, 1.0 / (cost.time + cost.length * fastest))


def plan_to_gap(
    problem: Problem,
    search: Callable[[Budget], PlanResult],
    budget: Budget,
    watch: Watch,
    *,
    kept: deque[CostToGo] | None = None,
) -> PlanResult:
    """The answer of a search, with what is proven of it.

    The proof runs in a thread of its own, mostly in compiled code, and both stop once the gap is
    small enough. Where expansions are counted the search goes first, and the proof does a stated
    amount of work after it: neither then depends on the clock, unless the time is over. `kept` is
    what was proven of other starts, and gets what is proven here.
    """
    if budget.expansions is not None:
        result = search(budget)
        if result.plan is None or result.cost is None:
            return result
        watch.note(result.cost)
        most = WORK_PER_EXPANSION * budget.expansions
        proving = Proving(problem, budget, watch, max_work=most, kept=kept)
        proving.run()
        return proven(result, proving)
    proving = Proving(problem, budget, watch, kept=kept)
    thread = _Beside(functools.partial(proving.run, after_a_plan=True))
    thread.start()
    try:
        result = search(budget._replace(watch=watch))
        if result.plan is not None and result.cost is not None:
            watch.cost = result.cost
            while thread.is_alive() and not (watch.is_closed or budget.is_over):
                thread.join(LOOK)
    finally:
        watch.is_abandoned = True
        thread.join()
    if thread.error is not None:
        raise thread.error
    return proven(result, proving)


def proven(result: PlanResult, proving: Proving) -> PlanResult:
    """A result with the best bound of its own and of a proof, and since when it is known."""
    if result.cost is None or result.bound is None:
        return result
    found = proving.bound(result.cost)
    if found.value < result.bound.value:
        found = replace(result.bound, history=found.history, work=found.work)
    return replace(result, bound=found, lower_bound=found.value, gap=found.gap(result.cost))


@dataclass(eq=False)
class _Beside(threading.Thread):
    """A thread that keeps the error it ends with."""

    work: Callable[[], None]
    error: BaseException | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        super().__init__(daemon=True)

    def run(self) -> None:
        """Do the work."""
        try:
            self.work()
        except BaseException as error:  # noqa: BLE001, raised again by who waits
            self.error = error
