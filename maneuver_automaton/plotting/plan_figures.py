"""The picture of a plan as a file: its path among obstacles, and its controls over time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.bounds import Narrowest
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.plotting.colors import Color
from maneuver_automaton.plotting.controls import (
    draw_track_altitude,
    draw_track_controls,
    draw_track_states,
)
from maneuver_automaton.plotting.cut_off import REACHED, draw_cut_off
from maneuver_automaton.plotting.labels import control_labels, result_text, word_text
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
from maneuver_automaton.plotting.track import Track, track_of_document, track_of_plan

LEFT, RIGHT = 0.7, 0.15  # [in] beside the axes on a page
PLANE, BETWEEN = 0.55, 0.83  # share of the plane in the width, and [in] to what is beside it
LOW, HIGH, LOW_FLAT, HIGH_FLAT = 3.55, 5.6, 1.7, 4.6  # [in] height of the plane
PANEL, FLAT_PANEL, GAP = 1.25, 1.35, 0.75  # [in] heights over time, and beside each other
LABELS, BAR = 0.56, 0.3  # [in] below axes with numbers, and for a colour bar
FLAT = 1.7  # a plane so much wider than high is given the width of the page
LEAST_PANEL = 1.35  # [in] width of what is over time; more of it stands in rows
LEAST_PLANE, LEAST_HIGH = 1.0, 0.6  # [in] heights of plane and panels in a page of stated height
WORD_LINES, CHARACTER = 2, 0.08  # lines of the word, and [in] of each character
MOST_PANELS = 4  # over time: of reduced state and controls


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Sheet:
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


def save_plan_figure(
    result: PlanResult,
    path: str | Path,
    *,
    footprint: Any = None,
    nodes: ArrayLike | None = None,
    look: Look | None = None,
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
    look : Look, optional
        Title, size and style.

    Raises
    ------
    ValueError
        If the nodes are none, or Matplotlib does not know the ending.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    write_figure(plan_figure(result, footprint=footprint, nodes=nodes, look=look), path)


def plan_figure(
    result: PlanResult,
    *,
    footprint: Any = None,
    nodes: ArrayLike | None = None,
    look: Look | None = None,
) -> Figure:
    """The picture of a `result` that `save_plan_figure` writes, in no window.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Problem, Unicycle, plan
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "spin": (0, 1)})
    >>> figure = plan_figure(plan(Problem(robot, [0, 0, 0], [2, 0, 0])), look=Look(title="Ahead"))
    >>> figure.texts[0].get_text()
    'Ahead'
    """
    problem, plan = result.problem, result.plan
    look = look or Look()
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
        word="" if plan is None else _word(plan.word, look),
        headline=headline,
        labels=control_labels(problem.automaton.model.control_names),
        state_labels=control_labels(problem.automaton.model.reduced_names),
        look=look,
        nodes=None if nodes is None else as_array("nodes", nodes, last=(3, 4)),
        reached=result.reached,
        narrowest=result.narrowest,
    )
    return _plan_figure(sheet)


def save_plan_file_figure(
    document: Mapping[str, Any],
    path: str | Path,
    *,
    footprint: Any = None,
    look: Look | None = None,
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
    look = look or Look()
    if track is None:
        headline = _no_plan_text(str(document["status"]), document.get("reason") or "")
        write_figure(_empty_figure(headline, look), path)
        return
    sheet = _Sheet(
        track=track,
        scene=bare_scene(track, footprint=footprint),
        word=_word([str(part["name"]) for part in document["primitives"]], look),
        headline=result_text(
            cost=document.get("cost"),
            duration=document.get("duration_s"),
            error_m=error.get("position_m"),
            error_rad=error.get("heading_rad"),
            clearance_m=document.get("clearance_m"),
        ),
        labels=(),
        look=look,
    )
    write_figure(_plan_figure(sheet), path)


def _plan_figure(sheet: _Sheet) -> Figure:
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
    bottom = 0.6 + 0.2 * legend_rows(names, inner)
    top = heading_height(lines) + 0.08 + (BAR if _has_costs(sheet) else 0.0)
    shape = _shape(sheet)
    flat = shape > FLAT or not panels or look.is_narrow
    below = (FLAT_PANEL + LABELS) * _rows(panels, inner) if flat else 0.0
    needed = below + LEAST_PLANE if flat else LEAST_HIGH * panels
    if look.height is not None and look.height - bottom - top < needed:
        panels, below, flat = 0, 0.0, True
    if flat:
        height = min(max(inner / shape, LOW_FLAT), HIGH_FLAT)
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
    bottom_legend(figure, handles, names, left=LEFT, width=inner)
    return figure


def _draw_over_time(
    side: Sequence[Axes], sheet: _Sheet, *, states: int, many: int, colors: Mapping[str, Color]
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


def _word(word: Sequence[str], look: Look) -> str:
    """The word of a plan in the lines that there are for it."""
    return word_text(word, width=int((look.width - LEFT - RIGHT) / CHARACTER), lines=WORD_LINES)


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
    """Handles and names of the trims of a track, and of what else is in the plane."""
    handles, names = trim_handles(sheet.track, colors)
    others, other_names = scene_handles(sheet.track, sheet.scene)
    if sheet.reached is not None:
        others, other_names = [*others, Patch(color=REACHED)], [*other_names, "may be reached"]
    return [*handles, *others], [*names, *other_names]


def _no_plan_text(status: str, reason: str) -> str:
    return f"{status.replace('_', ' ')}: {reason}".rstrip(": ")


def _empty_figure(headline: str, look: Look) -> Figure:
    lines = title_lines(look, look.width - 0.6, headline)
    figure = new_figure(look.width, heading_height(lines) + 0.18)
    heading_text(figure, lines, left=0.3)
    return figure
