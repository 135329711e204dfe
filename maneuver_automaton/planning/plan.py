"""`plan(problem)`: choose, search, refine, check, audit."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.planning.among_obstacles import (
    library_table,
    plan_on_lattice,
    prepare_map,
)
from maneuver_automaton.planning.among_zones import plan_among_zones
from maneuver_automaton.planning.blocked import blocked_ends
from maneuver_automaton.planning.free_space import plan_by_words
from maneuver_automaton.planning.in_space import (
    climbs_among_obstacles,
    load_in_space,
    plan_in_space,
)
from maneuver_automaton.planning.off_lattice import goals_off_lattice
from maneuver_automaton.planning.result import PlanResult
from maneuver_automaton.planning.with_inertia import load_inertia, plan_with_inertia
from maneuver_automaton.planning.within_tolerance import has_tolerance, plan_within_tolerance
from maneuver_automaton.planning.workspace import Workspace, workspace_of
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement.ready import load_lattice
from maneuver_automaton.search.budget import Budget
from maneuver_automaton.search.choose import load_search


def plan(problem: Problem, *, time_limit: float = 5.0, alternatives: int = 0) -> PlanResult:
    """Cheapest plan found for `problem`, audited by an ODE solver before it is returned.

    Parameters
    ----------
    problem : Problem
    time_limit : float
        [s] for search and refinement; the audit comes after it.
    alternatives : int
        How many dearer plans to return beside the cheapest, as far as there are so many.

    Returns
    -------
    PlanResult
        ``status`` says how it ended. ``lower_bound`` is the cost itself where the search was
        exhaustive over all admitted words of at most four moving trims, otherwise a closed bound.

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
    workspace = workspace_of(problem.obstacles)
    return plan_in(workspace, problem, time_limit=time_limit, alternatives=alternatives)


def plan_in(
    workspace: Workspace, problem: Problem, *, time_limit: float, alternatives: int
) -> PlanResult:
    """As `plan`, with what was prepared for the problem's map."""
    if not time_limit > 0.0:
        raise ValueError(f"time_limit must be positive, got {time_limit} s")
    if alternatives < 0:
        raise ValueError(f"alternatives must be at least 0, got {alternatives}")
    _load(problem, workspace)
    if alternatives and uses_lattice(problem):
        load_search(problem)
    budget = Budget.from_now(time_limit, expansions=problem.search.max_expansions)
    if has_tolerance(problem):
        return plan_within_tolerance(
            problem, _answered, budget, workspace, alternatives=alternatives
        )
    return _answered(problem, budget, workspace, alternatives=alternatives)


def _answered(
    problem: Problem, budget: Budget, workspace: Workspace, /, *, alternatives: int
) -> PlanResult:
    """The answer to a problem whose goals are met exactly."""
    blocked = blocked_ends(problem) or goals_off_lattice(problem)
    if blocked is not None:
        return blocked
    if problem.zones:
        return plan_among_zones(problem, _searched, budget, workspace, alternatives=alternatives)
    return _searched(problem, budget, workspace, alternatives=alternatives)


def _searched(
    problem: Problem, budget: Budget, workspace: Workspace, /, *, alternatives: int
) -> PlanResult:
    """The answer of the search that suits a problem without zones."""
    kinematic = plan_on_lattice if uses_lattice(problem) else plan_by_words
    if climbs_among_obstacles(problem):
        kinematic = plan_in_space
    how = plan_with_inertia if has_inertia(problem) else kinematic
    return how(problem, budget, workspace, alternatives=alternatives)


def prepare(problem: Problem, workspace: Workspace | None = None) -> None:
    """Have ready what every problem on the map of this one needs."""
    workspace = workspace or workspace_of(problem.obstacles)
    _load(problem, workspace)
    if uses_lattice(problem):
        prepare_map(problem, workspace)


def _load(problem: Problem, workspace: Workspace) -> None:
    """Compile or load what planning needs, before the clock runs."""
    if has_inertia(problem):
        load_inertia(problem, workspace)
        return
    if problem.start.size > 3 and (problem.obstacles or problem.zones):
        load_in_space(problem)
        return
    if problem.obstacles or problem.zones or uses_lattice(problem):
        load_lattice()
    if uses_lattice(problem):
        library_table(problem, workspace)
    else:
        load_search(problem)


def has_inertia(problem: Problem) -> bool:
    """Whether the vehicle cannot switch at will between the trims that it needs."""
    automaton = problem.automaton
    return bool(automaton.model.reduced_names) or not automaton.is_kinematic


def uses_lattice(problem: Problem) -> bool:
    """Whether the lattice is what plans: it was asked for, or there is something in the way.

    It needs trims in the plane of which one turns, or two that lead to different sides where none
    does and the heading never changes; and a rest where the time is fixed. Otherwise words are
    searched, and what is in the way sorts them out.
    """
    velocities = problem.automaton.body_velocities
    moving = velocities[velocities.any(axis=1)]
    turns = bool(moving[:, 2].any())
    keeps_heading = problem.automaton.translated is not None and not has_inertia(problem)
    sides = turns or (keeps_heading and np.linalg.matrix_rank(moving[:, :2]) == 2)
    steers = len(moving) > 1 and sides and velocities.shape[1] == 3
    if not steers or (problem.horizon.time is not None and len(moving) == len(velocities)):
        return False
    method = problem.search.method
    return method == "lattice" or (method == "auto" and bool(problem.obstacles))
