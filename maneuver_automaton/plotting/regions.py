"""Solid shapes as paths that Matplotlib fills: holes are holes, blocked cells are merged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.path import Path

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import Disc, OccupancyMap, Shape
from maneuver_automaton.collision.outline import blocked_rectangles, outlines, rings_of
from maneuver_automaton.groups import SE2

CELLS_PER_PATH = 500  # rectangles; the renderer holds so much of one path at a time


def shape_path(shape: Shape) -> Path:
    """The path around a shape.

    Examples
    --------
    >>> from maneuver_automaton.collision import Polygon
    >>> square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    >>> path = shape_path(Polygon(square, holes=[square / 2 + 1]))
    >>> path.contains_point((0.5, 0.5)), len(path.to_polygons())
    (True, 2)
    """
    if isinstance(shape, Disc):
        return Path.circle((float(shape.center[0]), float(shape.center[1])), shape.radius)
    return region_path(outlines(shape))


def region_path(polygons: Sequence[Any]) -> Path:
    """The path around valid shapely polygons: outer rings to the left, holes to the right."""
    rings = [
        _turning(ring, left=k == 0)
        for polygon in polygons
        for k, ring in enumerate(rings_of(polygon))
    ]
    corners = [np.concatenate([ring, ring[:1]]) for ring in rings]
    codes = [[Path.MOVETO, *[Path.LINETO] * (len(ring) - 1), Path.CLOSEPOLY] for ring in rings]
    return Path(
        np.concatenate([np.zeros((0, 2)), *corners]),
        np.array([code for part in codes for code in part], dtype=Path.code_type),
    )


def map_paths(cells: OccupancyMap) -> list[Path]:
    """Paths around the blocked cells of a map, where its origin puts them; each holds many."""
    sides = cells.resolution * blocked_rectangles(cells.blocked)
    corners = SE2(cells.origin).act(sides[:, [0, 1, 2, 1, 2, 3, 0, 3, 0, 1]].reshape(-1, 5, 2))
    codes = np.array([Path.MOVETO, *[Path.LINETO] * 3, Path.CLOSEPOLY], dtype=Path.code_type)
    parts = [corners[k : k + CELLS_PER_PATH] for k in range(0, len(corners), CELLS_PER_PATH)]
    return [Path(part.reshape(-1, 2), np.tile(codes, len(part))) for part in parts]


def moved_path(path: Path, pose: Array) -> Path:
    """The path moved by a pose (3,)."""
    return Path(SE2(pose).act(np.asarray(path.vertices)), path.codes)


def _turning(ring: Array, *, left: bool) -> Array:
    """The ring (n, 2) in the direction asked for."""
    to = ring - ring[0]
    after = np.roll(to, -1, axis=0)
    area = float((to[:, 0] * after[:, 1] - to[:, 1] * after[:, 0]).sum())
    return ring if (area > 0.0) == left else ring[::-1]
