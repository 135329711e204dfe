"""Draw control effort: the paper's example on several grids, a plan before and after retiming."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.lines import Line2D

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.optimal_control.uniform_effort import END_NODES, UniformEffortExample
from maneuver_automaton.plotting.colors import GREY, INK, SEQUENCE, Color
from maneuver_automaton.plotting.controls import TIME_LABEL
from maneuver_automaton.plotting.ends import draw_headings
from maneuver_automaton.plotting.pages import axes_at, heading_text, new_figure, write_figure
from maneuver_automaton.plotting.style import line_handle, outer_legend, tidy
from maneuver_automaton.refinement.effort import EffortReport
from maneuver_automaton.refinement.retiming import Retiming

BEFORE, AFTER = SEQUENCE[1], SEQUENCE[0]
EFFORT_LABEL = "effort |u|_R² [1/s]"
DOTS = 24  # equal steps of time along a path


def save_uniform_effort_figure(examples: Sequence[UniformEffortExample], path: str | Path) -> None:
    """Write the picture of the paper's example, solved on several grids.

    Above, path, states and controls on the first grid; below, what the cost and the quadratic
    effort add up to, the effort at each node, and its spread over the number of nodes.

    Parameters
    ----------
    examples : sequence of UniformEffortExample
        The same problem on different numbers of nodes, the one to show in full first.
    path : str or Path
        Where to write; the ending chooses the format.

    Raises
    ------
    ValueError
        If there is no example.
    """
    if not examples:
        raise ValueError("uniform effort figure: got no example, need at least one")
    first = examples[0]
    figure = new_figure(10.7, 6.3)
    grid = [
        [
            axes_at(figure, left=0.75 + 3.45 * column, bottom=bottom, width=2.45, height=2.3)
            for column in range(3)
        ]
        for bottom in (3.55, 0.55)
    ]
    draw_example_path(grid[0][0], first)
    draw_example_states(grid[0][1], first)
    draw_example_controls(grid[0][2], first)
    draw_accumulated(grid[1][0], first)
    draw_node_efforts(grid[1][1], examples)
    draw_spreads(grid[1][2], examples)
    nodes = len(first.solution.time)
    headline = f"uniform control effort: J = {first.cost:.6f} on {nodes} nodes"
    heading_text(figure, [(headline, 10.0, "bold")], left=0.3)
    write_figure(figure, path)


def draw_example_path(ax: Axes, example: UniformEffortExample) -> Line2D:
    """Draw where the robot drives, with a few arrows for its heading."""
    pose = example.solution.state
    (line,) = ax.plot(pose[:, 0], pose[:, 1], color=AFTER, linewidth=1.8)
    ax.plot(*pose[0, :2], color=AFTER, marker="o", markersize=5.0)
    shown = np.linspace(0, len(pose) - 1, 7).round().astype(int)
    draw_headings(ax, pose[shown], length=0.09, color=INK)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.1)
    tidy(ax, x="x1 [m]", y="x2 [m]")
    return line


def draw_example_states(ax: Axes, example: UniformEffortExample) -> tuple[Line2D, ...]:
    """Draw the three states over time."""
    names = ("x1 [m]", "x2 [m]", "x3 [rad]")
    return _draw_lines(ax, example.solution.time, example.solution.state, names, label="state")


def draw_example_controls(ax: Axes, example: UniformEffortExample) -> tuple[Line2D, ...]:
    """Draw the two controls over time."""
    names, control = ("u1 [m/s]", "u2 [rad/s]"), example.solution.control
    return _draw_lines(ax, _control_times(example), control, names, label="control")


def draw_accumulated(ax: Axes, example: UniformEffortExample) -> tuple[Line2D, ...]:
    """Draw the cost x4 and the effort x5 up to each instant, and the straight line of x5."""
    time = example.solution.time
    names = ("x4, cost", "x5, effort", "straight line")
    rows = np.stack([example.accumulated_cost, example.accumulated_effort], axis=-1)
    (straight,) = ax.plot(
        time[[0, -1]], rows[[0, -1], 1], color=INK, linewidth=1.0, linestyle=(0, (3, 2)), zorder=4.0
    )
    drawn = [
        ax.plot(time, rows[:, k], color=SEQUENCE[k], linewidth=2.4 if k else 1.8)[0] for k in (0, 1)
    ]
    lines = (*drawn, straight)
    tidy(ax, x=TIME_LABEL, y="sum up to here")
    outer_legend(ax, lines, names, above=True)
    return lines


def draw_node_efforts(
    ax: Axes, examples: Sequence[UniformEffortExample]
) -> tuple[PathCollection, ...]:
    """Draw the effort at each node; the two at each end, which the rule spoils, as rings."""
    rings, lines, names = [], [], []
    for k, example in enumerate(examples):
        color, time = SEQUENCE[k % len(SEQUENCE)], _control_times(example)
        ends = np.r_[0:END_NODES, len(time) - END_NODES : len(time)]
        (line,) = ax.plot(
            time[END_NODES:-END_NODES], example.effort[END_NODES:-END_NODES], color=color,
            linewidth=1.4,
        )  # fmt: skip
        rings.append(
            ax.scatter(
                time[ends], example.effort[ends], s=26.0, facecolors="none", edgecolors=[color],
                linewidths=1.2, zorder=3.0 + 0.1 * k,
            )
        )  # fmt: skip
        lines.append(line)
        names.append(f"{len(example.solution.time)} nodes")
    tidy(ax, x=TIME_LABEL, y=EFFORT_LABEL)
    handles = [*lines, line_handle(GREY, marker="o")]
    legend_names = [*names, "two nodes at each end"]
    ax.margins(0.06, 0.1)
    outer_legend(ax, handles, legend_names, above=True)
    return tuple(rings)


def draw_spreads(ax: Axes, examples: Sequence[UniformEffortExample]) -> tuple[Line2D, ...]:
    """Draw the relative spread of the effort over the number of nodes, with and without ends."""
    nodes = np.array([len(example.solution.time) for example in examples])
    order = np.argsort(nodes)
    spreads = np.array([[e.spread, e.inner_spread] for e in examples])[order]
    names = ("all nodes", "without two at each end")
    lines = tuple(
        ax.plot(
            nodes[order], 100.0 * spreads[:, k], color=SEQUENCE[k], marker="o", markersize=4.5,
            linewidth=1.4,
        )[0]
        for k in (0, 1)
    )  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    tidy(ax, x="nodes", y="(most - least) / mean [%]")
    ax.set_xticks(nodes[order], [str(n) for n in nodes[order].tolist()])
    ax.minorticks_off()
    ax.yaxis.set_major_formatter("{x:g}")
    outer_legend(ax, lines, names, above=True)
    return lines


def save_retiming_figure(
    retiming: Retiming, path: str | Path, *, labels: Sequence[str] = ()
) -> None:
    """Write the picture of a retiming: the path with equal steps of time, effort, and controls.

    Parameters
    ----------
    retiming : Retiming
        What to draw.
    path : str or Path
        Where to write; the ending chooses the format.
    labels : sequence of str
        What to call each control, with its unit; "control 1" and so on if left out.

    Raises
    ------
    ValueError
        If the plan has no trim, or the labels are not as many as its controls.
    """
    if not retiming.before.trims:
        raise ValueError("retiming figure: the plan has no trim, need one that moves")
    count = retiming.before.trims[0].control.size
    if labels and len(labels) != count:
        raise ValueError(f"retiming figure: got {len(labels)} labels for {count} controls")
    names = list(labels) or [f"control {k + 1}" for k in range(count)]
    lower, height = 1.35 * count, 1.35 * count + 1.85
    figure = new_figure(9.6, height + 1.0)
    draw_paces(axes_at(figure, left=0.7, bottom=0.55, width=3.6, height=height), retiming)
    top = axes_at(figure, left=5.3, bottom=0.55 + lower, width=4.1, height=1.85)
    draw_efforts(top, retiming)
    for k, name in enumerate(names):
        bottom = 0.55 + 1.35 * (count - 1 - k)
        ax = axes_at(figure, left=5.3, bottom=bottom, width=4.1, height=1.15)
        plans = (retiming.before, retiming.after)
        _draw_steps(ax, plans, [np.array([t.control[k] for t in plan.trims]) for plan in plans])
        tidy(ax, x=TIME_LABEL if k == count - 1 else "", y=name)
        ax.tick_params(labelbottom=k == count - 1)
    top.tick_params(labelbottom=False)
    headline = (
        f"cost {retiming.cost_before:.6g} → {retiming.cost_after:.6g}, the same path in the same "
        f"{retiming.before.duration:.5g} s"
    )
    heading_text(figure, [(headline, 10.0, "bold")], left=0.3)
    write_figure(figure, path)


def draw_efforts(ax: Axes, retiming: Retiming) -> tuple[LineCollection, ...]:
    """Draw the effort over time before and after, and the uniform level."""
    reports: tuple[EffortReport, EffortReport] = (retiming.effort_before, retiming.effort_after)
    plans = (retiming.before, retiming.after)
    steps = _draw_steps(ax, plans, [report.efforts for report in reports])
    duration = retiming.before.duration
    level = reports[0].uniform_cost / duration if duration > 0.0 else 0.0
    uniform = ax.axhline(level, color=INK, linewidth=1.0, linestyle=(0, (3, 2)), zorder=4.0)
    tidy(ax, x="", y=EFFORT_LABEL)
    handles = [
        Line2D([], [], color=BEFORE, linewidth=2.4),
        Line2D([], [], color=AFTER, linewidth=2.4),
    ]
    names = ("before", "after", "uniform, without limits")
    outer_legend(ax, [*handles, uniform], names, above=True)
    return steps


def draw_paces(ax: Axes, retiming: Retiming) -> tuple[Line2D, ...]:
    """Draw the path, with dots after equal steps of time before and after, side by side."""
    line = retiming.before.sample().pose
    ax.plot(line[:, 0], line[:, 1], color=GREY, linewidth=1.0, zorder=2.0)
    drawn = []
    for plan, color, size in ((retiming.before, BEFORE, 7.0), (retiming.after, AFTER, 3.2)):
        begin = plan.start_time
        poses = plan.pose_at(np.linspace(begin, begin + plan.duration, DOTS + 1))
        filled = color if size < 5.0 else "none"
        drawn += ax.plot(
            poses[:, 0], poses[:, 1], linestyle="none", marker="o", markersize=size, color=color,
            markerfacecolor=filled, markeredgewidth=1.2, zorder=3.0,
        )  # fmt: skip
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.08)
    tidy(ax, x="x [m]", y="y [m]")
    step = retiming.before.duration / DOTS
    names = [f"every {step:.3g} s before", f"every {step:.3g} s after"]
    outer_legend(ax, drawn, names, above=True)
    return tuple(drawn)


def _control_times(example: UniformEffortExample) -> Array:
    """Times (m,) of the controls: of the nodes, or of the middle between them."""
    time = example.solution.time
    if len(example.solution.control) == len(time):
        return time
    return np.asarray((time[:-1] + time[1:]) / 2.0)


def _draw_lines(
    ax: Axes, time: Array, rows: Array, names: Sequence[str], *, label: str
) -> tuple[Line2D, ...]:
    lines = tuple(
        ax.plot(time, column, color=SEQUENCE[k], linewidth=1.8)[0]
        for k, column in enumerate(rows.T)
    )
    tidy(ax, x=TIME_LABEL, y=label)
    outer_legend(ax, lines, names, above=True)
    return lines


def _draw_steps(
    ax: Axes, plans: Sequence[Plan], values: Sequence[Array]
) -> tuple[LineCollection, ...]:
    """One stair per plan: its `values` (n,), held from switch to switch."""
    drawn = []
    looks: tuple[tuple[Color, float], ...] = ((BEFORE, 2.8), (AFTER, 1.8))
    for plan, levels, (color, width) in zip(plans, values, looks, strict=True):
        times = np.repeat(plan.switching_times, 2)[1:-1]
        stair = np.column_stack([times, np.repeat(levels, 2)])
        stairs = LineCollection([stair], colors=[color], linewidths=width, zorder=3.0)
        ax.add_collection(stairs)
        drawn.append(stairs)
    low, high = min(0.0, *(v.min() for v in values)), max(0.0, *(v.max() for v in values))
    room = 0.1 * (high - low) or 1.0
    begin, end = plans[0].switching_times[[0, -1]]
    ax.set_ylim(low - room, high + room)
    ax.set_xlim(begin - 0.01 * (end - begin), end + 0.01 * (end - begin))
    return tuple(drawn)
