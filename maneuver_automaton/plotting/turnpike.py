"""Draw turnpikes: speeds over time for longer and longer paths, costs, and time away."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from maneuver_automaton.analysis.turnpike import Turnpike
from maneuver_automaton.plotting.colors import GREY, INK, SEQUENCE
from maneuver_automaton.plotting.controls import TIME_LABEL
from maneuver_automaton.plotting.labels import control_labels
from maneuver_automaton.plotting.pages import axes_at, heading_text, new_figure, write_figure
from maneuver_automaton.plotting.style import outer_legend, tidy

WIDEST = 2.4  # line of the shortest path, which the longer ones would hide


def save_turnpike_figure(study: Turnpike, path: str | Path) -> None:
    """Write the picture of a trim over longer and longer paths.

    Left, a component of the reduced state over time; in the middle, what the automaton and the
    optimum cost beyond the trim's rate; right, how long the optimum is away from the trim.
    """
    figure = new_figure(10.7, 3.6)
    axes = [
        axes_at(figure, left=0.75 + 3.45 * k, bottom=0.6, width=2.6, height=2.3) for k in (0, 1, 2)
    ]
    draw_turnpike_states(axes[0], study)
    draw_turnpike_costs(axes[1], study)
    draw_time_away(axes[2], study)
    longest = study.cases[-1]
    headline = (
        f"turnpike at {study.trim.name}: away for {longest.away:.3g} s of {longest.duration:.3g} s"
    )
    heading_text(figure, [(headline, 10.0, "bold")], left=0.3)
    write_figure(figure, path)


def draw_turnpike_states(ax: Axes, study: Turnpike, *, component: int = 0) -> list[Line2D]:
    """Draw a component of the reduced state over time, one line for each path, and the trim's."""
    lines = []
    for k, case in enumerate(study.cases):
        time = case.optimum.time
        values = case.optimum.state[:, case.goal.size + component]
        width = max(1.0, WIDEST - 0.4 * k)
        lines += ax.plot(time, values, color=SEQUENCE[k % len(SEQUENCE)], linewidth=width)
    level = float(study.trim.reduced_state[component])
    lines.append(ax.axhline(level, color=INK, linewidth=1.0, linestyle=(0, (3, 2))))
    names = [f"{case.duration:.3g} s" for case in study.cases] + ["trim"]
    tidy(ax, x=TIME_LABEL, y=control_labels([study.reduced_names[component]])[0])
    outer_legend(ax, lines, names, above=True)
    return lines


def draw_turnpike_costs(ax: Axes, study: Turnpike) -> list[Line2D]:
    """Draw what automaton and optimum cost more than the trim's rate times the time in it."""
    coast = np.array([case.coast for case in study.cases])
    rows = {
        "automaton": np.array([case.automaton_cost for case in study.cases]),
        "optimum": np.array([case.optimum.cost for case in study.cases]),
    }
    beyond = {name: values - study.unit_cost * coast for name, values in rows.items()}
    lines = [
        ax.plot(coast, values, color=color, linewidth=1.8, marker="o", markersize=4.0)[0]
        for values, color in zip(beyond.values(), (GREY, SEQUENCE[0]), strict=True)
    ]
    tidy(ax, x="time in the trim [s]", y="cost beyond the trim's")
    outer_legend(ax, lines, list(beyond), above=True)
    return lines


def draw_time_away(ax: Axes, study: Turnpike) -> list[Line2D]:
    """Draw how long the optimum is away from the trim, and how long it lasts."""
    duration = np.array([case.duration for case in study.cases])
    away = np.array([case.away for case in study.cases])
    lines = [
        *ax.plot(duration, duration, color=GREY, linewidth=1.0, linestyle=(0, (3, 2))),
        *ax.plot(duration, away, color=SEQUENCE[0], linewidth=1.8, marker="o", markersize=4.0),
    ]
    tidy(ax, x="duration [s]", y=f"time farther than {study.distance:g} [s]")
    outer_legend(ax, lines, ["all of it", "away"], above=True)
    return lines
