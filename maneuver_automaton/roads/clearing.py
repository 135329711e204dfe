"""What a drive has to stay clear of, laid out once for the kernels: a world, and traffic."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, Shape
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.collision.outline import outlines
from maneuver_automaton.collision.world import world_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads._kernels_free import CarArrays, Clearing
from maneuver_automaton.roads._kernels_traffic import TrafficArrays
from maneuver_automaton.roads.land import obstacles_in
from maneuver_automaton.roads.lanelets import Lanelet, drivable_area
from maneuver_automaton.roads.scene import RoadScene, unwrapped
from maneuver_automaton.roads.vehicle import RoadVehicle

SIMPLER = 0.005  # [m] by which the edge of the road may be drawn more simply
STRIP = 6.0  # [m] of land along the edge: more than the car is wide or moves in a tick
SNUG = 0.1  # [m] by which a rectangle may reach beyond a piece of a polygon
TINY = 1e-9  # [m] of an edge that has no direction
SHORTEST = 0.4  # [m] of a piece that is not cut any more


def clearing_of(
    scene: RoadScene,
    vehicle: RoadVehicle,
    *,
    tick: float,
    last_tick: int,
    off_edge: float,
    off_traffic: float,
) -> Clearing:
    """Land, traffic and body for the kernels.

    Parameters
    ----------
    scene, vehicle
    tick : float
        [s]; tick 0 is the start of the scene.
    last_tick : int
        Beyond it the traffic is not looked at.
    off_edge, off_traffic : float
        Distances kept from the edge of the road and from all other road users [m].
    """
    # Where the vehicle can be until the end, and nothing of a map beyond.
    far = vehicle.model.max_speed * tick * last_tick + vehicle.length
    # A world keeps one distance to all, so static obstacles are grown by what they need besides.
    more = max(off_traffic - off_edge, 0.0)
    still = [
        grown for one in scene.traffic if one.motion is None for grown in _grown(one.shape, more)
    ]
    world = world_of(
        (*land_around(scene, far=far), *still),
        (vehicle.footprint,),
        (0.0, 0.0, 0.0),
        keep=off_edge,
    )
    return Clearing(
        car=CarArrays(
            half_length=0.5 * vehicle.length,
            half_width=0.5 * vehicle.width,
            ahead=vehicle.ahead,
            reach=0.5 * math.hypot(vehicle.length, vehicle.width),
            wheelbase=vehicle.model.wheelbase,
            braking=vehicle.model.max_acceleration,
        ),
        body=world.body,
        static=world.arrays,
        keep=off_edge,
        margin=SIMPLER,
        traffic=traffic_arrays(
            scene.traffic,
            start=scene.start.time,
            tick=tick,
            last_tick=last_tick,
            margin=off_traffic,
        ),
        tick=tick,
    )


def land_around(scene: RoadScene, *, far: float) -> tuple[Obstacle, ...]:
    """What is no road, as static obstacles, no further than `far` [m] from the start.

    A strip along the edge is enough: a body that starts on the road has to cross it.
    """
    import shapely

    x, y = scene.start.middle[:2].tolist()
    around = shapely.box(x - far, y - far, x + far, y + far)
    near = [lanelet for lanelet in scene.lanelets if _meets(lanelet, around)]
    road = shapely.simplify(shapely.intersection(drivable_area(near), around), SIMPLER)
    strip = shapely.difference(shapely.buffer(road, STRIP, join_style="mitre"), road)
    return obstacles_in(strip)


def _grown(shape: Shape, by: float) -> tuple[Obstacle, ...]:
    """Static obstacles that hold all within a distance [m] of a shape."""
    import shapely

    if isinstance(shape, Disc):
        return (Obstacle(Disc(shape.radius + by, shape.center)),)
    outline = shapely.union_all(outlines(shape))
    # Corners become four chords of a quarter circle each, which is that much too small in between.
    return obstacles_in(shapely.buffer(outline, by / math.cos(math.pi / 16.0), quad_segs=4))


def _meets(lanelet: Lanelet, box: Any) -> bool:
    low_x, low_y, high_x, high_y = box.bounds
    low, high = lanelet.ring.min(axis=0), lanelet.ring.max(axis=0)
    return bool(low[0] <= high_x and low_x <= high[0] and low[1] <= high_y and low_y <= high[1])


def traffic_arrays(
    users: Sequence[Obstacle], *, start: float, tick: float, last_tick: int, margin: float
) -> TrafficArrays:
    """Moving obstacles as rectangles at the ticks from `start` [s] on; those without motion apart.

    A rectangle is as much larger as its owner leaves the straight motion between two ticks.
    """
    times: Array = start + tick * np.arange(last_tick + 2, dtype=np.float64)
    pieces = [
        (motion, place)
        for user in users
        if (motion := user.motion) is not None
        for place in rectangles_around(user.shape)
    ]
    poses = np.zeros((len(pieces), len(times), 3))
    first, last = np.zeros((2, len(pieces)), dtype=np.int64)
    half = np.zeros((len(pieces), 2))
    for m, (motion, (center, turn, size)) in enumerate(pieces):
        middle = SE2(np.append(center, turn))
        # First and last tick at which it is there: it counts from the tick before to that after.
        first[m] = math.ceil((motion.time[0] - start) / tick - 1e-6)
        last[m] = math.floor((motion.time[-1] - start) / tick + 1e-6)
        recorded = (SE2(motion.at(times)) @ middle).pose
        poses[m] = recorded
        poses[m, :, 2] = unwrapped(recorded[:, 2].tolist())
        half[m] = 0.5 * size + _off_line(motion, middle, times, poses[m], float(np.hypot(*size)))
    return TrafficArrays(
        pose=poses,
        first=first,
        last=last,
        half=half,
        reach=np.hypot(half[:, 0], half[:, 1]),
        margin=margin,
    )


Rectangle: TypeAlias = tuple[Array, float, Array]  # center, heading, size (length, width)


def rectangles_around(shape: Shape, *, snug: float = SNUG) -> list[Rectangle]:
    """Rectangles (center, heading, size) that cover a shape and reach little beyond it.

    A polygon is cut into convex pieces, and these across their length, until no corner of a
    rectangle is further than `snug` [m] from its piece, or the piece is shorter than `SHORTEST`.

    Examples
    --------
    >>> from maneuver_automaton.collision import Polygon
    >>> corner = Polygon([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]])
    >>> pieces = rectangles_around(corner)
    >>> round(float(sum(size.prod() for _, _, size in pieces)), 1)
    5.3
    """
    if isinstance(shape, Box):
        return [(np.array(shape.center), shape.heading, np.array(shape.size))]
    if isinstance(shape, Disc):
        return [(np.array(shape.center), 0.0, np.full(2, 2.0 * shape.radius))]
    return [one for ring, _ in convex_pieces(shape) for one in _snug(ring, snug)]


def _snug(ring: Array, snug: float) -> list[Rectangle]:
    """Rectangles around a convex ring (n, 2)."""
    import shapely

    piece = shapely.Polygon(ring)
    center, heading, size = _smallest(ring)
    corners = Box(size, center, heading).corners
    beyond = float(shapely.distance(shapely.points(corners), piece).max())
    if beyond <= snug or size[0] <= SHORTEST:
        return [(center, heading, size)]
    found: list[Rectangle] = []
    for side in (-1.0, 1.0):  # each half is what is on one side of the center
        ahead = side * size[0] * np.array([math.cos(heading), math.sin(heading)])
        half = Box([size[0], 2.0 * size[1]], center + 0.5 * ahead, heading)
        part = shapely.intersection(piece, shapely.Polygon(half.corners))
        if part.geom_type == "Polygon" and part.area > 0.0:
            found += _snug(np.asarray(part.exterior.coords)[:-1], snug)
    return found


def _smallest(ring: Array) -> Rectangle:
    """The smallest rectangle around a convex ring (n, 2): one of its sides is along an edge."""
    edges = np.roll(ring, -1, axis=0) - ring
    edges = edges[np.hypot(edges[:, 0], edges[:, 1]) > TINY]
    along = edges / np.hypot(edges[:, 0], edges[:, 1])[:, None]
    aside = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    u, v = ring @ along.T, ring @ aside.T
    sizes = np.stack([np.ptp(u, axis=0), np.ptp(v, axis=0)], axis=-1)
    k = int(np.argmin(sizes.prod(axis=1)))
    low_u, low_v = u[:, k].min(), v[:, k].min()
    center = (low_u + 0.5 * sizes[k, 0]) * along[k] + (low_v + 0.5 * sizes[k, 1]) * aside[k]
    long = along[k] if sizes[k, 0] >= sizes[k, 1] else aside[k]
    return center, math.atan2(long[1], long[0]), np.sort(sizes[k])[::-1].copy()


def _off_line(motion: Motion, middle: SE2, times: Array, poses: Array, size: float) -> float:
    """How far a recorded motion leaves that through its poses at the ticks [m]."""
    at = motion.time[(motion.time > times[0]) & (motion.time < times[-1])]
    if not at.size:
        return 0.0
    true = (SE2(motion.at(at)) @ middle).pose
    line = np.stack([np.interp(at, times, poses[:, k]) for k in range(3)], axis=-1)
    turned = np.remainder(true[:, 2] - line[:, 2] + np.pi, 2 * np.pi) - np.pi
    return float((np.hypot(*(true[:, :2] - line[:, :2]).T) + 0.5 * size * np.abs(turned)).max())
