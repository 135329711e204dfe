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
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.pages import (
    axes_at,
    bottom_legend,
    heading_height,
    heading_text,
    hide_times,
    legend_rows,
    new_figure,
    title_lines,
    write_figure,
)
from maneuver_automaton.plotting.plan_page import BETWEEN, LEFT, PLANE, RIGHT
from maneuver_automaton.receding_horizon import ClosedLoop, Guarantee

LEAST_PLANE, LEAST_SHARE = 1.0, 0.6  # [in] of the plane in a page of stated height; of the rest
VALUE, PANEL, GAP = 1.6, 0.95, 0.2  # [in] heights over time, and between them
LEGEND = 0.42  # [in] above the value
LABELS = 0.44  # [in] below axes that show their numbers
FLAT = 2.4  # a plane so much wider than high is given the width of the page
MOST_REASONS, TEXT_WIDTH = 2, 132


def save_closed_loop_figure(
    loop: ClosedLoop, path: str | Path, *, footprint: Any = None, look: Look | None = None
) -> None:
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
    look : Look, optional
        Title, size and style.

    Raises
    ------
    ValueError
        If Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    write_figure(_figure(loop, footprint=footprint, look=look or Look()), path)


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


def _figure(loop: ClosedLoop, *, footprint: Any, look: Look) -> Figure:
    colors, track = loop_colors(loop), driven_track(loop)
    inner = look.width - LEFT - RIGHT
    handles, names = loop_handles(loop, track, colors)
    lines = title_lines(look, inner, loop_text(loop), *_remarks(loop))
    top = heading_height(lines) + 0.14
    bottom = 0.16 + 0.2 * legend_rows(names, inner) + LABELS
    controls = track.pieces[0].control.shape[1] + track.climbs if track.pieces else 0
    each = [VALUE, *[PANEL] * controls, PANEL]
    stacked = sum(each) + GAP * (len(each) - 1)
    shape = _shape(loop, footprint)
    flat = shape > FLAT or look.is_narrow or not loop.steps
    over_time = bool(loop.steps)
    if not loop.steps:
        below, high = 0.0, 3.2
    elif look.is_narrow:
        below, high = stacked + LEGEND + LABELS, min(max(inner / shape, 1.3), 3.9)
    elif flat:
        half = max(VALUE + GAP + PANEL, controls * PANEL + (controls - 1) * GAP)
        below, high = half + LEGEND + LABELS, min(max(inner / shape, 1.3), 3.2)
    else:
        below, high = 0.0, max(3.9, stacked + LEGEND)
    if look.height is not None:
        room = look.height - bottom - top
        if room < (below + LEAST_PLANE if flat else LEAST_SHARE * (stacked + LEGEND)):
            over_time, below, flat = False, 0.0, True
        high = max(LEAST_PLANE, room - below)
    figure = new_figure(look.width, bottom + below + high + top)
    plane = axes_at(
        figure, left=LEFT, bottom=bottom + below, width=inner if flat else PLANE * inner,
        height=high,
    )  # fmt: skip
    if over_time:
        room = (below - LABELS if flat else high) - LEGEND
        value, middle, solve = _side_axes(
            figure, each, bottom=bottom, height=room, look=look, flat=flat
        )
        _draw_over_time(loop, value=value, middle=middle, solve=solve)
        if look.is_narrow or not flat:
            hide_times(middle)
    draw_closed_loop(plane, loop, footprint=footprint, colors=colors, legend=False)
    heading_text(figure, lines, left=LEFT)
    bottom_legend(figure, handles, names, left=LEFT, width=inner)
    return figure


def _side_axes(
    figure: Figure, heights: Sequence[float], *, bottom: float, height: float, look: Look,
    flat: bool,
) -> tuple[Axes, list[Axes], Axes]:  # fmt: skip
    """Axes for the value, for controls and altitude, and for the time per step."""
    inner = look.width - LEFT - RIGHT
    if flat and not look.is_narrow:
        half = (inner - 0.75) / 2.0
        value, solve = _stacked(
            figure, [VALUE, PANEL], left=LEFT, bottom=bottom, width=half, height=height
        )
        middle = _stacked(
            figure, heights[1:-1], left=look.width - RIGHT - half, bottom=bottom, width=half,
            height=height,
        )  # fmt: skip
        return value, middle, solve
    left = LEFT if flat else LEFT + PLANE * inner + BETWEEN
    value, *middle, solve = _stacked(
        figure, heights, left=left, bottom=bottom, width=look.width - left - RIGHT, height=height
    )
    return value, middle, solve


def _draw_over_time(loop: ClosedLoop, *, value: Axes, middle: list[Axes], solve: Axes) -> None:
    draw_value(value, loop)
    hide_times([value])
    draw_solve_times(solve, loop)
    if middle:
        track, colors = driven_track(loop), loop_colors(loop)
        labels = control_labels(loop.problem.automaton.model.control_names)
        draw_track_controls(middle[: len(labels)], track, labels=labels, colors=colors)
        if track.climbs:
            draw_track_altitude(middle[-1], track, colors=colors)
    for ax in middle:
        set_times(ax, loop)
    hide_times(middle[:-1])


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


def _remarks(loop: ClosedLoop) -> list[str]:
    """How the loop went, and what was broken, in lines."""
    lines = []
    if loop.steps:
        time = loop.problem.horizon.time
        horizon = "free final time" if time is None else f"horizon {time:g} s"
        replanned = sum(step.replanned for step in loop.steps)
        lines.append(f"a step every {loop.step:g} s · {horizon} · {_times(replanned)}")
    broken = list(loop.violations)
    for number, violation in broken[:MOST_REASONS]:
        text = f"step {number}: {violation}"
        lines.append(textwrap.shorten(text, TEXT_WIDTH, placeholder=" …"))
    if (more := len(broken) - MOST_REASONS) > 0:
        lines.append(f"and {more} more guarantee{'s' if more > 1 else ''} broken")
    rises = sum(one.guarantee is Guarantee.DECREASE for _, one in loop.disturbed)
    if rises:
        lines.append(f"noise raised the value in {rises} step{'s' if rises > 1 else ''}")
    return lines


def _times(count: int) -> str:
    rare = ("never replanned", "replanned once", "replanned twice")
    return rare[count] if count < len(rare) else f"replanned {count} times"


def _shape(loop: ClosedLoop, footprint: Any) -> float:
    """Width of what is drawn in the plane by its height."""
    wide, high = np.ptp(loop_view(loop, loop_scene(loop, footprint=footprint))[0], axis=0)
    return float(wide / high)
