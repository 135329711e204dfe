"""What a drive has to stay clear of, laid out once for the kernels: area, traffic, body."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision import Box, Disc, Obstacle, Shape
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads._kernels_free import (
    AreaArrays,
    BodyArrays,
    Clearing,
    TrafficArrays,
)
from maneuver_automaton.roads.lanelets import Lanelet, drivable_area
from maneuver_automaton.roads.scene import RoadScene, unwrapped
from maneuver_automaton.roads.vehicle import RoadVehicle

CELL = 0.2  # [m] of the field of distances
BITS = 4
TILE = 1 << BITS  # cells along each side of a tile
SIMPLER = 0.005  # [m] by which the edge may be drawn more simply
MOST_TILES = 150_000  # of 10 m^2 each
SNUG = 0.1  # [m] by which a rectangle may reach beyond a piece of a polygon
TINY = 1e-9  # [m] of an edge that has no direction
SHORTEST = 0.4  # [m] of a piece that is not cut any more
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
    import shapely

    body = body_arrays(vehicle, tick=tick, braking=braking)
    reach = body.reach + 0.5 * tick * vehicle.model.max_speed + off_edge
    # Where the vehicle can be until the end, and nothing of a map beyond.
    far = vehicle.model.max_speed * tick * last_tick + vehicle.length
    x, y = scene.start.middle[:2].tolist()
    around = shapely.box(x - far, y - far, x + far, y + far)
    near = [lanelet for lanelet in scene.lanelets if _meets(lanelet, around)]
    drivable = shapely.intersection(drivable_area(near), around)
    area = area_arrays(drivable, reach=reach, margin=off_edge)
    traffic = traffic_arrays(
        scene.traffic, start=scene.start.time, tick=tick, last_tick=last_tick, margin=off_traffic
    )
    return Clearing(body=body, area=area, traffic=traffic, tick=tick)


def _meets(lanelet: Lanelet, box: Any) -> bool:
    low_x, low_y, high_x, high_y = box.bounds
    low, high = lanelet.ring.min(axis=0), lanelet.ring.max(axis=0)
    return bool(low[0] <= high_x and low_x <= high[0] and low[1] <= high_y and low_y <= high[1])


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

    The field is laid out in tiles, and only where the area is.

    Raises
    ------
    ValueError
        If the area is too large for its field.
    """
    import shapely

    shapely.prepare(area)
    edges = _edges(area)
    tree = shapely.STRtree(shapely.linestrings(edges.reshape(-1, 2, 2)))
    origin = np.array(area.bounds[:2]) - CELL
    tile, places = _tiles(area, origin)
    steps = CELL * np.arange(TILE + 1)
    distance = np.zeros((len(places), TILE + 1, TILE + 1))
    for k, (column, row) in enumerate(places):
        x, y = np.meshgrid(
            origin[0] + CELL * TILE * column + steps, origin[1] + CELL * TILE * row + steps
        )
        inside = np.flatnonzero(shapely.contains_xy(area, x.ravel(), y.ravel()))
        if inside.size:
            points = shapely.points(x.ravel()[inside], y.ravel()[inside])
            (found, _), away = tree.query_nearest(points, return_distance=True, all_matches=False)
            distance[k].ravel()[inside[found]] = away
    first, items = _edges_near(tree, origin, places, reach)
    return AreaArrays(
        tile=tile,
        distance=distance,
        bits=BITS,
        cell=CELL,
        origin_x=float(origin[0]),
        origin_y=float(origin[1]),
        edges=edges,
        first=first,
        items=items,
        margin=margin + SIMPLER,
    )


def _tiles(area: Any, origin: Array) -> tuple[IntArray, IntArray]:
    """Tiles (rows, columns) by their numbers, -1 where the area is not; column and row (n, 2)."""
    import shapely

    width = CELL * TILE
    low_x, low_y, high_x, high_y = area.bounds
    columns, rows = (
        int((high - low + 2.0 * CELL) / width) + 1
        for low, high in ((low_x, high_x), (low_y, high_y))
    )
    # Cut into strips first: a road around a block has the whole block as its bounding box.
    found: set[tuple[int, int]] = set()
    for column in range(columns):
        x = origin[0] + width * column
        strip = shapely.intersection(area, shapely.box(x, low_y, x + width, high_y))
        for piece in shapely.get_parts(strip):
            if piece.is_empty:
                continue
            begin, end = (int((y - origin[1]) / width) for y in piece.bounds[1::2])
            rings = shapely.box(
                x, origin[1] + width * np.arange(begin, end + 1), x + width,
                origin[1] + width * np.arange(begin + 1, end + 2),
            )  # fmt: skip
            used = np.flatnonzero(shapely.intersects(piece, rings))
            found.update((row, column) for row in (begin + used).tolist())
    if len(found) > MOST_TILES:
        raise ValueError(
            f"roads: the lanelets within reach cover {len(found)} tiles of {width:g} m x "
            f"{width:g} m, need at most {MOST_TILES}"
        )
    tile = np.full((rows, columns), -1, dtype=np.int64)
    places = np.array(sorted(found), dtype=np.int64).reshape(-1, 2)
    tile[places[:, 0], places[:, 1]] = np.arange(len(places))
    return tile, places[:, ::-1]


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


def _edges_near(
    tree: Any, origin: Array, places: IntArray, reach: float
) -> tuple[IntArray, IntArray]:
    """Segments within `reach` [m] of every tile: where those of each begin, and their numbers."""
    import shapely

    width = CELL * TILE
    middles = shapely.points(origin + width * (places + 0.5))
    near = reach + width * math.sqrt(0.5)
    place, item = tree.query(middles, predicate="dwithin", distance=near)
    order = np.lexsort((item, place))
    first = np.zeros(len(places) + 1, dtype=np.int64)
    np.add.at(first, place + 1, 1)
    return np.cumsum(first), item[order].astype(np.int64)


def traffic_arrays(
    users: Sequence[Obstacle], *, start: float, tick: float, last_tick: int, margin: float
) -> TrafficArrays:
    """Road users as rectangles at the ticks from `start` [s] on.

    A rectangle is as much larger as its owner leaves the straight motion between two ticks.
    """
    times: Array = start + tick * np.arange(last_tick + 2, dtype=np.float64)
    pieces = [(user, place) for user in users for place in rectangles_around(user.shape)]
    poses = np.zeros((len(pieces), len(times), 3))
    first = np.zeros(len(pieces), dtype=np.int64)
    last = np.full(len(pieces), ALWAYS, dtype=np.int64)
    half = np.zeros((len(pieces), 2))
    for m, (user, (center, turn, size)) in enumerate(pieces):
        half[m] = 0.5 * size
        middle = SE2(np.append(center, turn))
        if user.motion is None:
            poses[m] = middle.pose
            continue
        # First and last tick at which it is there: it counts from the tick before to that after.
        first[m] = math.ceil((user.motion.time[0] - start) / tick - 1e-6)
        last[m] = math.floor((user.motion.time[-1] - start) / tick + 1e-6)
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
