"""The picture of a closed loop as a file: the plane, the value, the controls, the time per step."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from maneuver_automaton.plotting.closed_loop_plane import draw_closed_loop, loop_handles
from maneuver_automaton.plotting.closed_loop_time import draw_solve_times, draw_value, set_times
from maneuver_automaton.plotting.closed_loop_track import (
    driven_track,
    loop_colors,
    loop_scene,
    loop_view,
)
from maneuver_automaton.plotting.controls import draw_track_altitude, draw_track_controls
from maneuver_automaton.plotting.labels import control_labels
from maneuver_automaton.plotting.pages import (
    axes_at,
    bottom_legend,
    heading_text,
    legend_rows,
    new_figure,
    write_figure,
)
from maneuver_automaton.plotting.style import TEXT_PT, line_handle
from maneuver_automaton.receding_horizon import ClosedLoop

WIDTH, LEFT, RIGHT = 9.6, 0.7, 0.15  # [in] of the page, and beside the axes on it
INNER = WIDTH - LEFT - RIGHT
PLANE, SIDE = 4.82, 6.35  # [in] width of the plane, and where what is beside it begins
VALUE, PANEL, GAP = 1.6, 0.95, 0.2  # [in] heights over time, and between them
LEGEND = 0.42  # [in] above the value
LABELS = 0.44  # [in] below axes that show their numbers
FLAT = 2.4  # a plane so much wider than high is given the width of the page
MOST_NAMES, MOST_REASONS, TEXT_WIDTH = 26, 2, 132


def save_closed_loop_figure(loop: ClosedLoop, path: str | Path, *, footprint: Any = None) -> None:
    """Write the picture of a closed `loop`.

    It shows the plane, the value and the cost over time, the controls as applied, and how long
    every step took to decide. The file is replaced in one step; its ending chooses the format.

    Parameters
    ----------
    loop : ClosedLoop
        What to draw; without a step only start and goal are shown.
    path : str or Path
        Where to write.
    footprint : any form of `footprint_polygons`, optional
        The body of the vehicle; that of the problem if left out.

    Raises
    ------
    ValueError
        If Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    write_figure(_figure(loop, footprint=footprint), path)


def loop_text(loop: ClosedLoop) -> str:
    """How a `loop` ended, in one line.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Problem, Unicycle
    >>> from maneuver_automaton.receding_horizon import simulate
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "spin": (0, 1)})
    >>> loop_text(simulate(Problem(robot, [0, 0, 0], [2, 0, 0]), step=1.0))
    'goal reached after 2 steps · 2 s · cost 2'
    """
    if not loop.steps and loop.reached:
        return "the start is the goal: no step is needed"
    steps = f"{len(loop.steps)} step{'' if len(loop.steps) == 1 else 's'}"
    ended = f"goal reached after {steps}" if loop.reached else loop.reason
    if loop.reached and any(loop.inside[:-1]):
        ended = f"goal reached after {loop.inside.index(True)} of {steps}"
    return f"{ended} · {loop.times[-1] - loop.times[0]:.5g} s · cost {loop.cost:.6g}"


def _figure(loop: ClosedLoop, *, footprint: Any) -> Figure:
    colors, track = loop_colors(loop), driven_track(loop)
    handles, names = loop_handles(loop, track, colors)
    trims = len(track.twists)
    if trims > MOST_NAMES:
        handles[MOST_NAMES:trims] = [line_handle((1.0, 1.0, 1.0))]
        names[MOST_NAMES:trims] = [f"and {trims - MOST_NAMES} more"]
    lines = _heading(loop)
    top = 0.26 + sum(1.42 * size / 72.0 * (1 + text.count("\n")) for text, size, _ in lines)
    bottom = 0.16 + 0.2 * legend_rows(names, INNER) + LABELS
    controls = track.pieces[0].control.shape[1] + track.climbs if track.pieces else 0
    shape = _shape(loop, footprint)
    if not loop.steps:
        high = 3.2
        figure = new_figure(WIDTH, bottom + high + top)
        plane = axes_at(figure, left=LEFT, bottom=bottom, width=INNER, height=high)
    elif shape > FLAT:
        high = min(max(INNER / shape, 1.3), 3.2)
        below = max(VALUE + GAP + PANEL, controls * PANEL + (controls - 1) * GAP)
        figure = new_figure(WIDTH, bottom + below + LEGEND + LABELS + high + top)
        at = bottom + below + LEGEND + LABELS
        plane = axes_at(figure, left=LEFT, bottom=at, width=INNER, height=high)
        half = (INNER - 0.75) / 2.0
        value, solve = _stacked(
            figure, [VALUE, PANEL], left=LEFT, bottom=bottom, width=half, height=below
        )
        middle = _stacked(
            figure, [PANEL] * controls, left=WIDTH - RIGHT - half, bottom=bottom, width=half,
            height=below,
        )  # fmt: skip
        _draw_over_time(loop, value=value, middle=middle, solve=solve)
    else:
        each = [VALUE, *[PANEL] * controls, PANEL]
        high = max(3.9, sum(each) + GAP * (len(each) - 1) + LEGEND)
        figure = new_figure(WIDTH, bottom + high + top)
        plane = axes_at(figure, left=LEFT, bottom=bottom, width=PLANE, height=high)
        value, *middle, solve = _stacked(
            figure, each, left=SIDE, bottom=bottom, width=WIDTH - SIDE - RIGHT,
            height=high - LEGEND,
        )  # fmt: skip
        _draw_over_time(loop, value=value, middle=middle, solve=solve)
        for ax in middle:
            _hide_times(ax)
    draw_closed_loop(plane, loop, footprint=footprint, colors=colors, legend=False)
    heading_text(figure, lines, left=LEFT)
    bottom_legend(figure, handles, names, left=LEFT, width=INNER)
    return figure


def _draw_over_time(loop: ClosedLoop, *, value: Axes, middle: list[Axes], solve: Axes) -> None:
    draw_value(value, loop)
    _hide_times(value)
    draw_solve_times(solve, loop)
    if middle:
        track, colors = driven_track(loop), loop_colors(loop)
        labels = control_labels(loop.problem.automaton.model.control_names)
        draw_track_controls(middle[: len(labels)], track, labels=labels, colors=colors)
        if track.climbs:
            draw_track_altitude(middle[-1], track, colors=colors)
    for ax in middle:
        set_times(ax, loop)
    for ax in middle[:-1]:
        _hide_times(ax)


def _hide_times(ax: Axes) -> None:
    ax.set_xlabel("")
    ax.tick_params(labelbottom=False)


def _stacked(
    figure: Figure, heights: Sequence[float], *, left: float, bottom: float, width: float,
    height: float,
) -> list[Axes]:  # fmt: skip
    """Axes above each other, the first on top, their `heights` stretched to fill a box [in]."""
    stretch = (height - GAP * (len(heights) - 1)) / sum(heights) if heights else 1.0
    axes, at = [], bottom + height
    for each in heights:
        at -= stretch * each
        axes.append(axes_at(figure, left=left, bottom=at, width=width, height=stretch * each))
        at -= GAP
    return axes


def _heading(loop: ClosedLoop) -> list[tuple[str, float, str]]:
    """How the loop ended, how it went, and what was broken."""
    lines = [(textwrap.fill(loop_text(loop), 96), 10.0, "bold")]
    if loop.steps:
        time = loop.problem.horizon.time
        horizon = "free final time" if time is None else f"horizon {time:g} s"
        replanned = sum(step.replanned for step in loop.steps)
        lines.append(
            (f"a step every {loop.step:g} s · {horizon} · {_times(replanned)}", TEXT_PT,
             "normal")
        )  # fmt: skip
    broken = list(loop.violations)
    for number, violation in broken[:MOST_REASONS]:
        text = textwrap.shorten(f"step {number}: {violation}", TEXT_WIDTH, placeholder=" …")
        lines.append((text, TEXT_PT, "normal"))
    if len(broken) > MOST_REASONS:
        more = f"and {len(broken) - MOST_REASONS} more guarantees broken"
        lines.append((more, TEXT_PT, "normal"))
    return lines


def _times(count: int) -> str:
    rare = ("never replanned", "replanned once", "replanned twice")
    return rare[count] if count < len(rare) else f"replanned {count} times"


def _shape(loop: ClosedLoop, footprint: Any) -> float:
    """Width of what is drawn in the plane by its height."""
    wide, high = np.ptp(loop_view(loop, loop_scene(loop, footprint=footprint))[0], axis=0)
    return float(wide / high)
