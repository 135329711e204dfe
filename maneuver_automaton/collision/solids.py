"""Solids for a library of meshes, which are skins: what it needs to see an overlap in the plane.

An obstacle is a sheet at height 1/2, and two posts on each of its parts, thin triangles up to 3/2.
A body has walls from height 0 to 1, and a lid on top. If they overlap in the plane, then either
the outline of the body meets the part, and a wall cuts the sheet; this includes a body inside an
obstacle. Or the part lies inside the body, and its posts pierce the lid. If they do not overlap,
nothing touches; and the distance of the skins is that in the plane.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.collision.outline import blocked_rectangles, outlines, outlines_of
from maneuver_automaton.collision.shapes import (
    Box,
    ByKind,
    Disc,
    Polygon,
    Shape,
)
from maneuver_automaton.groups import SE2

# On a quadrilateral: its sheet, and posts on two sides, with tops above the first two corners.
QUAD: IntArray = np.array([[0, 1, 2], [0, 2, 3], [0, 1, 4], [1, 2, 5]])
POINT = 1e-9  # [m] half the side of the square that stands for a vehicle without a footprint


class Skin(NamedTuple):
    """A mesh."""

    vertices: Array  # (n, 3) [m]
    triangles: IntArray  # (m, 3)


def body_pieces(footprint: tuple[Shape, ...], *, margin: float, excess: float) -> tuple[Array, ...]:
    """Convex polygons (n, 2) that cover a footprint grown by `margin` [m], and little more."""
    round_corners = circumscribed(np.zeros(2), margin, excess) if margin > 0.0 else np.zeros((1, 2))
    if not footprint:
        return (_grown(Box([2.0 * POINT, 2.0 * POINT]).corners, round_corners),)
    pieces: list[Array] = []
    for shape in footprint:
        if isinstance(shape, Disc):
            pieces.append(circumscribed(shape.center, shape.radius + margin, excess))
        else:
            outlines(shape)  # refuses a polygon without area
            parts = [ring for ring, _ in convex_pieces(shape) if len(ring) >= 3]
            pieces += [_grown(part, round_corners) for part in parts]
    return tuple(pieces)


def circumscribed(center: Array, radius: float, excess: float) -> Array:
    """Corners (n, 2) of a regular polygon around a disc, none further than `excess` [m] from it.

    Of a huge disc, none further than a billionth of its radius.
    """
    reach = radius + max(excess, 1e-9 * radius)
    corners = max(8, math.ceil(math.pi / math.acos(radius / reach)))
    angle = 2.0 * math.pi / corners * np.arange(corners)
    reach = radius / math.cos(math.pi / corners)
    return center + reach * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def convex_hull(points: Array) -> Array:
    """Corners (m, 2) of the convex hull of points (n, 2) that are not all on one line."""
    import shapely

    normal = np.where(np.abs(points) < 1e-150, 0.0, points)  # products must not underflow
    hull = shapely.convex_hull(shapely.linestrings(normal))  # quicker than points one by one
    return np.asarray(shapely.get_coordinates(hull)[:-1])


def obstacle_skin(
    kinds: ByKind, shown: NDArray[np.bool_], *, excess: float
) -> tuple[Skin, IntArray]:
    """Sheets and posts of those obstacles (n,) that are shown, and whose each triangle is.

    Discs are by `excess` [m] too large.
    """
    wanted, few = shown.tolist(), shown[kinds.quads]
    quads = kinds.quads[few].tolist()
    others = [(k, one) for k, one in kinds.others if wanted[k]]
    discs = [(k, one) for k, one in kinds.discs if wanted[k]]
    maps = [(k, one) for k, one in kinds.maps if wanted[k]]
    parts = list(_on_polygons([one for _, one in others]))  # one for each of the rest
    for _, disc in discs:
        ring = circumscribed(disc.center, disc.radius, excess)
        first = np.broadcast_to(ring[0], (len(ring) - 2, 2))
        fan = np.stack([first, ring[1:-1], ring[2:]], axis=1)
        parts.append(_on_triangles(fan, np.zeros(1, dtype=np.int64)))
    for _, one in maps:
        rectangles = blocked_rectangles(one.blocked).astype(np.float64)
        rings = one.resolution * rectangles[:, [[0, 1], [2, 1], [2, 3], [0, 3]]]
        parts.append(_on_quads(SE2(one.origin).act(rings)))
    counts = [len(QUAD)] * len(quads) + [len(one.triangles) for one in parts]
    numbers = [*quads, *(k for k, _ in (*others, *discs, *maps))]
    owners = np.array(numbers, dtype=np.int64).repeat(counts)
    whole = _together([_on_quads(kinds.corners[few]), *parts])
    order = owners.argsort(kind="stable")
    return Skin(whole.vertices, whole.triangles[order]), owners[order]


def body_skin(pieces: Sequence[Array]) -> Skin:
    """Walls and lid over convex polygons (n, 2)."""
    vertices, triangles, first = [], [], 0
    for ring in pieces:
        n = len(ring)
        i, j = np.arange(n), np.append(np.arange(1, n), 0)
        k = np.arange(1, n - 1)
        walls = [np.stack([i, j, j + n], 1), np.stack([i, j + n, i + n], 1)]
        lid = np.stack([np.zeros_like(k), k, k + 1], 1) + n
        vertices += [_raised(ring, 0.0), _raised(ring, 1.0)]
        triangles += [first + np.concatenate([*walls, lid])]
        first += 2 * n
    return Skin(np.concatenate(vertices), np.concatenate(triangles))


def _together(parts: Sequence[Skin]) -> Skin:
    """Skins as one."""
    if len(parts) == 1:
        return parts[0]
    firsts = itertools.accumulate((len(one.vertices) for one in parts), initial=0)
    vertices = np.concatenate([one.vertices for one in parts])
    triangles = [one.triangles + n for one, n in zip(parts, firsts, strict=False)]
    return Skin(vertices, np.concatenate(triangles))


def _raised(places: Array, height: float) -> Array:
    return np.column_stack([places, np.full(len(places), height)])


def _on_quads(corners: Array) -> Skin:
    """Sheets and posts on convex quadrilaterals (k, 4, 2)."""
    vertices = np.full((len(corners), 6, 3), 0.5)
    vertices[:, :4, :2], vertices[:, 4:, :2] = corners, corners[:, :2]
    vertices[:, 4:, 2] = 1.5
    triangles = 6 * np.arange(len(corners))[:, None, None] + QUAD
    return Skin(vertices.reshape(-1, 3), triangles.reshape(-1, 3))


def _on_triangles(triangles: Array, posted: IntArray) -> Skin:
    """Sheet of triangles (m, 3, 2), and two posts on some of these, by number.

    No line holds both.
    """
    n, tops = 3 * len(triangles), triangles[posted, :2].reshape(-1, 2)
    foot, top = 3 * posted, n + 2 * np.arange(len(posted))
    posts = np.stack([foot, foot + 1, top, foot + 1, foot + 2, top + 1], axis=1).reshape(-1, 3)
    vertices = np.concatenate([_raised(triangles.reshape(-1, 2), 0.5), _raised(tops, 1.5)])
    return Skin(vertices, np.concatenate([np.arange(n).reshape(-1, 3), posts]))


def _grown(part: Array, corners: Array) -> Array:
    """Minkowski sum of two convex polygons."""
    return convex_hull((part[:, None] + corners).reshape(-1, 2))


def _on_polygons(polygons: Sequence[Polygon]) -> Iterator[Skin]:
    """Sheet of each polygon, all cut into triangles at once, and posts on one of each part."""
    import shapely

    if not polygons:
        return
    outlined = outlines_of(polygons)
    parts = np.array([part for some in outlined for part in some], dtype=object)
    triangles, of = shapely.get_parts(
        shapely.constrained_delaunay_triangles(parts), return_index=True
    )
    areas = shapely.area(parts)
    missed = areas - np.bincount(of, shapely.area(triangles), len(parts))
    for k in np.flatnonzero(np.abs(missed) > 1e-9 * areas)[:1]:
        raise ValueError(
            f"polygon: {missed[k]:.3g} m^2 of {areas[k]:.3g} m^2 were lost in triangles; need "
            "corners further apart"
        )
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    begins = np.searchsorted(of, np.arange(len(parts) + 1))
    ends = np.cumsum([0, *map(len, outlined)])
    for a, b in itertools.pairwise(ends.tolist()):
        yield _on_triangles(corners[begins[a] : begins[b]], begins[a:b] - begins[a])
