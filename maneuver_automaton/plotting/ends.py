"""Draw where a plan starts and where it is to end: places, headings, tolerances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.patches import Circle
from matplotlib.quiver import Quiver

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.colors import GREY, INK, Color
from maneuver_automaton.plotting.style import SMALL_PT, Entries, dashed_handle, mark_handle
from maneuver_automaton.problem import Goal, Via

ARROW_SIZE = 0.13  # of the size of the path
SET: Color = (0.00, 0.62, 0.45)
WAY: Color = (0.00, 0.35, 0.60)


def draw_ends(
    ax: Axes,
    start: Array,
    goals: Sequence[Goal],
    *,
    size: float,
    reached: int | None = None,
    via: Sequence[Via] = (),
) -> dict[str, Any]:
    """Draw a start pose (dof,), what is on the way, and all goals: others than `reached` pale."""
    pale = [reached is not None and k != reached for k in range(len(goals))]
    colors = [GREY if others else INK for others in pale]
    headed = [k for k, goal in enumerate(goals) if not goal.free_heading]
    artists: dict[str, Any] = {
        "start": ax.scatter(start[0], start[1], s=26.0, color=[INK], linewidths=0.0, zorder=5.1)
    }
    for k, (goal, color) in enumerate(zip(goals, colors, strict=True)):
        artists[f"goal {k}"] = draw_goal(ax, goal.pose, color=color)
        if goal.free_heading:
            artists[f"any heading {k}"] = ax.scatter(
                goal.pose[0], goal.pose[1], s=210.0, facecolors="none", edgecolors=[color],
                linewidths=1.1, zorder=4.9,
            )  # fmt: skip
        if goal.tolerance_m > 0.0:
            artists[f"tolerance {k}"] = ax.add_patch(
                Circle(
                    (float(goal.pose[0]), float(goal.pose[1])), goal.tolerance_m,
                    facecolor=(*SET, 0.15), edgecolor=SET, linewidth=0.9, zorder=1.6,
                )
            )  # fmt: skip
    faced = [one.pose for one in via if not one.free_heading]
    artists["headings"] = draw_headings(
        ax,
        np.array([start, *faced, *(goals[k].pose for k in headed)]),
        length=ARROW_SIZE * size,
        color=[INK, *(WAY for _ in faced), *(colors[k] for k in headed)],
    )
    return artists | _draw_via(ax, via)


def _draw_via(ax: Axes, via: Sequence[Via]) -> dict[str, Any]:
    """Numbers in circles at poses on the way; gates as lines, tolerances as discs."""
    artists: dict[str, Any] = {}
    for k, one in enumerate(via, 1):
        x, y = one.place[:2].tolist()
        if one.gate is not None:
            (artists[f"gate {k}"],) = ax.plot(
                one.gate[:, 0], one.gate[:, 1], color=WAY, linewidth=1.4, linestyle=(0, (3, 2)),
                marker="|", markersize=6.0, zorder=4.6,
            )  # fmt: skip
            x, y = one.gate[1, :2].tolist()
        if one.tolerance_m > 0.0 and one.gate is None:
            disc = Circle((x, y), one.tolerance_m, facecolor=(*WAY, 0.12), edgecolor=WAY)
            disc.set(linewidth=0.9, zorder=1.6)
            artists[f"near {k}"] = ax.add_patch(disc)
        artists[f"via {k}"] = ax.scatter(
            x, y, s=105.0, facecolors=["white"], edgecolors=[WAY], linewidths=1.2, zorder=5.2,
        )  # fmt: skip
        artists[f"number {k}"] = ax.annotate(
            str(k), (x, y), ha="center", va="center_baseline", fontsize=SMALL_PT, color=WAY,
            zorder=5.3, annotation_clip=True,
        )  # fmt: skip
    return artists


def draw_goal(ax: Axes, pose: Array, *, color: Color = INK) -> PathCollection:
    """A diamond for a goal; a start in the same place shows inside."""
    return ax.scatter(
        pose[0], pose[1], s=58.0, marker="D", facecolors=["white"], edgecolors=[color],
        linewidths=1.3, zorder=5.0 if color == INK else 4.9,
    )  # fmt: skip


def draw_headings(
    ax: Axes, poses: Array, *, length: float, color: Color | Sequence[Color] = INK
) -> Quiver:
    """Arrows of `length` [m] for the headings of poses (n, dof)."""
    arrows = length * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=-1)
    ax.update_datalim(poses[:, :2] + arrows)
    return ax.quiver(
        *poses[:, :2].T, *arrows.T, angles="xy", scale_units="xy", scale=1.0, units="inches",
        width=0.018, headwidth=5.0, headlength=6.0, headaxislength=5.2, color=color, zorder=4.8,
    )  # fmt: skip


def end_entries(goals: Sequence[Goal] = (), via: Sequence[Via] = ()) -> Entries:
    """Legend entries of start and goals, what else there is of goals, and poses on the way."""
    free = [goal.free_heading for goal in goals]
    goal_name = "goal, any heading" if free and all(free) else "goal"
    entries: list[tuple[Artist, str]] = [
        (mark_handle("o", size=5.5, face=INK, edge=INK), "start"),
        (mark_handle("D", size=6.0, edge=INK), goal_name),
    ]
    if any(free) and not all(free):
        entries.append((mark_handle("o", size=9.0, edge=INK), "any heading"))
    if len(goals) > 1:
        entries.append((mark_handle("D", size=6.0, edge=GREY), "other goal"))
    if any(goal.tolerance_m > 0.0 for goal in goals):
        entries.append((mark_handle("o", size=9.0, face=(*SET, 0.15), edge=SET), "goal tolerance"))
    if any(one.gate is None for one in via):
        entries.append((mark_handle("o", size=9.0, edge=WAY), "on the way"))
    if any(one.gate is not None for one in via):
        entries.append((dashed_handle(WAY, (0, (3, 2)), width=1.4), "gate"))
    return entries
