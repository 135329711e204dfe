"""What a problem needs, told by its vehicle, its obstacles and its goals alone."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.problem import Problem


def has_inertia(problem: Problem) -> bool:
    """Whether the vehicle cannot switch at will between the trims that it needs."""
    automaton = problem.automaton
    return bool(automaton.model.reduced_names) or not automaton.is_kinematic


def uses_lattice(problem: Problem) -> bool:
    """Whether the lattice plans: it was asked for, or there is something in the way.

    In the plane it needs two trims that move, one of which turns or leads to another side; and a
    rest where the time is fixed. Otherwise words are searched, and those that meet obstacles are
    refused.
    """
    return _uses_lattice(problem.setting)


@kept_by_first
def _uses_lattice(problem: Problem) -> bool:
    if climbs_among_obstacles(problem):
        return True
    velocities = problem.automaton.body_velocities
    moving = velocities[velocities.any(axis=1)]
    sides = moving[:, 2].any() or np.linalg.matrix_rank(moving[:, :2]) == 2
    steers = len(moving) > 1 and sides and velocities.shape[1] == 3
    if not steers or (problem.horizon.time is not None and len(moving) == len(velocities)):
        return False
    method = problem.search.method
    return method == "lattice" or (method == "auto" and bool(problem.obstacles))


def climbs_among_obstacles(problem: Problem) -> bool:
    """Whether a vehicle that switches at will has more than a plane, and something is in its way.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "left": (0.0, 1.0)})
    >>> climbs_among_obstacles(Problem(robot, [0, 0, 0], [9, 0, 0], obstacles=Disc(1.0, [4, 0])))
    False
    """
    in_space = problem.start.size > 3 and problem.automaton.is_kinematic
    return in_space and bool(problem.obstacles) and problem.search.method in ("auto", "lattice")


def has_tolerance(problem: Problem) -> bool:
    """Whether a plan may end beside a goal; on a lattice also whether at any heading."""
    turns = problem.automaton.lattice is not None
    return any(
        goal.tolerance_m > 0.0 or goal.tolerance_rad > 0.0 or (turns and goal.free_heading)
        for goal in problem.goals
    )


def rests_at_both_ends(problem: Problem) -> bool:
    """Whether the vehicle starts and ends at rest."""
    return problem.first_trim.is_rest and all(
        problem.last_trim(goal).is_rest for goal in problem.goals
    )
