"""What a drive has to stay clear of, laid out once for the kernels: area, traffic, body."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision import Box, Disc, Obstacle, Shape
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads._kernels_free import (
    AreaArrays,
    BodyArrays,
    Clearing,
    TrafficArrays,
)
from maneuver_automaton.roads.lanelets import drivable_area
from maneuver_automaton.roads.scene import RoadScene, unwrapped
from maneuver_automaton.roads.vehicle import RoadVehicle

CELL = 0.2  # [m] of the field of distances
BUCKET = 4.0  # [m]
SIMPLER = 0.005  # [m] by which the edge may be drawn more simply
MOST_CELLS = 20_000_000
DISC_SPACING = 0.75  # [m]
ALWAYS = 1 << 40  # a tick that never comes


def clearing_of(
    scene: RoadScene,
    vehicle: RoadVehicle,
    *,
    tick: float,
    last_tick: int,
    off_edge: float,
    off_traffic: float,
    braking: float,
) -> Clearing:
    """Area, traffic and body for the kernels.

    Parameters
    ----------
    scene, vehicle
    tick : float
        [s]; tick 0 is the start of the scene.
    last_tick : int
        Beyond it the traffic is not looked at.
    off_edge, off_traffic : float
        Distances kept from the edge of the area and from everybody [m].
    braking : float
        Deceleration when the vehicle has to stop [m/s^2].
    """
    body = body_arrays(vehicle, tick=tick, braking=braking)
    reach = body.reach + 0.5 * tick * vehicle.model.max_speed + off_edge
    area = area_arrays(drivable_area(scene.lanelets), reach=reach, margin=off_edge)
    traffic = traffic_arrays(
        scene.traffic, start=scene.start.time, tick=tick, last_tick=last_tick, margin=off_traffic
    )
    return Clearing(body=body, area=area, traffic=traffic, tick=tick)


def body_arrays(vehicle: RoadVehicle, *, tick: float, braking: float) -> BodyArrays:
    """The body, and discs that cover it and whatever it passes within a tick.

    Discs reach back behind the body where the vehicle moves more than its length in a tick.
    """
    length = max(vehicle.length, tick * vehicle.model.max_speed + DISC_SPACING)
    n = math.ceil(length / DISC_SPACING)
    front = vehicle.ahead + 0.5 * vehicle.length
    spacing = length / n
    return BodyArrays(
        half_length=0.5 * vehicle.length,
        half_width=0.5 * vehicle.width,
        ahead=vehicle.ahead,
        reach=0.5 * math.hypot(vehicle.length, vehicle.width),
        discs=front - spacing * (np.arange(n) + 0.5),
        radius=math.hypot(0.5 * spacing, 0.5 * vehicle.width),
        wheelbase=vehicle.model.wheelbase,
        max_steering_rate=vehicle.model.max_steering_rate,
        braking=braking,
    )


def area_arrays(area: Any, *, reach: float, margin: float) -> AreaArrays:
    """Field of distances and edges of a shapely area; `reach` [m] is how far a body gets in a tick.

    Raises
    ------
    ValueError
        If the area is too large for its field.
    """
    import shapely

    low_x, low_y, high_x, high_y = area.bounds
    columns, rows = (
        int((high - low) / CELL) + 4 for low, high in ((low_x, high_x), (low_y, high_y))
    )
    if columns * rows > MOST_CELLS:
        raise ValueError(
            f"roads: the area of {high_x - low_x:.0f} m x {high_y - low_y:.0f} m is too large, "
            f"need at most {MOST_CELLS * CELL * CELL / 1e6:g} km^2"
        )
    origin = np.array([low_x - CELL, low_y - CELL])
    x = origin[0] + CELL * np.arange(columns)
    distance = np.zeros((rows, columns))
    shapely.prepare(area)
    edges = _edges(area)
    tree = shapely.STRtree(shapely.linestrings(edges.reshape(-1, 2, 2)))
    for row in range(rows):
        inside = np.flatnonzero(shapely.contains_xy(area, x, origin[1] + CELL * row))
        if inside.size:
            points = shapely.points(x[inside], origin[1] + CELL * row)
            (found, _), away = tree.query_nearest(points, return_distance=True, all_matches=False)
            distance[row, inside[found]] = away
    first, items, across, up = _buckets(edges, origin, (columns, rows), reach)
    return AreaArrays(
        distance=distance,
        origin_x=float(origin[0]),
        origin_y=float(origin[1]),
        cell=CELL,
        edges=edges,
        first=first,
        items=items,
        bucket=BUCKET,
        columns=across,
        rows=up,
        margin=margin + SIMPLER,
    )


def _edges(area: Any) -> Array:
    """Segments (K, 4) of the edge, drawn more simply."""
    import shapely

    pieces = []
    for polygon in shapely.get_parts(shapely.simplify(area, SIMPLER)):
        for ring in (polygon.exterior, *polygon.interiors):
            corners = np.asarray(ring.coords)
            pieces.append(np.concatenate([corners[:-1], corners[1:]], axis=1))
    edges = np.concatenate(pieces)
    return np.ascontiguousarray(edges[(edges[:, :2] != edges[:, 2:]).any(axis=1)])


def _buckets(
    edges: Array, origin: Array, cells: tuple[int, int], reach: float
) -> tuple[IntArray, IntArray, int, int]:
    """Segments within `reach` [m] of every bucket, row by row; numbers of columns and rows."""
    import shapely

    across, up = (int(CELL * n / BUCKET) + 1 for n in cells)
    i, j = np.meshgrid(np.arange(across), np.arange(up))
    middles = shapely.points(
        origin[0] + BUCKET * (i.ravel() + 0.5), origin[1] + BUCKET * (j.ravel() + 0.5)
    )
    tree = shapely.STRtree(shapely.linestrings(edges.reshape(-1, 2, 2)))
    near = reach + BUCKET * math.sqrt(0.5)
    place, item = tree.query(middles, predicate="dwithin", distance=near)
    order = np.lexsort((item, place))
    first = np.zeros(across * up + 1, dtype=np.int64)
    np.add.at(first, place + 1, 1)
    return np.cumsum(first), item[order].astype(np.int64), across, up


def traffic_arrays(
    users: Sequence[Obstacle], *, start: float, tick: float, last_tick: int, margin: float
) -> TrafficArrays:
    """Road users as rectangles at the ticks from `start` [s] on.

    A rectangle is as much larger as its owner leaves the straight motion between two ticks.
    """
    times: Array = start + tick * np.arange(last_tick + 2, dtype=np.float64)
    poses = np.zeros((len(users), len(times), 3))
    first = np.zeros(len(users), dtype=np.int64)
    last = np.full(len(users), ALWAYS, dtype=np.int64)
    half = np.zeros((len(users), 2))
    for m, user in enumerate(users):
        center, turn, size = _rectangle(user.shape)
        half[m] = 0.5 * size
        middle = SE2(np.append(center, turn))
        if user.motion is None:
            poses[m] = middle.pose
            continue
        first[m] = math.floor((user.motion.time[0] - start) / tick + 1e-6)
        last[m] = math.ceil((user.motion.time[-1] - start) / tick - 1e-6)
        recorded = (SE2(user.motion.at(times)) @ middle).pose
        poses[m] = recorded
        poses[m, :, 2] = unwrapped(recorded[:, 2].tolist())
        half[m] += _off_line(user, middle, times, poses[m], float(np.hypot(*size)))
    return TrafficArrays(
        pose=poses,
        first=first,
        last=last,
        half=half,
        reach=np.hypot(half[:, 0], half[:, 1]),
        margin=margin,
    )


def _rectangle(shape: Shape) -> tuple[Array, float, Array]:
    """Center, heading and size (length, width) of a rectangle around a shape."""
    if isinstance(shape, Box):
        return np.array(shape.center), shape.heading, np.array(shape.size)
    if isinstance(shape, Disc):
        return np.array(shape.center), 0.0, np.full(2, 2.0 * shape.radius)
    import shapely

    around = shapely.minimum_rotated_rectangle(shapely.Polygon(shape.corners))
    corners = np.asarray(around.exterior.coords)
    along, aside = corners[1] - corners[0], corners[2] - corners[1]
    size = np.array([np.hypot(*along), np.hypot(*aside)])
    return 0.5 * (corners[0] + corners[2]), float(np.arctan2(along[1], along[0])), size


def _off_line(user: Obstacle, middle: SE2, times: Array, poses: Array, size: float) -> float:
    """How far a user's recorded motion leaves that through its poses at the ticks [m]."""
    assert user.motion is not None
    between = (user.motion.time > times[0]) & (user.motion.time < times[-1])
    at = user.motion.time[between]
    if not at.size:
        return 0.0
    true = (SE2(user.motion.at(at)) @ middle).pose
    line = np.stack([np.interp(at, times, poses[:, k]) for k in range(3)], axis=-1)
    turned = np.remainder(true[:, 2] - line[:, 2] + np.pi, 2 * np.pi) - np.pi
    return float((np.hypot(*(true[:, :2] - line[:, :2]).T) + 0.5 * size * np.abs(turned)).max())
