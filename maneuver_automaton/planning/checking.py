"""Nothing leaves the planner unchecked: FCL on every edge, then the audit by other means."""

from __future__ import annotations

import functools
from dataclasses import dataclass

from maneuver_automaton.audit import Audit, audit_plan
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import AnyObstacle, Shape
from maneuver_automaton.collision.checker import origin_near
from maneuver_automaton.collision.fcl_checker import FclChecker
from maneuver_automaton.collision.surroundings import surroundings_of
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.inside import stays_inside


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Checked:
    """What the checks of one plan found."""

    inside: bool  # the bounds
    free: bool  # FCL on every edge
    audit: Audit | None  # None if an earlier check failed
    reason: str = ""

    @property
    def passed(self) -> bool:
        """Whether the plan may be returned."""
        return self.audit is not None and self.audit.passed


def check_plan(problem: Problem, plan: Plan, goal: Goal) -> Checked:
    """Bounds, FCL, audit, in this order; the first that fails ends it."""
    if not stays_inside(plan, problem.bounds):
        return Checked(inside=False, free=True, audit=None, reason="it leaves the bounds")
    hit = _hit(problem, plan, goal)
    if hit:
        return Checked(inside=True, free=False, audit=None, reason=hit)
    audit = audit_plan(
        plan,
        goal,
        problem.automaton.model,
        footprint=problem.footprint,
        obstacles=problem.obstacles,
        margin=problem.margin,
    )
    return Checked(inside=True, free=True, audit=audit, reason=audit.reason)


def load_checks(problem: Problem) -> None:
    """Prepare what FCL and the audit compare with, once for a map."""
    if problem.obstacles:
        origin = _origin(problem.goals[0])
        checker_of(problem.footprint, problem.obstacles, problem.margin, origin)
        surroundings_of(problem.obstacles, origin)


@functools.lru_cache(maxsize=4)
def checker_of(
    footprint: tuple[Shape, ...],
    obstacles: tuple[AnyObstacle, ...],
    margin: float,
    origin: tuple[float, float],
) -> FclChecker:
    """FCL's view of a map."""
    return FclChecker(footprint, obstacles, margin=margin, origin=origin)


def _hit(problem: Problem, plan: Plan, goal: Goal) -> str:
    """Which edge hits what by FCL; empty if none does."""
    if not problem.obstacles:
        return ""
    checker = checker_of(problem.footprint, problem.obstacles, problem.margin, _origin(goal))
    if not plan.trims:
        hit = checker.pose_hit(plan.start, time=plan.start_time)
        return "" if hit is None else f"obstacle {hit} is hit at the start"
    for k, trim in enumerate(plan.trims):
        hit = checker.motion_hit(
            plan.switching_poses[k],
            trim.body_velocity,
            float(plan.durations[k]),
            start_time=float(plan.switching_times[k]),
        )
        if hit is not None:
            return f"obstacle {hit} is hit in trim {k}, {trim.name!r}"
    return ""


def _origin(goal: Goal) -> tuple[float, float]:
    return origin_near(goal.pose[:2])
