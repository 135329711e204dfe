"""The page of a fleet: the plane, and beside or below it bars and curves over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from maneuver_automaton.plotting.fleet_cast import Cast
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.pages import (
    axes_at,
    bottom_legend,
    heading_height,
    heading_text,
    legend_rows,
    new_figure,
    title_lines,
)

LEFT, RIGHT = 0.7, 0.15  # [in] beside the axes
PLANE, BETWEEN = 0.58, 0.95  # share of the plane in the width, and [in] to what is beside it
FLAT = 1.7  # a plane so much wider than high is given the width of the page
LOW, HIGH, LOWEST = 3.2, 5.6, 1.6  # [in] height of the plane, beside and above the others
LABELS, GAP = 0.56, 0.32  # [in] below axes with numbers, and between those over time
ROW, LEAST_BARS, MOST_BARS, CURVE = 0.19, 0.5, 3.0, 1.2  # [in] heights over time
MOST_ROW, MOST_CURVE = 0.36, 2.6  # [in] where there is room for more
CURVE_SHARE, LEAST_PLANE = 0.6, 0.8  # of the room, and [in], where there is little


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FleetPage:
    """A figure with its axes, without what is drawn on them."""

    figure: Figure
    plane: Axes
    bars: Axes
    curves: tuple[Axes, ...]  # over time, below the bars

    @property
    def upper(self) -> list[Axes]:
        """Axes over time that leave their times to those below."""
        return [self.bars, *self.curves][:-1]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Box:
    """A place of axes [in]."""

    left: float
    bottom: float
    width: float
    height: float


def fleet_page(
    cast: Cast,
    look: Look,
    lines: Sequence[str],
    legend: tuple[list[Artist], list[str]],
    *,
    curves: int,
) -> FleetPage:
    """A page with a heading of some lines, a legend, and so many curves over time."""
    handles, names = legend
    inner = look.width - LEFT - RIGHT
    heading = title_lines(look, inner, *lines)
    bottom = 0.02 + 0.18 * legend_rows(names, inner)
    plane, bars, below, height = _layout(cast, look, bottom, heading_height(heading), curves=curves)
    figure = new_figure(look.width, height)
    heading_text(figure, heading, left=0.3)
    page = FleetPage(
        figure=figure,
        plane=_axes(figure, plane),
        bars=_axes(figure, bars),
        curves=tuple(_axes(figure, box) for box in below),
    )
    bottom_legend(figure, handles, names, left=LEFT, width=inner)
    return page


def _axes(figure: Figure, box: _Box) -> Axes:
    return axes_at(figure, left=box.left, bottom=box.bottom, width=box.width, height=box.height)


def _layout(
    cast: Cast, look: Look, bottom: float, head: float, *, curves: int
) -> tuple[_Box, _Box, list[_Box], float]:
    """Places of plane, bars and curves, and the height of the page [in]."""
    wide, high = np.ptp(cast.box, axis=0).tolist()
    inner = look.width - LEFT - RIGHT
    rows = min(max(ROW * len(cast.members), LEAST_BARS), MOST_BARS)
    tail = curves * (CURVE + GAP)
    floor = bottom + LABELS
    if look.is_narrow or wide > FLAT * high:
        if look.height is None:
            plane_height = min(max(inner * high / max(wide, 1e-9), LOWEST), HIGH)
        else:
            plane_height = max(look.height - floor - rows - tail - LABELS - head - 0.1, LEAST_PLANE)
        bars = _Box(left=LEFT, bottom=floor + tail, width=inner, height=rows)
        below = _stacked(curves, left=LEFT, bottom=floor, width=inner, height=CURVE)
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
    room = plane_height - curves * GAP
    most = max(MOST_ROW * len(cast.members), room - curves * MOST_CURVE)
    least = min(CURVE, CURVE_SHARE * room / max(curves, 1))
    rows = min(most, room - curves * least)
    each = (room - rows) / max(curves, 1)
    bars = _Box(left=left, bottom=floor + plane_height - rows, width=width, height=rows)
    below = _stacked(curves, left=left, bottom=floor, width=width, height=each)
    return plane, bars, below, floor + plane_height + head + 0.1


def _stacked(count: int, *, left: float, bottom: float, width: float, height: float) -> list[_Box]:
    """Places above each other, the first on top."""
    return [
        _Box(left=left, bottom=bottom + k * (height + GAP), width=width, height=height)
        for k in reversed(range(count))
    ]
