"""How close a plan comes to obstacles, and to zones that do not admit its motion.

Distances are measured by shapely, which neither the search nor FCL uses for them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit.stretches import Stretches, course_of
from maneuver_automaton.audit.values import seen_from
from maneuver_automaton.automaton import Plan
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
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal

CLEARANCE_TOLERANCE = 1e-3  # [m] no overlap between poses is deeper
FIRST_POSES = 8  # of every trim, to measure distances at

Around: TypeAlias = Callable[[tuple[AnyObstacle, ...], tuple[float, float]], Surroundings]


class Scene(NamedTuple):
    """Obstacles around the place of a plan, and the body that keeps clear of them."""

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
    near, place = seen_from(plan, goal), goal.pose
    scene = Scene(footprint, obstacles, 0.0, origin_near(place), place, clock, (0.0, 0.0))
    least = closest(near, scene, surroundings_of, (first, last))
    return least._replace(time=clock + least.time)


def closest(
    plan: Plan,
    scene: Scene,
    around: Around,
    within: tuple[float, float] = (0.0, math.inf),
) -> Approach:
    """When the plan is closest to an obstacle, between two times since its start [s]."""
    distances, speed = _distances(plan, scene, around)
    if not plan.primitives:
        return Approach(0.0, float(distances(np.zeros(1))[0]))
    times, twists = _constant_twists(plan)
    rates = fastest_point(parts_of(scene.footprint), twists[:, :3]) + speed
    rates = np.hypot(rates, twists[:, 3:].sum(axis=1))
    first, last = max(within[0], times[0]), min(within[1], times[-1])
    cut = np.concatenate([[first], times[(times > first) & (times < last)], [last]])
    stretch = np.searchsorted(times, cut[:-1], "right") - 1
    return closest_approach(
        distances,
        cut,
        rates[np.clip(stretch, 0, len(rates) - 1)],
        resolution=CLEARANCE_TOLERANCE,
        enough=too_close(scene.margin),
    )


def _distances(plan: Plan, scene: Scene, around: Around) -> tuple[Callable[[Array], Array], float]:
    """Distances (k,) [m] at times (k,) since the start, and the greatest speed of an obstacle."""
    layers = scene.layers(plan)
    near = [around(layer.obstacles, scene.origin) for layer in layers]
    body = parts_of(scene.footprint)

    def distances(times: Array) -> Array:
        poses, clock = scene.seen(plan, times), scene.clock + times
        apart = [one.nearest(body, poses, clock).distance for one in near]
        altitudes = scene.altitudes(plan, times)
        over = [layer.clearance(altitudes, scene.height) for layer in layers]
        return np.asarray(np.min(np.hypot(apart, over), axis=0))

    return distances, max(one.speed for one in near)


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
        course = course_of(primitive)
        lengths = np.diff(course.time)
        steps = (group(course.pose[:-1]).inverse() @ group(course.pose[1:])).log()
        times.append(begin + course.time[:-1])
        twists.append(steps / np.maximum(lengths, 1e-300)[:, None])
    return np.concatenate([*times, plan.switching_times[-1:]]), np.concatenate(twists)


def what_is_hit(plan: Plan, scene: Scene, time: float) -> str:
    """A sentence on what the vehicle touches at a time since the start of the plan [s]."""
    at = np.array([time])
    near = [
        obstacle
        for layer in scene.layers(plan)
        if layer.clearance(scene.altitudes(plan, at), scene.height)[0] <= scene.margin
        for obstacle in layer.obstacles
    ]
    what = touched_near(
        scene.footprint,
        tuple(near),
        scene.seen(plan, at)[0],
        time=scene.clock + time,
        margin=scene.margin,
        origin=scene.origin,
    )
    return f"at {scene.clock + time:.6g} s {what}"


def zones_broken(
    plan: Plan,
    driven: Stretches,
    model: Model,
    *,
    footprint: tuple[Shape, ...],
    zones: tuple[Zone, ...],
    place: Array,
) -> list[str]:
    """Which zones a plan is in while it moves as they do not admit."""
    if not (zones and driven.lengths.size):
        return []
    reasons = []
    times = np.concatenate([[0.0], np.cumsum(driven.lengths)])
    group, dof = group_of(plan.start.size), plan.start.size
    steps = (group(driven.begins).inverse() @ group(driven.ends)).log().reshape(-1, dof)
    rates = fastest_point(parts_of(footprint), steps[:, :3] / driven.lengths[:, None])
    moving = [
        model.body_velocity(states, driven.controls)
        for states in (driven.states, driven.end_states)
    ]
    for zone in zones:
        admitted = zone.admits(moving[0]) & zone.admits(moving[1])
        admitted &= _named(plan, zone, 0.5 * (times[:-1] + times[1:]))
        where = (Obstacle(zone.shape),)
        scene = Scene(footprint, where, 0.0, origin_near(place), place, 0.0, (0.0, 0.0))
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
    plan: Plan, scene: Scene, times: Array, rates: Array, counted: NDArray[np.bool_]
) -> Approach:
    """When the plan is closest, in the stretches between `times` (n + 1,) that are `counted`."""
    distances, _ = _distances(plan, scene, surroundings_of)
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
