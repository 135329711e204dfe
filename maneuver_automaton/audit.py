"""Independent check of a finished plan: an ODE solver drives it again, step by step.

Nothing of the search is used: no group formula, no trim, no closed form. The model's equations
are integrated under the plan's controls, and every pose of the plan is compared with them. The
distance to the obstacles is measured by another library than the one that checked the motions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton.automaton import Plan, Trajectory
from maneuver_automaton.automaton.carried import carried
from maneuver_automaton.collision import AnyObstacle, Obstacle, Shape, Zone
from maneuver_automaton.collision.approach import Approach, closest_approach
from maneuver_automaton.collision.blocked import too_close, touched_near
from maneuver_automaton.collision.checker import origin_near
from maneuver_automaton.collision.heights import Layer, layers_of
from maneuver_automaton.collision.surroundings import (
    Surroundings,
    fastest_point,
    parts_of,
    surroundings_of,
)
from maneuver_automaton.groups import group_of
from maneuver_automaton.models import Model
from maneuver_automaton.models.state import vector_field
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.problem import Goal

DEFECT_TOLERANCE = 1e-7  # [m, rad] between plan and ODE solver, per metre, radian, second driven
LIMIT_TOLERANCE = 1e-9  # relative to the limit, at least to 1, by which a value may exceed it
TERMINAL_TOLERANCE = 1e-9  # [m, rad] of the last pose, beyond the goal's own tolerance
CLEARANCE_TOLERANCE = 1e-3  # [m] no overlap between poses is deeper
FIRST_POSES = 8  # of every trim, to measure distances at

Around: TypeAlias = Callable[[tuple[AnyObstacle, ...], tuple[float, float]], Surroundings]


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
        What it must not touch.
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
        ``passed`` if no sample is further than 1e-7 (relative to the way driven) from the solver's,
        the last pose is within 1e-9 of the goal, reduced states and controls keep the model's
        limits, no obstacle is touched or closer than the margin, to within 1 mm, and no zone is
        entered with a motion that it does not admit.
        ``min_clearance_m`` is the least distance measured, between poses it is at most a tenth
        less; None without obstacles.
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
    reasons += _beyond_limits(near, model)
    if states is not None:
        reasons += _wrong_ends(near, states)
    clearance = None
    place, clock = goal.pose, plan.start_time
    bodies = [("", near, footprint)] if obstacles else []
    if obstacles and parts:
        bodies += [(name, carried(near, model, name), shapes) for name, shapes in parts.items()]
    for name, moving, shapes in bodies:
        scene = _Scene(shapes, obstacles, margin, origin_near(place), place, clock, body_height)
        least = _closest(moving, scene, around)
        if math.isfinite(least.distance):
            clearance = min(least.distance, math.inf if clearance is None else clearance)
        if not least.distance > too_close(margin):
            what = f"the {name}: " if name else ""
            reasons.append(what + _what_is_hit(moving, scene, least.time))
    reasons += _zones_broken(near, model, footprint, zones, place)
    return Audit(
        passed=not reasons,
        max_dynamics_defect=defect,
        min_clearance_m=clearance,
        terminal_position_m=missed.position_m,
        terminal_heading_rad=missed.heading_rad,
        reason="; ".join(reasons),
    )


def closest_to(
    plan: Plan,
    obstacles: tuple[AnyObstacle, ...],
    *,
    footprint: tuple[Shape, ...],
    within: tuple[float, float] = (-math.inf, math.inf),
) -> Approach:
    """When a plan comes closest to obstacles, and their distance then [m], measured by shapely.

    Parameters
    ----------
    plan : Plan
    obstacles : tuple of Obstacle or OccupancyMap
    footprint : tuple of Shape
        Parts of the body; empty for a point.
    within : (float, float)
        First and last time that counts, on the plan's clock [s].

    Returns
    -------
    Approach
        An infinite distance if there is no obstacle, or the plan has no such time.

    Examples
    --------
    >>> from maneuver_automaton.collision import Disc
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    >>> plan = Plan([0.0, 0.0, 0.0], (ahead,), durations=[4.0])
    >>> post = (Obstacle(Disc(0.5, [3.0, 2.0])),)
    >>> closest_to(plan, post, footprint=(Disc(0.5),), within=(0.0, 3.0))
    Approach(time=3.0, distance=1.0)
    """
    goal, clock = Goal(pose=plan.end), plan.start_time
    first, last = max(within[0] - clock, 0.0), min(within[1] - clock, plan.duration)
    if not obstacles or first > last:
        return Approach(clock, math.inf)
    near, place = _seen_from(plan, goal), goal.pose
    scene = _Scene(footprint, obstacles, 0.0, origin_near(place), place, clock, (0.0, 0.0))
    least = _closest(near, scene, surroundings_of, (first, last))
    return least._replace(time=clock + least.time)


class _Pieces(NamedTuple):
    """Stretches between samples of a plan, each under one control."""

    begins: Array  # (n, dof)
    ends: Array  # (n, dof)
    lengths: Array  # (n,) [s]
    states: Array  # (n, n_z) where they begin
    end_states: Array  # (n, n_z)
    controls: Array  # (n, n_u)


class _Scene(NamedTuple):
    """What a plan must not touch."""

    footprint: tuple[Shape, ...]
    obstacles: tuple[AnyObstacle, ...]
    margin: float  # [m]
    origin: tuple[float, float]  # where obstacles are counted from [m]
    place: Array  # (dof,) the pose whose place the plan is counted from
    clock: float  # [s] when it starts
    height: tuple[float, float]  # [m] of the body

    def seen(self, plan: Plan, times: Array) -> Array:
        """Poses (n, 3) of the plan at times since its start, counted from the origin."""
        poses = plan.pose_at(times)[..., :3].copy()
        poses[..., :2] += self.place[:2] - self.origin
        return poses

    def altitudes(self, plan: Plan, times: Array) -> Array:
        """Altitudes (n,) [m] at times since the start; zero in the plane."""
        return np.asarray(plan.pose_at(times)[..., 3:].sum(axis=-1) + self.place[3:].sum())

    def layers(self, plan: Plan) -> tuple[Layer, ...]:
        """The obstacles by height, all in one in the plane."""
        return layers_of(self.obstacles, in_space=plan.start.size > 3)


def _defect(plan: Plan, model: Model) -> float:
    """How far the model's equations lead from sample to sample of the plan, added up.

    Each stretch begins at the plan's own pose. All are driven at once, every one in its own unit of
    time, so that the solver takes a few steps for the whole plan.

    Source: Hairer, Nørsett, Wanner (1993), *Solving Ordinary Differential Equations I*, Sec. II.5
    (Dormand-Prince 8(5,3), by SciPy).
    """
    from scipy.integrate import solve_ivp

    pieces = _pieces_of(plan)
    if not pieces.lengths.size:
        return 0.0
    dof = plan.start.size
    begins, ends = pieces.begins.copy(), pieces.ends.copy()
    places = [0, 1, *range(3, dof)]
    ends[:, places] -= begins[:, places]
    begins[:, places] = 0.0
    start = np.concatenate([begins, pieces.states], axis=1)
    f = vector_field(model)

    def rates(_: float, states: Array) -> Array:
        return (f(states.reshape(start.shape), pieces.controls) * pieces.lengths[:, None]).ravel()

    solution = solve_ivp(rates, (0.0, 1.0), start.ravel(), method="DOP853", rtol=1e-11, atol=1e-12)
    if not solution.success:
        raise ValueError(
            f"audit: the solver stopped at {solution.t[-1]:.6g} of 1: {solution.message}"
        )
    reached = solution.y[:, -1].reshape(start.shape)
    expected = np.concatenate([ends, pieces.end_states], axis=1)
    jumps = np.abs(pieces.states[1:] - pieces.end_states[:-1])
    return float(
        np.abs(reached - expected).max(axis=1).sum() + jumps.max(axis=1, initial=0.0).sum()
    )


def _pieces_of(plan: Plan) -> _Pieces:
    parts = [_empty_pieces(plan)]
    for k, primitive in enumerate(plan.primitives):
        begin, end = plan.switching_times[k], plan.switching_times[k + 1]
        if not end - begin > 1e-12:  # shorter ones lead nowhere
            continue
        if isinstance(primitive, Trim):
            times = np.linspace(begin, end, _samples(primitive.body_velocity, end - begin))
            rows = (times.size - 1, 1)
            states = np.tile(primitive.reduced_state, rows)
            controls = np.tile(primitive.control, rows)
            parts.append(_between(plan.pose_at(times), np.diff(times), states, states, controls))
            continue
        course = _course_of(primitive)
        group = group_of(plan.start.size)
        poses = (group(plan.switching_poses[k]) @ group(course.pose)).pose
        states = course.reduced_state
        lengths = np.diff(course.time)
        parts.append(_between(poses, lengths, states[:-1], states[1:], course.control[:-1]))
    return _Pieces(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _empty_pieces(plan: Plan) -> _Pieces:
    poses = np.zeros((0, plan.start.size))
    trim = plan.trims[0] if plan.trims else None
    states = np.zeros((0, 0 if trim is None else trim.reduced_state.size))
    controls = np.zeros((0, 0 if trim is None else trim.control.size))
    return _Pieces(poses, poses, np.zeros(0), states, states, controls)


def _between(
    poses: Array, lengths: Array, states: Array, end_states: Array, controls: Array
) -> _Pieces:
    return _Pieces(poses[:-1], poses[1:], lengths, states, end_states, controls)


def _course_of(maneuver: Maneuver) -> Trajectory:
    if maneuver.course is None:
        raise ValueError(f"maneuver {maneuver.name!r}: has no course, so it cannot be audited")
    return maneuver.course


def _beyond_limits(plan: Plan, model: Model) -> list[str]:
    """What exceeds a limit of the model, and by how much."""
    pieces = _pieces_of(plan)
    reasons: list[str] = []
    if not pieces.lengths.size:
        return reasons
    for names, limits, rows in (
        (model.reduced_names, model.reduced_limits, (pieces.states, pieces.end_states)),
        (model.control_names, model.control_limits, (pieces.controls,)),
    ):
        for k, (name, (low, high)) in enumerate(zip(names, limits, strict=True)):
            values = np.concatenate([row[:, k] for row in rows])
            excess = max(
                float((values - high).max(initial=0.0)), float((low - values).max(initial=0.0))
            )
            size = max([1.0, *(abs(limit) for limit in (low, high) if math.isfinite(limit))])
            if excess > LIMIT_TOLERANCE * size:
                reasons.append(f"{name} is {excess:.3g} beyond its limits [{low:.6g}, {high:.6g}]")
    return reasons


def _wrong_ends(plan: Plan, states: tuple[Array, Array]) -> list[str]:
    """How far the first and last reduced states are from what they must be."""
    if not plan.trims:
        return []
    reasons = []
    ends = (("begins", plan.trims[0], states[0]), ("ends", plan.trims[-1], states[1]))
    for what, trim, expected in ends:
        off = float(np.abs(trim.reduced_state - expected).max(initial=0.0))
        if off > TERMINAL_TOLERANCE:
            reasons.append(f"it {what} in trim {trim.name!r}, {off:.3g} off the reduced state")
    return reasons


def _closest(
    plan: Plan,
    scene: _Scene,
    around: Around,
    within: tuple[float, float] = (0.0, math.inf),
) -> Approach:
    """When the plan is closest to an obstacle, between two times since its start [s]."""
    layers = scene.layers(plan)
    near = [around(layer.obstacles, scene.origin) for layer in layers]
    body = parts_of(scene.footprint)

    def distances(times: Array) -> Array:
        poses, clock = scene.seen(plan, times), scene.clock + times
        apart = [one.nearest(body, poses, clock).distance for one in near]
        altitudes = scene.altitudes(plan, times)
        over = [layer.gap(altitudes, scene.height) for layer in layers]
        return np.asarray(np.min(np.hypot(apart, over), axis=0))

    if not plan.primitives:
        return Approach(0.0, float(distances(np.zeros(1))[0]))
    times, twists = _constant_twists(plan)
    rates = fastest_point(body, twists[:, :3]) + max(one.speed for one in near)
    rates = np.hypot(rates, twists[:, 3:].sum(axis=1))
    first, last = max(within[0], times[0]), min(within[1], times[-1])
    inner = times[(times > first) & (times < last)]
    cut = np.concatenate([[first], inner, [last]])
    rates = rates[np.clip(np.searchsorted(times, cut[:-1], "right") - 1, 0, len(rates) - 1)]
    times = cut
    return closest_approach(
        distances,
        times,
        rates,
        resolution=CLEARANCE_TOLERANCE,
        enough=too_close(scene.margin),
    )


def _constant_twists(plan: Plan) -> tuple[Array, Array]:
    """Times (n + 1,) [s] between which the plan's poses run with constant twists (n, dof)."""
    group = group_of(plan.start.size)
    times: list[Array] = []
    twists: list[Array] = []
    for k, primitive in enumerate(plan.primitives):
        begin, span = plan.switching_times[k], plan.primitive_durations[k]
        if isinstance(primitive, Trim):
            times.append(begin + span * np.arange(FIRST_POSES) / FIRST_POSES)
            twists.append(np.tile(primitive.body_velocity, (FIRST_POSES, 1)))
            continue
        course = _course_of(primitive)
        lengths = np.diff(course.time)
        steps = (group(course.pose[:-1]).inverse() @ group(course.pose[1:])).log()
        times.append(begin + course.time[:-1])
        twists.append(steps / np.maximum(lengths, 1e-300)[:, None])
    return np.concatenate([*times, plan.switching_times[-1:]]), np.concatenate(twists)


def _what_is_hit(plan: Plan, scene: _Scene, time: float) -> str:
    at = np.array([time])
    near = [
        obstacle
        for layer in scene.layers(plan)
        if layer.gap(scene.altitudes(plan, at), scene.height)[0] <= scene.margin
        for obstacle in layer.obstacles
    ]
    what = touched_near(
        scene.footprint,
        tuple(near),
        scene.seen(plan, np.array([time]))[0],
        time=scene.clock + time,
        margin=scene.margin,
        origin=scene.origin,
    )
    return f"at {scene.clock + time:.6g} s {what}"


def _zones_broken(
    plan: Plan, model: Model, footprint: tuple[Shape, ...], zones: tuple[Zone, ...], place: Array
) -> list[str]:
    """Which zones a plan is in while it moves as they do not admit."""
    reasons: list[str] = []
    if not (zones and plan.primitives):
        return reasons
    pieces = _pieces_of(plan)
    if not pieces.lengths.size:
        return reasons
    times = np.concatenate([[0.0], np.cumsum(pieces.lengths)])
    group, dof = group_of(plan.start.size), plan.start.size
    steps = (group(pieces.begins).inverse() @ group(pieces.ends)).log().reshape(-1, dof)
    rates = fastest_point(parts_of(footprint), steps[:, :3] / pieces.lengths[:, None])
    moving = [
        model.body_velocity(states, pieces.controls)
        for states in (pieces.states, pieces.end_states)
    ]
    for zone in zones:
        admitted = zone.admits(moving[0]) & zone.admits(moving[1])
        admitted &= _named(plan, zone, 0.5 * (times[:-1] + times[1:]))
        where = (Obstacle(zone.shape),)
        scene = _Scene(footprint, where, 0.0, origin_near(place), place, 0.0, (0.0, 0.0))
        least = _closest_while(plan, scene, times, rates, ~admitted)
        if not least.distance > too_close(0.0):
            reasons.append(
                f"at {least.time:.6g} s the vehicle moves as {zone.words} does not admit"
            )
    return reasons


def _named(plan: Plan, zone: Zone, times: Array) -> NDArray[np.bool_]:
    """Whether the names of what is driven at `times` (n,) are admitted in a zone."""
    index = np.searchsorted(plan.switching_times[1:-1], times, side="right")
    known = [
        zone.admits_names([one.name] if isinstance(one, Trim) else [one.source, one.target])
        for one in plan.primitives
    ]
    return np.array(known, dtype=np.bool_)[index]


def _closest_while(
    plan: Plan, scene: _Scene, times: Array, rates: Array, counted: NDArray[np.bool_]
) -> Approach:
    """When the plan is closest, in the stretches between `times` (n + 1,) that are `counted`."""
    around, body = surroundings_of(scene.obstacles, scene.origin), parts_of(scene.footprint)

    def distances(when: Array) -> Array:
        return around.nearest(body, scene.seen(plan, when), when).distance

    least = Approach(0.0, math.inf)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], counted, [False]]).astype(np.int8)))
    for first, last in edges.reshape(-1, 2):
        near = closest_approach(
            distances,
            times[first : last + 1],
            rates[first:last],
            resolution=CLEARANCE_TOLERANCE,
            enough=too_close(0.0),
        )
        least = min(least, near, key=lambda one: one.distance)
    return least


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
