"""Draw a plan in the plane: its path, the body along it, start and goal, turns on the spot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.quiver import Quiver
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.plotting.colors import GREY, INK, Color, trim_colors
from maneuver_automaton.plotting.footprint import footprint_polygons, placed
from maneuver_automaton.plotting.style import corner_legend, count_from_near, line_handle, tidy
from maneuver_automaton.plotting.track import Piece, Track, track_of_plan

FAINT_BODIES, FAINT_DARTS = 14, 9  # along a path
DART = np.array([[0.6, 0.0], [-0.4, 0.32], [-0.22, 0.0], [-0.4, -0.32]])
DART_SIZE, ARROW_SIZE, SPIN_RADIUS = 0.066, 0.13, 0.09  # of the size of the path
STILL_SIZE_M = 1.0  # size of a path that goes nowhere
ARC_POINTS = 61  # of a turn on the spot
RING, CLIMB, SINK = "o", "^", "v"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanArtists:
    """What `draw_plan` has drawn; `path` has one segment per trim that drives."""

    path: LineCollection
    bodies: PolyCollection  # faint, along the path
    switch_bodies: PolyCollection  # clear, at the switching times
    spins: LineCollection  # arcs for turns on the spot
    spin_heads: PolyCollection
    still: tuple[PathCollection, ...]  # a ring for each rest, a triangle for a climb on the spot
    start: PathCollection
    goal: PathCollection
    headings: Quiver  # of start and goal
    legend: Legend | None


def draw_plan(
    ax: Axes,
    plan: Plan,
    *,
    footprint: Any = None,
    goal: ArrayLike | None = None,
    colors: Mapping[str, Color] | None = None,
    legend: bool = True,
) -> PlanArtists:
    """Draw a `plan` in the plane on `ax`, to scale, each trim in its colour.

    Parameters
    ----------
    ax : Axes
        Where to draw; its scale is made equal in x and y.
    plan : Plan
        What to draw.
    footprint : any form of `footprint_polygons`, optional
        The body, drawn along the path; a small dart stands for it if left out.
    goal : (dof,) array_like, optional
        Pose of the goal [m, m, rad(, m)]; the end of the plan if left out.
    colors : mapping, optional
        Colour of each trim by name; `trim_colors` of the plan's trims if left out.
    legend : bool
        Whether to name the trims in the emptiest corner.

    Returns
    -------
    PlanArtists
        The artists, by what they show.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    >>> plan = Plan([0.0, 0.0, 0.0], (ahead,), durations=[2.0])
    >>> artists = draw_plan(Figure().add_subplot(), plan)
    >>> artists.path.get_segments()[0].tolist()
    [[0.0, 0.0], [2.0, 0.0]]
    """
    track = track_of_plan(plan)
    at = track.end if goal is None else as_array("goal", goal, last=plan.start.size)
    used = dict(trim_colors(track.twists) if colors is None else colors)
    return draw_track(ax, track, footprint=footprint, goal=at, colors=used, legend=legend)


def draw_track(
    ax: Axes,
    track: Track,
    *,
    footprint: Any,
    goal: Array,
    colors: Mapping[str, Color],
    legend: bool,
) -> PlanArtists:
    """Draw a `track`; see `draw_plan`."""
    outlines = footprint_polygons(footprint)
    reach = max((float(np.linalg.norm(o, axis=1).max()) for o in outlines), default=0.0)
    ends = np.array([track.start, goal])
    size = max(track.size, float(np.linalg.norm(np.ptp(ends[:, :2], axis=0))), 2.0 * reach)
    size = size if size > 1e-9 else STILL_SIZE_M
    body = outlines or [DART_SIZE * size * DART]
    faint = track.spread(FAINT_BODIES if outlines else FAINT_DARTS, reach=reach)
    spins = [piece for piece in track.pieces if not piece.drives and piece.turn]
    path = LineCollection(
        [piece.pose[:, :2] for piece in track.pieces if piece.drives],
        colors=[colors[piece.name] for piece in track.pieces if piece.drives],
        linewidths=2.6, capstyle="butt", joinstyle="round", zorder=3.0,
    )  # fmt: skip
    arcs, heads = _spin_symbols(spins, size=size)
    spin_colors = [colors[piece.name] for piece in spins]
    switches = track.switching_poses if track.pieces else track.start[None]
    if not outlines:
        switches = _away_from(ends, switches, distance=1e-6 * size)
    artists = PlanArtists(
        path=path,
        bodies=_bodies(body, faint, filled=not outlines, clear=False),
        switch_bodies=_bodies(body, switches, filled=not outlines, clear=True),
        spins=LineCollection(arcs, colors=spin_colors, linewidths=1.8, zorder=4.0),
        spin_heads=PolyCollection(heads, facecolors=spin_colors, linewidths=0.0, zorder=4.0),
        still=_draw_still(ax, track, colors),
        start=draw_start(ax, track.start),
        goal=draw_goal(ax, goal),
        headings=draw_headings(ax, ends, length=ARROW_SIZE * size),
        legend=_legend(ax, track, ends, colors) if legend else None,
    )
    for part in (artists.path, artists.bodies, artists.switch_bodies, artists.spins):
        ax.add_collection(part)
    ax.add_collection(artists.spin_heads)
    set_view(ax, ends, size=size)
    return artists


def trim_handles(track: Track, colors: Mapping[str, Color]) -> tuple[list[Line2D], list[str]]:
    """Legend handles and names of the trims of a `track`, in order."""
    symbols = {piece.name: _symbol(piece) for piece in reversed(track.pieces)}
    names = list(track.twists)
    return [line_handle(colors[name], marker=symbols[name]) for name in names], names


def draw_start(ax: Axes, pose: Array) -> PathCollection:
    """A dot for a start."""
    return ax.scatter(pose[0], pose[1], s=26.0, color=[INK], linewidths=0.0, zorder=5.1)


def draw_goal(ax: Axes, pose: Array) -> PathCollection:
    """A diamond for a goal; a start in the same place shows inside."""
    return ax.scatter(
        pose[0], pose[1], s=58.0, marker="D", facecolors=["white"], edgecolors=[INK],
        linewidths=1.3, zorder=5.0,
    )  # fmt: skip


def draw_headings(ax: Axes, poses: Array, *, length: float, color: Color = INK) -> Quiver:
    """Arrows of `length` [m] for the headings of poses (n, dof)."""
    arrows = length * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=-1)
    ax.update_datalim(poses[:, :2] + arrows)
    return ax.quiver(
        *poses[:, :2].T, *arrows.T, angles="xy", scale_units="xy", scale=1.0, units="inches",
        width=0.018, headwidth=5.0, headlength=6.0, headaxislength=5.2, color=color, zorder=4.8,
    )  # fmt: skip


def set_view(ax: Axes, ends: Array, *, size: float) -> None:
    """Equal scales, and room around a path that is thin or stands still."""
    both_shared = all(
        len(group.get_siblings(ax)) > 1
        for group in (ax.get_shared_x_axes(), ax.get_shared_y_axes())
    )
    ax.set_aspect("equal", adjustable="box" if both_shared else "datalim")
    room = 0.16 * size
    ax.update_datalim(np.concatenate([ends[:, :2] - room, ends[:, :2] + room]))
    ax.margins(0.06)
    ax.autoscale_view()
    tidy(ax, x="x [m]", y="y [m]")
    count_from_near(ax, ends[0, :2])


def end_handles() -> tuple[list[Line2D], list[str]]:
    """Legend handles of start and goal."""
    start = Line2D([], [], linestyle="none", marker="o", markersize=5.5, color=INK)
    goal = Line2D(
        [], [], linestyle="none", marker="D", markersize=6.0, color=INK,
        markerfacecolor="white", markeredgewidth=1.3,
    )  # fmt: skip
    return [start, goal], ["start", "goal"]


def _symbol(piece: Piece) -> str:
    """Marker of a piece that stays where it is, empty if a line shows it."""
    if piece.drives or piece.turn:
        return ""
    return RING if not piece.climb else CLIMB if piece.climb > 0.0 else SINK


def _bodies(body: list[Array], poses: Array, *, filled: bool, clear: bool) -> PolyCollection:
    if filled:
        face = (1.0, 1.0, 1.0, 1.0) if clear else (*GREY, 0.6)
        edge: tuple[float, ...] = (*INK, 1.0 if clear else 0.0)
    else:
        face = (*GREY, 0.10 if clear else 0.0)
        edge = (*INK, 0.85 if clear else 0.20)
    return PolyCollection(
        placed(body, poses),
        facecolors=[face],
        edgecolors=[edge],
        linewidths=0.9 if clear else 0.6,
        zorder=3.5 if filled and clear else 2.0,
    )


def _away_from(ends: Array, poses: Array, *, distance: float) -> Array:
    """The poses whose place is that of neither end, where other marks are."""
    gaps = np.linalg.norm(poses[:, None, :2] - ends[:, :2], axis=-1)
    return np.asarray(poses[gaps.min(axis=1) > distance])


def _spin_symbols(spins: list[Piece], *, size: float) -> tuple[list[Array], list[Array]]:
    """Arcs about the place of each turn and their arrow heads; later turns there lie outside."""
    arcs, heads, places = [], [], np.zeros((0, 2))
    for piece in spins:
        x, y, heading = piece.pose[0, :3]
        here = np.linalg.norm(places - (x, y), axis=1) < 1e-6 * size
        places = np.concatenate([places, [[x, y]]])
        radius = SPIN_RADIUS * size * (1.0 + 0.3 * np.count_nonzero(here))
        turn = float(np.clip(piece.turn, -1.93 * np.pi, 1.93 * np.pi))
        angle = heading + np.linspace(0.0, turn, ARC_POINTS)
        spokes = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        arcs.append((x, y) + radius * spokes)
        along = np.sign(turn) * np.array([-spokes[-1, 1], spokes[-1, 0]])
        tip, wing = 0.042 * size * along, 0.018 * size * spokes[-1]
        heads.append(arcs[-1][-1] + np.array([tip, wing, -wing]))
    return arcs, heads


def _draw_still(ax: Axes, track: Track, colors: Mapping[str, Color]) -> tuple[PathCollection, ...]:
    return tuple(
        ax.scatter(
            piece.pose[0, 0], piece.pose[0, 1], s=150.0, marker=_symbol(piece), facecolors="none",
            edgecolors=[colors[piece.name]], linewidths=1.8, zorder=4.5,
        )
        for piece in track.pieces
        if _symbol(piece)
    )  # fmt: skip


def _legend(ax: Axes, track: Track, ends: Array, colors: Mapping[str, Color]) -> Legend:
    handles, labels = trim_handles(track, colors)
    marks, names = end_handles()
    points = np.concatenate([track.pose[:, :2], ends[:, :2]])
    return corner_legend(ax, [*handles, *marks], [*labels, *names], points=points)
