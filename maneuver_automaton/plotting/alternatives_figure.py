"""The picture of a result and its alternatives as a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from maneuver_automaton.automaton import Plan
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.plotting.alternatives import alternative_text, draw_alternatives, plan_color
from maneuver_automaton.plotting.colors import INK
from maneuver_automaton.plotting.controls import draw_over_time, step_curves
from maneuver_automaton.plotting.labels import control_labels
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.pages import (
    axes_at,
    heading_height,
    heading_text,
    new_figure,
    title_lines,
    write_figure,
)
from maneuver_automaton.plotting.style import SMALL_PT, TEXT_PT, share_limits
from maneuver_automaton.plotting.track import track_of_plan

WIDTH, LEFT = 9.6, 0.7  # [in] of the page, and of what stands left of the axes on it
ROW = 0.95  # [in]


def save_alternatives_figure(
    result: PlanResult, path: str | Path, *, footprint: Any = None, title: str = ""
) -> None:
    """Write a picture of all plans of a `result`: overlaid on the left, their controls beside.

    The body is that of the problem if no `footprint` is given. A `title` stands above.

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
    body = max(3.6, ROW * len(plans))
    lines = title_lines(Look(title=title), WIDTH - LEFT, _count_text(len(plans)))
    figure = new_figure(WIDTH, 0.5 + body + 0.2 + heading_height(lines))
    heading_text(figure, lines, left=LEFT)
    tall = min(body, 4.6)
    ax = axes_at(figure, left=LEFT, bottom=0.5 + body - tall, width=3.82, height=tall)
    draw_alternatives(
        ax, plans, costs=costs, problem=result.problem, footprint=footprint, legend=False
    )
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
