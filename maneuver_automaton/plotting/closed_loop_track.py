"""What the pictures need of a closed loop: its track, its colours, and the room it takes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.plotting.colors import Color, trim_colors
from maneuver_automaton.plotting.paths import STILL_SIZE_M
from maneuver_automaton.plotting.track import Piece, Track, track_of_plan
from maneuver_automaton.receding_horizon import ClosedLoop

SAME = 1e-9  # [m, rad, s] between the end of a piece and the start of what goes on from there


def loop_colors(loop: ClosedLoop) -> dict[str, Color]:
    """A colour for every trim that a `loop` planned or drove."""
    twists: dict[str, Array] = {}
    for plan in [step.plan for step in loop.steps] + list(loop.driven):
        for trim in plan.trims:
            twists.setdefault(trim.name, trim.body_velocity)
    return trim_colors(twists)


def driven_track(loop: ClosedLoop) -> Track:
    """What was driven in a `loop`; a trim that goes on in the next step is one piece."""
    pieces: list[Piece] = []
    for plan in loop.driven:
        for piece in track_of_plan(plan).pieces:
            if pieces and _goes_on(pieces[-1], piece):
                pieces[-1] = _joined(pieces[-1], piece)
            else:
                pieces.append(piece)
    return Track(loop.poses[0], tuple(pieces))


def planned_places(loop: ClosedLoop) -> list[Array]:
    """Places (n, 2) along the plan of every step."""
    return [track_of_plan(step.plan).pose[:, :2] for step in loop.steps]


def loop_points(loop: ClosedLoop) -> Array:
    """Places (n, 2) that a picture of a `loop` shows, the start first [m]."""
    goals = [goal.pose[None, :2] for goal in loop.problem.goals]
    return np.concatenate(
        [loop.poses[:, :2], *goals, *planned_places(loop), driven_track(loop).pose[:, :2]]
    )


def view_size(points: Array, outlines: Sequence[Array]) -> float:
    """Size [m] of a picture of points (n, 2), the first being the start, and of a body."""
    reach = max((float(np.linalg.norm(o, axis=1).max()) for o in outlines), default=0.0)
    size = max(float(np.linalg.norm(points - points[0], axis=1).max()), 2.0 * reach)
    return size if size > SAME else STILL_SIZE_M


def _goes_on(one: Piece, other: Piece) -> bool:
    scale = 1.0 + float(np.abs(one.pose[-1]).max())
    return bool(
        one.name == other.name
        and abs(one.time[-1] - other.time[0]) <= SAME * (1.0 + abs(one.time[-1]))
        and np.abs(one.pose[-1] - other.pose[0]).max() <= SAME * scale
    )


def _joined(one: Piece, other: Piece) -> Piece:
    return Piece(
        name=one.name,
        twist=one.twist,
        time=np.concatenate([one.time, other.time[1:]]),
        pose=np.concatenate([one.pose, other.pose[1:]]),
        control=np.concatenate([one.control, other.control[1:]]),
    )
