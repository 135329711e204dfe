"""Starts and goals where no vehicle can be."""

from __future__ import annotations

import math
from dataclasses import replace

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import Disc
from maneuver_automaton.collision.blocked import touched
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.inside import outside


def blocked_ends(problem: Problem) -> PlanResult | None:
    """The verdict, if the start or every goal is out of bounds or touches an obstacle."""
    reason = outside(problem.start, problem.bounds)
    if reason:
        reason = f"the start is outside the bounds: {reason}"
    elif problem.obstacles:
        said = where_touched(problem, problem.start, problem.start_time)
        reason = f"at the start {said}" if said else ""
    if reason:
        return PlanResult(problem=problem, status=PlanStatus.START_BLOCKED, reason=reason)
    reasons = [why_goal_blocked(problem, goal) for goal in problem.goals]
    if all(reasons):
        many = f"every goal is blocked; the first: {reasons[0]}"
        return PlanResult(
            problem=problem,
            status=PlanStatus.GOAL_BLOCKED,
            reason=reasons[0] if len(reasons) == 1 else many,
        )
    return None


def why_goal_blocked(problem: Problem, goal: Goal) -> str:
    """Why no plan can end at a goal; empty if one may. What moves may be gone on arrival."""
    reason = outside(goal.pose, problem.bounds)
    if reason:
        return f"the goal is outside the bounds: {reason}"
    if not problem.obstacles:
        return ""
    if goal.free_heading and problem.footprint:  # only what touches at every heading counts
        inside = body_of(problem.footprint).inscribed
        if not inside > 0.0:
            return ""
        problem = replace(problem, footprint=(Disc(inside),))
    said = where_touched(problem, goal.pose, math.inf)
    return f"at the goal {said}" if said else ""


def where_touched(problem: Problem, pose: Array, time: float) -> str:
    """What the vehicle touches at a pose and a time; inf: only what stands still counts."""
    still = tuple(o for o in problem.obstacles if getattr(o, "motion", None) is None)
    obstacles = problem.obstacles if math.isfinite(time) else still
    if not obstacles:
        return ""
    return touched(
        problem.footprint,
        obstacles,
        pose,
        time=time if math.isfinite(time) else 0.0,
        margin=problem.margin,
        origin=(float(pose[0]), float(pose[1])),
    )
