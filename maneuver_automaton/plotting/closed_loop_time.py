"""Draw a closed loop over time: its value and cost, and how long every step took to decide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.colors import GREY, INK, SEQUENCE, Color, shaded
from maneuver_automaton.plotting.controls import TIME_LABEL
from maneuver_automaton.plotting.style import SMALL_PT, plain, tidy
from maneuver_automaton.receding_horizon import ClosedLoop

VALUE, SPENT, BOTH = SEQUENCE[0], SEQUENCE[2], INK
BROKEN: Color = (0.86, 0.10, 0.10)
SHORTEST_S = 1e-6  # what a clock may have missed, for the logarithm


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ValueArtists:
    """Artists of `draw_value`."""

    value: Line2D
    spent: Line2D  # cost accumulated
    both: Line2D  # their sum
    bound: Line2D  # below which no plan of the step can cost
    replanned: PathCollection
    broken: PathCollection  # steps that broke a guarantee, or lost one to noise
    legend: Legend | None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SolveArtists:
    """Artists of `draw_solve_times`."""

    times: Line2D
    replanned: PathCollection


def draw_value(ax: Axes, loop: ClosedLoop, *, legend: bool = True) -> ValueArtists:
    """Draw the value of every step of a `loop`, the cost accumulated by then, and their sum.

    The sum never rises while nothing disturbs the loop: it falls where a step finds a better plan.
    Rings mark the steps that replanned, red crosses those that broke a guarantee, grey ones those
    that a disturbance took one from, and a pale line is the lower bound of the value.

    Parameters
    ----------
    ax : Axes
        Where to draw.
    loop : ClosedLoop
        What to draw; with no step there is a single point.
    legend : bool
        Whether to name the lines above the axes.

    Returns
    -------
    ValueArtists
        The artists, by what they show.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from maneuver_automaton import Automaton, Problem, Unicycle
    >>> from maneuver_automaton.receding_horizon import simulate
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "spin": (0, 1)})
    >>> loop = simulate(Problem(robot, [0, 0, 0], [2, 0, 0]), step=1.0)
    >>> artists = draw_value(Figure().add_subplot(), loop)
    >>> artists.value.get_ydata().tolist(), artists.spent.get_ydata().tolist()
    ([2.0, 1.0, 0.0], [0.0, 1.0, 2.0])
    """
    values, spent = values_and_costs(loop)
    times = loop.times
    bounds = np.array([step.lower_bound for step in loop.steps])
    bounds = np.where(np.isfinite(bounds), bounds, np.nan)
    replanned = np.array([step.replanned for step in loop.steps], dtype=bool)
    crossed = [step for step in loop.steps if step.violations or step.disturbed]
    begins = times[: len(loop.steps)]
    (bound,) = ax.plot(begins, bounds, color=shaded(VALUE, 0.6), linewidth=3.2, zorder=2.0)
    (both,) = ax.plot(times, values + spent, color=BOTH, linewidth=1.0, dashes=(4, 2), zorder=2.4)
    (cost,) = ax.plot(times, spent, color=SPENT, linewidth=1.6, zorder=2.6)
    size = 2.6 if len(times) <= 60 else 0.0
    (value,) = ax.plot(
        times, values, color=VALUE, linewidth=1.8, marker="o", markersize=size, zorder=2.8
    )
    heights = values[: len(loop.steps)]
    artists = ValueArtists(
        value=value,
        spent=cost,
        both=both,
        bound=bound,
        replanned=ax.scatter(
            begins[replanned], heights[replanned], s=30.0, facecolors="white",
            edgecolors=[INK], linewidths=1.0, zorder=3.0,
        ),
        broken=ax.scatter(
            [step.time for step in crossed], [step.value for step in crossed], s=34.0, marker="x",
            color=[BROKEN if step.violations else GREY for step in crossed], linewidths=1.6,
            zorder=3.2,
        ),
        legend=_legend(ax, [value, cost, both, bound], loop) if legend else None,
    )  # fmt: skip
    set_times(ax, loop)
    ax.set_ylim(bottom=0.0)
    ax.margins(y=0.08)
    tidy(ax, x=TIME_LABEL, y="cost")
    return artists


def draw_solve_times(ax: Axes, loop: ClosedLoop) -> SolveArtists:
    """Draw how long every step of a `loop` took to decide, on a logarithmic axis.

    Steps that replanned have a ring.
    """
    times, seconds = loop.times[: len(loop.steps)], np.maximum(loop.solve_s, SHORTEST_S)
    replanned = np.array([step.replanned for step in loop.steps], dtype=bool)
    ax.set_yscale("log")
    (line,) = ax.plot(
        times, seconds, color=GREY, linewidth=0.6, marker="o", markersize=3.0,
        markerfacecolor=INK, markeredgewidth=0.0, zorder=2.5,
    )  # fmt: skip
    rings = ax.scatter(
        times[replanned], seconds[replanned], s=30.0, facecolors="none", edgecolors=[INK],
        linewidths=1.0, zorder=3.0,
    )  # fmt: skip
    if seconds.size:  # whole decades, at least one
        low, high = (
            np.floor(np.log10(seconds.min() / 1.02)),
            np.ceil(np.log10(seconds.max() * 1.02)),
        )
        ax.set_ylim(10.0**low, 10.0**high)
    set_times(ax, loop)
    tidy(ax, x=TIME_LABEL, y="to decide [s]")
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.tick_params(which="minor", length=1.5, width=0.4, color=GREY)
    return SolveArtists(times=line, replanned=rings)


def values_and_costs(loop: ClosedLoop) -> tuple[Array, Array]:
    """Value (n + 1,) and accumulated cost (n + 1,) at the times of a `loop`; NaN if unknown."""
    values = np.array([*(step.value for step in loop.steps), loop.value])
    spent = np.array([*(step.accumulated_cost for step in loop.steps), loop.cost])
    if loop.status == "no_plan":
        values[-1] = np.nan
    return np.where(np.isfinite(values), values, np.nan), spent


def set_times(ax: Axes, loop: ClosedLoop) -> None:
    """The whole duration of a `loop` in x, with a little room."""
    begin, end = float(loop.times[0]), float(loop.times[-1])
    room = 0.02 * (end - begin) or 0.5
    ax.set_xlim(begin - room, end + room)


def _legend(ax: Axes, lines: list[Line2D], loop: ClosedLoop) -> Legend:
    ring = Line2D(
        [], [], linestyle="none", marker="o", markersize=5.5, markerfacecolor="white",
        markeredgecolor=INK, markeredgewidth=1.0,
    )  # fmt: skip
    cross, grey = (
        Line2D([], [], linestyle="none", marker="x", markersize=5.8, color=one, markeredgewidth=1.6)
        for one in (BROKEN, GREY)
    )
    handles, names = lines, ["value V", "spent", "sum", "lower bound"]
    if any(step.replanned for step in loop.steps):
        handles, names = [*handles, ring], [*names, "replanned"]
    if any(step.violations for step in loop.steps):
        handles, names = [*handles, cross], [*names, "broken"]
    if any(step.disturbed for step in loop.steps):
        handles, names = [*handles, grey], [*names, "disturbed"]
    legend = ax.legend(
        handles, [str(k) for k in range(len(names))], loc="lower left",
        bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, fontsize=SMALL_PT, handlelength=1.5,
        columnspacing=1.1, labelspacing=0.3, borderaxespad=0.2, borderpad=0.1,
    )  # fmt: skip
    return plain(legend, names)
