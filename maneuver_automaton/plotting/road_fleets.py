"""The picture of several vehicles on one road: all of them in the plane, and their speeds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.patches import Patch

from maneuver_automaton.plotting.colors import INK, Color, fleet_colors
from maneuver_automaton.plotting.look import Look
from maneuver_automaton.plotting.obstacles import MOVING, SOLID
from maneuver_automaton.plotting.pages import (
    axes_at,
    bottom_legend,
    heading_height,
    heading_text,
    legend_rows,
    new_figure,
    title_lines,
    write_figure,
)
from maneuver_automaton.plotting.regions import shape_path
from maneuver_automaton.plotting.roads import (
    FLATTEST,
    HIGHEST,
    LANE,
    LEFT,
    MOMENTS,
    PANEL,
    RIGHT,
    draw_drive,
    draw_surroundings,
    road_box,
    set_road_view,
)
from maneuver_automaton.plotting.style import line_handle, tidy
from maneuver_automaton.roads import RoadFleetResult, RoadScene, RoadVehicle

BETWEEN = 0.62  # [in] between the plane and the speeds


def save_road_fleet_figure(
    result: RoadFleetResult, vehicle: RoadVehicle, path: str | Path, *, look: Look | None = None
) -> None:
    """Write the picture of several drives: a colour for each, bodies at times that all share.

    Parameters
    ----------
    result : RoadFleetResult
        At least one has a plan.
    vehicle : RoadVehicle
    path : str or Path
        Where to write; the file is replaced in one step.
    look : Look, optional
        Title, size and style.

    Raises
    ------
    ValueError
        If nobody has a plan, or Matplotlib does not know the ending.
    OSError
        If the file cannot be written.
    """
    plans = result.plans
    if not plans:
        raise ValueError("road fleet: nobody has a plan, there is nothing to draw")
    look = look or Look(title=result.name)
    colors = dict(zip(result.results, fleet_colors(len(result.results)), strict=True))
    scenes = {name: result.results[name].planner.scene for name in plans}
    boxes = [road_box(scenes[name], vehicle, plan) for name, plan in plans.items()]
    low = np.min([box[0] for box in boxes], axis=0)
    high = np.max([box[1] for box in boxes], axis=0)
    others = _others(next(iter(scenes.values())), set(result.results))
    handles, names = _entries(result, others, colors)
    inner = look.width - LEFT - RIGHT
    lines = title_lines(look, inner, _headline(result))
    top, bottom = heading_height(lines) + 0.1, 0.6 + 0.2 * legend_rows(names, inner)
    height = float(np.clip(inner * (high - low)[1] / (high - low)[0], FLATTEST, HIGHEST))
    figure = new_figure(look.width, top + height + BETWEEN + PANEL + bottom)
    heading_text(figure, lines, left=LEFT)
    bottom_legend(figure, handles, names, left=LEFT, width=inner)
    speed = axes_at(figure, left=LEFT, bottom=bottom, width=inner, height=PANEL)
    plane = axes_at(figure, left=LEFT, bottom=bottom + PANEL + BETWEEN, width=inner, height=height)
    begins = [plan.start_time for plan in plans.values()]
    ends = [plan.start_time + plan.duration for plan in plans.values()]
    moments = np.linspace(min(begins), max(ends), MOMENTS)
    draw_surroundings(plane, others, moments.tolist())
    for (name, plan), begin, end in zip(plans.items(), begins, ends, strict=True):
        there = moments[(moments >= begin) & (moments <= end)]
        times = [*there.tolist(), *([end] if there.size == 0 or there[-1] < end else [])]
        draw_drive(plane, vehicle, plan, times, color=colors[name])
        plane.add_collection(_goals(scenes[name], colors[name]), autolim=False)
        _draw_speed(speed, result, name, colors[name])
    set_road_view(plane, low, high)
    tidy(speed, x="time [s]", y="speed [m/s]")
    write_figure(figure, path)


def _draw_speed(ax: Axes, result: RoadFleetResult, name: str, color: Color) -> None:
    driven = result.plans[name].sample()
    ax.plot(driven.time, driven.reduced_state[:, 0], color=color, linewidth=1.4)


def _others(scene: RoadScene, names: set[str]) -> RoadScene:
    """A scene without goals, and without the vehicles that are planned: they are road users too."""
    return replace(
        scene,
        goals=tuple(replace(goal, places=None) for goal in scene.goals),
        traffic=tuple(one for one in scene.traffic if one.name not in names),
    )


def _goals(scene: RoadScene, color: Color) -> PathCollection:
    paths = [shape_path(place) for goal in scene.goals for place in goal.places or ()]
    return PathCollection(
        paths, facecolors="none", edgecolors=[color], linewidths=1.0, linestyles=[(0, (4, 3))],
        zorder=1.2,
    )  # fmt: skip


def _headline(result: RoadFleetResult) -> str:
    found, count = len(result.plans), len(result.results)
    parts = [f"{found} of {count} with a plan" if found < count else f"{count} vehicles"]
    if result.pairs:
        nearest = result.pairs[0]
        parts.append(f"nearest {' and '.join(nearest.pair)}, {nearest.distance_m:.3g} m")
    return " · ".join(parts)


def _entries(
    result: RoadFleetResult, others: RoadScene, colors: dict[str, Color]
) -> tuple[list[Artist], list[str]]:
    """Handles and names of the vehicles, of lanes and of what else is there."""
    handles: list[Artist] = [line_handle(colors[name], width=3.4) for name in result.plans]
    names = [f"problem {name}" for name in result.plans]
    handles.append(Patch(facecolor="none", edgecolor=INK, linestyle=(0, (4, 3))))
    names.append("goal")
    rows = [(LANE, "lane", True)]
    rows.append((MOVING, "traffic, the later the darker", any(o.motion for o in others.traffic)))
    rows.append((SOLID, "obstacle", any(o.motion is None for o in others.traffic)))
    for color, name, there in rows:
        if there:
            handles.append(Patch(facecolor=color))
            names.append(name)
    return handles, names
