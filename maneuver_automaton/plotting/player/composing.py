"""Parts of a page's content that plans, closed loops and drives have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.colors import Color
from maneuver_automaton.plotting.footprint import footprint_polygons, placed
from maneuver_automaton.plotting.labels import shown_name
from maneuver_automaton.plotting.player.clearances import clearance_entry, sample_times
from maneuver_automaton.plotting.player.local import Local, hex_color, rounded
from maneuver_automaton.plotting.player.motions import (
    curve_entries,
    motion_entry,
    part_entries,
    part_frames,
)
from maneuver_automaton.plotting.player.surroundings import (
    goal_entries,
    limit_entries,
    obstacle_entries,
)
from maneuver_automaton.plotting.scene import (
    Scene,
    mark_size,
    scene_points,
    scene_size,
    view_box,
)
from maneuver_automaton.plotting.track import Track
from maneuver_automaton.problem import Problem

Fact = tuple[str, str]  # a name, and its value with the unit


def names_of(colors: Mapping[str, Color]) -> dict[str, int]:
    """The number of each trim on the page, by name."""
    return {name: k for k, name in enumerate(colors)}


def trim_entries(colors: Mapping[str, Color]) -> list[dict[str, str]]:
    """Name and colour of each trim."""
    return [{"name": shown_name(name), "color": hex_color(color)} for name, color in colors.items()]


def played(
    track: Track, local: Local, names: dict[str, int], *, scene: Scene, problem: Problem | None
) -> dict[str, Any]:
    """A motion with its curves, its clearance, and the parts that it carries."""
    model = None if problem is None else problem.automaton.model
    parts = {} if problem is None else problem.parts
    times = sample_times(track.switching_times)
    poses = track.at(times)
    bodies = [(ring, poses) for ring in scene.body or (np.zeros((1, 2)),)]
    if model is not None and parts and track.pieces:
        at, frames = part_frames(track, model)
        for k, shapes in enumerate(parts.values()):
            columns = [np.interp(times, at, column) for column in frames[:, k].T]
            placed = (SE2(poses) @ SE2(np.stack(columns, axis=-1))).pose
            bodies += [(ring, placed) for ring in footprint_polygons(list(shapes))]
    heights = None
    if problem is not None and track.start.size > 3:
        heights = poses[:, 3:] + np.array(problem.body_height)
    return {
        **motion_entry(track, local, names),
        "curves": curve_entries(track, model),
        "clearance": clearance_entry(times, bodies, scene.obstacles, heights=heights),
        "parts": [] if model is None else part_entries(track, model, list(parts)),
    }


def around(
    scene: Scene, local: Local, box: Array, *, size: float, leave: bool = False
) -> dict[str, Any]:
    """What a motion happens among, and the box (2, 2) that is shown of it."""
    return {
        "origin": local.origin.tolist(),
        "box": local.places(box),
        "mark": rounded([size])[0],
        "goals": goal_entries(scene.goals, local, scene.reached),
        "obstacles": obstacle_entries(scene.obstacles, local, leave=leave),
        **limit_entries(scene.zones, scene.bounds, local),
    }


def plan_view(scene: Scene, tracks: Sequence[Track]) -> tuple[Array, float]:
    """The box (2, 2) around tracks in a scene and all that a body sweeps; the size of its marks."""
    size = max(scene_size(scene, track) for track in tracks)
    points = [scene_points(scene, track, size=size) for track in tracks]
    bodies = [corners for track in tracks for corners in placed(scene.body, track.pose)]
    box = view_box(scene, np.concatenate([*points, *bodies]), size=size)
    return box, mark_size(scene, box, size=size)
