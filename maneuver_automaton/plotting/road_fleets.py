"""Pictures of several vehicles on one road: all of them in the plane, and their speeds; films."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.text import Text

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.colors import INK, Color, fleet_colors
from maneuver_automaton.plotting.film import Film, picture_times, write_film
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
    bodies_at,
    draw_drive,
    draw_surroundings,
    road_box,
    set_road_view,
)
from maneuver_automaton.plotting.style import line_handle, tidy
from maneuver_automaton.roads import RoadFleetDrive, RoadFleetResult, RoadScene, RoadVehicle

BETWEEN = 0.62  # [in] between the plane and the speeds

AnyRoadFleet = RoadFleetResult | RoadFleetDrive


def save_road_fleet_figure(
    result: AnyRoadFleet, vehicle: RoadVehicle, path: str | Path, *, look: Look | None = None
) -> None:
    """Write the picture of several drives: a colour for each, bodies at times that all share.

    Parameters
    ----------
    result : RoadFleetResult or RoadFleetDrive
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
    page = _page(result, vehicle, look or Look(title=result.name), under=BETWEEN + PANEL)
    plans, colors, plane = result.plans, page.colors, page.plane
    speed = axes_at(page.figure, left=LEFT, bottom=page.bottom, width=page.inner, height=PANEL)
    moments = np.linspace(*page.span, MOMENTS)
    draw_surroundings(plane, page.others, moments.tolist())
    for name, plan in plans.items():
        begin, end = plan.start_time, plan.start_time + plan.duration
        there = moments[(moments >= begin) & (moments <= end)]
        times = [*there.tolist(), *([end] if there.size == 0 or there[-1] < end else [])]
        draw_drive(plane, vehicle, plan, times, color=colors[name])
        plane.add_collection(_goals(page.scenes[name], colors[name]), autolim=False)
        _draw_speed(speed, result, name, colors[name])
    set_road_view(plane, *page.corners)
    tidy(speed, x="time [s]", y="speed [m/s]")
    write_figure(page.figure, path)


def save_road_fleet_animation(
    result: AnyRoadFleet, vehicle: RoadVehicle, path: str | Path, *, look: Look | None = None
) -> None:
    """Write a moving picture of several drives, by its ending .gif or .mp4.

    Parameters
    ----------
    result : RoadFleetResult or RoadFleetDrive
        At least one has a plan.
    vehicle : RoadVehicle
    path : str or Path
        Where to write.
    look : Look, optional
        Title, size and style.

    Raises
    ------
    ValueError
        If nobody has a plan, or the ending is another one.
    OSError
        If the file cannot be written.
    """
    page = _page(result, vehicle, look or Look(title=result.name), under=0.0)
    plane, others = page.plane, page.others
    _, _, traffic = draw_surroundings(plane, others, [])
    bodies = {}
    for name, plan in result.plans.items():
        bodies[name], _ = draw_drive(plane, vehicle, plan, [], color=page.colors[name])
        plane.add_collection(_goals(page.scenes[name], page.colors[name]), autolim=False)
    set_road_view(plane, *page.corners)
    clock: Text = plane.text(
        0.01, 0.98, "", transform=plane.transAxes, va="top", fontsize=9.0, color=INK, zorder=9.0
    )

    def show(time: float) -> None:
        here = others.present(time)
        traffic.set_paths([shape_path(one.at(time)) for one in here])
        traffic.set_facecolor([SOLID if one.motion is None else MOVING for one in here])
        for name, body in bodies.items():
            plan = result.plans[name]
            there = plan.start_time <= time <= plan.start_time + plan.duration
            body.set_verts(bodies_at(vehicle, plan.pose_at([time])) if there else [])
            body.set_facecolor([page.colors[name]])
        clock.set_text(f"{time:.1f} s")

    times = picture_times(*page.span)
    moving = (traffic, *bodies.values(), clock)
    film = Film(figure=page.figure, moving=moving, show=show, times=times, samples=[page.span[0]])
    write_film(film, path)


def road_fleet_colors(result: AnyRoadFleet) -> dict[str, Color]:
    """The colour of each vehicle, by name."""
    return dict(zip(result.results, fleet_colors(len(result.results)), strict=True))


class _Page(NamedTuple):
    """A figure with axes for the plane, and what is drawn there."""

    figure: Figure
    plane: Axes
    colors: dict[str, Color]
    scenes: dict[str, RoadScene]
    others: RoadScene  # the road and all that is there besides
    corners: tuple[Array, Array]
    span: tuple[float, float]  # [s]
    bottom: float  # [in]
    inner: float  # [in]


def _page(result: AnyRoadFleet, vehicle: RoadVehicle, look: Look, *, under: float) -> _Page:
    """The page, with so much room `under` the plane [in]."""
    plans = result.plans
    if not plans:
        raise ValueError("road fleet: nobody has a plan, there is nothing to draw")
    colors = road_fleet_colors(result)
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
    figure = new_figure(look.width, top + height + under + bottom)
    heading_text(figure, lines, left=LEFT)
    bottom_legend(figure, handles, names, left=LEFT, width=inner)
    plane = axes_at(figure, left=LEFT, bottom=bottom + under, width=inner, height=height)
    begin = min(plan.start_time for plan in plans.values())
    end = max(plan.start_time + plan.duration for plan in plans.values())
    return _Page(figure, plane, colors, scenes, others, (low, high), (begin, end), bottom, inner)


def _draw_speed(ax: Axes, result: AnyRoadFleet, name: str, color: Color) -> None:
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


def _headline(result: AnyRoadFleet) -> str:
    found, count = len(result.plans), len(result.results)
    parts = [f"{found} of {count} with a plan" if found < count else f"{count} vehicles"]
    if result.pairs:
        nearest = result.pairs[0]
        parts.append(f"nearest {' and '.join(nearest.pair)}, {nearest.distance_m:.3g} m")
    return " · ".join(parts)


def _entries(
    result: AnyRoadFleet, others: RoadScene, colors: dict[str, Color]
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
