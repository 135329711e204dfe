"""Independent check of a finished plan: an ODE solver drives it again, step by step.

Nothing of the search is used: no group formula, no trim, no closed form. The model's equations
are integrated under the plan's controls, and every pose of the plan is compared with them. The
distance to the obstacles is measured by another library than the one that checked the motions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import AnyObstacle, Shape
from maneuver_automaton.collision.approach import Approach, closest_approach
from maneuver_automaton.collision.blocked import too_close, touched_near
from maneuver_automaton.collision.checker import origin_near
from maneuver_automaton.collision.surroundings import fastest_point, parts_of, surroundings_of
from maneuver_automaton.models import Model
from maneuver_automaton.models.state import vector_field
from maneuver_automaton.problem import Goal

DEFECT_TOLERANCE = 1e-7  # [m, rad] between plan and ODE solver, per metre, radian, second driven
TERMINAL_TOLERANCE = 1e-9  # [m, rad] of the last pose, beyond the goal's own tolerance
CLEARANCE_TOLERANCE = 1e-3  # [m] no overlap between poses is deeper
FIRST_POSES = 8  # of every trim, to measure distances at


@dataclass(frozen=True, slots=True, kw_only=True)
class TerminalError:
    """Distance to the goal, and absolute heading difference modulo a full turn."""

    position_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Audit:
    """What the audit of one plan found."""

    passed: bool
    max_dynamics_defect: float  # [m, rad, model's units] worst difference to the ODE solver
    min_clearance_m: float | None
    terminal_position_m: float
    terminal_heading_rad: float
    reason: str = ""


def terminal_error(plan: Plan, goal: Goal) -> TerminalError:
    """How far a plan's last pose is from a goal, computed from the goal's place.

    Examples
    --------
    >>> terminal_error(Plan([1.0, 0.0, 0.0], (), durations=[]), Goal(pose=[1.0, 2.0, 0.0]))
    TerminalError(position_m=2.0, heading_rad=0.0)
    """
    return _distance(_seen_from(plan, goal).end, goal)


def audit_plan(
    plan: Plan,
    goal: Goal,
    model: Model,
    *,
    footprint: tuple[Shape, ...] = (),
    obstacles: tuple[AnyObstacle, ...] = (),
    margin: float = 0.0,
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
    obstacles : tuple of Obstacle or OccupancyMap
        What it must not touch.
    margin : float
        Distance to keep [m].

    Returns
    -------
    Audit
        ``passed`` if no sample is further than 1e-7 (relative to the way driven) from the solver's,
        the last pose is within 1e-9 of the goal, and no obstacle is touched or closer than the
        margin, to within 1 mm. ``min_clearance_m`` is the least distance measured, between poses
        it is at most a tenth less; None without obstacles.
    """
    near = _seen_from(plan, goal)
    defect = _defect(near, model)
    scale = 1.0 + near.duration + float(np.abs(near.switching_poses).max())
    missed = _distance(near.end, goal)
    reasons = []
    if not defect <= DEFECT_TOLERANCE * scale:
        reasons.append(f"the plan is {defect:.3g} off the model's equations")
    if not missed.position_m <= goal.tolerance_m + TERMINAL_TOLERANCE:
        reasons.append(f"it ends {missed.position_m:.3g} m from the goal")
    if not (goal.free_heading or missed.heading_rad <= goal.tolerance_rad + TERMINAL_TOLERANCE):
        reasons.append(f"its last heading is {missed.heading_rad:.3g} rad off")
    clearance = None
    if obstacles:
        place, clock = goal.pose[:2], plan.start_time
        scene = _Scene(footprint, obstacles, margin, origin_near(place), place, clock)
        least = _closest(near, scene)
        clearance = least.distance if math.isfinite(least.distance) else None
        if not least.distance > too_close(margin):
            reasons.append(_what_is_hit(near, scene, least.time))
    return Audit(
        passed=not reasons,
        max_dynamics_defect=defect,
        min_clearance_m=clearance,
        terminal_position_m=missed.position_m,
        terminal_heading_rad=missed.heading_rad,
        reason="; ".join(reasons),
    )


class _Pieces(NamedTuple):
    """Stretches between samples of a plan, each with the trim it belongs to."""

    begins: Array  # (n, dof)
    ends: Array  # (n, dof)
    lengths: Array  # (n,) [s]
    trims: list[int]


class _Scene(NamedTuple):
    """What a plan must not touch."""

    footprint: tuple[Shape, ...]
    obstacles: tuple[AnyObstacle, ...]
    margin: float  # [m]
    origin: tuple[float, float]  # where obstacles are counted from [m]
    place: Array  # (2,) where the plan is counted from [m]
    clock: float  # [s] when it starts

    def seen(self, plan: Plan, times: Array) -> Array:
        """Poses (n, 3) of the plan at times since its start, counted from the origin."""
        poses = plan.pose_at(times)[..., :3].copy()
        poses[..., :2] += self.place - self.origin
        return poses


def _defect(plan: Plan, model: Model) -> float:
    """How far the model's equations lead from sample to sample of the plan, added up.

    Each stretch begins at the plan's own pose. All are driven at once, every one in its own unit of
    time, so that the solver takes a few steps for the whole plan.

    Source: Hairer, Nørsett, Wanner (1993), *Solving Ordinary Differential Equations I*, Sec. II.5
    (Dormand-Prince 8(5,3), by SciPy).
    """
    from scipy.integrate import solve_ivp

    pieces = _pieces_of(plan)
    if not pieces.trims:
        return 0.0
    driven = [plan.trims[k] for k in pieces.trims]
    controls = np.array([trim.control for trim in driven])
    reduced = np.array([trim.reduced_state for trim in driven])
    dof = plan.start.size
    begins, ends = pieces.begins.copy(), pieces.ends.copy()
    places = [0, 1, *range(3, dof)]
    ends[:, places] -= begins[:, places]
    begins[:, places] = 0.0
    start = np.concatenate([begins, reduced], axis=1)
    f = vector_field(model)

    def rates(_: float, states: Array) -> Array:
        return (f(states.reshape(start.shape), controls) * pieces.lengths[:, None]).ravel()

    solution = solve_ivp(rates, (0.0, 1.0), start.ravel(), method="DOP853", rtol=1e-11, atol=1e-12)
    if not solution.success:
        raise ValueError(
            f"audit: the solver stopped at {solution.t[-1]:.6g} of 1: {solution.message}"
        )
    reached = solution.y[:, -1].reshape(start.shape)
    expected = np.concatenate([ends, reduced], axis=1)
    jumps = np.abs(np.diff(reduced, axis=0))
    return float(
        np.abs(reached - expected).max(axis=1).sum() + jumps.max(axis=1, initial=0.0).sum()
    )


def _pieces_of(plan: Plan) -> _Pieces:
    times: list[Array] = []
    owners: list[int] = []
    for k, trim in enumerate(plan.trims):
        begin, end = plan.switching_times[k], plan.switching_times[k + 1]
        if end - begin > 1e-12:  # shorter ones lead nowhere
            times.append(np.linspace(begin, end, _samples(trim.body_velocity, end - begin)))
            owners += [k] * (times[-1].size - 1)
    begins = np.concatenate([np.zeros(0), *(row[:-1] for row in times)])
    ends = np.concatenate([np.zeros(0), *(row[1:] for row in times)])
    return _Pieces(plan.pose_at(begins), plan.pose_at(ends), ends - begins, owners)


def _closest(plan: Plan, scene: _Scene) -> Approach:
    """When the plan is closest to an obstacle."""
    around = surroundings_of(scene.obstacles, scene.origin)
    body = parts_of(scene.footprint)

    def distances(times: Array) -> Array:
        return around.nearest(body, scene.seen(plan, times), scene.clock + times).distance

    if not plan.trims:
        return Approach(0.0, float(distances(np.zeros(1))[0]))
    steps = plan.durations[:, None] * np.arange(FIRST_POSES) / FIRST_POSES
    times = np.append(plan.switching_times[:-1, None] + steps, plan.switching_times[-1])
    twists = np.array([trim.body_velocity[:3] for trim in plan.trims])
    rates = np.repeat(fastest_point(body, twists) + around.speed, FIRST_POSES)
    return closest_approach(
        distances,
        times,
        rates,
        resolution=CLEARANCE_TOLERANCE,
        enough=too_close(scene.margin),
    )


def _what_is_hit(plan: Plan, scene: _Scene, time: float) -> str:
    what = touched_near(
        scene.footprint,
        scene.obstacles,
        scene.seen(plan, np.array([time]))[0],
        time=scene.clock + time,
        margin=scene.margin,
        origin=scene.origin,
    )
    return f"at {scene.clock + time:.6g} s {what}"


def _seen_from(plan: Plan, goal: Goal) -> Plan:
    """The plan with the goal's place as origin and from time 0: no digit is lost."""
    start = np.array(plan.start)
    places = [0, 1, *range(3, start.size)]
    start[places] -= goal.pose[places]
    return replace(plan, start=start, start_time=0.0)


def _distance(end: Array, goal: Goal) -> TerminalError:
    places = [0, 1, *range(3, end.size)]
    heading = 0.0 if goal.free_heading else float(abs(wrapped(end[2] - goal.pose[2])))
    return TerminalError(
        position_m=float(np.linalg.norm(end[places])),
        heading_rad=heading,
    )


def _samples(body_velocity: Array, duration: float) -> int:
    """Samples of one trim: every radian and every metre, two at least, a hundred at most."""
    way = float(np.linalg.norm(body_velocity)) * duration
    return 2 + min(98, int(np.ceil(way)))
