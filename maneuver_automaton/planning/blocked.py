"""Starts and goals where no vehicle can be, and goals that no word of its library ends at."""

from __future__ import annotations

import math
from dataclasses import replace

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import AnyObstacle, Disc, advancement, layers, shapes
from maneuver_automaton.collision import blocked as exactly
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.problem import Goal, Problem, moves
from maneuver_automaton.search import scene
from maneuver_automaton.search.lattice_goals import nearest_on_lattice
from maneuver_automaton.search.limits import outside

LEAVES = "`plan --leave`, or plan(problem, leave=True), drives out of what a start touches first"


def blocked_ends(problem: Problem) -> PlanResult | None:
    """The verdict, if the start or every goal is out of bounds or touches an obstacle.

    Exact, for bodies of any shape; goals are poses, or places of any heading: tolerances are left
    out, and whoever has them must ask again.
    """
    reason, notes = outside(problem.start, problem.bounds), tuple[str, ...]()
    sure = [False] * (1 + len(problem.goals))  # proven free by the kernels, all in one call
    if problem.obstacles and not (problem.parts or problem.start.size > 3 or problem.moves):
        sure = [one > problem.margin + scene.CLEARLY for one in scene.ends_of(problem)[1].tolist()]
    if reason:
        reason = f"the start is outside the bounds: {reason}"
    elif problem.obstacles and not sure[0]:
        said = where_touched(problem, problem.start, problem.start_time)
        said = said or _part_touched(problem, None, problem.start, problem.start_time)
        reason, notes = (f"at the start {said}", (LEAVES,)) if said else ("", ())
    if reason:
        return PlanResult(
            problem=problem, status=PlanStatus.START_BLOCKED, reason=reason, notes=notes
        )
    reasons = [
        why_goal_blocked(problem, goal, free=free)
        for goal, free in zip(problem.goals, sure[1:], strict=True)
    ]
    if all(reasons):
        many = f"every goal is blocked; the first: {reasons[0]}"
        return PlanResult(
            problem=problem,
            status=PlanStatus.GOAL_BLOCKED,
            reason=reasons[0] if len(reasons) == 1 else many,
        )
    return None


def blocked_anyway(problem: Problem) -> PlanResult | None:
    """The verdict of `blocked_ends` where it holds for all ends within the tolerances too."""
    loose = any(goal.tolerance_m > 0.0 or goal.tolerance_rad > 0.0 for goal in problem.goals)
    blocked = blocked_ends(problem)
    open_end = loose and blocked is not None and blocked.status is PlanStatus.GOAL_BLOCKED
    return None if open_end else blocked


def proven_free(problem: Problem, poses: Array) -> list[bool]:
    """Whether the kernels prove poses in the plane free of all that stands, all in one call."""
    world = scene.world_around(problem)
    aside = advancement.clearances(world, world.into(poses)).tolist()
    return [one > problem.margin + scene.CLEARLY for one in aside]


def why_goal_blocked(problem: Problem, goal: Goal, *, free: bool = False) -> str:
    """Why no plan can end at a goal; empty if one may, as where its pose is known to be `free`.

    Moving obstacles may be gone on arrival.
    """
    reason = outside(goal.pose, problem.bounds)
    if reason:
        return f"the goal is outside the bounds: {reason}"
    if free or not problem.obstacles:
        return ""
    if goal.free_heading and problem.footprint:  # only what touches at every heading counts
        return _why_blocked_all_round(problem, goal)
    said = where_touched(problem, goal.pose, math.inf)
    if not goal.free_heading:
        said = said or _part_touched(problem, goal, goal.pose, math.inf)
    return f"at the goal {said}" if said else ""


def _why_blocked_all_round(problem: Problem, goal: Goal) -> str:
    """Why no plan can end at a goal of any heading; empty if that is not proven."""
    inside = body_of(problem.footprint).inscribed
    if inside > 0.0:
        disc = replace(problem, footprint=(Disc(inside),))
        if said := where_touched(disc, goal.pose, math.inf):
            return f"at the goal {said}"
    said = where_touched(problem, goal.pose, math.inf)
    still = tuple(one for one in _at_altitude(problem, goal.pose) if not moves(one))
    body, margin = problem.footprint, problem.margin
    if said and exactly.touched_all_round(body, still, goal.pose[:2], margin=margin):
        return f"at the goal no heading is free; at that given {said}"
    return ""


def open_goals(problem: Problem) -> tuple[int, ...]:
    """Which goals a plan may end at."""
    return tuple(k for k, goal in enumerate(problem.goals) if not why_goal_blocked(problem, goal))


def goals_left(problem: Problem) -> tuple[int, ...]:
    """Which goals a plan may end at, of a problem for which `blocked_ends` gave no verdict."""
    return (0,) if len(problem.goals) == 1 else open_goals(problem)


def _part_touched(problem: Problem, goal: Goal | None, pose: Array, time: float) -> str:
    """Sentence on the obstacle that a carried part touches at the start or a goal; or empty."""
    automaton, trim = problem.automaton, problem.start_trim if goal is None else goal.trim
    state = problem.start_state if goal is None else goal.state
    if not problem.parts or (trim is None and state is None and automaton.rest is None):
        return ""
    if state is None:
        at = automaton.index_of(trim) if trim else automaton.rest or 0
        state = automaton.trims[at].reduced_state
    offsets = automaton.model.part_poses(state)
    for name, offset in zip(automaton.model.part_names, offsets, strict=True):
        if name in problem.parts:
            carried = replace(problem, footprint=problem.parts[name], parts={})
            if said := where_touched(carried, (SE2(pose[:3]) @ SE2(offset)).pose, time):
                return f"the {name}: {said}"
    return ""


def where_touched(problem: Problem, pose: Array, time: float) -> str:
    """Sentence on the obstacle that the vehicle touches at a pose and time; inf: static ones only.

    The kernels prove most poses free; where they do not, shapely decides.
    """
    beside = _at_altitude(problem, pose)
    static = tuple(obstacle for obstacle in beside if not moves(obstacle))
    obstacles = beside if math.isfinite(time) else static
    if not obstacles:
        return ""
    at = time if math.isfinite(time) else 0.0
    if pose.size == 3:
        whole = obstacles == problem.obstacles
        world = scene.world_around(problem if whole else replace(problem, obstacles=obstacles))
        (clearance,) = advancement.clearances(world, world.into(pose[:3]), times=at)
        if clearance > problem.margin + scene.CLEARLY:
            return ""
    return exactly.touched(
        problem.footprint,
        obstacles,
        pose[:3],
        time=at,
        margin=problem.margin,
        origin=shapes.origin_near(pose[:2]),
    )


def _at_altitude(problem: Problem, pose: Array) -> tuple[AnyObstacle, ...]:
    """Obstacles that stand at the altitude of a pose, within the margin; all of them in a plane."""
    if pose.size == 3:
        return problem.obstacles
    near = [
        number
        for layer in layers.layers_of(problem.obstacles, in_space=True)
        if layer.clearance(pose[3:], problem.body_height)[0] <= problem.margin
        for number in layer.numbers
    ]
    return tuple(problem.obstacles[number] for number in sorted(near))


def goals_off_lattice(problem: Problem) -> PlanResult | None:
    """The verdict, if every goal lies beside the lattice on which the library's maneuvers end."""
    reasons = [why_off_lattice(problem, goal) for goal in problem.goals]
    if not all(reasons):
        return None
    many = f"every goal lies beside the lattice; the first: {reasons[0]}"
    return PlanResult(
        problem=problem, status=PlanStatus.NO_PLAN, reason=reasons[0] if len(reasons) == 1 else many
    )


def why_off_lattice(problem: Problem, goal: Goal) -> str:
    """Why a goal lies beside the lattice of the start; empty if it does not, or there is none.

    Examples
    --------
    >>> import numpy as np
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import LatticeBody
    >>> from maneuver_automaton.primitives import Maneuver, Trim
    >>> east = Trim(name="east", body_velocity=np.zeros(3), control=np.zeros(3),
    ...             reduced_state=np.array([1.0, 0.0]))
    >>> ahead = Maneuver(name="ahead", source="east", target="east", displacement=[0.5, 0, 0])
    >>> library = Automaton(LatticeBody(resolution=0.5), (east,), (ahead,))
    >>> problem = Problem(library, [0, 0, 0], [1.1, 0, 0])
    >>> why_off_lattice(problem, problem.goals[0])
    'the goal is beside the lattice of 0.5 m that begins at the start: the nearest node, (1, 0) m at 0 rad, is 0.1 m and 0 rad off'
    """  # noqa: E501, as it is said
    near = nearest_on_lattice(problem, goal)
    if near is None or near.is_near(goal):
        return ""
    x, y, heading = (near.pose + 0.0).tolist()
    cell = problem.automaton.model.resolution  # type: ignore[attr-defined]
    allowed = ""
    if goal.tolerance_m or goal.tolerance_rad:
        allowed = f"; its tolerance is {goal.tolerance_m:.6g} m and {goal.tolerance_rad:.6g} rad"
    return (
        f"the goal is beside the lattice of {cell:g} m that begins at the start: the nearest node, "
        f"({x:.10g}, {y:.10g}) m at {math.remainder(heading, 2.0 * math.pi):.10g} rad, is "
        f"{near.distance:.6g} m and {near.turn:.6g} rad off{allowed}"
    )
