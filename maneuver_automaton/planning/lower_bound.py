"""`lower_bound(problem)`: how little a plan can cost, proven."""

from __future__ import annotations

import math
from dataclasses import replace

from maneuver_automaton._arrays import as_number, as_whole, check_range
from maneuver_automaton.budget import Budget, Watch
from maneuver_automaton.costs import terms_of
from maneuver_automaton.planning.proving import Proving, known_bound
from maneuver_automaton.planning.result import LowerBound, workspace_of
from maneuver_automaton.planning.steps import answer, prepare_steps
from maneuver_automaton.problem import Problem

SHARES = (0.0, 0.5, 2.0)  # of a plan's cost, shared by the changes it may have: prices of one
PLANNING, EXPANSIONS = 0.2, 3000  # share of the time, and expansions, for a plan to begin with


def lower_bound(
    problem: Problem,
    *,
    time_limit: float = 10.0,
    incumbent: float = math.inf,
    gap: float = 0.0,
    max_work: int | None = None,
    max_direction_changes: int | None = None,
) -> LowerBound:
    """The best lower bound of the cost of all plans that can be proven in a time.

    A function of the pose that falls along no motion faster than its cost rises, and is zero at the
    goal, is a lower bound wherever it comes from. It is sought as piecewise linear function over
    cells of poses that are not proven to collide, and what it proves is measured on every cell.

    Parameters
    ----------
    problem : Problem
    time_limit : float
        [s]
    incumbent : float
        Cost of the best plan known. It helps: only poses that a cheaper plan may visit are looked
        at. No bound exceeds it. If it is left out, a plan is looked for first, for a moment.
    gap : float
        Share of the incumbent's cost that is small enough: end as soon as that is proven.
    max_work : int, optional
        Work at which to end, in steps times cells; the answer is then the same at every call,
        unless the time is over before.
    max_direction_changes : int, optional
        Bound the plans that change between forward and reverse at most so often, of a vehicle
        without inertia: "not below 12 m with fewer than 3 changes".

    Returns
    -------
    LowerBound
        `kind` says what won: ``cells`` is the function above, ``shortest`` the shortest path of a
        car in free space, ``incumbent`` that no plan is left that would be cheaper.

    Raises
    ------
    ValueError
        If a limit is not positive, the gap not from 0 to 1, or the number of changes negative.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Car, Cost, Problem, plan
    >>> car = Car(wheelbase=2.8, max_steering=0.6)
    >>> controls = {f"{v} {s}": (v, s) for v in (1, -1) for s in (-0.6, 0.0, 0.6)}
    >>> robot = Automaton.of_controls(car, controls)
    >>> problem = Problem(robot, [0, 0, 0], [6, 3, 0.9], cost=Cost(length=1.0))
    >>> cost = plan(problem).cost
    >>> bound = lower_bound(problem, incumbent=cost, max_work=2_000_000)
    >>> bound.kind, 0.0 <= bound.gap(cost) < 0.05
    ('shortest', True)
    """
    time_limit, gap = as_number("time_limit", time_limit), as_number("gap", gap)
    incumbent = as_number("incumbent", incumbent)
    max_work = None if max_work is None else as_whole("max_work", max_work)
    if max_direction_changes is not None:
        max_direction_changes = as_whole("max_direction_changes", max_direction_changes)
    check_range("time_limit", time_limit, unit="s", infinite=True)
    if not 0.0 <= gap <= 1.0:
        raise ValueError(f"gap must be a share from 0 to 1, got {gap}")
    check_range("max_direction_changes", max_direction_changes, least=0)
    watch = Watch(gap=gap, cost=incumbent)
    budget = Budget.from_now(time_limit)
    if max_direction_changes is not None and problem.automaton.is_kinematic:
        return _with_few_changes(
            problem, budget, max_work, most=max_direction_changes, incumbent=incumbent
        )
    if incumbent == math.inf:
        # Cost of a plan that a little work finds, the same at every call in time; inf for none.
        workspace = workspace_of(problem.obstacles)
        prepare_steps(problem, workspace)
        brief = replace(problem, search=replace(problem.search, max_expansions=EXPANSIONS))
        part = budget.part(PLANNING)._replace(expansions=EXPANSIONS)
        cost = answer(brief, part, workspace, alternatives=0).cost
        incumbent = watch.cost = math.inf if cost is None else cost
    proving = Proving(problem, budget, watch, max_work=max_work)
    proving.run()
    return proving.bound(incumbent)


def _with_few_changes(
    problem: Problem, budget: Budget, work: int | None, *, most: int, incumbent: float
) -> LowerBound:
    """Bound of plans with few changes: at some price for each, less that of so many."""
    best, cost = known_bound(problem), terms_of(problem.cost)
    if cost is None:
        return best
    scale = incumbent if incumbent < math.inf else 2.0 * best.value
    for number, share in enumerate(SHARES):
        price = share * scale / (1 + most)
        costlier = replace(cost, direction_change=cost.direction_change + price)
        limit = incumbent + most * price
        one = Proving(
            replace(problem, cost=costlier),
            budget.part(1.0 / (len(SHARES) - number)),
            Watch(gap=0.0, cost=limit),
            max_work=None if work is None else work // len(SHARES),
        )
        one.run()
        value = one.bound(limit).value - most * price
        if value > best.value:
            best = replace(one.best, value=min(value, incumbent), work=one.work)
    return best
