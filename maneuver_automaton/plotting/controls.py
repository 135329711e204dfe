"""Draw what a plan does over time: controls as steps, altitude as a line, trims as colours."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.plotting.colors import GREY, INK, Color, track_colors
from maneuver_automaton.plotting.style import outer_legend, tidy
from maneuver_automaton.plotting.track import Track, track_of_plan

STYLES: tuple[tuple[float, Sequence[float]] | Literal["-"], ...] = (
    "-",
    (0, (4, 1.5)),
    (0, (1.2, 1.2)),
    (0, (5, 1.5, 1.2, 1.5)),
)
TIME_LABEL = "time [s]"
CONSTANT, NEAR = 0.02, 0.2  # of the largest value: varies less, or more, then zero is in view
CROWDED = 30  # pieces from which on lines where trims change would hide what they part
CHARACTER, OVER = 0.066, 0.1  # [in] of a label, and how far it may stand over its axes


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StepArtists:
    """Artists of one quantity over time."""

    steps: LineCollection  # one segment per trim, in its colour
    jumps: LineCollection  # from trim to trim
    switches: LineCollection  # vertical lines at the switching times


def draw_controls(
    axes: Axes | Sequence[Axes],
    plan: Plan,
    *,
    labels: Sequence[str] = (),
    colors: Mapping[str, Color] | None = None,
) -> tuple[StepArtists, ...]:
    """Draw the controls of a `plan` over time as steps.

    Parameters
    ----------
    axes : Axes, or one for each control
        Where to draw; on a single one the controls are told apart by the style of their lines.
    plan : Plan
        What to draw.
    labels : sequence of str
        What to call each control, with its unit; "control 1" and so on if left out.
    colors : mapping, optional
        Colour of each trim by name; `track_colors` of the plan's trims if left out.

    Returns
    -------
    tuple of StepArtists
        One for each control.

    Raises
    ------
    ValueError
        If the axes or the labels are not as many as the controls.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.5])
    >>> plan = Plan([0.0, 0.0, 0.0], (ahead,), durations=[2.0])
    >>> speed, turn = draw_controls(Figure().add_subplot(), plan)
    >>> turn.steps.get_segments()[0].tolist()
    [[0.0, 0.5], [2.0, 0.5]]
    """
    track = track_of_plan(plan)
    colors = track_colors(track.twists) if colors is None else colors
    panels = [axes] if isinstance(axes, Axes) else list(axes)
    many = track.pieces[0].control.shape[1] if track.pieces else max(len(labels), len(panels))
    if len(panels) not in (1, many) or (labels and len(labels) != many):
        raise ValueError(
            f"controls: got {len(panels)} axes and {len(labels)} labels, need 1 or {many} axes "
            f"and no or {many} labels for {many} controls"
        )
    names = list(labels) or [f"control {k + 1}" for k in range(many)]
    if len(panels) == many:
        return tuple(
            draw_over_time(panels[k], track, step_curves(track, k), label=names[k], colors=colors)
            for k in range(many)
        )
    (ax,) = panels
    drawn = tuple(
        draw_over_time(ax, track, step_curves(track, k), label="controls", colors=colors, style=k)
        for k in range(many)
    )
    lines = (Line2D([], [], color=INK, linestyle=STYLES[k % len(STYLES)]) for k in range(many))
    outer_legend(ax, [*zip(lines, names, strict=True)])
    return drawn


def step_curves(track: Track, k: int) -> list[Array]:
    """Control `k` over time, held from sample to sample: corners (n, 2) of its steps by piece."""
    curves = []
    for piece in track.pieces:
        changes = np.flatnonzero(np.diff(piece.control[:-1, k])) + 1
        starts = np.concatenate([[0], changes])
        times = np.stack([piece.time[starts], piece.time[np.append(changes, -1)]], axis=-1)
        curves.append(np.stack([times.ravel(), np.repeat(piece.control[starts, k], 2)], axis=-1))
    return curves


def draw_over_time(
    ax: Axes,
    track: Track,
    curves: Sequence[Array],
    *,
    label: str,
    colors: Mapping[str, Color],
    style: int = 0,
) -> StepArtists:
    """Draw one curve (n, 2) per piece of a `track` in the colour of its trim."""
    shown = [colors[piece.name] for piece in track.pieces]
    times = track.switching_times
    crowded = len(track.pieces) > CROWDED
    artists = StepArtists(
        steps=LineCollection(
            curves, colors=shown, linewidths=2.4, linestyles=[STYLES[style % len(STYLES)]],
            capstyle="butt", zorder=3.0,
        ),
        jumps=LineCollection(
            [np.stack([a[-1], b[0]]) for a, b in pairwise(curves)],
            colors=[GREY], linewidths=0.35 if crowded else 0.9, zorder=2.5,
        ),
        switches=LineCollection(
            [] if crowded else [[(t, 0.0), (t, 1.0)] for t in times],
            colors=[(*GREY, 0.6)], linewidths=0.6,
            transform=ax.get_xaxis_transform(), zorder=1.5,
        ),
    )  # fmt: skip
    ax.add_collection(artists.steps)
    ax.add_collection(artists.jumps)
    ax.add_collection(artists.switches, autolim=False)
    _set_limits(ax, times, curves)
    tidy(ax, x=TIME_LABEL, y=within(ax, label))
    ax.grid(visible=False, axis="x")
    return artists


def within(ax: Axes, label: str) -> str:
    """The label, in lines where it is longer than the axes are high."""
    high = ax.bbox.height / ax.get_figure(root=True).dpi  # type: ignore[union-attr]
    most = max(12, int((high + OVER) / CHARACTER))
    return label if len(label) <= most else "\n".join(textwrap.wrap(label, most))


def _set_limits(ax: Axes, times: Array, curves: Sequence[Array]) -> None:
    """Whole duration in x; in y the values seen so far, with zero and a little room."""
    begin, end = (times[0], times[-1]) if times.size else (0.0, 1.0)
    low, high = ax.dataLim.intervaly if np.isfinite(ax.dataLim.intervaly).all() else (0.0, 0.0)
    values = np.concatenate([[low, high], *(curve[:, 1] for curve in curves)])
    low, high = float(values.min()), float(values.max())
    size = max(abs(low), abs(high))
    if not CONSTANT * size < high - low <= NEAR * size:
        low, high = min(low, 0.0), max(high, 0.0)
    room = 0.12 * (high - low) or 1.0
    ax.set_xlim(begin - 0.01 * (end - begin), end + 0.01 * (end - begin))
    ax.set_ylim(low - room, high + room)
