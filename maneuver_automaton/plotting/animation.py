"""A plan in motion: the vehicle drives along its path, in real time where that is short enough."""

from __future__ import annotations

from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection

from maneuver_automaton.automaton import Plan
from maneuver_automaton.plotting.bodies import DART, DART_SIZE
from maneuver_automaton.plotting.colors import GREY, INK, Color
from maneuver_automaton.plotting.film import Film, picture_times, write_film
from maneuver_automaton.plotting.footprint import placed
from maneuver_automaton.plotting.motions import track_colors
from maneuver_automaton.plotting.paths import bare_scene
from maneuver_automaton.plotting.scene import (
    mark_size,
    plan_scene,
    scene_points,
    scene_size,
    view_box,
)
from maneuver_automaton.plotting.stage import stage_of
from maneuver_automaton.plotting.track import Track, track_of_plan
from maneuver_automaton.problem import Problem


def save_plan_animation(
    plan: Plan, path: str | Path, *, problem: Problem | None = None, footprint: Any = None
) -> None:
    """Write an animated GIF of a plan; the file is replaced in one step.

    Parameters
    ----------
    plan : Plan
        What to drive; an empty plan gives a single frame.
    path : str or Path
        Where to write; the ending must be .gif.
    problem : Problem, optional
        Obstacles, which may move, goals and body to draw with it.
    footprint : any form of `footprint_polygons`, optional
        The body of the vehicle; that of the problem if left out, a dart if there is none.

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
    write_film(_film(plan, problem, footprint), target)


def _film(plan: Plan, problem: Problem | None, footprint: Any) -> Film:
    track = track_of_plan(plan)
    if problem is None:
        scene = bare_scene(track, footprint=footprint)
    else:
        scene = plan_scene(problem, plan, footprint=footprint)
    size = scene_size(scene, track)
    body = scene.body or (DART_SIZE * size * DART,)
    everywhere = [scene_points(scene, track, size=size), *placed(body, track.pose)]
    for one in scene.carried:
        everywhere += placed(one.body, one.track.pose)
    box = view_box(scene, np.concatenate(everywhere), size=size)
    colors = track_colors(track.twists)
    marks = mark_size(scene, box, size=size)
    stage = stage_of(scene, track, colors=colors, box=box, size=marks)
    line = LineCollection([track.pose[:, :2]], colors=[(*GREY, 0.7)], linewidths=0.9, zorder=1.8)
    trail = LineCollection([], linewidths=2.8, capstyle="butt", zorder=3.0)
    vehicle = PolyCollection([], edgecolors=[INK], linewidths=1.2, zorder=6.0)
    for part in (line, trail, vehicle):
        stage.ax.add_collection(part, autolim=False)

    def show(time: float) -> None:
        stage.show(time)
        driven = track.between(plan.start_time, time)
        trail.set_segments([places for _, places in driven])
        trail.set_color([colors[name] for name, _ in driven])
        parts = [placed(one.body, one.track.at(np.array([time]))) for one in scene.carried]
        vehicle.set_verts([*placed(body, plan.pose_at(time)[None]), *chain.from_iterable(parts)])
        vehicle.set_facecolor((*_color_at(track, time, colors), 0.55))
        stage.clock.set_text(f"{time:.2f} s")

    times = picture_times(plan.start_time, plan.start_time + plan.duration)
    # one picture of each trim: its colour is in none of the others
    first = {piece.name: float(piece.time[0]) for piece in reversed(track.pieces)}
    return Film(
        figure=stage.figure,
        moving=[stage.traffic, trail, vehicle, stage.clock],
        show=show,
        times=times,
        samples=[float(times[-1]), *first.values()],
    )


def _color_at(track: Track, time: float, colors: dict[str, Color]) -> Color:
    if not track.pieces:
        return INK
    after = np.searchsorted(track.switching_times[1:-1], time, side="right")
    return colors.get(track.pieces[int(after)].name, GREY)
