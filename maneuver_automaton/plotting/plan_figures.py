"""The picture of a plan as a file: its path among obstacles, and its controls over time."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.plotting.colors import Color, trim_colors
from maneuver_automaton.plotting.controls import (
    draw_track_altitude,
    draw_track_controls,
    draw_track_states,
)
from maneuver_automaton.plotting.cut_off import REACHED, draw_cut_off
from maneuver_automaton.plotting.labels import control_labels, result_text, word_text
from maneuver_automaton.plotting.nodes import draw_cost_bar, draw_nodes
from maneuver_automaton.plotting.pages import (
    axes_at,
    bottom_legend,
    heading_text,
    legend_rows,
    new_figure,
    stacked_axes,
    write_figure,
)
from maneuver_automaton.plotting.paths import bare_scene, draw_track, scene_handles, trim_handles
from maneuver_automaton.plotting.scene import (
    MARGIN,
    Scene,
    plan_scene,
    scene_points,
    scene_size,
    view_box,
)
from maneuver_automaton.plotting.style import TEXT_PT, line_handle
from maneuver_automaton.plotting.track import Track, track_of_document, track_of_plan

if TYPE_CHECKING:
    from maneuver_automaton.bounds import Narrowest

WIDTH, LEFT, RIGHT = 9.6, 0.7, 0.15  # [in] of the page, and beside the axes on it
INNER = WIDTH - LEFT - RIGHT
PLANE, SIDE = 4.82, 6.35  # [in] width of the plane, and where what is beside it begins
LOW, HIGH, LOW_FLAT, HIGH_FLAT = 3.55, 5.6, 1.7, 4.6  # [in] height of the plane
PANEL, FLAT_PANEL, GAP = 1.25, 1.35, 0.75  # [in] heights over time, and beside each other
LABELS, BAR = 0.56, 0.3  # [in] below axes with numbers, and for a colour bar
FLAT = 1.7  # a plane so much wider than high is given the width of the page
WORD_WIDTH, WORD_LINES, HEADLINE_WIDTH = 112, 2, 96  # [characters]
MOST_PANELS = 4  # over time: of reduced state and controls
MOST_NAMES = 34


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Sheet:
    """What the picture of one plan shows."""

    track: Track
    scene: Scene
    word: str
    headline: str
    labels: Sequence[str]  # of the controls
    state_labels: Sequence[str] = ()
    nodes: Array | None = None  # (n, 3) or (n, 4)
    reached: Array | None = None  # (n, 4, 2)
    narrowest: Narrowest | None = None


def save_plan_figure(
    result: PlanResult,
    path: str | Path,
    *,
    footprint: Any = None,
    nodes: ArrayLike | None = None,
) -> None:
    """Write the picture of a `result`: obstacles, path, what the body sweeps, controls over time.

    Without a plan it shows start and goal, and says why there is none. The file is replaced in
    one step; its ending chooses the format.

    Parameters
    ----------
    result : PlanResult
        What to draw.
    path : str or Path
        Where to write.
    footprint : any form of `footprint_polygons`, optional
        The body of the vehicle; that of the problem if left out.
    nodes : (n, 3) or (n, 4) array_like, optional
        Poses that the search has expanded [m, m, rad], and the cost of each.

    Raises
    ------
    ValueError
        If the nodes are none, or Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    problem, plan = result.problem, result.plan
    if plan is None:
        track = Track(problem.start, ())
        headline = _no_plan_text(result.status.value, result.reason)
    else:
        track = track_of_plan(plan)
        error = result.terminal_error
        headline = result_text(
            cost=result.cost,
            duration=plan.duration,
            error_m=None if error is None else error.position_m,
            error_rad=None if error is None else error.heading_rad,
            clearance_m=result.clearance_m,
        )
    sheet = _Sheet(
        track=track,
        scene=plan_scene(problem, plan, footprint=footprint),
        word="" if plan is None else word_text(plan.word, width=WORD_WIDTH, lines=WORD_LINES),
        headline=headline,
        labels=control_labels(problem.automaton.model.control_names),
        state_labels=control_labels(problem.automaton.model.reduced_names),
        nodes=None if nodes is None else as_array("nodes", nodes, last=(3, 4)),
        reached=result.reached,
        narrowest=result.narrowest,
    )
    write_figure(_plan_figure(sheet), path)


def save_plan_file_figure(
    document: Mapping[str, Any], path: str | Path, *, footprint: Any = None
) -> None:
    """Write the picture of a loaded plan.json: that of `save_plan_figure`, from the file alone.

    The file names neither controls nor obstacles: the former are numbered.

    Raises
    ------
    KeyError
        If a key of the contract is missing.
    ValueError
        If the trajectory holds no numbers, or its columns differ in length.
    """
    track = track_of_document(document)
    error = document.get("terminal_error") or {}
    if track is None:
        headline = _no_plan_text(str(document["status"]), document.get("reason") or "")
        write_figure(_empty_figure(headline), path)
        return
    sheet = _Sheet(
        track=track,
        scene=bare_scene(track, footprint=footprint),
        word=word_text(
            [str(part["name"]) for part in document["primitives"]],
            width=WORD_WIDTH,
            lines=WORD_LINES,
        ),
        headline=result_text(
            cost=document.get("cost"),
            duration=document.get("duration_s"),
            error_m=error.get("position_m"),
            error_rad=error.get("heading_rad"),
            clearance_m=document.get("clearance_m"),
        ),
        labels=(),
    )
    write_figure(_plan_figure(sheet), path)


def _plan_figure(sheet: _Sheet) -> Figure:
    """The plane beside what happens over time, or above it if the plane is flat."""
    track = sheet.track
    colors = trim_colors(track.twists)
    handles, names = _legend_entries(sheet, colors)
    states, many = _panels(track)
    panels = states + many + track.climbs if track.pieces else 0
    bottom = 0.6 + 0.2 * legend_rows(names, INNER)
    top = 0.36 + 0.2 * sheet.headline.count("\n")
    top += 0.2 + 0.18 * sheet.word.count("\n") if sheet.word else 0.0
    top += BAR if _has_costs(sheet) else 0.0
    shape = _shape(sheet)
    flat = shape > FLAT or not panels
    if flat:
        height = min(max(INNER / shape, LOW_FLAT), HIGH_FLAT)
        below = FLAT_PANEL + LABELS if panels else 0.0
        figure = new_figure(WIDTH, bottom + below + height + top)
        ax = axes_at(figure, left=LEFT, bottom=bottom + below, width=INNER, height=height)
        side = _beside(figure, panels, bottom=bottom)
    else:
        height = max(min(max(PLANE / shape, LOW), HIGH), PANEL * panels)
        figure = new_figure(WIDTH, bottom + height + top)
        ax = axes_at(figure, left=LEFT, bottom=bottom, width=PLANE, height=height)
        side = stacked_axes(
            figure, panels, left=SIDE, bottom=bottom, width=WIDTH - SIDE - RIGHT, height=height
        )
    draw_track(ax, track, sheet.scene, colors=colors, legend=False)
    _draw_nodes(figure, ax, sheet)
    if sheet.reached is not None:
        draw_cut_off(ax, sheet.reached, narrowest=sheet.narrowest)
    if side:
        named = list(sheet.state_labels) or [f"state {k + 1}" for k in range(states)]
        draw_track_states(side[:states], track, labels=named[:states], colors=colors)
        if many:
            draw_track_controls(
                side[states : states + many], track, labels=sheet.labels, colors=colors
            )
        if track.climbs:
            draw_track_altitude(side[-1], track, colors=colors)
    if not flat:
        for upper in side[:-1]:
            upper.set_xlabel("")
            upper.tick_params(labelbottom=False)
    heading_text(
        figure, [(sheet.headline, 10.0, "bold"), (sheet.word, TEXT_PT, "normal")], left=LEFT
    )
    bottom_legend(figure, handles, names, left=LEFT, width=INNER)
    return figure


def _panels(track: Track) -> tuple[int, int]:
    """How many components of the reduced state and controls there is room for over time."""
    if not track.pieces:
        return 0, 0
    states = min(track.pieces[0].state.shape[1], MOST_PANELS)
    controls = track.pieces[0].control.shape[1]
    return states, controls if states + controls <= MOST_PANELS else 0


def _beside(figure: Figure, count: int, *, bottom: float) -> list[Axes]:
    """`count` axes beside each other in the width of the page."""
    width = (INNER - GAP * (count - 1)) / max(count, 1)
    return [
        axes_at(
            figure, left=LEFT + k * (width + GAP), bottom=bottom, width=width, height=FLAT_PANEL
        )
        for k in range(count)
    ]


def _draw_nodes(figure: Figure, ax: Axes, sheet: _Sheet) -> None:
    if sheet.nodes is None:
        return
    cost = sheet.nodes[:, 3] if _has_costs(sheet) else None
    ticks = draw_nodes(ax, sheet.nodes[:, :3], cost=cost)
    if cost is not None:
        place = ax.get_position()
        wide, high = figure.get_size_inches()
        box = (place.x1 * wide - 1.7, place.y1 * high + 0.06, 1.7, 0.08)
        draw_cost_bar(figure, ticks, box=box)


def _has_costs(sheet: _Sheet) -> bool:
    return sheet.nodes is not None and sheet.nodes.shape[-1] == 4


def _shape(sheet: _Sheet) -> float:
    """Width of what the plane shows by its height."""
    size = scene_size(sheet.scene, sheet.track)
    points = scene_points(sheet.scene, sheet.track, size=size)
    sides = np.ptp(view_box(sheet.scene, points, size=size), axis=0)
    wide, high = sides * (1.0 + 2.0 * MARGIN)
    return float(wide / high)


def _legend_entries(sheet: _Sheet, colors: Mapping[str, Color]) -> tuple[list[Artist], list[str]]:
    """Handles and names of the first trims of a track, and of what else is in the plane."""
    handles, names = trim_handles(sheet.track, colors)
    others, other_names = scene_handles(sheet.track, sheet.scene)
    if sheet.reached is not None:
        others, other_names = [*others, Patch(color=REACHED)], [*other_names, "may be reached"]
    left_out = len(names) - MOST_NAMES
    if left_out <= 0:
        return [*handles, *others], [*names, *other_names]
    blank = line_handle((1.0, 1.0, 1.0))
    return (
        [*handles[:MOST_NAMES], blank, *others],
        [*names[:MOST_NAMES], f"and {left_out} more", *other_names],
    )


def _no_plan_text(status: str, reason: str) -> str:
    text = f"{status.replace('_', ' ')}: {reason}".rstrip(": ")
    return textwrap.fill(text, HEADLINE_WIDTH)


def _empty_figure(headline: str) -> Figure:
    figure = new_figure(WIDTH, 0.5 + 0.2 * headline.count("\n"))
    heading_text(figure, [(headline, 10.0, "bold")], left=0.3)
    return figure
