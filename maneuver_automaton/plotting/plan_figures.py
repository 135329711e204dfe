"""Pictures of a result as files: the plan, and its alternatives."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.plotting.alternatives import alternative_text, draw_alternatives, plan_color
from maneuver_automaton.plotting.colors import INK, Color, trim_colors
from maneuver_automaton.plotting.controls import (
    draw_over_time,
    draw_track_altitude,
    draw_track_controls,
    step_curves,
)
from maneuver_automaton.plotting.labels import control_labels, result_text, word_text
from maneuver_automaton.plotting.pages import (
    axes_at,
    bottom_legend,
    heading_text,
    legend_rows,
    new_figure,
    stacked_axes,
    write_figure,
)
from maneuver_automaton.plotting.paths import draw_track, end_handles, trim_handles
from maneuver_automaton.plotting.style import SMALL_PT, TEXT_PT, line_handle, share_limits
from maneuver_automaton.plotting.track import Track, track_of_document, track_of_plan

WIDTH, LEFT = 9.6, 0.7  # [in] of the page, and of what stands left of the axes on it
WORD_WIDTH, WORD_LINES, HEADLINE_WIDTH = 112, 2, 96  # [characters]
MOST_NAMES = 34
ALTERNATIVE_ROW = 0.95  # [in]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Sheet:
    """What the picture of one plan shows."""

    track: Track
    goal: Array
    word: str
    headline: str
    labels: Sequence[str]


def save_plan_figure(result: PlanResult, path: str | Path, *, footprint: Any = None) -> None:
    """Write the picture of a `result`: path on the left, controls over time on the right.

    Without a plan it shows start and goal, and says why there is none. The file is replaced in
    one step; its ending chooses the format.

    Parameters
    ----------
    result : PlanResult
        What to draw.
    path : str or Path
        Where to write.
    footprint : any form of `footprint_polygons`, optional
        The body of the vehicle.
    """
    problem, plan = result.problem, result.plan
    goal = problem.goals[result.goal_index or 0]
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
        )
    pose = goal.pose.copy()
    if goal.free_heading:
        pose[2] = track.end[2]
    sheet = _Sheet(
        track=track,
        goal=pose,
        word="" if plan is None else word_text(plan.word, width=WORD_WIDTH, lines=WORD_LINES),
        headline=headline,
        labels=control_labels(problem.automaton.model.control_names),
    )
    write_figure(_plan_figure(sheet, footprint=footprint), path)


def save_plan_file_figure(
    document: Mapping[str, Any], path: str | Path, *, footprint: Any = None
) -> None:
    """Write the picture of a loaded plan.json: that of `save_plan_figure`, from the file alone.

    The file does not name the controls, so they are numbered.

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
        goal=track.end,
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
        ),
        labels=(),
    )
    write_figure(_plan_figure(sheet, footprint=footprint), path)


def save_alternatives_figure(
    result: PlanResult, path: str | Path, *, footprint: Any = None
) -> None:
    """Write a picture of all plans of a `result`: overlaid on the left, their controls beside.

    Raises
    ------
    ValueError
        If the result has no plan.
    """
    if result.plan is None or result.cost is None:
        raise ValueError(f"alternatives: the result holds no plan: {result.reason}")
    plans = [result.plan, *(other.plan for other in result.alternatives)]
    costs = [result.cost, *(other.cost for other in result.alternatives)]
    labels = control_labels(result.problem.automaton.model.control_names)
    body = max(3.6, ALTERNATIVE_ROW * len(plans))
    figure = new_figure(WIDTH, 0.52 + body + 0.5)
    heading_text(figure, [(_count_text(len(plans)), 10.0, "bold")], left=LEFT)
    tall = min(body, 4.6)
    ax = axes_at(figure, left=LEFT, bottom=0.5 + body - tall, width=3.82, height=tall)
    draw_alternatives(ax, plans, costs=costs, footprint=footprint, legend=False)
    _draw_rows(figure, plans, costs, labels=labels, left=5.1, bottom=0.5, height=body)
    write_figure(figure, path)


def _count_text(count: int) -> str:
    return "1 plan" if count == 1 else f"{count} locally optimal plans, best first"


def _draw_rows(
    figure: Figure, plans: Sequence[Plan], costs: Sequence[float], *, labels: Sequence[str],
    left: float, bottom: float, height: float,
) -> None:  # fmt: skip
    """One row per plan, one column per control, scales shared by the column."""
    high = figure.get_size_inches()[1]
    row, gap = min(height / len(plans), 1.3), 0.5
    width = (WIDTH - 0.15 - left + gap) / len(labels) - gap
    tracks = [track_of_plan(plan) for plan in plans]
    for k, label in enumerate(labels):
        column = [
            axes_at(
                figure, left=left + k * (width + gap), bottom=bottom + height - (n + 1) * row,
                width=width, height=row - 0.36,
            )
            for n in range(len(plans))
        ]  # fmt: skip
        for n, (ax, track) in enumerate(zip(column, tracks, strict=True)):
            draw_over_time(
                ax,
                track,
                step_curves(track, k),
                label="",
                colors=plan_color(n),
            )
        share_limits(column)
        figure.text(
            (left + k * (width + gap)) / WIDTH, (bottom + height - 0.1) / high, label,
            fontsize=TEXT_PT, color=INK, va="bottom", parse_math=False,
        )  # fmt: skip
    for n, (plan, cost) in enumerate(zip(plans, costs, strict=True)):
        figure.text(
            left / WIDTH, (bottom + height - n * row - 0.31) / high,
            alternative_text(plan, cost, width=74), fontsize=SMALL_PT, color=plan_color(n),
            fontweight="bold" if n == 0 else "normal", va="bottom", parse_math=False,
        )  # fmt: skip


def _plan_figure(sheet: _Sheet, *, footprint: Any) -> Figure:
    colors = trim_colors(sheet.track.twists)
    handles, shown = _legend_entries(sheet.track, colors)
    many = sheet.track.pieces[0].control.shape[1] if sheet.track.pieces else 0
    panels = many + sheet.track.climbs if sheet.track.pieces else 0
    strip = 0.2 + 0.2 * legend_rows(shown, WIDTH - LEFT - 0.08)
    word = sheet.word
    top = 0.58 + 0.18 * word.count("\n") + 0.2 * sheet.headline.count("\n")
    bottom, inner = strip + 0.42, max(3.55, 1.25 * panels)
    figure = new_figure(WIDTH, top + inner + bottom)
    heading_text(figure, [(sheet.headline, 10.0, "bold"), (word, TEXT_PT, "normal")], left=LEFT)
    ax = axes_at(
        figure,
        left=LEFT,
        bottom=bottom,
        width=4.82 if panels else WIDTH - LEFT - 0.18,
        height=inner,
    )
    draw_track(ax, sheet.track, footprint=footprint, goal=sheet.goal, colors=colors, legend=False)
    if panels:
        side = stacked_axes(
            figure, panels, left=6.35, bottom=bottom, width=WIDTH - 6.35 - 0.15, height=inner
        )
        draw_track_controls(side[:many], sheet.track, labels=sheet.labels, colors=colors)
        if sheet.track.climbs:
            draw_track_altitude(side[-1], sheet.track, colors=colors)
        for upper in side[:-1]:
            upper.set_xlabel("")
            upper.tick_params(labelbottom=False)
    bottom_legend(figure, handles, shown, left=LEFT, width=WIDTH - LEFT - 0.08)
    return figure


def _legend_entries(track: Track, colors: Mapping[str, Color]) -> tuple[list[Line2D], list[str]]:
    """Handles and names of the first trims of a track, and of its start and goal."""
    handles, names = trim_handles(track, colors)
    ends, end_names = end_handles()
    left_out = len(names) - MOST_NAMES
    if left_out <= 0:
        return [*handles, *ends], [*names, *end_names]
    blank = line_handle((1.0, 1.0, 1.0))
    return (
        [*handles[:MOST_NAMES], blank, *ends],
        [*names[:MOST_NAMES], f"and {left_out} more", *end_names],
    )


def _no_plan_text(status: str, reason: str) -> str:
    text = f"{status.replace('_', ' ')}: {reason}".rstrip(": ")
    return textwrap.fill(text, HEADLINE_WIDTH)


def _empty_figure(headline: str) -> Figure:
    figure = new_figure(WIDTH, 0.5 + 0.2 * headline.count("\n"))
    heading_text(figure, [(headline, 10.0, "bold")], left=0.3)
    return figure
