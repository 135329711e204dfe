"""`plan(problem)`: choose, search, refine, check, audit; `plans(problem)`: as they come."""

from __future__ import annotations

import functools
import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from queue import SimpleQueue

from maneuver_automaton._arrays import as_number, as_whole, check_range
from maneuver_automaton._interrupts import patient
from maneuver_automaton._kept import kept_with
from maneuver_automaton._kernel_list import expect_many_calls, load_kernels
from maneuver_automaton.budget import Budget, Watch
from maneuver_automaton.planning import leaving, no_way, polishing, proving
from maneuver_automaton.planning.checking import load_checks
from maneuver_automaton.planning.result import LowerBound, PlanResult, Workspace, workspace_of
from maneuver_automaton.planning.steps import answer, prepare_steps, uses_lattice
from maneuver_automaton.problem import Problem, between_trims
from maneuver_automaton.search import beginning, lattice_query
from maneuver_automaton.search.choose import load_search

MOST_ALTERNATIVES = 1 << 16  # that are looked for, however many are asked for


def plan(
    problem: Problem,
    *,
    time_limit: float = 5.0,
    alternatives: int = 0,
    gap: float | None = None,
    watch: Watch | None = None,
    on_better: Callable[[PlanResult], None] | None = None,
    leave: bool = False,
) -> PlanResult:
    """Cheapest plan found for `problem`, audited by an integration of its own.

    Parameters
    ----------
    problem : Problem
    time_limit : float
        [s] for the whole call: searches end early enough for the checks of what they find.
        Compiling and loading what all problems of a vehicle share do not count.
    alternatives : int
        How many costlier plans to return beside the cheapest, as far as there are so many.
    gap : float, optional
        Share of the cost: end as soon as no plan is proven to be cheaper by more. A proof then
        runs beside the search, for as long as the time limit says.
    watch : Watch, optional
        Where to look, from another thread, for the cost and the bound meanwhile.
    on_better : callable, optional
        Called with each plan that is better than those before, audited; what it takes counts.
    leave : bool
        Whether a start that touches something is left first, by the shortest coast out of it; the
        `notes` of the result say so. Of a kinematic vehicle in a plane where nothing moves.

    Returns
    -------
    PlanResult
        ``status`` says how it ended. ``lower_bound`` is the cost itself where the search was
        exhaustive over all admitted words of at most four moving trims, or over those of three of
        a vehicle that drives forward alone, or the only shortest path of a car in free space was
        driven; otherwise a closed bound.

    Raises
    ------
    ValueError
        If a limit is not positive, or the number of alternatives negative.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Cost, Horizon, Problem, Unicycle, plan
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "ahead": (1, 0), "spin": (0, 1)})
    >>> problem = Problem(robot, [0, 0, 0], [1, 1, 0], horizon=Horizon(max_trims=3))
    >>> result = plan(problem)
    >>> result.plan.word, round(result.cost, 4), result.audit.passed
    (('spin', 'ahead', 'spin'), 7.6974, True)
    """
    if leave:
        search = functools.partial(plan, gap=gap, watch=watch)
        return leaving.plan_leaving(problem, search, time_limit=time_limit)
    workspace = workspace_of(problem.obstacles)
    shows = None
    if on_better is not None:
        watch = watch or Watch(gap=-math.inf)
        shows = _shown(problem, watch, on_better)
    return plan_in(
        workspace,
        problem,
        time_limit=time_limit,
        alternatives=alternatives,
        gap=gap,
        watch=watch,
        shows=shows,
    )


def _shown(
    problem: Problem, watch: Watch, on_better: Callable[[PlanResult], None]
) -> Callable[[Callable[..., PlanResult]], None]:
    """What hands a better plan on, with the best bound that there is meanwhile."""
    known = functools.cache(lambda: proving.known_bound(problem))

    def show(found: Callable[..., PlanResult]) -> None:
        bound = known()
        if watch.bound > bound.value:
            bound = LowerBound(value=watch.bound, kind="cells")
        on_better(_noted(found(bound=bound)))

    return show


def plan_in(
    workspace: Workspace,
    problem: Problem,
    *,
    time_limit: float,
    alternatives: int,
    gap: float | None = None,
    watch: Watch | None = None,
    shows: Callable[..., None] | None = None,
) -> PlanResult:
    """Plan as `plan` does, with arrays prepared for the problem's map."""
    time_limit = as_number("time_limit", time_limit)
    alternatives = min(as_whole("alternatives", alternatives), MOST_ALTERNATIVES)
    gap = None if gap is None else as_number("gap", gap)
    check_range("time_limit", time_limit, unit="s", infinite=True)
    check_range("alternatives", alternatives, least=0)
    if gap is not None and not 0.0 <= gap < 1.0:
        raise ValueError(f"gap must be a share from 0 to below 1, got {gap}")
    load(problem, workspace)
    if gap is not None:
        load_kernels("cells")
    if alternatives and uses_lattice(problem):
        load_search(problem)
    budget = Budget.from_now(time_limit, expansions=problem.search.max_expansions)
    budget = budget._replace(shows=shows) if shows else budget
    with patient():
        if gap is None:
            if watch is not None:
                watch.problem = problem
                budget = budget._replace(watch=watch)
            result = answer(problem, budget, workspace, alternatives=alternatives)
        else:
            watch = watch or Watch(gap=gap)
            watch.gap, watch.problem = gap, problem

            def search(part: Budget) -> PlanResult:
                return answer(problem, part, workspace, alternatives=alternatives)

            kept = proving.kept_bounds(problem, workspace)
            result = proving.plan_to_gap(problem, search, budget, watch, kept=kept)
        return _noted(result if result.plan else no_way.with_proof(result, budget))


def _noted(result: PlanResult) -> PlanResult:
    """The result, with what was left out of planning."""
    if not result.problem.automaton.model.reduced_names:
        return result  # there is nothing to polish
    notes = polishing.left_out(result.problem)
    return replace(result, notes=(*result.notes, *notes)) if notes else result


def prepare(problem: Problem, workspace: Workspace | None = None) -> None:
    """Have ready what every problem on the map of this one needs."""
    expect_many_calls()
    workspace = workspace or workspace_of(problem.obstacles)
    load(problem, workspace)
    problem = between_trims(problem)
    if uses_lattice(problem):
        goals = tuple(range(len(problem.goals)))
        lattice_query.lattice_query(problem, goals, prepared=workspace.prepared)
        beginning.prepare_first_call(problem, workspace.prepared)
        load_checks(problem, workspace)


def load(problem: Problem, workspace: Workspace) -> None:
    """Compile or load what planning needs, before the clock runs: once for all like queries."""
    others = problem.setting is not problem  # may follow

    def made() -> bool:
        prepare_steps(problem, workspace)
        if others and not problem.has_states and uses_lattice(problem):
            beginning.prepare_first_call(problem, workspace.prepared)
        return True

    kept_with(problem.setting, (problem.ends, others, workspace), made)


def plans(
    problem: Problem, *, time_limit: float = 5.0, alternatives: int = 0, gap: float | None = None
) -> Iterator[PlanResult]:
    """Better and better plans for `problem`; the last one is the answer of `plan`.

    The search goes on in a thread of its own while a plan is looked at, and ends when the iterator
    is closed: when the loop over it is left.

    Parameters
    ----------
    problem : Problem
    time_limit : float
        [s] as of `plan`.
    alternatives : int
        How many costlier plans the last one has beside it.
    gap : float, optional
        Share of the cost that is small enough, as of `plan`.

    Yields
    ------
    PlanResult
        A plan that passed all checks, cheaper than those before. The last answer has the best
        bound, alternatives, and where there is no plan the reason.

    Raises
    ------
    ValueError
        As `plan` does.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Box, Unicycle
    >>> trims = {"ahead": (1, 0), "left": (1, 1), "right": (1, -1)}
    >>> robot = Automaton.of_controls(Unicycle(), trims)
    >>> wall = Box([1.0, 1.0], [3.0, 0.2])
    >>> problem = Problem(robot, [0, 0, 0], [6, 0, 0], obstacles=wall, footprint=Box([0.4, 0.2]))
    >>> costs = [better.cost for better in plans(problem, time_limit=0.5)]
    >>> all(after <= before for before, after in zip(costs, costs[1:]))
    True
    """
    watch = Watch(gap=-math.inf if gap is None else gap)
    came: SimpleQueue[PlanResult | BaseException | None] = SimpleQueue()

    def search() -> None:
        try:
            last = plan(
                problem,
                time_limit=time_limit,
                alternatives=alternatives,
                gap=gap,
                watch=watch,
                on_better=came.put,
            )
            came.put(last)
        except BaseException as error:  # noqa: BLE001, raised again by who waits
            came.put(error)
        came.put(None)

    thread = threading.Thread(target=search, daemon=True)
    thread.start()
    try:
        while (one := came.get()) is not None:
            if isinstance(one, BaseException):
                raise one
            yield one
    finally:
        watch.is_given_up = True
        thread.join()
