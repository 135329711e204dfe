"""Pictures of the horizon without terminal constraint: closed loops, growth, suboptimality."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from maneuver_automaton._arrays import Array
from maneuver_automaton.analysis.stability import CertifiedHorizon
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.colors import INK, SEQUENCE
from maneuver_automaton.plotting.ends import draw_goal, draw_headings, draw_start
from maneuver_automaton.plotting.pages import axes_at, heading_text, new_figure, write_figure
from maneuver_automaton.plotting.style import SMALL_PT, TEXT_PT, line_handle, plain, tidy
from maneuver_automaton.receding_horizon.unconstrained import UnconstrainedProblem
from maneuver_automaton.receding_horizon.unconstrained_loop import UnconstrainedLoop

PER_INTERVAL = 12  # poses drawn along each interval
NEAREST_M = 1e-5  # distances below this are drawn here: a logarithmic axis has no zero
LOWEST = -0.5  # least index shown
DARTS = 7  # along a path


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DrivenLoop:
    """A closed loop and the problem it solved."""

    problem: UnconstrainedProblem
    loop: UnconstrainedLoop

    def track(self) -> tuple[Array, Array]:
        """Times (n,) [s] and poses (n, 3) seen from the goal, several along each interval."""
        problem, step = self.problem, self.problem.horizon.interval
        pose: SE2 = SE2(problem.goal).inverse() @ SE2(self.loop.poses[0])
        inside = np.linspace(0.0, step, PER_INTERVAL + 1)[1:]
        pieces, times = [pose.pose[None]], [np.zeros(1)]
        for k, trim in enumerate(self.loop.trims.ravel()):
            twist = problem.automaton.body_velocities[trim]
            along = (pose @ SE2.exp(inside[:, None] * twist)).pose
            pieces.append(along)
            times.append(k * step + inside)
            pose = SE2(along[-1])
        return np.concatenate(times), np.concatenate(pieces)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CertificateCurve:
    """A certificate to be drawn; `unit` seconds are one unit of its horizons."""

    certificate: CertifiedHorizon
    unit: float = 1.0  # [s]; the interval, for a certificate counted in intervals


def draw_loops(ax: Axes, loops: Mapping[str, DrivenLoop]) -> list[Line2D]:
    """Paths of closed loops in the plane, seen from the goal and to scale; one line each."""
    lines = []
    for color, run in zip(SEQUENCE, loops.values(), strict=False):
        _, poses = run.track()
        lines += ax.plot(poses[:, 0], poses[:, 1], color=color, linewidth=1.8)
        every = max(1, len(poses) // DARTS)
        draw_headings(ax, poses[every // 2 :: every], length=0.07, color=color)
        ax.plot(*poses[-1, :2], color=color, marker="s", markersize=5.0)
    for run in loops.values():
        draw_start(ax, run.track()[1][0])
    draw_goal(ax, np.zeros(3))
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.12)
    tidy(ax, x="x [m]", y="y [m]")
    return lines


def draw_distances(ax: Axes, loops: Mapping[str, DrivenLoop]) -> list[Line2D]:
    """Distance to the goal over time on a logarithmic axis: whole (solid), sideways (dashed)."""
    lines = []
    for color, run in zip(SEQUENCE, loops.values(), strict=False):
        times, poses = run.track()
        whole = np.maximum(np.hypot(poses[:, 0], poses[:, 1]), NEAREST_M)
        aside = np.maximum(np.abs(poses[:, 1]), NEAREST_M)
        lines += ax.plot(times, whole, color=color, linewidth=1.6)
        ax.plot(times, aside, color=color, linewidth=1.2, linestyle=(0, (4, 2)))
    ax.set_yscale("log")
    tidy(ax, x="time [s]", y="distance to the goal [m]")
    return lines


def draw_growth(ax: Axes, curves: Mapping[str, CertificateCurve]) -> list[Line2D]:
    """Growth bounds B(t) [s], and the line B = t that resting alone gives."""
    lines = []
    longest = 0.0
    for color, curve in zip(SEQUENCE, curves.values(), strict=False):
        growth = curve.certificate.growth
        times, bounds = curve.unit * growth.times, curve.unit * growth.bounds
        lines += ax.plot(times, bounds, color=color, linewidth=1.6)
        longest = max(longest, times[-1])
    ax.plot([0.0, longest], [0.0, longest], color=INK, linewidth=0.9, linestyle=(0, (2, 3)))
    ax.annotate(
        "resting: B = t", (0.42 * longest, 0.42 * longest), xytext=(-4.0, 5.0), ha="right",
        textcoords="offset points", fontsize=SMALL_PT, color=INK,
    )  # fmt: skip
    tidy(ax, x="time t [s]", y="growth bound B(t) [s]")
    return lines


def draw_indices(
    ax: Axes,
    curves: Mapping[str, CertificateCurve],
    measured: Mapping[str, Sequence[tuple[float, float]]],
) -> list[Line2D]:
    """Suboptimality index over the horizon; a ring marks the least certified one.

    Crosses in the colour of a curve are what closed loops `measured`: (horizon [s], least decrease
    of the value per cost driven in any step).
    """
    lines = []
    for color, (name, curve) in zip(SEQUENCE, curves.items(), strict=False):
        certificate = curve.certificate
        at = curve.unit * certificate.horizons
        lines += ax.plot(at, np.maximum(certificate.indices, LOWEST), color=color, linewidth=1.6)
        if certificate.horizon is not None:
            ax.plot(
                curve.unit * certificate.horizon, certificate.index_at(certificate.horizon),
                color=color, marker="o", markersize=7.0, markerfacecolor="none",
            )  # fmt: skip
        points = np.array(measured.get(name, ())).reshape(-1, 2)
        ax.plot(*points.T, color=color, marker="x", markersize=5.0, linestyle="none")
    ax.axhline(0.0, color=INK, linewidth=0.8)
    ax.set_ylim(LOWEST, 1.05)
    tidy(ax, x="horizon T [s]", y="suboptimality index α [-]")
    return lines


def save_stability_figure(
    path: str | Path,
    loops: Mapping[str, DrivenLoop],
    curves: Mapping[str, CertificateCurve],
    *,
    measured: Mapping[str, Sequence[tuple[float, float]]] | None = None,
    title: str = "Receding horizon without terminal constraint",
) -> None:
    """Write one figure: paths, distance over time, growth bounds, suboptimality indices.

    Names of `loops` and `curves` become labels; `measured` goes by the names of `curves`.

    Raises
    ------
    ValueError
        If there is no loop or no curve, more than there are colours, or a name of `measured` is
        not among the curves.
    OSError
        If the file cannot be written.
    """
    for what, named in (("loops", loops), ("curves", curves)):
        if not 1 <= len(named) <= len(SEQUENCE):
            raise ValueError(f"{what}: got {len(named)}, need 1 to {len(SEQUENCE)}")
    points = measured or {}
    for name in points:
        if name not in curves:
            raise ValueError(f"measured: got {name!r}, need one of {', '.join(curves)}")
    figure = new_figure(9.6, 7.4)
    heading_text(figure, [(title, 11.0, "bold")], left=0.7)
    boxes = [(0.7, 3.95), (5.45, 3.95), (0.7, 0.5), (5.45, 0.5)]
    above_left, above_right, below_left, below_right = (
        axes_at(figure, left=left, bottom=bottom, width=3.95, height=2.75) for left, bottom in boxes
    )
    _legend(above_left, draw_loops(above_left, loops), list(loops), "paths, seen from the goal")
    draw_distances(above_right, loops)
    both = [line_handle(INK, width=1.6), Line2D([], [], color=INK, linestyle=(0, (4, 2)))]
    _legend(above_right, both, ["distance", "sideways only"], "distance to the goal")
    _legend(below_left, draw_growth(below_left, curves), list(curves), "growth of the value")
    draw_indices(below_right, curves, points)
    marks: list[Line2D] = [line_handle(INK, marker="o")]
    names = ["least certified horizon"]
    if points:
        marks.append(Line2D([], [], color=INK, marker="x", linestyle="none", markersize=5.0))
        names.append("least decrease measured")
    _legend(below_right, marks, names, "index of the horizon")
    write_figure(figure, path)


def _legend(ax: Axes, handles: Sequence[Line2D], labels: Sequence[str], title: str) -> None:
    """A legend that shows names as they are, and a title above the axes."""
    legend = ax.legend(
        handles, [str(k) for k in range(len(labels))], loc="best", fontsize=SMALL_PT,
        frameon=True, framealpha=0.85, edgecolor="none", handlelength=1.8,
    )  # fmt: skip
    plain(legend, labels, length=40)
    ax.set_title(title, fontsize=TEXT_PT, color=INK, loc="left", parse_math=False)
