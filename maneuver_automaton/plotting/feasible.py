"""Draw the initially feasible set: the least time from every place, one slice per heading."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.quiver import Quiver
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import ScaledTranslation

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton.analysis.feasible import FeasibleSet
from maneuver_automaton.plotting.colors import GREY, INK, SEQUENCE, shaded
from maneuver_automaton.plotting.ends import draw_goal, draw_headings, draw_start, end_handles
from maneuver_automaton.plotting.pages import (
    axes_at,
    bottom_legend,
    heading_text,
    legend_rows,
    new_figure,
    write_figure,
)
from maneuver_automaton.plotting.style import SMALL_PT, TEXT_PT, line_handle, tidy

SOON, LATE = shaded(SEQUENCE[0], -0.35), shaded(SEQUENCE[0], 0.86)
TIMES = LinearSegmentedColormap.from_list("least time", [SOON, SEQUENCE[0], LATE])
OUTSIDE = (0.93, 0.92, 0.90)  # where no plan within the time was found
EDGE = SEQUENCE[1]
LEVELS = 6  # about so many lines of equal least time
CLEAR = 0.92  # of the limit, below which they stay
ARROW = 0.11  # of the window
WIDTH, LEAST_WIDTH, LEFT, RIGHT = 9.6, 6.4, 0.7, 0.95  # [in]; the scale of times is on the right
MOST_COLUMNS, GAP, TITLE = 4, 0.16, 0.26  # panels in a row; [in] between them, and above each


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SliceArtists:
    """Artists of `draw_feasible_slice`; a line is None where nothing in the window has it."""

    cells: QuadMesh
    levels: ContourSet | None  # of equal least time
    edge: ContourSet | None  # of the set
    arrow: Text  # above the axes, the heading of every start pose in the slice
    headings: Quiver | None  # of the goals that ask for one, and of the start if it is in the slice
    goals: tuple[PathCollection, ...]
    start: PathCollection | None  # in the slice whose heading is nearest to that of the start


def draw_feasible_slice(ax: Axes, feasible: FeasibleSet, index: int) -> SliceArtists:
    """Draw one slice of a `feasible` set: all start poses of one heading.

    Parameters
    ----------
    ax : Axes
        Where to draw; its scale is made equal in x and y.
    feasible : FeasibleSet
        What to draw.
    index : int
        Which of its headings.

    Returns
    -------
    SliceArtists
        The artists, by what they show.

    Raises
    ------
    ValueError
        If there is no such slice, or the grid is a line.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from maneuver_automaton import Automaton, Horizon, Problem, Unicycle
    >>> from maneuver_automaton.analysis.feasible import feasible_set
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "spin": (0, 1)})
    >>> problem = Problem(robot, [0, 0, 0], [0, 0, 0], horizon=Horizon(max_trims=3))
    >>> found = feasible_set(
    ...     problem, 2.0, window=((-3, 0), (0, 1)), headings=[0.0], resolution=1.0
    ... )
    >>> artists = draw_feasible_slice(Figure().add_subplot(), found, 0)
    >>> int(artists.cells.get_array().count())
    3
    """
    if not 0 <= index < feasible.headings.size:
        raise ValueError(
            f"feasible set: got slice {index}, need one from 0 to {feasible.headings.size - 1}"
        )
    x, y, limit = feasible.x, feasible.y, feasible.within
    if x.size < 2 or y.size < 2:
        raise ValueError(f"feasible set: got a grid of {x.size} by {y.size}, need at least 2 by 2")
    ax.set_facecolor(OUTSIDE)
    cells = ax.pcolormesh(
        x, y, np.ma.masked_array(feasible.times[index], ~feasible.feasible[index]), cmap=TIMES,
        vmin=0.0, vmax=limit, shading="nearest", rasterized=True, zorder=1.0,
    )  # fmt: skip
    levels, edge = _draw_levels(ax, feasible, index)
    size = ARROW * max(float(np.ptp(x)), float(np.ptp(y)))
    goals = feasible.problem.goals
    artists = SliceArtists(
        cells=cells,
        levels=levels,
        edge=edge,
        arrow=_draw_title(ax, float(feasible.headings[index])),
        headings=_draw_headings(ax, feasible, index, size=size),
        goals=tuple(draw_goal(ax, goal.pose) for goal in goals),
        start=draw_start(ax, feasible.problem.start) if index == start_slice(feasible) else None,
    )
    ax.set_aspect("equal", adjustable="box")
    dx, dy = 0.5 * (x[1] - x[0]), 0.5 * (y[1] - y[0])
    ax.set_xlim(x[0] - dx, x[-1] + dx)
    ax.set_ylim(y[0] - dy, y[-1] + dy)
    tidy(ax, x="x [m]", y="y [m]")
    ax.grid(visible=False)
    return artists


def _draw_levels(
    ax: Axes, feasible: FeasibleSet, index: int
) -> tuple[ContourSet | None, ContourSet | None]:
    """Lines of equal least time, and the edge of the set; None where there is none."""
    x, y, limit, times = feasible.x, feasible.y, feasible.within, feasible.times[index]
    finite = np.where(np.isfinite(times), times, np.nan)
    lines = [level for level in level_times(feasible) if _crossed(finite, level)]
    levels = edge = None
    if lines:
        levels = ax.contour(
            x, y, finite, levels=lines, colors=["white"], linewidths=0.7, alpha=0.75, zorder=1.5
        )
    capped = np.minimum(times, 2.0 * limit)
    if _crossed(capped, limit):
        edge = ax.contour(x, y, capped, levels=[limit], colors=[EDGE], linewidths=1.8, zorder=2.0)
    return levels, edge


def save_feasible_figure(feasible: FeasibleSet, path: str | Path) -> None:
    """Write a picture of all slices of a `feasible` set, with one scale of times.

    Raises
    ------
    ValueError
        If Matplotlib does not know the ending, or the grid is a line.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    write_figure(_figure(feasible), path)


def level_times(feasible: FeasibleSet) -> Array:
    """Times [s] of the level lines, round numbers below the limit."""
    ticks = np.asarray(MaxNLocator(LEVELS).tick_values(0.0, feasible.within))
    return ticks[(ticks > 0.0) & (ticks < CLEAR * feasible.within)]


def start_slice(feasible: FeasibleSet) -> int:
    """Which slice has the heading nearest to that of the problem's start."""
    gaps = np.abs(wrapped(feasible.headings - feasible.problem.start[2]))
    return int(np.argmin(gaps))


def _crossed(times: Array, level: float) -> bool:
    """Whether a line of this level runs through the grid."""
    known = times[np.isfinite(times)]
    return bool(known.size and known.min() < level < known.max())


def _draw_title(ax: Axes, heading: float) -> Text:
    """The heading above the axes, as a number on the left and as an arrow on the right."""
    ax.set_title(f"heading {heading:.3g} rad", fontsize=SMALL_PT, color=INK, loc="left", pad=3.0)
    above = ScaledTranslation(-0.1, 0.09, ax.figure.dpi_scale_trans)  # [in]
    return ax.text(
        1.0, 1.0, "→", transform=ax.transAxes + above, rotation=math.degrees(heading),
        rotation_mode="default", ha="center", va="center", fontsize=13.0, color=INK,
    )  # fmt: skip


def _draw_headings(ax: Axes, feasible: FeasibleSet, index: int, *, size: float) -> Quiver | None:
    start, goals = feasible.problem.start, feasible.problem.goals
    rows = [goal.pose[:3] for goal in goals if not goal.free_heading]
    if np.abs(wrapped(feasible.headings[index] - start[2])) <= 1e-9:
        rows.append(start[:3])
    return draw_headings(ax, np.array(rows), length=size) if rows else None


def _figure(feasible: FeasibleSet) -> Figure:
    count = feasible.headings.size
    columns = min(MOST_COLUMNS, count)
    rows = math.ceil(count / columns)
    tall = float(np.ptp(feasible.y) / np.ptp(feasible.x))
    wide = min((WIDTH - LEFT - RIGHT - GAP * (columns - 1)) / columns, 4.6)
    high = min(max(wide * tall, 0.6), 5.0)
    top = 0.66
    inner = rows * (high + TITLE) + (rows - 1) * GAP
    width = max(LEAST_WIDTH, LEFT + columns * wide + (columns - 1) * GAP + RIGHT)
    handles, names = _legend_entries(feasible)
    bottom = 0.62 + 0.2 * legend_rows(names, width - LEFT - 0.1)
    figure = new_figure(width, bottom + inner + top)
    heading_text(figure, _headings(feasible), left=LEFT)
    for k in range(count):
        row, column = divmod(k, columns)
        ax = axes_at(
            figure,
            left=LEFT + column * (wide + GAP),
            bottom=bottom + (rows - 1 - row) * (high + TITLE + GAP),
            width=wide,
            height=high,
        )
        draw_feasible_slice(ax, feasible, k)
        if column:
            ax.set_ylabel("")
            ax.tick_params(labelleft=False)
        if k + columns < count:
            ax.set_xlabel("")
            ax.tick_params(labelbottom=False)
    right = LEFT + columns * wide + (columns - 1) * GAP + 0.15
    _draw_scale(figure, feasible, left=right, bottom=bottom, height=inner - TITLE)
    bottom_legend(figure, handles, names, left=LEFT, width=width - LEFT - 0.1)
    return figure


def _legend_entries(feasible: FeasibleSet) -> tuple[list[Line2D], list[str]]:
    edge = line_handle(EDGE, width=1.8)
    outside = Line2D(
        [], [], linestyle="none", marker="s", markersize=7.0, markerfacecolor=OUTSIDE,
        markeredgecolor=GREY, markeredgewidth=0.5,
    )  # fmt: skip
    none = "no plan" if feasible.exhaustive else "none found"
    marks, names = end_handles()
    return [edge, outside, *marks], [
        "edge of the set",
        f"{none} within {feasible.within:g} s",
        *names,
    ]


def _draw_scale(
    figure: Figure, feasible: FeasibleSet, *, left: float, bottom: float, height: float
) -> None:
    """The scale of times, with the level lines as ticks."""
    ax = axes_at(figure, left=left, bottom=bottom, width=0.14, height=height)
    scale = figure.colorbar(ScalarMappable(Normalize(0.0, feasible.within), TIMES), cax=ax)
    levels = [0.0, *level_times(feasible), feasible.within]
    scale.set_ticks(levels)
    for level in levels[1:-1]:
        ax.axhline(level, color="white", linewidth=0.7, alpha=0.75)
    ax.tick_params(labelsize=SMALL_PT, color=GREY, labelcolor=INK, length=3.0, width=0.6)
    ax.set_ylabel("least time [s]", fontsize=TEXT_PT, color=INK)
    scale.outline.set_visible(False)


def _headings(feasible: FeasibleSet) -> list[tuple[str, float, str]]:
    share = float(feasible.feasible.mean())
    kind = "every admitted word searched" if feasible.exhaustive else "best plans found"
    return [
        (f"feasible within {feasible.within:g} s: {share:.0%} of the grid", 10.0, "bold"),
        (f"least time to the goal from every start pose · {kind}", TEXT_PT, "normal"),
    ]
