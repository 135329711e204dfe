"""Draw the limits that no body touches: the bounds of the pose, and zones of some motions only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.patches import Patch
from matplotlib.path import Path

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import Disc, OccupancyMap, Shape
from maneuver_automaton.collision.outline import blocked_rectangles, outlines, rings_of
from maneuver_automaton.collision.zones import Zone
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.colors import GREY, Color
from maneuver_automaton.plotting.style import line_handle
from maneuver_automaton.problem import Bounds

ZONE: Color = (0.76, 0.56, 0.02)
HATCHES = ("//", "\\\\", "xx", "..", "--", "||")  # of zones that ask for different things
DASHES = (0, (6.0, 3.0))
FAR_M = 1e6  # a side without a limit is drawn so far, and cut off by the picture


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LimitArtists:
    """Artists of `draw_limits`."""

    zones: tuple[PathCollection, ...]  # one for all that ask for the same
    bounds: LineCollection


def draw_limits(ax: Axes, zones: Sequence[Zone], bounds: Bounds) -> LimitArtists:
    """Draw zones hatched, and the bounds of the pose dashed, on `ax`, which keeps its limits.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from maneuver_automaton.collision import Box
    >>> school = Zone(shape=Box([10.0, 4.0]), max_speed=1.0)
    >>> drawn = draw_limits(Figure().add_subplot(), [school], Bounds(y=(-3.0, 3.0)))
    >>> len(drawn.zones), len(drawn.bounds.get_segments())
    (1, 2)
    """
    artists = LimitArtists(
        zones=tuple(
            PathCollection(
                [shape_path(one.shape) for one in alike], facecolors=[(*ZONE, 0.10)],
                edgecolors=[(*ZONE, 0.65)], linewidths=0.8, hatch=HATCHES[k % len(HATCHES)],
                zorder=0.8,
            )
            for k, alike in enumerate(_alike(zones).values())
        ),
        bounds=LineCollection(
            bound_lines(bounds), colors=[GREY], linewidths=1.1, linestyles=[DASHES], zorder=0.9
        ),
    )  # fmt: skip
    for part in (*artists.zones, artists.bounds):
        ax.add_collection(part, autolim=False)
    return artists


def limit_handles(zones: Sequence[Zone], bounds: Bounds) -> tuple[list[Artist], list[str]]:
    """Legend handles: what each kind of zone asks for, and the bounds."""
    handles: list[Artist] = [
        Patch(facecolor=(*ZONE, 0.10), edgecolor=(*ZONE, 0.65), hatch=2 * HATCHES[k % len(HATCHES)])
        for k in range(len(_alike(zones)))
    ]
    names = [f"zone: {asks}" for asks in _alike(zones)]
    if bound_lines(bounds):
        line = line_handle(GREY, width=1.1)
        line.set_linestyle(DASHES)
        handles.append(line)
        names.append("bounds of the pose")
    return handles, names


def bound_lines(bounds: Bounds) -> list[Array]:
    """Lines (2, 2) along the bounds in the plane, far where the other axis has none [m]."""
    across, up = bounds.x or (-FAR_M, FAR_M), bounds.y or (-FAR_M, FAR_M)
    lines = [np.array([[x, up[0]], [x, up[1]]]) for x in bounds.x or ()]
    return lines + [np.array([[across[0], y], [across[1], y]]) for y in bounds.y or ()]


def limit_boxes(zones: Sequence[Zone], bounds: Bounds) -> list[Array]:
    """Corners (n, 2) around each zone, and those of the bounds if they are closed [m]."""
    boxes = [np.asarray(shape_path(one.shape).get_extents().get_points()) for one in zones]
    if bounds.x and bounds.y:
        boxes.append(np.array(list(product(bounds.x, bounds.y))))
    return boxes


def _alike(zones: Sequence[Zone]) -> dict[str, list[Zone]]:
    """Zones by what they ask for."""
    groups: dict[str, list[Zone]] = {}
    for zone in zones:
        groups.setdefault(zone.asks, []).append(zone)
    return groups


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
