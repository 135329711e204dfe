"""Drives on roads: lanelets, road users at several times, the path of one vehicle, its speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.text import Text

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.colors import GREY, INK, SEQUENCE, Color, shaded
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
from maneuver_automaton.plotting.style import line_handle, outer_legend, tidy
from maneuver_automaton.roads import GoalRegion, RoadScene, RoadVehicle

LANE = (0.91, 0.91, 0.92)
EGO, GOAL = SEQUENCE[0], SEQUENCE[2]
LEFT, RIGHT = 0.75, 0.2  # [in] beside the axes
PANEL, GAP = 1.2, 0.75  # [in] height of what is over time, and above it
MARGIN = 12.0  # [m] around all that drives
FLATTEST, HIGHEST = 1.6, 5.4  # [in] of the plane
MOMENTS = 5  # times at which bodies are shown
HAZE = 0.75  # of the first of them


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadArtists:
    """Artists of `draw_road`."""

    lanes: PolyCollection
    goals: PathCollection
    traffic: PathCollection
    bodies: PolyCollection
    path: LineCollection


def draw_road(
    ax: Axes,
    scene: RoadScene,
    vehicle: RoadVehicle,
    plan: Plan,
    *,
    times: Sequence[float] | None = None,
) -> RoadArtists:
    """Draw a drive on `ax`: bodies at `times` [s], the later the darker.

    Parameters
    ----------
    ax : Axes
    scene : RoadScene
    vehicle : RoadVehicle
    plan : Plan
        Of the rear axle, in the coordinates and on the clock of the scene.
    times : sequence of float, optional
        Five times from the beginning to the end if left out.
    """
    begin, end = plan.switching_times[[0, -1]].tolist()
    moments = list(np.linspace(begin, end, MOMENTS) if times is None else times)
    lanes, goals, traffic = draw_surroundings(ax, scene, moments)
    bodies, path = draw_drive(ax, vehicle, plan, moments)
    set_road_view(ax, *road_box(scene, vehicle, plan))
    return RoadArtists(lanes=lanes, goals=goals, traffic=traffic, bodies=bodies, path=path)


def draw_surroundings(
    ax: Axes, scene: RoadScene, moments: Sequence[float]
) -> tuple[PolyCollection, PathCollection, PathCollection]:
    """Lanes, goals, and the other road users at some times [s], the later the darker."""
    lanes = PolyCollection(
        [lanelet.ring for lanelet in scene.lanelets],
        facecolors=[LANE],
        edgecolors=["white"],
        linewidths=0.8,
        zorder=0.5,
    )
    goals = _goal_paths(scene.goals)
    paths, colors = [], []
    for k, moment in enumerate(moments):
        for one in scene.present(moment):
            paths.append(shape_path(one.at(moment)))
            colors.append(SOLID if one.motion is None else shaded(MOVING, _haze(k, len(moments))))
    traffic = PathCollection(paths, facecolors=colors, edgecolors=["white"], linewidths=0.5)
    traffic.set_zorder(2.0)
    for artist in (lanes, goals, traffic):
        ax.add_collection(artist, autolim=False)
    return lanes, goals, traffic


def draw_drive(
    ax: Axes, vehicle: RoadVehicle, plan: Plan, moments: Sequence[float], *, color: Color = EGO
) -> tuple[PolyCollection, LineCollection]:
    """A vehicle at some times [s], the later the darker, and the path of its middle."""
    bodies = PolyCollection(
        bodies_at(vehicle, plan.pose_at(moments)),
        facecolors=[shaded(color, _haze(k, len(moments))) for k in range(len(moments))],
        edgecolors=["white"],
        linewidths=0.6,
        zorder=3.0,
    )
    path = LineCollection(
        [vehicle.middle_of(plan.sample().pose)[:, :2]], colors=[color], linewidths=1.4, zorder=2.5
    )
    for artist in (bodies, path):
        ax.add_collection(artist, autolim=False)
    return bodies, path


def set_road_view(ax: Axes, low: Array, high: Array) -> None:
    """Show what is between two corners (2,) [m], in equal scales and without a grid."""
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_aspect("equal")
    tidy(ax, x="x [m]", y="y [m]")
    ax.grid(visible=False)


def save_road_figure(
    scene: RoadScene,
    vehicle: RoadVehicle,
    plan: Plan,
    path: str | Path,
    *,
    said: str = "",
    look: Look | None = None,
) -> None:
    """Write the picture of a drive: the plane, and speed and accelerations over time.

    Parameters
    ----------
    scene : RoadScene
    vehicle : RoadVehicle
    plan : Plan
        Of the rear axle, in the coordinates and on the clock of the scene.
    path : str or Path
        Where to write.
    said : str
        Stands below the title; the source of the scene if left out.
    look : Look, optional
        Title, size and style; the name of the scene is the title if left out. A page too low
        leaves out what is over time.

    Raises
    ------
    ValueError
        If the ending of `path` is none that Matplotlib knows.
    OSError
        If the file cannot be written.
    """
    look = look or Look(title=scene.name)
    page = _page(scene, vehicle, plan, panels=2, said=said or scene.source, look=look)
    draw_road(page.plane, scene, vehicle, plan)
    if page.panels:
        speed, rates = page.panels
        _draw_over_time(speed, rates, vehicle, plan)
    write_figure(page.figure, path)


def _draw_over_time(speed: Axes, rates: Axes, vehicle: RoadVehicle, plan: Plan) -> None:
    """Draw the speed, and the acceleration along and across the road, over time."""
    driven = plan.sample()
    speed.plot(driven.time, driven.reduced_state[:, 0], color=EGO, linewidth=1.4)
    tidy(speed, x="", y="speed [m/s]")
    across = driven.reduced_state[:, 0] ** 2 * np.tan(driven.reduced_state[:, 1])
    rates.step(driven.time, driven.control[:, 0], where="post", color=EGO, linewidth=1.4)
    rates.plot(driven.time, across / vehicle.model.wheelbase, color=SEQUENCE[1], linewidth=1.4)
    tidy(rates, x="time [s]", y="acceleration\n[m/s²]")
    handles = [line_handle(color, width=1.4) for color in (EGO, SEQUENCE[1])]
    outer_legend(rates, handles, ["along", "across"], above=True)


def save_road_animation(
    scene: RoadScene, vehicle: RoadVehicle, plan: Plan, path: str | Path
) -> None:
    """Write a moving picture of a drive, by its ending .gif or .mp4.

    Raises
    ------
    ValueError
        If the ending is another one.
    OSError
        If the file cannot be written.
    """
    begin, end = plan.switching_times[[0, -1]].tolist()
    page = _page(scene, vehicle, plan, panels=0, said=scene.source, look=Look(title=scene.name))
    figure, ax = page.figure, page.plane
    drawn = draw_road(ax, scene, vehicle, plan, times=[])
    clock: Text = ax.text(
        0.01, 0.98, "", transform=ax.transAxes, va="top", fontsize=9.0, color=INK, zorder=9.0
    )

    def show(time: float) -> None:
        here = scene.present(time)
        drawn.traffic.set_paths([shape_path(one.at(time)) for one in here])
        drawn.traffic.set_facecolor([SOLID if one.motion is None else MOVING for one in here])
        drawn.bodies.set_verts(bodies_at(vehicle, plan.pose_at([time])))
        drawn.bodies.set_facecolor([EGO])
        clock.set_text(f"{time:.1f} s")

    times = picture_times(begin, end)
    moving = (drawn.traffic, drawn.bodies, clock)
    write_film(Film(figure=figure, moving=moving, show=show, times=times, samples=[begin]), path)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Page:
    """A figure with axes for the plane, and for what is over time where there is room."""

    figure: Figure
    plane: Axes
    panels: tuple[Axes, ...]


def _page(
    scene: RoadScene, vehicle: RoadVehicle, plan: Plan, *, panels: int, said: str, look: Look
) -> _Page:
    low, high = road_box(scene, vehicle, plan)
    inner = look.width - LEFT - RIGHT
    handles, names = _legend_entries(scene, moving=bool(panels))
    lines = title_lines(look, inner, said)
    top = heading_height(lines) + 0.1
    bottom = 0.6 + 0.2 * legend_rows(names, inner)
    under = panels * (PANEL + GAP)
    height = float(np.clip(inner * (high - low)[1] / (high - low)[0], FLATTEST, HIGHEST))
    if look.height is not None:
        if look.height - top - bottom - under < FLATTEST:
            panels, under = 0, 0.0
        height = max(FLATTEST, look.height - top - bottom - under)
    figure = new_figure(look.width, top + height + under + bottom)
    heading_text(figure, lines, left=LEFT)
    bottom_legend(figure, handles, names, left=LEFT, width=inner)
    at = [bottom + k * (PANEL + GAP) for k in reversed(range(panels))]
    return _Page(
        figure=figure,
        plane=axes_at(figure, left=LEFT, bottom=bottom + under, width=inner, height=height),
        panels=tuple(
            axes_at(figure, left=LEFT, bottom=low, width=inner, height=PANEL) for low in at
        ),
    )


def _legend_entries(scene: RoadScene, *, moving: bool) -> tuple[list[Artist], list[str]]:
    """Handles and names of the vehicle, of traffic and of goals; `moving`: at several times."""
    later = ", the later the darker" if moving else ""
    handles: list[Artist] = [Patch(facecolor=EGO), Patch(facecolor=LANE)]
    names = [f"vehicle{later}", "lane"]
    if any(one.motion is not None for one in scene.traffic):
        handles.append(Patch(facecolor=MOVING))
        names.append(f"traffic{later}")
    if any(one.motion is None for one in scene.traffic):
        handles.append(Patch(facecolor=SOLID))
        names.append("obstacle")
    if any(goal.places for goal in scene.goals):
        handles.append(Patch(facecolor=(*GOAL, 0.18), edgecolor=GOAL))
        names.append("goal")
    return handles, names


def road_box(scene: RoadScene, vehicle: RoadVehicle, plan: Plan) -> tuple[Array, Array]:
    """Lower left and upper right corner around the drive, the road users beside it, the goals."""
    begin, end = plan.switching_times[[0, -1]].tolist()
    places = [vehicle.middle_of(plan.sample().pose)[:, :2]]
    for goal in scene.goals:
        if goal.places is not None and not goal.lanelets:
            places += [np.asarray(shape_path(place).vertices) for place in goal.places]
    low, high = (
        f(np.concatenate(places), axis=0) - s for f, s in ((np.min, 25.0), (np.max, -25.0))
    )
    for moment in np.linspace(begin, end, MOMENTS):
        for one in scene.present(float(moment)):
            corners = np.asarray(shape_path(one.at(float(moment))).vertices)
            if (corners > low).all() and (corners < high).all():
                places.append(corners)
    every = np.concatenate(places)
    low, high = every.min(axis=0) - MARGIN, every.max(axis=0) + MARGIN
    return low, high


def _goal_paths(goals: Sequence[GoalRegion]) -> PathCollection:
    paths = [shape_path(place) for goal in goals for place in goal.places or ()]
    return PathCollection(
        paths,
        facecolors=[(*GOAL, 0.18)],
        edgecolors=[GOAL if paths else GREY],
        linewidths=0.8,
        zorder=1.0,
    )


def bodies_at(vehicle: RoadVehicle, poses: Array) -> list[Array]:
    """Corners of a vehicle at poses (n, 3) of its rear axle."""
    corners = vehicle.footprint.corners
    return [np.asarray(SE2(pose).act(corners)) for pose in poses]


def _haze(k: int, n: int) -> float:
    """How much lighter what is shown at the k-th of n times is."""
    return HAZE * (1.0 - k / max(n - 1, 1))
