"""Obstacles, bounds, zones and ground: the paths around shapes, and how they are drawn."""

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
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.collision import AnyObstacle, Disc, Motion, Obstacle, OccupancyMap, Shape
from maneuver_automaton.collision.outline import blocked_rectangles, outlines, rings_of
from maneuver_automaton.collision.shapes import as_obstacles
from maneuver_automaton.collision.zones import Zone
from maneuver_automaton.groups import SE2
from maneuver_automaton.places import Ground
from maneuver_automaton.plotting.colors import GREY, Color, shaded
from maneuver_automaton.plotting.style import Entries, dashed_handle
from maneuver_automaton.problem import Bounds

ZONE: Color = (0.76, 0.56, 0.02)
GROUND: Color = (0.35, 0.55, 0.20)
MOST_SHADE = 0.3  # of the dearest ground
HATCHES = ("//", "\\\\", "xx", "..", "--", "||")  # of zones that ask for different things
DASHES = (0, (6.0, 3.0))
FAR_M = 1e6  # a side without a limit is drawn so far, and cut off by the picture


def draw_limits(ax: Axes, zones: Sequence[Zone], bounds: Bounds) -> dict[str, Any]:
    """Draw zones hatched, and the bounds of the pose dashed, on `ax`, which keeps its limits."""
    artists: dict[str, Any] = {
        f"zone {k}": PathCollection(
            [shape_path(one.shape) for one in alike], facecolors=[(*ZONE, 0.10)],
            edgecolors=[(*ZONE, 0.65)], linewidths=0.8, hatch=HATCHES[k % len(HATCHES)],
            zorder=0.8,
        )
        for k, alike in enumerate(_alike(zones).values())
    }  # fmt: skip
    artists["bounds"] = LineCollection(
        bound_lines(bounds), colors=[GREY], linewidths=1.1, linestyles=[DASHES], zorder=0.9
    )
    for part in artists.values():
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


def turning(ring: Array, *, left: bool) -> Array:
    """The ring (n, 2) in the direction asked for."""
    to = ring - ring[0]
    after = np.roll(to, -1, axis=0)
    area = float((to[:, 0] * after[:, 1] - to[:, 1] * after[:, 0]).sum())
    return ring if (area > 0.0) == left else ring[::-1]


SOLID: Color = (0.36, 0.38, 0.42)
MOVING: Color = (0.44, 0.22, 0.58)
ROBOT: Color = (0.90, 0.58, 0.05)  # the vehicle, at the times at which moving obstacles are shown
PALEST, DARKEST = 0.72, -0.15  # of moving obstacles, at the first of several times and at the last
TRACK_POINTS, TURN_RAD = 60, 0.05  # of a track at least, and between two of them on an arc at most
THERE_ALPHA, GONE_ALPHA = 0.62, 0.08  # of a moving obstacle while it is there, and while it is not
SLACK_S = 1e-9
MOST_STEPS = 5  # between the times at which moving obstacles are shown


@dataclass(frozen=True, slots=True, eq=False)
class MovingShape:
    """The path around a moving shape, in its own frame."""

    path: Path
    motion: Motion
    presence: tuple[float, float]  # from when until when it is there [s]

    def there(self, time: float) -> bool:
        """Whether it is there at `time` [s]."""
        return self.presence[0] - SLACK_S <= time <= self.presence[1] + SLACK_S

    def at(self, time: float) -> Path:
        """Where it is at `time` [s]."""
        return Path(SE2(self.motion.at(time)).act(np.asarray(self.path.vertices)), self.path.codes)

    def track(self, begin: float, end: float) -> Array:
        """Places (n, 2) of its middle between two times [m]."""
        corners = self.motion.times_for_lines(TURN_RAD)
        corners = corners[(corners > begin) & (corners < end)]
        times = np.union1d(np.linspace(begin, end, TRACK_POINTS), corners)
        box = self.path.get_extents()
        middle = np.array([0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1)])
        return np.asarray(SE2(self.motion.at(times)).act(middle))


def draw_obstacles(
    ax: Axes,
    obstacles: AnyObstacle | Sequence[AnyObstacle],
    *,
    time: ArrayLike | None = None,
    fleeting: bool = False,
) -> dict[str, Any]:
    """Draw `obstacles` on `ax`, which keeps its limits.

    Static obstacles are dark grey, moving ones violet, at several times the darker the later, over
    its track from the first time to the last. One that is not there at a time is faint, its edge
    dashed.

    Parameters
    ----------
    ax : Axes
        Where to draw.
    obstacles : obstacle, map, shape, or a sequence of these
        What to draw; margins are not drawn.
    time : array_like, optional
        One time or several in a row [s]; if left out, where each motion begins, over its whole
        track.
    fleeting : bool
        Whether what moves is there only while its motion lasts; it has no track then.

    Returns
    -------
    dict of str to Artist
        The artists, by what they show: "obstacles", a path for each; "map 0" and so on; "traffic",
        a path for each moving shape, time by time; and its "tracks" in between.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from maneuver_automaton.collision import Box, Disc
    >>> there = Obstacle(Disc(0.3), motion=Motion([0.0, 1.0], [[0, 0, 0], [2, 0, 0]]))
    >>> artists = draw_obstacles(Figure().add_subplot(), [Box([1.0, 2.0]), there], time=[0.0, 0.5])
    >>> len(artists["obstacles"].get_paths()), len(artists["traffic"].get_paths())
    (1, 2)
    """
    known = as_obstacles(obstacles)
    moving = moving_shapes(known, fleeting=fleeting)
    if time is None:
        shown = [one.at(float(one.motion.time[0])) for one in moving]
        there = [True] * len(shown)
        tracks = [one.track(*one.motion.time[[0, -1]].tolist()) for one in moving]
        colors = [MOVING] * len(shown)
    else:
        times = np.atleast_1d(as_array("obstacles: time", time))
        shades = zip(times.tolist(), moment_colors(len(times)), strict=True)
        rows = [(one, t, color) for t, color in shades for one in moving]
        rows = [row for row in rows if not fleeting or row[0].there(row[1])]
        shown = [one.at(t) for one, t, _ in rows]
        there = [one.there(t) for one, t, _ in rows]
        tracks = (
            [] if fleeting else [one.track(float(times[0]), float(times[-1])) for one in moving]
        )
        colors = [color for *_, color in rows]
    # Moving shapes, each in its colour, and whether each is there.
    drawn = PathCollection(shown, linewidths=0.7, zorder=1.9)
    show_presence(drawn, colors, there)
    maps = [_solid(map_paths(one)) for one in known if isinstance(one, OccupancyMap)]
    artists = {
        "obstacles": _solid([shape_path(one.shape) for one in static_shapes(known)]),
        **{f"map {k}": one for k, one in enumerate(maps)},
        "traffic": drawn,
        "tracks": LineCollection(
            tracks, colors=[(*MOVING, 0.45)], linewidths=0.8, linestyles=[(0, (4, 2))], zorder=1.3
        ),
    }
    for part in artists.values():
        ax.add_collection(part, autolim=False)
    return artists


def static_shapes(obstacles: Sequence[AnyObstacle]) -> list[Obstacle]:
    """The static shapes."""
    return [one for one in obstacles if isinstance(one, Obstacle) and one.motion is None]


def moving_shapes(obstacles: Sequence[AnyObstacle], *, fleeting: bool = False) -> list[MovingShape]:
    """The moving shapes, ready to be drawn at many times; `fleeting` as `Obstacle.lasts` has it."""
    return [
        MovingShape(shape_path(one.shape), one.motion, presence=one.lasts(fleeting=fleeting))
        for one in obstacles
        if isinstance(one, Obstacle) and one.motion is not None
    ]


def show_presence(drawn: PathCollection, colors: Sequence[Color], there: Sequence[bool]) -> None:
    """Give moving shapes their colours: faint and dashed those that are not there."""
    alphas = [THERE_ALPHA if here else GONE_ALPHA for here in there]
    edges = [1.0 if here else 0.45 for here in there]
    drawn.set_facecolor([(*color, alpha) for color, alpha in zip(colors, alphas, strict=True)])
    drawn.set_edgecolor(
        [(*shaded(color, -0.25), alpha) for color, alpha in zip(colors, edges, strict=True)]
    )
    drawn.set_linestyle(["solid" if here else (0, (3, 2)) for here in there] or ["solid"])


def round_times(begin: float, end: float, *, most: int = MOST_STEPS) -> Array:
    """A few round times (n,) [s] from `begin` to `end`, which are the first and the last."""
    if not end > begin:
        return np.array([begin])
    steps = 10.0 ** np.floor(np.log10((end - begin) / most)) * np.array([1.0, 2.0, 5.0, 10.0])
    step = steps[(end - begin) / steps <= most][0]
    inner = step * np.arange(np.floor(begin / step) + 1.0, np.ceil(end / step))
    apart = inner[(inner - begin > 0.3 * step) & (end - inner > 0.3 * step)]
    return np.array([begin, *apart.tolist(), end])


def moment_colors(count: int, *, color: Color = MOVING) -> list[Color]:
    """A shade of a colour for each of `count` times, pale to dark."""
    if count == 1:
        return [color]
    return [shaded(color, amount) for amount in np.linspace(PALEST, DARKEST, count).tolist()]


def obstacle_entries(obstacles: Sequence[AnyObstacle], times: Array) -> Entries:
    """Legend entries: obstacles, and moving ones at each of the `times` (n,) [s]."""
    entries: list[tuple[Artist, str]] = []
    moving = [one for one in obstacles if isinstance(one, Obstacle) and one.motion is not None]
    if len(moving) < len(obstacles):
        entries.append((Patch(facecolor=SOLID), "obstacle"))
    if moving:
        later = [f"at {t:.3g} s" for t in times[1:].tolist()]
        names = [f"moving, at {times[0]:.3g} s", *later] if later else ["moving"]
        entries += [
            (Patch(facecolor=(*color, THERE_ALPHA), edgecolor=shaded(color, -0.25)), name)
            for color, name in zip(moment_colors(len(times)), names, strict=True)
        ]
    if any(one.present_s is not None for one in moving):
        gone = Patch(facecolor=(*MOVING, GONE_ALPHA), edgecolor=(*MOVING, 0.6), linestyle="dashed")
        entries.append((gone, "not there at that time"))
    return entries


def _solid(paths: Sequence[Path]) -> PathCollection:
    """Static obstacles; the thin edge keeps walls of one cell visible, and hides seams."""
    return PathCollection(paths, facecolors=[SOLID], edgecolors=[SOLID], linewidths=0.4, zorder=1.0)
