"""A closed loop in motion: the vehicle drives, its plan ahead of it, the plans before fading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.text import Text

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.closed_loop_plane import (
    JUMP,
    JUMP_STYLE,
    draw_ends,
)
from maneuver_automaton.plotting.closed_loop_track import (
    driven_track,
    loop_colors,
    loop_points,
    view_size,
)
from maneuver_automaton.plotting.colors import GREY, INK, Color
from maneuver_automaton.plotting.film import Film, check_film_path, picture_times, write_film
from maneuver_automaton.plotting.footprint import footprint_polygons, placed
from maneuver_automaton.plotting.pages import (
    DPI,
    axes_at,
    bottom_legend,
    legend_rows,
    new_figure,
)
from maneuver_automaton.plotting.paths import DART, DART_SIZE, end_handles, trim_handles
from maneuver_automaton.plotting.track import Piece, Track, track_of_plan
from maneuver_automaton.receding_horizon import ClosedLoop

WIDTH, LEFT, RIGHT = 6.4, 0.75, 0.2  # [in]
LOWEST, HIGHEST = 1.6, 4.0  # [in] of the plane
ROOM = 0.2  # around what is drawn, of its size
REMEMBERED = 6  # plans that are still fading
MOST_NAMES = 12


def save_closed_loop_animation(
    loop: ClosedLoop, path: str | Path, *, footprint: Any = None
) -> None:
    """Write a closed `loop` as a moving picture; the file is replaced in one step.

    Parameters
    ----------
    loop : ClosedLoop
        What to show; without a step there is a single picture.
    path : str or Path
        Where to write: a .gif, an .html that needs no other file, or an .mp4 where Matplotlib
        finds ffmpeg.
    footprint : any form of `footprint_polygons`, optional
        The body of the vehicle; a dart if there is none.

    Raises
    ------
    ValueError
        If the ending is none of these, or .mp4 without ffmpeg.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    target = check_film_path(path)
    write_film(_film(loop, footprint=footprint), target)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Scene:
    """What moves, and what it is taken from."""

    loop: ClosedLoop
    body: list[Array]
    colors: Mapping[str, Color]
    driven: Track
    plans: list[Track]  # one per step
    old: LineCollection
    ahead: LineCollection
    trail: LineCollection
    jumps: LineCollection
    vehicle: PolyCollection
    clock: Text

    def show(self, time: float) -> None:
        """Set everything to a `time` [s]."""
        loop = self.loop
        k = _step_at(loop, time)
        self.vehicle.set_verts(placed(self.body, _pose_at(loop, time)[None]))
        self.clock.set_text(_clock_text(loop, k, time))
        if k is None:
            return
        begin = loop.times[0]
        self._set(self.trail, self.driven, begin, time)
        plan = self.plans[k]
        arrived = loop.reached and time >= loop.times[-1]
        self._set(self.ahead, plan, time, time if arrived else np.inf)
        past = range(max(0, k - REMEMBERED), k)
        self.old.set_segments([self.plans[n].pose[:, :2] for n in past])
        fading = [0.75 * (1.0 - (k - n) / (REMEMBERED + 1)) for n in past]
        self.old.set_color([(*GREY, alpha) for alpha in fading])
        self.jumps.set_segments(
            [
                [plan.end[:2], pose[:2]]
                for plan, pose, at in zip(loop.driven, loop.poses[1:], loop.times[1:], strict=True)
                if at <= time
            ]
        )

    def _set(self, lines: LineCollection, track: Track, begin: float, end: float) -> None:
        """Have `lines` show the part of a `track` between two times."""
        shown = [
            piece for piece in track.pieces if max(begin, piece.time[0]) < min(end, piece.time[-1])
        ]
        lines.set_segments([_between(piece, begin, end) for piece in shown])
        lines.set_color([self.colors[piece.name] for piece in shown])


def _film(loop: ClosedLoop, *, footprint: Any) -> Film:
    colors, track = loop_colors(loop), driven_track(loop)
    outlines = footprint_polygons(footprint)
    points = loop_points(loop)
    size = view_size(points, outlines)
    body = outlines or [DART_SIZE * size * DART]
    points = np.concatenate([points, *placed(body, track.pose), *placed(body, loop.poses)])
    wide, high = np.ptp(points, axis=0) + ROOM * size
    inner = WIDTH - LEFT - RIGHT
    height = min(max(inner * float(high / wide), LOWEST), HIGHEST)
    handles, names = trim_handles(track, colors)
    if len(names) > MOST_NAMES:
        handles, names = [], []
    ends, end_names = end_handles()
    handles, names = [*handles, *ends], [*names, *end_names]
    bottom = 0.62 + 0.2 * legend_rows(names, inner)
    figure = new_figure(WIDTH, _even(bottom + height + 0.45))
    ax = axes_at(figure, left=LEFT, bottom=bottom, width=inner, height=height)
    bottom_legend(figure, handles, names, left=LEFT, width=inner)
    ax.update_datalim(points)
    draw_ends(ax, loop, size=size)
    scene = _scene(figure, ax, loop, body, colors=colors)
    times = picture_times(float(loop.times[0]), float(loop.times[-1]))
    moving = [scene.old, scene.jumps, scene.trail, scene.ahead, scene.vehicle, scene.clock]
    samples = [times[-1], *(step.time for step in loop.steps)]
    return Film(figure=figure, moving=moving, show=scene.show, times=times, samples=samples)


def _scene(
    figure: Figure,
    ax: Axes,
    loop: ClosedLoop,
    body: list[Array],
    *,
    colors: Mapping[str, Color],
) -> _Scene:
    high = figure.get_size_inches()[1]
    scene = _Scene(
        loop=loop,
        body=body,
        colors=colors,
        driven=driven_track(loop),
        plans=[track_of_plan(step.plan) for step in loop.steps],
        old=LineCollection([], linewidths=1.0, zorder=1.5),
        ahead=LineCollection([], linewidths=1.5, zorder=3.2),
        trail=LineCollection([], linewidths=3.2, capstyle="butt", zorder=3.0),
        jumps=LineCollection([], colors=[JUMP], linewidths=1.4, linestyles=[JUMP_STYLE], zorder=2),
        vehicle=PolyCollection(
            [], facecolors=[(*GREY, 0.35)], edgecolors=[INK], linewidths=1.2, zorder=6.0
        ),
        clock=figure.text(
            LEFT / WIDTH, 1.0 - 0.14 / high, "", fontsize=10.0, color=INK, va="top",
            parse_math=False,
        ),
    )  # fmt: skip
    for part in (scene.old, scene.ahead, scene.trail, scene.jumps, scene.vehicle):
        ax.add_collection(part, autolim=False)
    return scene


def _step_at(loop: ClosedLoop, time: float) -> int | None:
    """Number in the log of the step under way; None if there is no step."""
    if not loop.steps:
        return None
    after = int(np.searchsorted(loop.times, time, side="right"))
    return min(max(after - 1, 0), len(loop.steps) - 1)


def _pose_at(loop: ClosedLoop, time: float) -> Array:
    k = _step_at(loop, time)
    if k is None or time >= loop.times[-1]:
        return np.asarray(loop.poses[-1])
    return loop.driven[k].pose_at(time)


def _clock_text(loop: ClosedLoop, k: int | None, time: float) -> str:
    """Time and value; whether the step under way replanned or broke a guarantee."""
    text = f"{time:.2f} s"
    if k is None or time >= loop.times[-1]:
        return f"{text} · {'goal reached' if loop.reached else loop.reason}"
    step = loop.steps[k]
    parts = [text, f"step {step.number}", f"V = {step.value:.4g}"]
    if step.replanned:
        parts.append("replanned")
    if step.violations:
        parts.append("guarantee broken")
    return " · ".join(parts)


def _between(piece: Piece, begin: float, end: float) -> Array:
    """Places (n, 2) of a piece between two times."""
    low, high = max(begin, float(piece.time[0])), min(end, float(piece.time[-1]))
    inside = piece.time[(piece.time > low) & (piece.time < high)]
    at = np.array([low, *inside, high])
    return np.stack([np.interp(at, piece.time, column) for column in piece.pose.T[:2]], axis=-1)


def _even(inches: float) -> float:
    """A height that is an even number of pixels, as films need it."""
    return 2.0 * round(inches * DPI / 2.0) / DPI
