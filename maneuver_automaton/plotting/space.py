"""A flight in space: buildings as prisms, paths above their shadows, seen from above and aside."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.cast import Cast
from maneuver_automaton.plotting.colors import GREY, INK, Color, shaded
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.obstacles import shape_path, turning
from maneuver_automaton.plotting.pages import space_page
from maneuver_automaton.plotting.paths import WAY, trim_entries
from maneuver_automaton.plotting.style import SMALL_PT, TEXT_PT, Entries, line_handle, tidy
from maneuver_automaton.recording import recording_of

ELEVATION, AZIMUTH = 42.0, -68.0  # [deg] from where space is seen
LIGHT = np.array([0.42, -0.76, 0.5])  # direction from which walls are lit
BUILDING: Color = (0.72, 0.74, 0.78)
START: Color = (0.10, 0.55, 0.25)
GOAL: Color = (0.78, 0.16, 0.10)
STORY = 4.0  # [m] of walls drawn in one piece: each piece is before or behind others as a whole
STROKE = 1.0  # [m] of the path in one piece
BROAD, SHADOW, POST = 0.0055, 0.0022, 0.0012  # of the scene's size: widths of what is drawn
RIM = 0.3  # [pt] one for all: nearer faces are drawn later, line widths would not follow
POSTS = 14  # lines from the path down to the ground
HIDDEN = 0.3  # opacity of the path where a building is before it


def flies_among_heights(result: Any) -> bool:
    """Whether all fly, and among obstacles with heights, so that a plane does not show all."""
    recording = recording_of(result)
    flies = all(one.start.size > 3 for one in recording.movers)
    return flies and any(_height(one) is not None for one in recording.world.obstacles)


def space_figure(cast: Cast, lines: Sequence[str], look: Look) -> Figure:
    """The picture of a flight: in space, from above, and from the side, all to scale."""
    for one in cast.actors:
        if one.track.start.size < 4:
            name = "vehicle" if one.mover.model is None else one.mover.model.name
            raise ValueError(f"a picture in space: the {name} has no altitude")
    low, high = _box(cast)
    wide, deep, _ = (high - low).tolist()
    page = space_page(look, lines, _entries(cast), shape=wide / deep)
    draw_space(page.plane, cast)
    above, aside = page.panels
    _draw_flat(above, cast, across=1, low=low, high=high)
    _draw_flat(aside, cast, across=2, low=low, high=high)
    return page.figure


def draw_space(ax: Axes3D, cast: Cast) -> Poly3DCollection:
    """Draw a cast in space to scale: buildings, paths, their shadows on the ground, ends.

    One vehicle has the colours of its trims, several have one each. An obstacle without heights is
    as high as the picture. What comes back are walls, roofs, and strokes of paths.
    """
    low, high = _box(cast)
    faces: list[Array] = []
    inner: list[Color] = []
    rims: list[tuple[float, ...]] = []
    size, level = float((high - low).max()), math.cos(math.radians(ELEVATION))
    turned = math.radians(AZIMUTH)
    seen = [level * math.cos(turned), level * math.sin(turned), math.sin(math.radians(ELEVATION))]
    for obstacle in _standing(cast):
        bottom, top = _height(obstacle) or (low[2], high[2])
        for face, shade in _prism(obstacle, max(bottom, low[2]), min(top, high[2])):
            faces.append(face)
            inner.append(shaded(BUILDING, shade))
            rims.append((*shaded(BUILDING, -0.25), 0.5))
    for places, color, width in _strokes(cast, ground=float(low[2])):
        # A stroke (2, 3) as a face (4, 3) that is seen from the front.
        aside = np.cross(places[1] - places[0], seen)
        length = float(np.linalg.norm(aside))
        aside = 0.5 * (width * size) * aside / length if length > 0.0 else np.zeros(3)
        faces.append(
            np.array([places[0] - aside, places[1] - aside, places[1] + aside, places[0] + aside])
        )
        inner.append(color)
        rims.append((*color, 1.0))
    longest = max((len(face) for face in faces), default=0)
    collection = Poly3DCollection(
        [np.pad(face, ((0, longest - len(face)), (0, 0)), mode="edge") for face in faces],
        facecolors=inner,
        edgecolors=rims,
        linewidths=RIM,
        zsort="average",
        clip_on=False,
    )
    if faces:
        ax.add_collection3d(collection)
    path = [(places, color) for places, color, _ in _strokes(cast, ground=None)]
    if path:
        ax.add_collection3d(Line3DCollection(
            [places for places, _ in path], colors=[color for _, color in path],
            linewidths=1.6, alpha=HIDDEN, zorder=5, clip_on=False,
        ))  # fmt: skip
    for pose, color, marker in _ends(cast):
        ax.plot(
            pose[[0]], pose[[1]], pose[[3]], marker=marker, color=color, linestyle="none",
            markersize=7 if marker == "o" else 12, markeredgecolor="white", markeredgewidth=0.6,
            zorder=10, clip_on=False,
        )  # fmt: skip
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(tuple(high - low), zoom=1.32)
    ax.view_init(elev=ELEVATION, azim=AZIMUTH)
    # Faint panes and small numbers.
    for axis, name in ((ax.xaxis, "x [m]"), (ax.yaxis, "y [m]"), (ax.zaxis, "altitude [m]")):
        axis.set_label_text(name, fontsize=TEXT_PT, color=INK)
        axis.set_tick_params(labelsize=SMALL_PT, labelcolor=INK, pad=0.0)
        axis.pane.set_facecolor((0.965, 0.97, 0.975, 1.0))
        axis.pane.set_edgecolor((*GREY, 0.4))
        axis._axinfo["grid"].update(color=(*GREY, 0.25), linewidth=0.5)
    ax.locator_params(axis="z", nbins=4)
    for part in ax.get_children():  # what stands out of its box makes it no smaller
        part.set_in_layout(False)
    return collection


def _ends(cast: Cast) -> list[tuple[Array, Color, str]]:
    rows = []
    for one in cast.actors:
        colors = (START, GOAL) if cast.is_alone else (one.color, one.color)
        rows.append((one.track.start, colors[0], "o"))
        rows += [(via.pose, WAY, "s") for via in one.mover.via]
        rows += [(goal.pose, colors[1], "*") for goal in one.mover.goals]
    return rows


def _draw_flat(ax: Axes, cast: Cast, *, across: int, low: Array, high: Array) -> None:
    """Draw a cast along x and another axis: 1 for y, from above, or 2 for the altitude."""
    places = [0, 1, 3]
    standing = sorted(_standing(cast), key=lambda one: (_height(one) or (0, math.inf))[1])
    if across == 2:
        standing = sorted(standing, key=lambda one: -_ring(one)[:, 1].mean())
    for obstacle in standing:
        ring, heights = _ring(obstacle), _height(obstacle) or (low[2], high[2])
        top = min(heights[1], high[2])
        if across == 2:
            left, right = ring[:, 0].min(), ring[:, 0].max()
            ring = np.array([[left, heights[0]], [right, heights[0]], [right, top], [left, top]])
        tint = shaded(BUILDING, 0.45 - 0.75 * (top - low[2]) / (high[2] - low[2]))
        face = tint if across == 1 else (*BUILDING, 0.55)
        ax.add_collection(
            PolyCollection([ring], facecolors=[face], edgecolors=[shaded(BUILDING, -0.35)],
                           linewidths=0.5)
        )  # fmt: skip
        if across == 1 and _height(obstacle):
            ax.text(
                *ring.mean(axis=0), f"{top:g}", fontsize=SMALL_PT - 2.0, color=INK,
                ha="center", va="center", clip_on=True,
            )  # type: ignore[call-arg] # fmt: skip
    strokes = [(stroke[:, [0, across]], color) for stroke, color, _ in _strokes(cast, ground=None)]
    ax.add_collection(
        LineCollection(
            [line for line, _ in strokes], colors=[color for _, color in strokes],
            linewidths=1.8, capstyle="round",
        )
    )  # fmt: skip
    for pose, color, marker in _ends(cast):
        ax.plot(*pose[places][[0, across]], marker, color=color, ms=6 if marker == "o" else 10)
    ax.set(xlim=(low[0], high[0]), ylim=(low[across], high[across]), aspect="equal", anchor="S")
    tidy(ax, x="x [m]", y="y [m]" if across == 1 else "altitude [m]")


def _strokes(cast: Cast, *, ground: float | None) -> list[tuple[Array, Color, float]]:
    """Stretches (n, 3) of the paths with colour and width; with a ground shadows and posts."""
    strokes: list[tuple[Array, Color, float]] = []
    for one in cast.actors:
        if ground is not None and one.track.pieces:
            for piece in one.track.pieces:
                shadow = piece.pose[:, [0, 1, 3]].copy()
                shadow[:, 2] = ground
                strokes += [(part, shaded(INK, 0.5), SHADOW) for part in _parts(shadow)]
            for pose in one.track.spread(POSTS, reach=0.0):
                post = np.array([[pose[0], pose[1], ground], [pose[0], pose[1], pose[3]]])
                strokes += [(part, shaded(GREY, 0.2), POST) for part in _parts(post)]
        for piece in one.track.pieces:
            color = cast.colors[piece.name] if cast.is_alone else one.color
            strokes += [(part, color, BROAD) for part in _parts(piece.pose[:, [0, 1, 3]])]
    return strokes


def _parts(places: Array) -> list[Array]:
    """A path in short parts that share their ends."""
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    if not steps.sum() > 0.0:
        return []
    driven = np.concatenate([[0.0], np.cumsum(steps)])
    count = max(2, math.ceil(driven[-1] / STROKE) + 1)
    at = np.linspace(0.0, driven[-1], count)
    even = np.stack([np.interp(at, driven, column) for column in places.T], axis=1)
    return [even[k : k + 2] for k in range(count - 1)]


def _prism(obstacle: Obstacle, bottom: float, top: float) -> list[tuple[Array, float]]:
    """Faces (n, 3) of an upright prism, walls in pieces, each with its shade."""
    ring = _ring(obstacle)
    faces: list[tuple[Array, float]] = []
    levels = np.linspace(bottom, top, max(1, math.ceil((top - bottom) / STORY)) + 1)
    for begin, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        along = end - begin
        length = float(np.hypot(*along))
        if length == 0.0:
            continue
        outward = np.array([along[1], -along[0]]) / length
        shade = -0.12 + 0.3 * float(outward @ LIGHT[:2])
        pieces = max(1, math.ceil(length / STORY))
        corners = begin + np.linspace(0.0, 1.0, pieces + 1)[:, None] * along
        for low, high in pairwise(levels):
            for a, b in pairwise(corners):
                faces.append((np.array([[*a, low], [*b, low], [*b, high], [*a, high]]), shade))
    faces.append((np.column_stack([ring, np.full(len(ring), top)]), 0.42))
    return faces


def _ring(obstacle: Obstacle) -> Array:
    """Outer corners (n, 2), counter-clockwise, where the obstacle is at the beginning."""
    ring = np.asarray(shape_path(obstacle.shape).to_polygons()[0])[:-1]
    if obstacle.motion is not None:
        ring = np.asarray(SE2(obstacle.motion.pose[0]).act(ring))
    return turning(ring, left=True)


def _height(obstacle: Any) -> tuple[float, float] | None:
    return obstacle.height if isinstance(obstacle, Obstacle) else None


def _standing(cast: Cast) -> list[Obstacle]:
    return [one for one in cast.recording.world.obstacles if isinstance(one, Obstacle)]


def _entries(cast: Cast) -> Entries:
    alone = cast.is_alone
    named = [] if cast.is_many or alone else cast.actors
    entries = [*trim_entries(cast.actors[0].track, cast.colors)] if alone else []
    entries += [(line_handle(one.color), one.name) for one in named]
    for color, marker, name in ((START, "o", "start"), (GOAL, "*", "goal")):
        handle = line_handle(color if alone else INK, marker=marker)
        handle.set_markerfacecolor(color if alone else INK)
        entries.append((handle, name))
    if any(one.mover.via for one in cast.actors):
        entries.append((line_handle(WAY, marker="s"), "on the way"))
    return entries


def _box(cast: Cast) -> tuple[Array, Array]:
    """Corners (3,) of what is shown, the ground at the lowest building."""
    poses = [one.track.pose[:, [0, 1, 3]] for one in cast.actors]
    movers = [one.mover for one in cast.actors]
    goals = [goal.pose[None, [0, 1, 3]] for one in movers for goal in one.goals]
    goals += [via.pose[None, [0, 1, 3]] for one in movers for via in one.via]
    points = np.concatenate([*poses, *goals])
    low, high = points.min(axis=0), points.max(axis=0)
    for obstacle in _standing(cast):
        ring, heights = _ring(obstacle), _height(obstacle)
        low[:2] = np.minimum(low[:2], ring.min(axis=0))
        high[:2] = np.maximum(high[:2], ring.max(axis=0))
        if heights is not None:
            low[2] = min(low[2], heights[0]) if math.isfinite(heights[0]) else low[2]
            high[2] = max(high[2], heights[1]) if math.isfinite(heights[1]) else high[2]
    pad = 0.02 * float((high - low).max()) + 1e-3
    return low - [pad, pad, 0.0], high + pad
