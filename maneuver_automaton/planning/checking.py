"""Nothing leaves the planner unchecked: FCL on every edge, then the audit by other means."""

from __future__ import annotations

import enum
import functools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit import Audit, audit_plan, origin_of
from maneuver_automaton.automaton import Automaton, Plan, Primitive
from maneuver_automaton.automaton.carried import carried
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.collision import Box
from maneuver_automaton.collision.checker import origin_near
from maneuver_automaton.collision.fcl_checker import FclChecker
from maneuver_automaton.collision.heights import Layer, layers_of
from maneuver_automaton.groups import group_of
from maneuver_automaton.models import Unicycle
from maneuver_automaton.planning.workspace import Workspace, workspace_of
from maneuver_automaton.planning.zones import what_zone_forbids
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.refinement.conditions import broken_condition
from maneuver_automaton.search.inside import stays_inside

PROVEN = (1e-3, 2e-5)  # [m] a hit counts if it is one for the finer cover of round shapes too
AUDIT_S, SAMPLE_S = 5e-3, 1.5e-5  # [s] that an audit takes, in all and a sample among obstacles


class Condition(enum.Enum):
    """Conditions that a plan may break, in the order of the checks."""

    WORD = "word"  # the horizon, the number of trims, and how long each of them lasts
    BOUNDS = "bounds"
    COLLISION = "collision"  # with an obstacle, or with a zone that does not admit the motion
    AUDIT = "audit"
    TIME = "time"  # of the checks themselves: nothing else is known to be broken


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Checked:
    """Findings of the checks of one plan."""

    audit: Audit | None  # None if an earlier check failed
    broken: Condition | None = None  # the first that is broken
    reason: str = ""

    @property
    def passed(self) -> bool:
        """Whether the plan may be returned."""
        return self.broken is None


class TooLate(Exception):
    """There is no time left to check a plan."""


def check_plan(
    problem: Problem,
    plan: Plan,
    goal: Goal,
    workspace: Workspace | None = None,
    *,
    budget: Budget = UNLIMITED,
) -> Checked:
    """Horizon and limits, bounds, FCL, audit, in this order; the first that fails ends it.

    They are given up, too, a moment after the time of a `budget` is over.
    """
    workspace = workspace or workspace_of(problem.obstacles)
    reason = broken_condition(problem, plan)
    if reason:
        return Checked(audit=None, broken=Condition.WORD, reason=reason)
    if not stays_inside(plan, problem.bounds):
        return Checked(audit=None, broken=Condition.BOUNDS, reason="it leaves the bounds")
    try:
        reason = what_is_hit(problem, plan, goal, workspace, budget=budget)
        if reason:
            return Checked(audit=None, broken=Condition.COLLISION, reason=reason)
        _ask(budget, _audit_takes(problem, plan))
        audit = audit_plan(
            plan,
            goal,
            problem.automaton.model,
            footprint=problem.footprint,
            parts=problem.parts,
            obstacles=problem.obstacles,
            body_height=problem.body_height,
            margin=problem.margin,
            states=_end_states(problem, goal),
            zones=problem.zones,
            around=workspace.surroundings,
            ask=lambda: _ask(budget),
        )
    except TooLate:
        return Checked(audit=None, broken=Condition.TIME)
    broken = None if audit.passed else Condition.AUDIT
    return Checked(audit=audit, broken=broken, reason=audit.reason)


def _ask(budget: Budget, needed: float = 0.0) -> None:
    """Go on only if more than the time needed [s] is left."""
    if budget.left_to_check <= needed:
        raise TooLate


def _audit_takes(problem: Problem, plan: Plan) -> float:
    """About how long an audit takes [s]: one that is begun late would be given up."""
    if not problem.obstacles:
        return AUDIT_S
    courses = [m.course for m in plan.maneuvers if m is not None and m.course is not None]
    samples = sum(len(course.time) for course in courses)
    return AUDIT_S + SAMPLE_S * samples * (1 + len(problem.parts))


def load_checks(problem: Problem, workspace: Workspace) -> None:
    """Prepare what FCL and the audit compare with."""
    origin = _origin(problem.goals[0])
    for layer in layers_of(problem.obstacles, in_space=problem.start.size > 3):
        workspace.checker(
            problem.footprint, layer.obstacles, problem.margin, origin, proven=PROVEN[0]
        )
    if problem.obstacles:
        workspace.surroundings(problem.obstacles, origin_of(problem.goals[0].pose))


@functools.cache
def load_checking() -> None:
    """Import what checks: the audit, shapely, FCL."""
    ahead = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0)})
    wall = Box([1.0, 1.0], [5.0, 5.0])
    problem = Problem(ahead, [0, 0, 0], [1, 0, 0], obstacles=wall, footprint=Box([0.1, 0.1]))
    check_plan(problem, Plan([0, 0, 0], ahead.trims, durations=[1.0]), problem.goals[0])


def what_is_hit(
    problem: Problem,
    plan: Plan,
    goal: Goal,
    workspace: Workspace | None = None,
    *,
    budget: Budget = UNLIMITED,
) -> str:
    """Which edge hits what, or what a zone does not admit, by FCL; empty if none does.

    Raises
    ------
    TooLate
        A moment after the time of a `budget` is over.
    """
    workspace = workspace or workspace_of(problem.obstacles)
    forbidden = what_zone_forbids(problem, plan, _origin(goal)) if problem.zones else ""
    if forbidden or not problem.obstacles:
        return forbidden
    bodies = [("", plan, problem.footprint)]
    for name, shapes in problem.parts.items():
        _ask(budget)
        bodies.append((f"the {name}: ", carried(plan, problem.automaton.model, name), shapes))
    layers = layers_of(problem.obstacles, in_space=plan.start.size > 3)
    for what, moving, shapes in bodies:
        for layer in layers:
            for proven in PROVEN:
                checker = workspace.checker(
                    shapes, layer.obstacles, problem.margin, _origin(goal), proven=proven
                )
                hit = _what_hits(checker, moving, layer, problem, budget)
                if not hit:
                    break
            if hit:
                return what + hit
    return ""


def _what_hits(
    checker: FclChecker, plan: Plan, layer: Layer, problem: Problem, budget: Budget
) -> str:
    """Which primitive hits what of a layer, while its altitude is within reach of it."""
    if not plan.primitives:
        height = plan.start[3:].sum(keepdims=True)
        if layer.clearance(height, problem.body_height)[0] > problem.margin:
            return ""
        hit = checker.pose_hit(plan.start[:3], time=plan.start_time)
        return "" if hit is None else f"obstacle {layer.numbers[hit]} is hit at the start"
    for k, primitive in enumerate(plan.primitives):
        _ask(budget)
        start, begin = plan.switching_poses[k], float(plan.switching_times[k])
        if isinstance(primitive, Maneuver) and primitive.course is None:
            return f"maneuver {primitive.name!r} has no course, so it cannot be checked"
        for piece in _within_reach(primitive, start, plan.primitive_durations[k], layer, problem):
            time = begin + float(piece.time[0])
            if isinstance(primitive, Trim):
                first, last = piece.time.tolist()
                pose = primitive.coast(group_of(start.size)(start), first).pose
                hit = checker.motion_hit(
                    pose[:3], primitive.body_velocity[:3], last - first, start_time=time
                )
            else:
                since = piece.time - piece.time[0]
                hit = checker.course_hit(
                    start[:3], piece.pose, since, start_time=time, ask=lambda: _ask(budget)
                )
            if hit is not None:
                kind = "trim" if isinstance(primitive, Trim) else "maneuver"
                return f"obstacle {layer.numbers[hit]} is hit in {kind} {k}, {primitive.name!r}"
    return ""


class _Stretch(NamedTuple):
    """A part of a primitive; of a trim the times of its ends."""

    time: Array  # (n,) [s] since the primitive's begin
    pose: Array  # (n, 3) seen from there


def _within_reach(
    primitive: Primitive, start: Array, duration: float, layer: Layer, problem: Problem
) -> list[_Stretch]:
    """The parts of a primitive in which its altitude is within the margin of a layer."""
    if isinstance(primitive, Trim):
        ends = np.array([0.0, duration])
        poses = np.zeros((2, 3))
        climb = float(primitive.body_velocity[3:].sum())
        if math.isinf(layer.high) or start.size == 3:
            return [_Stretch(ends, poses)]
        low = layer.low - problem.body_height[1] - problem.margin - start[3]
        high = layer.high - problem.body_height[0] + problem.margin - start[3]
        if climb == 0.0:
            return [_Stretch(ends, poses)] if low <= 0.0 <= high else []
        first, last = sorted((low / climb, high / climb))
        inside = np.clip([first, last], 0.0, duration)
        return [_Stretch(inside, poses)] if last >= 0.0 and first <= duration else []
    assert primitive.course is not None
    time, pose = primitive.course.time, primitive.course.pose
    if math.isinf(layer.high) or start.size == 3:
        return [_Stretch(time, pose[:, :3])]
    step = float(np.abs(np.diff(pose[:, 3])).max(initial=0.0))  # so that no run is a sample
    near = layer.clearance(start[3] + pose[:, 3], problem.body_height) <= problem.margin + step
    runs = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(np.int8)))
    return [
        _Stretch(time[first:last], pose[first:last, :3])
        for first, last in runs.reshape(-1, 2).tolist()
        if last - first > 1
    ]


def _end_states(problem: Problem, goal: Goal) -> tuple[Array, Array] | None:
    """Reduced states in which a vehicle with inertia begins and ends."""
    if problem.automaton.is_kinematic:
        return None
    return problem.first_trim.reduced_state, problem.last_trim(goal).reduced_state


def _origin(goal: Goal) -> tuple[float, float]:
    return origin_near(goal.pose[:2])
