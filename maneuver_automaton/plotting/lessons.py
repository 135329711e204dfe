"""Two pictures of what symmetry means: what moves with it, and what does not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.colors import GREY, INK, WHEEL, Color
from maneuver_automaton.plotting.ends import draw_goal, draw_headings
from maneuver_automaton.plotting.pages import axes_at, new_figure, write_figure
from maneuver_automaton.plotting.style import TEXT_PT, tidy
from maneuver_automaton.primitives import Trim

SHIFT = np.array([3.0, 2.5, 1.2])
START = np.array([1.0, 0.5, 0.3])
TURN = Trim(name="turn", body_velocity=np.array([1.0, 0.0, 0.7]), control=np.array([1.0, 0.7]))
TURN_S = 2.6
AHEAD = Trim(name="ahead", body_velocity=np.array([1.0, 0.0, 0.0]), control=np.array([1.0, 0.0]))
BLUE: Color = tuple(WHEEL[0].tolist())
RED: Color = (0.80, 0.14, 0.10)


def figure_symmetry(path: str | Path) -> None:
    """Write a picture: a motion moved by the symmetry is a motion, numbers added are not.

    Black, a motion of the mobile robot under a constant control. Blue, the same moved by a group
    element: the flow from the moved start, pose by pose. Red, the three numbers of that element
    added to every state: its headings are not tangent to it, so no control can drive it, and the
    flow from the added start (dashed) is another curve.

    Source: the paper, Fig. 1, with the shift (3, 2.5, 1.2).

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     figure_symmetry(Path(folder) / "symmetry.png")
    ...     (Path(folder) / "symmetry.png").exists()
    True
    """
    original = TURN.coast(SE2(START), np.linspace(0.0, TURN_S, 81))
    moved = SE2(SHIFT) @ original
    added = original.pose + SHIFT
    flow = TURN.coast(SE2(START + SHIFT), np.linspace(0.0, TURN_S, 81))
    figure = new_figure(6.4, 5.2)
    ax = axes_at(figure, left=0.6, bottom=1.45, width=5.65, height=3.6)
    _draw_motion(ax, original.pose, INK, length=0.34)
    _draw_motion(ax, moved.pose, BLUE, length=0.34)
    _draw_motion(ax, added, RED, length=0.34)
    _draw_motion(ax, flow.pose, RED, length=0.34, dashed=True)
    _frame(ax)
    labels = (
        "a motion of the robot from x⁰ under a constant control",
        "moved by the symmetry g(Δx), Δx = (3, 2.5, 1.2): a motion again",
        "Δx added to every state: its headings are not tangent, no motion",
        "the motion from x⁰ + Δx under the same control: another curve",
    )
    figure.legend(
        ax.lines[::2], labels, loc="lower left", bbox_to_anchor=(0.6 / 6.4, 0.08 / 5.2),
        fontsize=TEXT_PT, frameon=False, borderaxespad=0.0, borderpad=0.0,
    )  # fmt: skip
    write_figure(figure, path)


def figure_shift(path: str | Path) -> None:
    """Write a picture: a moved problem has the moved solution only if its goal moves as well.

    The robot drives straight from (-1, 0, 0) to the origin. With the start moved by (1, 1, 0)
    and the goal left where it is, the same control misses; parallel parking is another problem.
    With the goal moved too, the same control solves it.

    Source: the paper, Example 10.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     figure_shift(Path(folder) / "shift.png")
    ...     (Path(folder) / "shift.png").exists()
    True
    """
    shift, start, goal = (
        SE2(np.array([1.0, 1.0, 0.0])),
        SE2(np.array([-1.0, 0.0, 0.0])),
        SE2.identity(),
    )
    figure = new_figure(7.6, 3.2)
    titles = (
        "start moved, goal not: the control misses",
        "both moved: the control still solves it",
    )
    for k, aim in enumerate((goal, shift @ goal)):
        ax = axes_at(figure, left=0.6 + 3.5 * k, bottom=0.48, width=3.2, height=2.4)
        _draw_drive(ax, start, GREY)
        _draw_drive(ax, shift @ start, BLUE if k else RED)
        _mark(ax, start.pose, "x⁰", GREY)
        _mark(ax, (shift @ start).pose, "g x⁰", INK)
        draw_goal(ax, aim.pose)
        _mark(ax, aim.pose, "g x*" if k else "x*", INK)
        ax.update_datalim([(-1.25, -0.4), (1.25, 1.25)])
        _frame(ax)
        ax.set_xticks([-1.0, 0.0, 1.0])
        ax.set_yticks([0.0, 1.0])
        if k:
            _mark(ax, goal.pose, "x*", GREY)
            ax.set_ylabel("")
        ax.set_title(titles[k], fontsize=TEXT_PT, color=INK, loc="left")
    write_figure(figure, path)


def _draw_drive(ax: Axes, start: SE2, color: Color) -> None:
    """One second straight ahead."""
    poses = AHEAD.coast(start, np.array([0.0, 0.4, 1.0])).pose
    ax.plot(*poses[:, :2].T, color=color, linewidth=1.8)
    ax.plot(*poses[0, :2], color=color, marker="o", markersize=5.0)
    draw_headings(ax, poses[1:2], length=0.18, color=color)


def _mark(ax: Axes, pose: Array, text: str, color: Color) -> None:
    """A name below a pose."""
    ax.annotate(
        text, tuple(pose[:2]), xytext=(0.0, -9.0), textcoords="offset points", ha="center",
        va="top", fontsize=TEXT_PT, color=color,
    )  # fmt: skip


def _draw_motion(
    ax: Axes, poses: Array, color: Color, *, length: float, dashed: bool = False
) -> None:
    """A path from a dot on, with arrows of `length` [m] for the headings along it."""
    ax.plot(*poses[:, :2].T, color=color, linewidth=1.8, linestyle=(0, (4, 2)) if dashed else "-")
    draw_headings(ax, poses[:: len(poses) // 5], length=length, color=color)
    ax.plot(*poses[0, :2], color=color, marker="o", markersize=4.5)


def _frame(ax: Axes) -> None:
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.06)
    ax.autoscale_view()
    tidy(ax, x="x [m]", y="y [m]")
