"""Plan until the best plan is proven to be near the optimum: a search, and a proof beside it."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from maneuver_automaton.budget import Budget, Watch
from maneuver_automaton.planning.kept_bounds import KeptBounds
from maneuver_automaton.planning.lower_bound import Proving
from maneuver_automaton.planning.result import PlanResult
from maneuver_automaton.problem import Problem

WORK_PER_EXPANSION = 5_000  # steps times cells of the proof where expansions are counted
LOOK = 0.02  # [s] between two looks at the proof once the search is over


def plan_to_gap(
    problem: Problem,
    search: Callable[[Budget], PlanResult],
    budget: Budget,
    watch: Watch,
    *,
    kept: KeptBounds | None = None,
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
        result = search(replace(budget, watch=watch))
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
