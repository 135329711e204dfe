"""The picture of a fleet: all vehicles in the plane, and beside it what they do over time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from maneuver_automaton.fleet import FleetResult
from maneuver_automaton.plotting.fleet_cast import Cast, cast_of
from maneuver_automaton.plotting.fleet_distances import distance_times, nearest_others
from maneuver_automaton.plotting.fleet_plane import draw_fleet_plane, plane_handles
from maneuver_automaton.plotting.fleet_time import draw_bars, draw_fleet_distances, time_handles
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

LEFT, RIGHT = 0.7, 0.15  # [in] beside the axes
PLANE, BETWEEN = 0.58, 0.95  # share of the plane in the width, and [in] to what is beside it
FLAT = 1.7  # a plane so much wider than high is given the width of the page
LOW, HIGH, LOWEST = 3.2, 5.6, 1.6  # [in] height of the plane, beside and above the others
LABELS, GAP = 0.56, 0.32  # [in] below axes with numbers, and between those over time
ROW, LEAST_BARS, MOST_BARS, CURVE = 0.19, 0.5, 3.0, 1.2  # [in] heights over time
MOST_ROW, MOST_CURVE = 0.36, 2.6  # [in] where there is room for more
CURVE_SHARE, LEAST_PLANE = 0.6, 0.8  # of the room, and [in], where there is little
MOST_REASONS = 4  # above the picture, and names of vehicles for each


@dataclass(frozen=True, slots=True, kw_only=True)
class _Box:
    """A place of axes [in]."""

    left: float
    bottom: float
    width: float
    height: float


def save_fleet_figure(
    result: FleetResult, path: str | Path, *, numbered: bool = False, look: Look | None = None
) -> None:
    """Write the picture of a fleet that `draw_fleet` makes; the ending chooses the format.

    Raises
    ------
    ValueError
        If Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    write_figure(draw_fleet(result, numbered=numbered, look=look), path)


def draw_fleet(result: FleetResult, *, numbered: bool = False, look: Look | None = None) -> Figure:
    """The picture of a fleet: every vehicle in its colour, in the plane and over time.

    In the plane paths, bodies along them at equal times, starts hollow, goals filled; vehicles
    without a plan are hatched at their starts. Up to twelve are named in the legend, more are
    numbered at their starts. Over time there is a bar for each, light where it rests, and the least
    distance of any two bodies, measured by shapely every 0.05 s.

    Parameters
    ----------
    result : FleetResult
        What to draw.
    numbered : bool
        Whether to number the bodies by their times.
    look : Look, optional
        Title, size and style.

    Returns
    -------
    Figure
        It belongs to no window; its axes are the plane, the bars and, where two or more move, the
        distances.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> from maneuver_automaton.fleet import FleetProblem, plan_fleet
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "spin": (0, 1)})
    >>> rows = [Problem(robot, [0, y, 0], [3, y, 0], footprint=Disc(0.3)) for y in (0.0, 1.0)]
    >>> figure = draw_fleet(plan_fleet(FleetProblem(rows, names=["a", "b"]), max_rounds=0))
    >>> [text.get_text() for text in figure.legends[0].get_texts()][:4], len(figure.axes)
    (['a', 'b', 'start', 'goal'], 3)
    """
    look, cast = look or Look(), cast_of(result)
    curve = len(cast.members) > 1 and cast.end > cast.begin
    lines = title_lines(look, look.width - LEFT - RIGHT, headline(result), *_reasons(cast))
    handles, names = _entries(cast, curve=curve)
    bottom = 0.02 + 0.18 * legend_rows(names, look.width - LEFT - RIGHT)
    plane, bars, below, height = _layout(cast, look, bottom, heading_height(lines), curve=curve)
    figure = new_figure(look.width, height)
    heading_text(figure, lines, left=0.3)
    draw_fleet_plane(_axes(figure, plane), cast, numbered=numbered)
    over_time = _axes(figure, bars)
    draw_bars(over_time, cast)
    if curve:
        times = distance_times(cast)
        least = nearest_others(cast.members, times).min(axis=1)
        draw_fleet_distances(_axes(figure, below), cast, times, least)
        hide_times([over_time])
    bottom_legend(figure, handles, names, left=LEFT, width=look.width - LEFT - RIGHT)
    return figure


def headline(result: FleetResult) -> str:
    """The numbers of a fleet in a line."""
    with_plan, count = len(result.plans), len(result.problem)
    parts = [f"{count} vehicle{'s' if count > 1 else ''}"]
    if with_plan < count:
        parts.append(f"{with_plan} with a plan" if with_plan else "none has a plan")
    if with_plan:
        parts += [f"sum {result.sum_s:.5g} s", f"last {result.last_s:.5g} s"]
    if result.gap is not None:
        parts.append(f"gap at most {100.0 * result.gap:.3g} %" if result.gap else "optimal")
    if with_plan and math.isfinite(result.clearance_m):
        parts.append(f"clearance {result.clearance_m:.3g} m")
    return " · ".join(parts)


def _reasons(cast: Cast) -> list[str]:
    """Why some have no plan: a line for each reason, with the names that it holds for."""
    named: dict[str, list[str]] = {}
    for one in cast.members:
        if one.plan is None:
            named.setdefault(one.reason or "no plan", []).append(one.name)
    lines = []
    for reason, names in named.items():
        more = len(names) - MOST_REASONS
        rest = f" and {more} more" if more > 0 else ""
        lines.append(f"{', '.join(names[:MOST_REASONS])}{rest}: {reason}")
    more = len(lines) - MOST_REASONS
    return lines if more <= 0 else [*lines[:MOST_REASONS], f"and {more} more reasons"]


def _entries(cast: Cast, *, curve: bool) -> tuple[list[Artist], list[str]]:
    plane, plane_names = plane_handles(cast)
    time, time_names = time_handles(cast, distances=curve)
    return [*plane, *time], [*plane_names, *time_names]


def _axes(figure: Figure, box: _Box) -> Axes:
    return axes_at(figure, left=box.left, bottom=box.bottom, width=box.width, height=box.height)


def _layout(
    cast: Cast, look: Look, bottom: float, head: float, *, curve: bool
) -> tuple[_Box, _Box, _Box, float]:
    """Places of plane, bars and distances, and the height of the page [in]."""
    wide, high = np.ptp(cast.box, axis=0).tolist()
    inner = look.width - LEFT - RIGHT
    rows = min(max(ROW * len(cast.members), LEAST_BARS), MOST_BARS)
    tail = CURVE + GAP if curve else 0.0
    floor = bottom + LABELS
    if look.is_narrow or wide > FLAT * high:
        if look.height is None:
            plane_height = min(max(inner * high / max(wide, 1e-9), LOWEST), HIGH)
        else:
            plane_height = max(look.height - floor - rows - tail - LABELS - head - 0.1, LEAST_PLANE)
        bars = _Box(left=LEFT, bottom=floor + tail, width=inner, height=rows)
        below = _Box(left=LEFT, bottom=floor, width=inner, height=CURVE)
        up = floor + tail + rows + LABELS
        plane = _Box(left=LEFT, bottom=up, width=inner, height=plane_height)
        return plane, bars, below, up + plane_height + head + 0.1
    plane_width = PLANE * (inner - BETWEEN)
    if look.height is None:
        least = max(LOW, tail + min(rows, 2.0))
        plane_height = min(max(plane_width * high / max(wide, 1e-9), least), HIGH)
    else:
        plane_height = max(look.height - floor - head - 0.1, LEAST_PLANE)
    left, width = LEFT + plane_width + BETWEEN, inner - BETWEEN - plane_width
    plane = _Box(left=LEFT, bottom=floor, width=plane_width, height=plane_height)
    room = plane_height - (GAP if curve else 0.0)
    most = max(MOST_ROW * len(cast.members), room - (MOST_CURVE if curve else 0.0))
    least = min(CURVE, CURVE_SHARE * room) if curve else 0.0
    rows = min(most, room - least)
    bars = _Box(left=left, bottom=floor + plane_height - rows, width=width, height=rows)
    below = _Box(left=left, bottom=floor, width=width, height=room - rows)
    return plane, bars, below, floor + plane_height + head + 0.1
