"""What can be said without searching: goals out of reach, and bounds that hold for every plan."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.setup import SearchSetup, search_setup


def why_impossible(problem: Problem) -> str:
    """Why no word of whatever length can reach any goal, as far as a glance proves it."""
    reasons = [_impossible(problem, search_setup(problem, goal)) for goal in problem.goals]
    return reasons[0] if all(reasons) else ""


def _impossible(problem: Problem, setup: SearchSetup) -> str:
    if not len(setup.trims):
        return "no trim of the library moves"
    turn = 0.0 if setup.free_heading else abs(math.remainder(setup.goal[2], 2.0 * math.pi))
    if turn > 1e-9 and not setup.twists[:, 2].any():
        return f"no trim of the library turns, and the goal is {turn:.6g} rad away"
    if abs(setup.goal[3]) > 1e-9 and not (setup.twists[:, 3] * setup.goal[3] > 0.0).any():
        return f"no trim of the library climbs towards the goal, {setup.goal[3]:.6g} m away"
    directions = setup.twists / np.linalg.norm(setup.twists, axis=1, keepdims=True)
    if np.linalg.matrix_rank(directions, tol=1e-9) == 1:
        return "all trims of the library move along one and the same curve"
    limit = problem.horizon.time or problem.horizon.max_time
    if limit is not None:
        way = float(np.linalg.norm(setup.goal[[0, 1, 3]]))
        speed = float(np.linalg.norm(setup.twists[:, [0, 1, 3]], axis=1).max())
        turning = float(np.abs(setup.twists[:, 2]).max())
        least = max(way / speed if way else 0.0, turn / turning if turn else 0.0)
        if least > limit * (1.0 + 1e-9):
            return (
                f"the goal cannot be reached in {limit:g} s: "
                f"way and turn alone take at least {least:.6g} s"
            )
    return ""


def closed_bound(problem: Problem, goal: Goal) -> float:
    """Way and turn at the best price per metre and radian; a fixed time at the best per second.

    Holds for every plan, whatever its word.
    """
    setup = search_setup(problem, goal)
    if setup.start_is_goal or not len(setup.rates):
        return 0.0
    limit = problem.horizon.time
    rest = setup.rest_rate if limit is not None and setup.rest is not None else 0.0
    padded = rest * limit if limit is not None and setup.rest is not None else 0.0
    rates = setup.rates - rest
    if (rates < 0.0).any():
        return 0.0
    speeds = np.linalg.norm(setup.twists[:, [0, 1, 3]], axis=1)
    turns = np.abs(setup.twists[:, 2])
    way = float(np.linalg.norm(setup.goal[[0, 1, 3]]))
    turn = 0.0 if goal.free_heading else abs(math.remainder(setup.goal[2], 2.0 * math.pi))
    with np.errstate(divide="ignore", invalid="ignore"):
        per_metre = float(np.min(np.where(speeds > 0.0, rates / speeds, np.inf)))
        per_radian = float(np.min(np.where(turns > 0.0, rates / turns, np.inf)))
    bound = max(
        way * per_metre if way > 0.0 else 0.0,
        turn * per_radian if turn > 0.0 else 0.0,
    )
    if limit is not None and setup.rest is None:
        bound = max(bound, limit * float(rates.min()))
    return padded + (bound if math.isfinite(bound) else 0.0)


def rest_rate(problem: Problem) -> float | None:
    """Cost per second of the cheapest rest where it pads a fixed time; None if nothing pads."""
    if problem.horizon.time is None:
        return None
    still = ~problem.automaton.body_velocities.any(axis=1)
    return float(problem.rates[still].min()) if still.any() else None
