"""The picture of docs/symmetry.md: `python docs/figures/symmetry.py FOLDER` writes it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import maneuver_automaton as ma

SHIFT, START = np.array([3.0, 2.5, 1.2]), np.array([1.0, 0.5, 0.3])
TURN = ma.Trim(name="turn", body_velocity=[1.0, 0.0, 0.7], control=[1.0, 0.7])
INK, GREY, BLUE, RED = "#1a1a1f", "#8c8c94", "#0062b2", "#cc241a"


def moved_and_added() -> Figure:
    """A motion moved by the symmetry is a motion; numbers added to every state are not.

    Source: the paper, Fig. 1, with the shift (3, 2.5, 1.2).
    """
    times = np.linspace(0.0, 2.6, 81)
    original = TURN.coast(ma.SE2(START), times)
    added = TURN.coast(ma.SE2(START + SHIFT), times)
    figure = Figure(figsize=(6.4, 5.2), layout="constrained")
    ax = figure.subplots()
    for poses, color, style, label in (
        (original.pose, INK, "-", "a motion of the robot from x⁰ under a constant control"),
        ((ma.SE2(SHIFT) @ original).pose, BLUE, "-",
         "moved by the symmetry g(Δx), Δx = (3, 2.5, 1.2): a motion again"),
        (original.pose + SHIFT, RED, "-",
         "Δx added to every state: its headings are not tangent, no motion"),
        (added.pose, RED, "--", "the motion from x⁰ + Δx under the same control: another curve"),
    ):  # fmt: skip
        ax.plot(*poses[:, :2].T, color=color, linestyle=style, linewidth=1.8, label=label)
        ax.plot(*poses[0, :2], color=color, marker="o", markersize=4.5)
        arrows(ax, poses[::16], color)
    frame(ax)
    figure.legend(loc="outside lower left", frameon=False, fontsize=9)
    return figure


def arrows(ax: Axes, poses: np.ndarray, color: str) -> None:
    """Arrows where poses (n, 3) head."""
    x, y, heading = poses.T
    ax.quiver(x, y, np.cos(heading), np.sin(heading), color=color, scale=22, width=0.005, zorder=4)


def frame(ax: Axes) -> None:
    """Equal scales, two spines and a faint grid."""
    ax.set_aspect("equal", adjustable="datalim")
    ax.set(xlabel="x [m]", ylabel="y [m]")
    tidy(ax)


def tidy(ax: Axes) -> None:
    """Two spines and a faint grid."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(visible=True, color=GREY, alpha=0.22, linewidth=0.5)
    ax.set_axisbelow(True)


PICTURES = {"symmetry.png": moved_and_added}

if __name__ == "__main__":
    for name, drawn in PICTURES.items():
        drawn().savefig(Path(sys.argv[1]) / name, dpi=130)
