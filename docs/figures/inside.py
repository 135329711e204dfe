"""The picture of docs/inside.md: the rooms of the package, and the data between them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

INK, GREY, BLUE, PAPER = "#1a1a1f", "#8c8c94", "#0062b2", "#ffffff"
ROOMS = {  # room or rooms: the middle of its box, what it is for
    "groups, models": (0.0, 4.0, "poses, a vehicle's\nvelocity and dynamics"),
    "primitives,\noptimal_control": (2.9, 4.0, "trims, maneuvers"),
    "automaton": (5.8, 4.0, "the graph, plans,\nfiles of libraries"),
    "collision": (8.7, 4.0, "shapes, maps, zones,\nFCL, proofs of motions"),
    "scenario, formats": (0.0, 2.2, "files in"),
    "planning": (5.8, 2.2, "plan, Planner,\nwhat is kept and why"),
    "bounds": (8.7, 2.2, "lower bounds,\nproofs of no plan"),
    "receding_horizon,\nfleet, roads": (0.0, 0.4, "plan again and again,\nseveral, in traffic"),
    "words, search": (2.9, 0.4, "words in closed form,\nA* on a lattice"),
    "refinement": (5.8, 0.4, "better words and times,\npolishing"),
    "audit": (8.7, 0.4, "checks the plan anew,\nwith code of its own"),
    "plotting, exports,\nformats, cli": (2.9, -1.4, "pictures, pages,\ndocuments, tables"),
    "recording": (5.8, -1.4, "who moved where\nand when"),
}
DATA = (  # from, to, what is handed over
    ("groups, models", "primitives,\noptimal_control", "Model"),
    ("primitives,\noptimal_control", "automaton", "Trim,\nManeuver"),
    ("automaton", "planning", "Automaton"),
    ("collision", "planning", "obstacles"),
    ("scenario, formats", "planning", "Problem"),
    ("planning", "words, search", "query"),
    ("words, search", "refinement", "words"),
    ("refinement", "planning", "candidates"),
    ("bounds", "planning", "bound"),
    ("planning", "audit", "Plan"),
    ("planning", "receding_horizon,\nfleet, roads", "Planner"),
    ("audit", "recording", "PlanResult"),
    ("receding_horizon,\nfleet, roads", "recording", "loops, fleets, drives"),
    ("recording", "plotting, exports,\nformats, cli", "Recording"),
)
WIDE, HIGH = 1.62, 0.92


def rooms_and_data() -> Figure:
    """Boxes for rooms, arrows for what one hands to the other."""
    figure = Figure(figsize=(9.6, 6.0), layout="constrained")
    ax = figure.subplots()
    for name, (x, y, what) in ROOMS.items():
        ax.text(x, y + 0.18, name, ha="center", va="center", color=INK, fontsize=9, weight="bold",
                zorder=3, linespacing=0.95)  # fmt: skip
        ax.text(x, y - 0.22, what, ha="center", va="center", color=INK, fontsize=7.5, zorder=3)
        ax.add_patch(
            FancyBboxPatch((x - WIDE / 2, y - HIGH / 2), WIDE, HIGH, boxstyle="round,pad=0.02",
                           facecolor=PAPER, edgecolor=GREY, zorder=2)
        )  # fmt: skip
    for first, last, what in DATA:
        arrow(ax, ROOMS[first][:2], ROOMS[last][:2], what)
    ax.set(xlim=(-1.0, 9.7), ylim=(-2.0, 4.6), aspect="equal")
    ax.set_axis_off()
    return figure


def arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], what: str) -> None:
    """An arrow from border to border, with what it carries."""
    first, last = np.array(start), np.array(end)
    half = 1.04 * np.array([WIDE, HIGH]) / 2.0
    way = last - first
    with np.errstate(divide="ignore"):
        part = (half / np.abs(way)).min()
    look = {"arrowstyle": "-|>", "color": BLUE, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", last - part * way, first + part * way, zorder=4, arrowprops=look)
    ax.text(*(first + last) / 2.0, what, ha="center", va="center", color=BLUE, fontsize=7.5,
            zorder=5, bbox={"facecolor": PAPER, "edgecolor": "none", "pad": 0.8})  # fmt: skip


PICTURES: dict[str, Callable[[], Figure]] = {"inside.png": rooms_and_data}
