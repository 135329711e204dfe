"""Nothing leaves the planner unchecked: FCL on every edge, then the audit by other means."""

from __future__ import annotations

import functools
from dataclasses import dataclass

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit import Audit, audit_plan
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.carried import carried
from maneuver_automaton.collision import AnyObstacle, Shape
from maneuver_automaton.collision.checker import origin_near
from maneuver_automaton.collision.fcl_checker import FclChecker
from maneuver_automaton.collision.surroundings import surroundings_of
from maneuver_automaton.planning.zones import what_zone_forbids
from maneuver_automaton.primitives import Trim
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
    hit = what_is_hit(problem, plan, goal)
    if hit:
        return Checked(inside=True, free=False, audit=None, reason=hit)
    audit = audit_plan(
        plan,
        goal,
        problem.automaton.model,
        footprint=problem.footprint,
        parts=problem.parts,
        obstacles=problem.obstacles,
        margin=problem.margin,
        states=_end_states(problem, goal),
        zones=problem.zones,
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


def what_is_hit(problem: Problem, plan: Plan, goal: Goal) -> str:
    """Which edge hits what, or what a zone does not admit, by FCL; empty if none does."""
    forbidden = what_zone_forbids(problem, plan, _origin(goal)) if problem.zones else ""
    if forbidden or not problem.obstacles:
        return forbidden
    bodies = [("", plan, problem.footprint)]
    for name, shapes in problem.parts.items():
        bodies.append((f"the {name}: ", carried(plan, problem.automaton.model, name), shapes))
    for what, moving, shapes in bodies:
        checker = checker_of(shapes, problem.obstacles, problem.margin, _origin(goal))
        hit = _what_hits(checker, moving)
        if hit:
            return what + hit
    return ""


def _what_hits(checker: FclChecker, plan: Plan) -> str:
    if not plan.primitives:
        hit = checker.pose_hit(plan.start[:3], time=plan.start_time)
        return "" if hit is None else f"obstacle {hit} is hit at the start"
    for k, primitive in enumerate(plan.primitives):
        start, begin = plan.switching_poses[k], float(plan.switching_times[k])
        if isinstance(primitive, Trim):
            duration = float(plan.primitive_durations[k])
            hit = checker.motion_hit(start, primitive.body_velocity, duration, start_time=begin)
        else:
            course = primitive.course
            if course is None:
                return f"maneuver {primitive.name!r} has no course, so it cannot be checked"
            hit = checker.course_hit(start, course.pose, course.time, start_time=begin)
        if hit is not None:
            kind = "trim" if isinstance(primitive, Trim) else "maneuver"
            return f"obstacle {hit} is hit in {kind} {k}, {primitive.name!r}"
    return ""


def _end_states(problem: Problem, goal: Goal) -> tuple[Array, Array] | None:
    """Reduced states in which a vehicle with inertia begins and ends."""
    if problem.automaton.is_kinematic:
        return None
    return problem.first_trim.reduced_state, problem.last_trim(goal).reduced_state


def _origin(goal: Goal) -> tuple[float, float]:
    return origin_near(goal.pose[:2])
