"""Draw bounds of the pose, zones of some motions only, and ground that has a price."""

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
from maneuver_automaton.places import Ground
from maneuver_automaton.plotting.colors import GREY, Color
from maneuver_automaton.plotting.style import Entries, dashed_handle
from maneuver_automaton.problem import Bounds

ZONE: Color = (0.76, 0.56, 0.02)
GROUND: Color = (0.35, 0.55, 0.20)
MOST_SHADE = 0.3  # of the dearest ground
HATCHES = ("//", "\\\\", "xx", "..", "--", "||")  # of zones that ask for different things
DASHES = (0, (6.0, 3.0))
FAR_M = 1e6  # a side without a limit is drawn so far, and cut off by the picture


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LimitArtists:
    """Artists of `draw_limits`."""

    zones: tuple[PathCollection, ...]  # one for all that ask for the same
    bounds: LineCollection


def draw_limits(ax: Axes, zones: Sequence[Zone], bounds: Bounds) -> LimitArtists:
    """Draw zones hatched, and the bounds of the pose dashed, on `ax`, which keeps its limits."""
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


def draw_ground(ax: Axes, grounds: Sequence[Ground]) -> list[Artist]:
    """Shade ground that has a price, the darker the higher, on `ax`, which keeps its limits."""
    most = max((one.price for one in grounds if one.areas), default=1.0) or 1.0
    artists: list[Artist] = []
    for one in grounds:
        if one.raster is None:
            shade = (*GROUND, MOST_SHADE * one.price / most)
            areas = PathCollection(
                [shape_path(area) for area in one.areas], facecolors=[shade], linewidths=0.0,
                zorder=0.6,
            )  # fmt: skip
            artists.append(ax.add_collection(areas, autolim=False))
            continue
        values = np.asarray(one.raster.values, dtype=np.float64)
        rows, columns = values.shape
        corners = np.stack(np.meshgrid(np.arange(columns + 1), np.arange(rows + 1)), axis=-1)
        corners = SE2(one.raster.origin).act(corners * one.raster.resolution)
        span = float(np.ptp(values)) or 1.0
        shades = np.zeros((rows, columns, 4))
        shades[..., :3], shades[..., 3] = GROUND, MOST_SHADE * (values - values.min()) / span
        limits = ax.get_xlim(), ax.get_ylim()
        mesh = ax.pcolormesh(corners[..., 0], corners[..., 1], shades, zorder=0.6)
        ax.set(xlim=limits[0], ylim=limits[1])
        artists.append(mesh)
    return artists


def ground_entries(grounds: Sequence[Ground]) -> Entries:
    """Legend entries of ground that has a price: what each costs, and one for all rasters."""
    most = max((one.price for one in grounds if one.areas), default=1.0) or 1.0
    shades: dict[str, float] = {}
    for one in grounds:
        if one.raster is None:
            shades[f"ground: {one.price:g} per {one.per}"] = MOST_SHADE * one.price / most
        else:
            shades["hills" if one.raster.are_heights else "ground by a raster"] = MOST_SHADE
    return [(Patch(color=(*GROUND, shade)), name) for name, shade in shades.items()]


def limit_entries(zones: Sequence[Zone], bounds: Bounds) -> Entries:
    """Legend entries: what each kind of zone asks for, and the bounds."""
    entries: list[tuple[Artist, str]] = []
    for k, asks in enumerate(_alike(zones)):
        hatch = 2 * HATCHES[k % len(HATCHES)]
        zone = Patch(facecolor=(*ZONE, 0.10), edgecolor=(*ZONE, 0.65), hatch=hatch)
        entries.append((zone, f"zone: {asks}"))
    if bound_lines(bounds):
        entries.append((dashed_handle(GREY, DASHES, width=1.1), "bounds of the pose"))
    return entries


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
    """The path around a shape."""
    if isinstance(shape, Disc):
        return Path.circle((float(shape.center[0]), float(shape.center[1])), shape.radius)
    return region_path(outlines(shape))


def region_path(polygons: Sequence[Any]) -> Path:
    """The path around valid shapely polygons: outer rings to the left, holes to the right."""
    rings = [
        turning(ring, left=k == 0)
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


def turning(ring: Array, *, left: bool) -> Array:
    """The ring (n, 2) in the direction asked for."""
    to = ring - ring[0]
    after = np.roll(to, -1, axis=0)
    area = float((to[:, 0] * after[:, 1] - to[:, 1] * after[:, 0]).sum())
    return ring if (area > 0.0) == left else ring[::-1]
