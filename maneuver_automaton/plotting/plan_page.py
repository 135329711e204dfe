"""The page of a plan: the plane beside what happens over time, or above it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.colors import Color
from maneuver_automaton.plotting.controls import (
    draw_track_altitude,
    draw_track_controls,
    draw_track_states,
)
from maneuver_automaton.plotting.cut_off import REACHED, draw_cut_off
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.motions import track_colors
from maneuver_automaton.plotting.nodes import draw_cost_bar, draw_nodes
from maneuver_automaton.plotting.pages import (
    axes_at,
    bottom_legend,
    heading_height,
    heading_text,
    hide_times,
    legend_rows,
    new_figure,
    stacked_axes,
    title_lines,
)
from maneuver_automaton.plotting.paths import draw_track, scene_handles, trim_handles
from maneuver_automaton.plotting.scene import (
    MARGIN,
    Scene,
    scene_points,
    scene_size,
    view_box,
)
from maneuver_automaton.plotting.track import Track

if TYPE_CHECKING:
    from maneuver_automaton.bounds import Narrowest

LEFT, RIGHT = 0.7, 0.15  # [in] beside the axes on a page
PLANE, BETWEEN = 0.55, 0.83  # share of the plane in the width, and [in] to what is beside it
LOW, HIGH, LOW_FLAT, HIGH_FLAT = 3.55, 5.6, 1.7, 4.6  # [in] height of the plane
PANEL, FLAT_PANEL, GAP = 1.25, 1.35, 0.75  # [in] heights over time, and beside each other
LABELS, BAR = 0.56, 0.3  # [in] below axes with numbers, and for a colour bar
FLAT = 1.7  # a plane so much wider than high is given the width of the page
LEAST_PANEL = 1.35  # [in] width of what is over time; more of it stands in rows
LEAST_PLANE, LEAST_HIGH = 1.0, 0.6  # [in] heights of plane and panels in a page of stated height
MOST_PANELS = 4  # over time: of reduced state and controls


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sheet:
    """What the picture of one plan shows."""

    track: Track
    scene: Scene
    word: str
    headline: str
    labels: Sequence[str]  # of the controls
    state_labels: Sequence[str] = ()
    look: Look
    nodes: Array | None = None  # (n, 3) or (n, 4)
    reached: Array | None = None  # (n, 4, 2)
    narrowest: Narrowest | None = None


def plan_page(sheet: Sheet) -> Figure:
    """The plane beside what happens over time, or above it if the plane is flat or the page narrow.

    A page of a stated height gives the plane what the rest leaves.
    """
    track, look = sheet.track, sheet.look
    inner = look.width - LEFT - RIGHT
    colors = track_colors(track.twists)
    handles, names = _legend_entries(sheet, colors)
    lines = title_lines(look, inner, sheet.headline, sheet.word)
    states, many = _panels(track)
    panels = states + many + track.climbs if track.pieces else 0
    edge = RIGHT if look.is_narrow else LEFT  # of the legend: a column has no room to spare
    bottom = 0.6 + 0.2 * legend_rows(names, look.width - edge - RIGHT)
    top = heading_height(lines) + 0.08 + (BAR if _has_costs(sheet) else 0.0)
    shape = _shape(sheet)
    flat = shape > FLAT or not panels or look.is_narrow
    below = (FLAT_PANEL + LABELS) * _rows(panels, inner) if flat else 0.0
    needed = below + LEAST_PLANE if flat else LEAST_HIGH * panels
    if look.height is not None and look.height - bottom - top < needed:
        panels, below, flat = 0, 0.0, True
    if flat:
        height = min(max(inner / shape, LEAST_PLANE if look.is_narrow else LOW_FLAT), HIGH_FLAT)
    else:
        height = max(min(max(PLANE * inner / shape, LOW), HIGH), PANEL * panels)
    if look.height is not None:
        height = max(LEAST_PLANE, look.height - bottom - below - top)
    figure = new_figure(look.width, bottom + below + height + top)
    wide = inner if flat else PLANE * inner
    ax = axes_at(figure, left=LEFT, bottom=bottom + below, width=wide, height=height)
    if flat:
        side = _beside(figure, panels, bottom=bottom, inner=inner)
    else:
        left = LEFT + wide + BETWEEN
        side = stacked_axes(
            figure, panels, left=left, bottom=bottom, width=look.width - left - RIGHT,
            height=height,
        )  # fmt: skip
    draw_track(ax, track, sheet.scene, colors=colors, legend=False)
    _draw_nodes(figure, ax, sheet)
    if sheet.reached is not None:
        draw_cut_off(ax, sheet.reached, narrowest=sheet.narrowest)
    _draw_over_time(side, sheet, states=states, many=many, colors=colors)
    if not flat:
        hide_times(side[:-1])
    heading_text(figure, lines, left=LEFT)
    bottom_legend(figure, handles, names, left=edge, width=look.width - edge - RIGHT)
    return figure


def _draw_over_time(
    side: Sequence[Axes], sheet: Sheet, *, states: int, many: int, colors: Mapping[str, Color]
) -> None:
    """Draw reduced state, controls and altitude, each on its axes."""
    if not side:
        return
    track = sheet.track
    named = list(sheet.state_labels) or [f"state {k + 1}" for k in range(states)]
    draw_track_states(side[:states], track, labels=named[:states], colors=colors)
    if many:
        draw_track_controls(side[states : states + many], track, labels=sheet.labels, colors=colors)
    if track.climbs:
        draw_track_altitude(side[-1], track, colors=colors)


def _panels(track: Track) -> tuple[int, int]:
    """How many components of the reduced state and controls there is room for over time."""
    if not track.pieces:
        return 0, 0
    states = min(track.pieces[0].state.shape[1], MOST_PANELS)
    controls = track.pieces[0].control.shape[1]
    return states, controls if states + controls <= MOST_PANELS else 0


def _columns(inner: float) -> int:
    """How many axes over time have room beside each other."""
    return max(1, int((inner + GAP) / (LEAST_PANEL + GAP)))


def _rows(count: int, inner: float) -> int:
    """Rows that `count` axes over time take in a width [in]."""
    return math.ceil(count / _columns(inner))


def _beside(figure: Figure, count: int, *, bottom: float, inner: float) -> list[Axes]:
    """`count` axes beside each other in the width of the page, in as many rows as it takes."""
    rows = _rows(count, inner)
    columns = math.ceil(count / max(rows, 1))
    width = (inner - GAP * (columns - 1)) / max(columns, 1)
    return [
        axes_at(
            figure,
            left=LEFT + k % columns * (width + GAP),
            bottom=bottom + (rows - 1 - k // columns) * (FLAT_PANEL + LABELS),
            width=width,
            height=FLAT_PANEL,
        )
        for k in range(count)
    ]


def _draw_nodes(figure: Figure, ax: Axes, sheet: Sheet) -> None:
    if sheet.nodes is None:
        return
    cost = sheet.nodes[:, 3] if _has_costs(sheet) else None
    ticks = draw_nodes(ax, sheet.nodes[:, :3], cost=cost)
    if cost is not None:
        place = ax.get_position()
        wide, high = figure.get_size_inches()
        box = (place.x1 * wide - 1.7, place.y1 * high + 0.06, 1.7, 0.08)
        draw_cost_bar(figure, ticks, box=box)


def _has_costs(sheet: Sheet) -> bool:
    return sheet.nodes is not None and sheet.nodes.shape[-1] == 4


def _shape(sheet: Sheet) -> float:
    """Width of what the plane shows by its height."""
    size = scene_size(sheet.scene, sheet.track)
    points = scene_points(sheet.scene, sheet.track, size=size)
    sides = np.ptp(view_box(sheet.scene, points, size=size), axis=0)
    wide, high = sides * (1.0 + 2.0 * MARGIN)
    return float(wide / high)


def _legend_entries(sheet: Sheet, colors: Mapping[str, Color]) -> tuple[list[Artist], list[str]]:
    """Handles and names of the trims of a track, and of what else is in the plane."""
    handles, names = trim_handles(sheet.track, colors)
    others, other_names = scene_handles(sheet.track, sheet.scene)
    if sheet.reached is not None:
        others, other_names = [*others, Patch(color=REACHED)], [*other_names, "may be reached"]
    return [*handles, *others], [*names, *other_names]
