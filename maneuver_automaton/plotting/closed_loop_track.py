"""What the pictures need of a closed loop: its track, its colours, and the room it takes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.carried import carried
from maneuver_automaton.plotting.colors import Color
from maneuver_automaton.plotting.footprint import footprint_polygons, placed
from maneuver_automaton.plotting.motions import track_colors
from maneuver_automaton.plotting.scene import (
    STILL_SIZE_M,
    Scene,
    mark_size,
    scene_of,
    scene_points,
    view_box,
)
from maneuver_automaton.plotting.track import Piece, Track, track_of_plan
from maneuver_automaton.receding_horizon import ClosedLoop

END_TOLERANCE = 1e-9  # [m, rad, s] between the end of a piece and the start of the next


def loop_colors(loop: ClosedLoop) -> dict[str, Color]:
    """A colour for every trim, and the parts of every maneuver, that a `loop` planned or drove."""
    twists: dict[str, Array] = {}
    for plan in [step.plan for step in loop.steps] + list(loop.driven):
        if any(plan.maneuvers):
            twists = track_of_plan(plan).twists | twists
            continue
        for trim in plan.trims:
            twists.setdefault(trim.name, trim.body_velocity)
    return track_colors(twists)


def driven_track(loop: ClosedLoop) -> Track:
    """Track driven in a `loop`."""
    return joined_track(loop.poses[0], loop.driven)


def joined_track(start: Array, plans: Sequence[Plan]) -> Track:
    """Track of one plan after the other; a trim that goes on in the next plan is one piece."""
    pieces: list[Piece] = []
    for plan in plans:
        for piece in track_of_plan(plan).pieces:
            if pieces and _goes_on(pieces[-1], piece):
                pieces[-1] = _one_piece(pieces[-1], piece)
            else:
                pieces.append(piece)
    return Track(start, tuple(pieces))


def carried_poses(loop: ClosedLoop) -> list[tuple[list[Array], Array]]:
    """Outlines of what a vehicle carries, and its poses (n + 1, dof) at the times of a `loop`."""
    model = loop.problem.automaton.model
    parts = []
    for name, shapes in loop.problem.parts.items() if loop.driven else ():
        plans = [carried(plan, model, name) for plan in loop.driven]
        poses = np.array([*(plan.start for plan in plans), plans[-1].end])
        parts.append((footprint_polygons(shapes), poses))
    return parts


def planned_places(loop: ClosedLoop) -> list[Array]:
    """Places (n, 2) along the plan of every step."""
    return [track_of_plan(step.plan).pose[:, :2] for step in loop.steps]


def loop_points(loop: ClosedLoop) -> Array:
    """Places (n, 2) that a picture of a `loop` shows, the start first [m]."""
    goals = [goal.pose[None, :2] for goal in loop.problem.goals]
    return np.concatenate(
        [loop.poses[:, :2], *goals, *planned_places(loop), driven_track(loop).pose[:, :2]]
    )


def loop_scene(loop: ClosedLoop, *, footprint: Any = None) -> Scene:
    """What a `loop` is drawn among; its own body if no other is given."""
    begin, end = loop.times[[0, -1]].tolist()
    return scene_of(loop.problem, begin, end, footprint=footprint)


def loop_view(loop: ClosedLoop, scene: Scene) -> tuple[Array, float]:
    """Corners (2, 2) of what a picture of a `loop` shows, and the size [m] of its marks."""
    points = loop_points(loop)
    size = max(float(np.linalg.norm(points - points[0], axis=1).max()), 2.0 * scene.reach)
    size = size if size > END_TOLERANCE else STILL_SIZE_M
    around = scene_points(scene, driven_track(loop), size=size)
    bodies = placed(scene.body, loop.poses)
    box = view_box(scene, np.concatenate([points, around, *bodies]), size=size)
    return box, mark_size(scene, box, size=size)


def _goes_on(one: Piece, other: Piece) -> bool:
    scale = 1.0 + float(np.abs(one.pose[-1]).max())
    return bool(
        one.name == other.name
        and abs(one.time[-1] - other.time[0]) <= END_TOLERANCE * (1.0 + abs(one.time[-1]))
        and np.abs(one.pose[-1] - other.pose[0]).max() <= END_TOLERANCE * scale
    )


def _one_piece(one: Piece, other: Piece) -> Piece:
    return Piece(
        name=one.name,
        twist=one.twist,
        time=np.concatenate([one.time, other.time[1:]]),
        pose=np.concatenate([one.pose, other.pose[1:]]),
        control=np.concatenate([one.control, other.control[1:]]),
        state=np.concatenate([one.state, other.state[1:]]),
    )
