"""The audit of a finished plan: its dynamics, its ends, its limits and its clearance."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit.clearance import Around, Scene, closest, what_is_hit, zones_broken
from maneuver_automaton.audit.dynamics import beyond_limits, defect_of, wrong_ends
from maneuver_automaton.audit.stretches import stretches_of
from maneuver_automaton.audit.values import Audit, TerminalError, distance_to, seen_from
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.carried import carried
from maneuver_automaton.collision import AnyObstacle, Shape, Zone
from maneuver_automaton.collision.blocked import too_close
from maneuver_automaton.collision.checker import origin_near
from maneuver_automaton.collision.surroundings import surroundings_of
from maneuver_automaton.models import Model
from maneuver_automaton.problem import Goal

DEFECT_TOLERANCE = 1e-7  # [m, rad] between plan and ODE solver, per metre, radian, second driven
TERMINAL_TOLERANCE = 1e-9  # [m, rad] of the last pose, beyond the goal's own tolerance


def audit_plan(
    plan: Plan,
    goal: Goal,
    model: Model,
    *,
    footprint: tuple[Shape, ...] = (),
    parts: Mapping[str, tuple[Shape, ...]] | None = None,
    obstacles: tuple[AnyObstacle, ...] = (),
    body_height: tuple[float, float] = (0.0, 0.0),
    margin: float = 0.0,
    states: tuple[Array, Array] | None = None,
    zones: tuple[Zone, ...] = (),
    around: Around = surroundings_of,
) -> Audit:
    """Drive a finished plan again with an ODE solver, and measure its distance to the obstacles.

    Parameters
    ----------
    plan : Plan
        What is about to be returned.
    goal : Goal
        Where it must end, to within its tolerance.
    model : Model
        The vehicle's equations; they alone are used.
    footprint : tuple of Shape
        Parts of the body; empty for a point.
    parts : mapping of str to tuple of Shape, optional
        What the vehicle carries, by name, each in its own frame.
    obstacles : tuple of Obstacle or OccupancyMap
        Obstacles that it must not touch.
    body_height : (float, float)
        From where to where the body reaches about its altitude [m].
    margin : float
        Distance to keep [m].
    states : two (n_z,) arrays, optional
        Reduced states in which it must begin and end.
    zones : tuple of Zone
        Where not every motion is admitted.
    around : callable
        The surroundings of some obstacles, say from a store of those of the map.

    Returns
    -------
    Audit
        ``passed`` if no sample is further than 1e-7 (relative to the path driven) from the
        solver's, the last pose is within 1e-9 of the goal, reduced states and controls keep the
        model's limits, no obstacle is touched or closer than the margin, to within 1 mm, and no
        zone is entered with a motion that it does not admit.
        ``min_clearance_m`` is the least distance measured, between poses it is at most a tenth
        less; None without obstacles.
    """
    near = seen_from(plan, goal)
    driven = stretches_of(near)
    defect = defect_of(driven, model)
    scale = 1.0 + near.duration + float(np.abs(near.switching_poses).max())
    missed = distance_to(near.end, goal)
    reasons = []
    if not defect <= DEFECT_TOLERANCE * scale:
        reasons.append(f"the plan is {defect:.3g} off the model's equations")
    reasons += _off_the_goal(missed, goal)
    reasons += beyond_limits(driven, model)
    if states is not None:
        reasons += wrong_ends(near, states)
    distances = []
    place = goal.pose
    where = (margin, origin_near(place), place, plan.start_time, body_height)
    bodies = {"": footprint, **(parts or {})} if obstacles else {}
    for name, shapes in bodies.items():
        moving = carried(near, model, name) if name else near
        scene = Scene(shapes, obstacles, *where)
        least = closest(moving, scene, around)
        distances.append(least.distance)
        if not least.distance > too_close(margin):
            what = f"the {name}: " if name else ""
            reasons.append(what + what_is_hit(moving, scene, least.time))
    reasons += zones_broken(near, driven, model, footprint=footprint, zones=zones, place=place)
    return Audit(
        passed=not reasons,
        max_dynamics_defect=defect,
        min_clearance_m=min(filter(math.isfinite, distances), default=None),
        terminal_position_m=missed.position_m,
        terminal_heading_rad=missed.heading_rad,
        reason="; ".join(reasons),
    )


def _off_the_goal(missed: TerminalError, goal: Goal) -> list[str]:
    """How far the end is beyond the goal's tolerance."""
    reasons = []
    if not missed.position_m <= goal.tolerance_m + TERMINAL_TOLERANCE:
        reasons.append(f"it ends {missed.position_m:.3g} m from the goal")
    if not (goal.free_heading or missed.heading_rad <= goal.tolerance_rad + TERMINAL_TOLERANCE):
        reasons.append(f"its last heading is {missed.heading_rad:.3g} rad off")
    return reasons
