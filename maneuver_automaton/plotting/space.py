"""A flight in space: buildings as prisms, the path above its shadow, seen from above and aside."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.plotting.colors import GREY, INK, Color, shaded
from maneuver_automaton.plotting.labels import result_text, shown_name
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.motions import MOST_TRIMS, motion_names, track_colors
from maneuver_automaton.plotting.pages import (
    axes_at,
    bottom_legend,
    heading_height,
    heading_text,
    legend_rows,
    new_figure,
    title_lines,
    write_figure,
)
from maneuver_automaton.plotting.regions import shape_path
from maneuver_automaton.plotting.style import SMALL_PT, TEXT_PT, line_handle, tidy
from maneuver_automaton.plotting.track import Track, track_of_plan
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Problem

WIDTH, SPACE, FLAT = 9.6, 5.2, 1.75  # [in] of the page; heights of the axes
HIGHEST = 2.6  # [in] of the plane
LEFT, GAP = 0.7, 0.62  # [in]
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
NAMES = 40  # characters of a trim's name
HIDDEN = 0.3  # opacity of the path where a building is before it


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SpaceArtists:
    """Artists of `draw_space`."""

    faces: Poly3DCollection  # walls, roofs, and strokes of the path, nearer ones above
    ends: tuple[Line2D, ...]


def flies_among_heights(problem: Problem) -> bool:
    """Whether a vehicle in space has obstacles with heights, so that a plane does not show all."""
    return problem.start.size > 3 and any(_height(one) is not None for one in problem.obstacles)


def draw_space(ax: Axes3D, result: PlanResult) -> SpaceArtists:
    """Draw a plan in space to scale: buildings, path, its shadow on the ground, start and goals.

    Coasts have the colours of their trims, maneuvers are dark. An obstacle without heights is as
    high as the picture.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> axes = Figure().add_subplot(projection="3d")
    >>> hasattr(axes, "set_box_aspect")
    True
    """
    problem = result.problem
    track = _track(result)
    low, high = _box(problem, track)
    faces: list[Array] = []
    inner: list[Color] = []
    rims: list[tuple[float, ...]] = []
    size = float((high - low).max())
    for obstacle in _standing(problem):
        bottom, top = _height(obstacle) or (low[2], high[2])
        for face, shade in _prism(obstacle, max(bottom, low[2]), min(top, high[2])):
            faces.append(face)
            inner.append(shaded(BUILDING, shade))
            rims.append((*shaded(BUILDING, -0.25), 0.5))
    for places, color, width in _strokes(result, track, ground=float(low[2])):
        faces.append(_ribbon(places, width * size))
        inner.append(color)
        rims.append((*color, 1.0))
    collection = Poly3DCollection(
        _as_long_as_the_longest(faces),
        facecolors=inner,
        edgecolors=rims,
        linewidths=RIM,
        zsort="average",
        clip_on=False,
    )
    if faces:
        ax.add_collection3d(collection)
    path = [(places, color) for places, color, _ in _strokes(result, track, ground=None)]
    if path:
        through = Line3DCollection(
            [places for places, _ in path], colors=[color for _, color in path],
            linewidths=1.6, alpha=HIDDEN, zorder=5, clip_on=False,
        )  # fmt: skip
        ax.add_collection3d(through)
    ends = [_mark(ax, track.start, START, "o")]
    ends += [_mark(ax, goal.pose, GOAL, "*") for goal in problem.goals]
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(tuple(high - low), zoom=1.32)
    ax.view_init(elev=ELEVATION, azim=AZIMUTH)
    _bare_axes(ax)
    return SpaceArtists(faces=collection, ends=tuple(ends))


def save_space_figure(result: PlanResult, path: str | Path, *, title: str = "") -> None:
    """Write a picture of a flight: in space, from above, and from the side, all to scale.

    A `title` stands above the numbers.

    Raises
    ------
    ValueError
        If the vehicle is one of the plane, or Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    if result.problem.start.size < 4:
        raise ValueError(
            f"a picture in space: the {result.problem.automaton.model.name} has no altitude"
        )
    write_figure(_figure(result, title), path)


def _figure(result: PlanResult, title: str) -> Figure:
    import mpl_toolkits.mplot3d  # noqa: F401 - Matplotlib knows the projection from then on

    track, problem = _track(result), result.problem
    handles, names = _legend(result, track)
    bottom = 0.6 + 0.2 * legend_rows(names, WIDTH - 2 * LEFT, length=NAMES)
    low, high = _box(problem, track)
    span = high - low
    room = WIDTH - LEFT - 0.2 - GAP
    each = 0.5 * room
    height = max(FLAT, min(each * span[1] / span[0], HIGHEST))
    lines = title_lines(Look(title=title), WIDTH - LEFT, _headline(result))
    figure = new_figure(WIDTH, bottom + height + 0.15 + SPACE + heading_height(lines))
    tall = float(figure.get_size_inches()[1])
    base = bottom + height + 0.15
    box = (0.0, base / tall, 1.0, SPACE / tall)
    space: Any = figure.add_axes(box, projection="3d", computed_zorder=False)
    space.patch.set_alpha(0.0)
    draw_space(space, result)
    from_above = axes_at(figure, left=LEFT, bottom=bottom, width=each, height=height)
    aside = axes_at(figure, left=LEFT + each + GAP, bottom=bottom, width=each, height=height)
    _draw_flat(from_above, result, track, across=1, low=low, high=high)
    _draw_flat(aside, result, track, across=2, low=low, high=high)
    heading_text(figure, lines, left=0.35)
    bottom_legend(figure, handles, names, left=LEFT, width=WIDTH - 2 * LEFT, length=NAMES)
    return figure


def _draw_flat(
    ax: Axes, result: PlanResult, track: Track, *, across: int, low: Array, high: Array
) -> None:
    """Draw the scene along x and another axis: 1 for y, from above, or 2 for the altitude."""
    places = [0, 1, 3]
    standing = sorted(_standing(result.problem), key=lambda one: (_height(one) or (0, math.inf))[1])
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
                ha="center", va="center",
            )  # type: ignore[call-arg] # fmt: skip
    lines, colors = [], []
    for stroke, color, _ in _strokes(result, track, ground=None):
        lines.append(stroke[:, [0, across]])
        colors.append(color)
    ax.add_collection(LineCollection(lines, colors=colors, linewidths=1.8, capstyle="round"))
    ends = [(track.start, START, "o"), *((g.pose, GOAL, "*") for g in result.problem.goals)]
    for pose, color, marker in ends:
        ax.plot(*pose[places][[0, across]], marker, color=color, ms=6 if marker == "o" else 10)
    ax.set(xlim=(low[0], high[0]), ylim=(low[across], high[across]), aspect="equal", anchor="S")
    tidy(ax, x="x [m]", y="y [m]" if across == 1 else "altitude [m]")


def _strokes(
    result: PlanResult, track: Track, *, ground: float | None
) -> list[tuple[Array, Color, float]]:
    """Stretches (n, 3) of the path with colour and width; with a ground its shadow and posts."""
    colors = _colors(result, track)
    strokes: list[tuple[Array, Color, float]] = []
    if ground is not None and track.pieces:
        for piece in track.pieces:
            shadow = piece.pose[:, [0, 1, 3]].copy()
            shadow[:, 2] = ground
            strokes += [(part, shaded(INK, 0.5), SHADOW) for part in _parts(shadow)]
        for pose in track.spread(POSTS, reach=0.0):
            post = np.array([[pose[0], pose[1], ground], [pose[0], pose[1], pose[3]]])
            strokes += [(part, shaded(GREY, 0.2), POST) for part in _parts(post)]
    for piece in track.pieces:
        color = colors.get(piece.name, INK)
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


def _ribbon(places: Array, width: float) -> Array:
    """A stroke (2, 3) as a face (4, 3) that is seen from the front."""
    azimuth, elevation = math.radians(AZIMUTH), math.radians(ELEVATION)
    level = math.cos(elevation)
    seen = [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)]
    aside = np.cross(places[1] - places[0], seen)
    length = float(np.linalg.norm(aside))
    aside = 0.5 * width * aside / length if length > 0.0 else np.zeros(3)
    return np.array([places[0] - aside, places[1] - aside, places[1] + aside, places[0] + aside])


def _as_long_as_the_longest(faces: list[Array]) -> list[Array]:
    """Faces (k, 3) with as many corners each; a shorter one stays in its last corner.

    Matplotlib fills shorter ones up with what its memory held, and takes that for corners when it
    looks for the limits of the axes.
    """
    longest = max((len(face) for face in faces), default=0)
    return [np.pad(face, ((0, longest - len(face)), (0, 0)), mode="edge") for face in faces]


def _prism(obstacle: Obstacle, bottom: float, top: float) -> list[tuple[Array, float]]:
    """Faces (n, 3) of an upright prism, walls in pieces, each with its shade."""
    ring = _ring(obstacle)
    faces: list[tuple[Array, float]] = []
    count = max(1, math.ceil((top - bottom) / STORY))
    levels = np.linspace(bottom, top, count + 1)
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
                wall = [[*a, low], [*b, low], [*b, high], [*a, high]]
                faces.append((np.array(wall), shade))
    roof = np.column_stack([ring, np.full(len(ring), top)])
    faces.append((roof, 0.42))
    return faces


def _ring(obstacle: Obstacle) -> Array:
    """Outer corners (n, 2), counter-clockwise, where the obstacle is at the beginning."""
    ring = np.asarray(shape_path(obstacle.shape).to_polygons()[0])[:-1]
    if obstacle.motion is not None:
        ring = np.asarray(SE2(obstacle.motion.pose[0]).act(ring))
    after = np.roll(ring, -1, axis=0)
    area = float((ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]).sum())
    return ring if area > 0.0 else ring[::-1]


def _height(obstacle: Any) -> tuple[float, float] | None:
    return obstacle.height if isinstance(obstacle, Obstacle) else None


def _standing(problem: Problem) -> list[Obstacle]:
    return [one for one in problem.obstacles if isinstance(one, Obstacle)]


def _track(result: PlanResult) -> Track:
    if result.plan is None:
        return Track(result.problem.start, ())
    return track_of_plan(result.plan)


def _colors(result: PlanResult, track: Track) -> dict[str, Color]:
    """Colours of the trims in which the plan coasts; without any, of the parts of its motion."""
    if result.plan is None:
        return {}
    coasts = {one.name for one in result.plan.primitives if isinstance(one, Trim)} & track.seen
    shown = coasts or track.seen
    return track_colors({name: twist for name, twist in track.twists.items() if name in shown})


def _legend(result: PlanResult, track: Track) -> tuple[list[Line2D], list[str]]:
    colors = _colors(result, track)
    shown = {name: twist for name, twist in track.twists.items() if name in colors}
    entries = motion_names(shown, many=len(shown) > MOST_TRIMS)
    handles = [line_handle(colors[name]) for name in entries.values()]
    names = [shown_name(name) for name in entries]
    if track.seen - colors.keys():
        handles.append(line_handle(INK))
        names.append("maneuvers")
    for color, marker in ((START, "o"), (GOAL, "*")):
        handles.append(line_handle(color, marker=marker))
        handles[-1].set_markerfacecolor(color)
    return handles, [*names, "start", "goal"]


def _box(problem: Problem, track: Track) -> tuple[Array, Array]:
    """Corners (3,) of what is shown, the ground at the lowest building."""
    poses = [track.pose[:, [0, 1, 3]], *(goal.pose[None, [0, 1, 3]] for goal in problem.goals)]
    points = np.concatenate(poses)
    low, high = points.min(axis=0), points.max(axis=0)
    for obstacle in _standing(problem):
        ring, heights = _ring(obstacle), _height(obstacle)
        low[:2] = np.minimum(low[:2], ring.min(axis=0))
        high[:2] = np.maximum(high[:2], ring.max(axis=0))
        if heights is not None:
            low[2] = min(low[2], heights[0]) if math.isfinite(heights[0]) else low[2]
            high[2] = max(high[2], heights[1]) if math.isfinite(heights[1]) else high[2]
    pad = 0.02 * float((high - low).max()) + 1e-3
    return low - [pad, pad, 0.0], high + pad


def _mark(ax: Axes3D, pose: Array, color: Color, marker: str) -> Line2D:
    mark: Line2D
    (mark,) = ax.plot(
        pose[[0]], pose[[1]], pose[[3]], marker=marker, color=color, linestyle="none",
        markersize=7 if marker == "o" else 12, markeredgecolor="white", markeredgewidth=0.6,
        zorder=10, clip_on=False,
    )  # fmt: skip
    return mark


def _bare_axes(ax: Axes3D) -> None:
    """Faint panes and small numbers."""
    for axis, name in ((ax.xaxis, "x [m]"), (ax.yaxis, "y [m]"), (ax.zaxis, "altitude [m]")):
        axis.set_label_text(name, fontsize=TEXT_PT, color=INK)
        axis.set_tick_params(labelsize=SMALL_PT, labelcolor=INK, pad=0.0)
        axis.pane.set_facecolor((0.965, 0.97, 0.975, 1.0))
        axis.pane.set_edgecolor((*GREY, 0.4))
        axis._axinfo["grid"].update(color=(*GREY, 0.25), linewidth=0.5)
    ax.locator_params(axis="z", nbins=4)


def _headline(result: PlanResult) -> str:
    if result.plan is None:
        return f"{result.status.value.replace('_', ' ')}: {result.reason}".rstrip(": ")
    error = result.terminal_error
    return result_text(
        cost=result.cost,
        duration=result.plan.duration,
        error_m=None if error is None else error.position_m,
        error_rad=None if error is None else error.heading_rad,
        clearance_m=result.clearance_m,
    )
