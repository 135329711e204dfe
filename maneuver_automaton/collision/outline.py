"""Polygons as shapely knows them: valid, and with nothing solid lost."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.shapes import Box, Polygon

LOST = 1e-9  # share of a part's area, that a union may lose


def outlines(shape: Polygon | Box) -> list[Any]:
    """Valid shapely polygons that together are the shape.

    A ring that crosses or touches itself is cut into its faces: those it runs around are solid,
    once or several times, in either direction. Repeated corners and spikes without width vanish.
    """
    solid = solid_parts(shape)
    if not solid:
        raise ValueError(
            f"polygon: got {len(shape.corners)} corners around no area, near "
            f"({shape.corners[0, 0]:.6g}, {shape.corners[0, 1]:.6g}); need corners that are not "
            "all on one line"
        )
    return solid


def outlines_of(polygons: Sequence[Polygon]) -> list[list[Any]]:
    """The `outlines` of each of some polygons: those that are valid are made all at once."""
    import shapely

    if not polygons:
        return []
    numbers = np.repeat(np.arange(len(polygons)), [len(one.corners) for one in polygons])
    rings = shapely.linearrings(np.concatenate([one.corners for one in polygons]), indices=numbers)
    wholes = shapely.polygons(rings)
    plain = shapely.is_valid(wholes) & (shapely.area(wholes) > 0.0)
    every = zip(polygons, wholes, plain.tolist(), strict=True)
    return [[whole] if ok and not one.holes else outlines(one) for one, whole, ok in every]


def solid_parts(shape: Polygon | Box) -> list[Any]:
    """As `outlines`; none if the polygon has no area."""
    import shapely

    if isinstance(shape, Box):
        return [shapely.Polygon(shape.corners)]
    whole = shapely.Polygon(shape.corners, shape.holes)
    if not whole.is_valid:
        whole = united(_faces(shape.corners))
        for hole in shape.holes:
            whole = shapely.difference(whole, united(_faces(hole)))
    parts = shapely.get_parts(whole)
    return [part for part in parts if part.geom_type == "Polygon" and part.area > 0.0]


def united(parts: Iterable[Any]) -> Any:
    """One geometry of all parts: united in turn where uniting them at once loses some of them."""
    import shapely

    every = np.array(list(parts), dtype=object)
    whole = shapely.union_all(every)
    areas = shapely.area(every)
    if abs(areas.sum() - whole.area) <= LOST * areas.sum():
        return whole  # none lies over another, and all are there
    shapely.prepare(whole)
    left = ~shapely.covers(whole, every)  # few, and soon told: a difference takes long
    lost = shapely.area(shapely.difference(every[left], whole)) > LOST * areas[left]
    return functools.reduce(shapely.union, every) if lost.any() else whole


def rings_of(polygon: Any) -> list[Array]:
    """Corners (n, 2) of the outer ring of a valid polygon, then of its holes, none repeated."""
    import shapely

    rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
    return [ring[1:][(ring[1:] != ring[:-1]).any(axis=1)] for ring in rings]


def _faces(ring: Array) -> list[Any]:
    """Faces of the plane that a closed line runs around at least once."""
    import shapely

    line = shapely.LineString(np.vstack([ring, ring[:1]]))
    cut = shapely.node(line)
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(cut)))
    return [face for face in faces if _turns_around(ring, face.representative_point()) != 0]


def _turns_around(ring: Array, point: Any) -> int:
    """How often a closed line runs around a point that is not on it."""
    to = ring - [point.x, point.y]
    after = np.roll(to, -1, axis=0)
    cross = to[:, 0] * after[:, 1] - to[:, 1] * after[:, 0]
    return round(float(np.arctan2(cross, (to * after).sum(axis=1)).sum() / (2.0 * np.pi)))


def blocked_rectangles(blocked: NDArray[np.bool_]) -> IntArray:
    """Rectangles (n, 4) of cells [low column, low row, high column, high row), none twice.

    Runs of blocked cells, joined with the run below where that has the same ends.
    """
    rows, columns = blocked.shape
    padded = np.zeros((rows, columns + 2), dtype=np.int8)
    padded[:, 1:-1] = blocked
    edge = np.diff(padded, axis=1)
    row, first = np.nonzero(edge == 1)
    _, last = np.nonzero(edge == -1)
    if not row.size:
        return np.zeros((0, 4), dtype=np.int64)
    order = np.lexsort((row, last, first))
    row, first, last = row[order], first[order], last[order]
    joined = (np.diff(first) == 0) & (np.diff(last) == 0) & (np.diff(row) == 1)
    begins = np.flatnonzero(np.append(True, ~joined))
    ends = np.append(begins[1:], row.size) - 1
    boxes = np.stack([first[begins], row[begins], last[begins], row[ends] + 1], axis=1)
    return boxes[np.lexsort((boxes[:, 0], boxes[:, 1]))].astype(np.int64)
