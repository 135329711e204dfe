"""Goals that keep room for noise: whoever drives within its tube of a plan arrives all the same."""

from __future__ import annotations

import math
from dataclasses import replace

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.receding_horizon.candidates import within

LEFT = 0.5  # share of a tolerance that is left at least


def with_room(problem: Problem, tube_m: float) -> Problem:
    """The problem with goals whose tolerances are less by what a vehicle may be beside its plan.

    A plan that ends at the edge of a tolerance arrives only where nothing disturbs it; one that
    ends within these arrives from anywhere in its tube. At least half of a tolerance is left.

    Parameters
    ----------
    problem : Problem
    tube_m : float
        How far any point of the body may be from where its plan has it [m].

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0)})
    >>> goal = Goal([4, 0, 0], tolerance_m=0.15, tolerance_rad=0.3)
    >>> there = with_room(Problem(robot, [0, 0, 0], goal, footprint=Disc(0.5)), 0.05)
    >>> [(round(one.tolerance_m, 3), round(one.tolerance_rad, 3)) for one in there.goals]
    [(0.1, 0.2)]
    """
    body = body_of(problem.footprint)
    reach = math.hypot(body.middle_x, body.middle_y) + body.reach
    turn = 2.0 * math.asin(min(1.0, tube_m / (2.0 * reach))) if reach > 0.0 else math.pi
    goals = tuple(
        replace(
            goal,
            tolerance_m=max(goal.tolerance_m - tube_m, LEFT * goal.tolerance_m),
            tolerance_rad=max(goal.tolerance_rad - turn, LEFT * goal.tolerance_rad),
        )
        for goal in problem.goals
    )
    return replace(problem, goals=goals)


def fleet_with_room(fleet: FleetProblem, tube_m: float) -> FleetProblem:
    """The fleet as a loop plans it at first: each with goals that keep room; see `with_room`.

    With inertia by maneuvers of the library alone: a motion in one piece could not be left where
    another one breaks down.
    """
    roomy = (with_room(one, tube_m) for one in fleet.problems)
    words = (replace(one, search=replace(one.search, polish=False)) for one in roomy)
    return replace(fleet, problems=tuple(words))


def tube_of(fleet: FleetProblem, tube_m: float | None) -> float:
    """How far any point of a body may be beside its plan [m]; half of the margin if not given."""
    return 0.5 * fleet.margin if tube_m is None else tube_m


def aimed_at(plan: Plan, goal: Goal) -> Goal:
    """A goal as a plan aims at it: where the plan ends, if that is beside but within tolerance."""
    if not within(plan.end, goal) or within(
        plan.end, replace(goal, tolerance_m=0.0, tolerance_rad=0.0)
    ):
        return goal
    return replace(goal, pose=plan.end)
