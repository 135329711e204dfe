"""Solids between two heights: what a mesh library needs to see an overlap in the plane.

Meshes are skins. A body stands from 0 to 1, an obstacle from 1/2 to 3/2, and each has the one lid
that lies inside the other's heights: where two solids overlap in the plane, a wall crosses a wall
or a lid, one inside the other included; where they do not, nothing touches.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.outline import outlines, rings_of
from maneuver_automaton.collision.rectangles import blocked_rectangles
from maneuver_automaton.collision.shapes import AnyObstacle, Disc, OccupancyMap, Shape
from maneuver_automaton.groups import SE2

POINT = 1e-9  # [m] half the side of the square that stands for a vehicle without a footprint


class Skin(NamedTuple):
    """Triangles: walls, and one lid."""

    vertices: Array  # (n, 3) [m]
    triangles: IntArray  # (m, 3)


def body_pieces(footprint: tuple[Shape, ...], *, margin: float, excess: float) -> tuple[Array, ...]:
    """Convex polygons (n, 2) that cover a footprint grown by `margin` [m], and little more.

    Parameters
    ----------
    footprint : tuple of Shape
        Parts of the body; empty for a point.
    margin : float
        How far to grow [m].
    excess : float
        How far round corners may stand out at most [m].

    Examples
    --------
    >>> from maneuver_automaton.collision.shapes import Box
    >>> (square,) = body_pieces((Box([2.0, 2.0]),), margin=0.5, excess=1e-3)
    >>> bool(np.hypot(*(square - 1.0).T).min() > 0.49), square.max().round(2).item()
    (True, 1.5)
    """
    round_corners = circumscribed(np.zeros(2), margin, excess) if margin > 0.0 else np.zeros((1, 2))
    if not footprint:
        point = POINT * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        return (_grown(point, round_corners),)
    pieces: list[Array] = []
    for shape in footprint:
        if isinstance(shape, Disc):
            pieces.append(circumscribed(shape.center, shape.radius + margin, excess))
        else:
            pieces += [_grown(part, round_corners) for part in _convex_parts(shape)]
    return tuple(pieces)


def circumscribed(center: Array, radius: float, excess: float) -> Array:
    """Corners (n, 2) of a regular polygon around a disc, none further than `excess` [m] from it.

    Examples
    --------
    >>> around = circumscribed(np.zeros(2), 1.0, 1e-3)
    >>> len(around), bool(np.hypot(*around.T).max() <= 1.0 + 1e-3)
    (71, True)
    """
    corners = max(8, math.ceil(math.pi / math.acos(radius / (radius + excess))))
    angle = 2.0 * math.pi / corners * np.arange(corners)
    reach = radius / math.cos(math.pi / corners)
    return center + reach * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def convex_hull(points: Array) -> Array:
    """Corners (m, 2) of the convex hull of points (n, 2) that are not all on one line."""
    import shapely

    return shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(points)))[:-1]


def body_skin(pieces: Iterable[Array]) -> Skin:
    """Skin of convex polygons, from height 0 to a lid at 1."""
    return joined([_skin([piece], _fan(piece), 0.0, 1.0, lid=1.0) for piece in pieces])


def obstacle_skin(obstacle: AnyObstacle, *, excess: float) -> Skin:
    """Skin of an obstacle in its own frame, from a lid at height 1/2 to 3/2.

    A disc stands out by at most `excess` [m].

    Examples
    --------
    >>> from maneuver_automaton.collision.shapes import Box, Obstacle
    >>> skin = obstacle_skin(Obstacle(Box([1.0, 1.0])), excess=1e-3)
    >>> skin.vertices.shape, skin.triangles.shape
    ((22, 3), (10, 3))
    """
    if isinstance(obstacle, OccupancyMap):
        return _map_skin(obstacle)
    shape = obstacle.shape
    if isinstance(shape, Disc):
        ring = circumscribed(shape.center, shape.radius, excess)
        return _obstacle_skin([ring], _fan(ring))
    return joined([_obstacle_skin(rings_of(part), _lid(part)) for part in outlines(shape)])


def joined(skins: list[Skin]) -> Skin:
    """Several skins as one."""
    first = np.cumsum([0, *(len(skin.vertices) for skin in skins)])
    shifted = [skin.triangles + n for skin, n in zip(skins, first, strict=False)]
    vertices = np.concatenate([np.zeros((0, 3)), *(skin.vertices for skin in skins)])
    return Skin(vertices, np.concatenate([np.zeros((0, 3), dtype=np.int64), *shifted]))


def _grown(part: Array, corners: Array) -> Array:
    """Minkowski sum of two convex polygons."""
    return convex_hull((part[:, None] + corners).reshape(-1, 2))


def _convex_parts(shape: Any) -> list[Array]:
    """Convex polygons that together are a shape: itself, or triangles."""
    parts: list[Array] = []
    for polygon in outlines(shape):
        hull = polygon.convex_hull
        whole = not polygon.interiors and hull.area - polygon.area <= 1e-12 * hull.area
        parts += rings_of(hull) if whole else list(_lid(polygon))
    return parts


def _obstacle_skin(rings: list[Array], lid: Array) -> Skin:
    return _skin(rings, lid, 0.5, 1.5, lid=0.5)


def _skin(rings: list[Array], cover: Array, low: float, high: float, *, lid: float) -> Skin:
    """Walls over closed lines (n, 2), and triangles (m, 3, 2) at the height `lid`."""
    begins = np.concatenate(rings)
    ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    return _walls_and_lid(begins, ends, cover, low, high, lid)


def _walls_and_lid(
    begins: Array, ends: Array, cover: Array, low: float, high: float, lid: float
) -> Skin:
    n, m = len(begins), 3 * len(cover)
    places = np.concatenate([begins, ends, begins, ends, cover.reshape(-1, 2)])
    heights = np.repeat([low, high, lid], [2 * n, 2 * n, m])
    i = np.arange(n)
    walls = np.concatenate(
        [np.stack([i, i + n, i + 3 * n], 1), np.stack([i, i + 3 * n, i + 2 * n], 1)]
    )
    lids = 4 * n + np.arange(m).reshape(-1, 3)
    return Skin(np.column_stack([places, heights]), np.concatenate([walls, lids]))


def _fan(ring: Array) -> Array:
    """Triangles (n - 2, 3, 2) of a convex polygon."""
    n = len(ring) - 2
    return np.stack([np.broadcast_to(ring[0], (n, 2)), ring[1:-1], ring[2:]], axis=1)


def _lid(polygon: Any) -> Array:
    """Triangles (n, 3, 2) that cover a valid polygon."""
    import shapely

    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    missed = polygon.area - shapely.area(triangles).sum()
    if abs(missed) > 1e-9 * polygon.area:
        raise ValueError(
            f"polygon: {missed:.3g} m^2 of {polygon.area:.3g} m^2 were lost in triangles; need "
            "corners further apart"
        )
    return shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]


def _map_skin(one: OccupancyMap) -> Skin:
    """Walls where blocked cells meet free ones, a lid of rectangles."""
    boxes = blocked_rectangles(one.blocked)
    across = _edges(one.blocked)  # rows are lines of the grid
    along = _edges(one.blocked.T)
    starts = np.concatenate([across[:, [1, 0]], along[:, [0, 1]]])
    stops = np.concatenate([across[:, [2, 0]], along[:, [0, 2]]])
    cover = boxes[:, [[0, 1], [2, 1], [2, 3], [0, 1], [2, 3], [0, 3]]].reshape(-1, 2)
    cells = np.concatenate([starts, stops, cover]).astype(np.float64)
    places = SE2(one.origin).act(one.resolution * cells)
    n = len(starts)
    return _walls_and_lid(
        places[:n], places[n : 2 * n], places[2 * n :].reshape(-1, 3, 2), 0.5, 1.5, 0.5
    )


def _edges(blocked: Any) -> IntArray:
    """Runs (n, 3) along the rows where blocked meets free: line, first cell, last cell + 1."""
    rows, columns = blocked.shape
    padded = np.zeros((rows + 2, columns + 2), dtype=np.int8)
    padded[1:-1, 1:-1] = blocked
    edge = np.zeros((rows + 1, columns + 2), dtype=np.int8)
    edge[:, 1:-1] = padded[1:, 1:-1] != padded[:-1, 1:-1]
    step = np.diff(edge, axis=1)
    line, first = np.nonzero(step == 1)
    _, last = np.nonzero(step == -1)
    return np.stack([line, first, last], axis=1).astype(np.int64)
