"""A plan in motion: the vehicle drives along its path, in real time where that is short enough."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.plotting.colors import INK, trim_colors
from maneuver_automaton.plotting.film import Film, picture_times, write_film
from maneuver_automaton.plotting.footprint import footprint_polygons, placed
from maneuver_automaton.plotting.pages import axes_at, new_figure
from maneuver_automaton.plotting.paths import draw_plan

WIDTH, HEIGHT = 6.4, 4.8  # [in]


def save_plan_animation(plan: Plan, path: str | Path, *, footprint: Any = None) -> None:
    """Write an animated GIF of a plan; the file is replaced in one step.

    Parameters
    ----------
    plan : Plan
        What to drive; an empty plan gives a single frame.
    path : str or Path
        Where to write; the ending must be .gif.
    footprint : any form of `footprint_polygons`, optional
        The body of the vehicle; an arrowhead if there is none.

    Raises
    ------
    ValueError
        If the ending is not .gif.
    OSError
        If the file cannot be written; an old one stays as it was.
    """
    target = Path(path)
    if target.suffix.lower() != ".gif":
        raise ValueError(f"animation: got the file name {target.name}, need one ending in .gif")
    times = picture_times(plan.start_time, plan.start_time + plan.duration)
    figure = new_figure(WIDTH, HEIGHT)
    ax = axes_at(figure, left=0.75, bottom=0.55, width=WIDTH - 0.95, height=HEIGHT - 0.95)
    draw_plan(ax, plan, footprint=footprint)
    size = 0.05 * float(np.ptp([ax.get_xlim(), ax.get_ylim()], axis=1).max())
    outlines = footprint_polygons(footprint) or [_arrowhead(size)]
    colors = trim_colors({trim.name: trim.body_velocity for trim in plan.trims})
    body = PolyCollection([], closed=True, edgecolor=INK, linewidth=1.2, zorder=10)
    ax.add_collection(body, autolim=False)
    clock = figure.text(0.75 / WIDTH, 1.0 - 0.25 / HEIGHT, "", fontsize=10, color=INK)

    def show(time: float) -> None:
        body.set_verts(placed(outlines, plan.pose_at(time)[None]))
        body.set_facecolor((*_color_at(plan, time, colors), 0.55))
        clock.set_text(f"{time:.2f} s")

    # one picture of each trim: its colour is in none of the others
    first = {trim.name: time for trim, time in zip(plan.trims, plan.switching_times, strict=False)}
    samples = list(first.values()) or [float(times[0])]
    write_film(
        Film(figure=figure, moving=[body, clock], show=show, times=times, samples=samples), target
    )


def _color_at(plan: Plan, time: float, colors: Any) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    if not plan.trims:
        return to_rgb(INK)
    after = np.searchsorted(plan.switching_times[1:-1], time, side="right")
    return to_rgb(colors[plan.trims[int(after)].name])


def _arrowhead(size: float) -> Array:
    return size * np.array([[1.0, 0.0], [-0.7, 0.6], [-0.4, 0.0], [-0.7, -0.6]])
