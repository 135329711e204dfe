"""A track as numbers from which the browser computes every pose: arcs of one twist each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import group_of
from maneuver_automaton.models import Model
from maneuver_automaton.plotting.controls import step_curves
from maneuver_automaton.plotting.labels import control_labels
from maneuver_automaton.plotting.player.local import POSE_DIGITS, Local, rounded
from maneuver_automaton.plotting.track import Piece, Track

ONE_TWIST = 1e-9  # [m, rad] a piece is one arc where its twist meets all samples so closely


def motion_entry(track: Track, local: Local, names: dict[str, int]) -> dict[str, Any]:
    """Arcs of a `track`: begin time, first pose, twist, and which of the `names` it belongs to.

    A trim is one arc; a maneuver is one for each step between its samples, as `Plan.pose_at` has
    it. `times` and `poses` have one entry more than `twists`: where the last arc ends.
    """
    times: list[float] = []
    poses: list[Array] = []
    twists: list[Array] = []
    trims: list[int] = []
    for piece in track.pieces:
        for begin, pose, twist in _arcs(piece):
            times.append(begin)
            poses.append(pose)
            twists.append(twist)
            trims.append(names[piece.name])
    times.append(float(track.pieces[-1].time[-1]) if track.pieces else 0.0)
    poses.append(track.end)
    return {
        "times": rounded(times, POSE_DIGITS),
        "poses": local.poses(np.array(poses)),
        "twists": rounded(np.array(twists), POSE_DIGITS) if twists else [],
        "trims": trims,
    }


def curve_entries(track: Track, model: Model | None) -> list[dict[str, Any]]:
    """Reduced state and controls of a `track` over time, each with its label."""
    if not track.pieces:
        return []
    states, controls = track.pieces[0].state.shape[1], track.pieces[0].control.shape[1]
    if model is None:
        labels = [f"state {k + 1}" for k in range(states)]
        labels += [f"control {k + 1}" for k in range(controls)]
    else:
        labels = control_labels([*model.reduced_names, *model.control_names])
    curves = [
        np.concatenate([np.stack([one.time, one.state[:, k]], axis=-1) for one in track.pieces])
        for k in range(states)
    ]
    curves += [np.concatenate(step_curves(track, k)) for k in range(controls)]
    return [{"label": label, **_curve(curve)} for label, curve in zip(labels, curves, strict=False)]


def part_entries(track: Track, model: Model, names: Sequence[str]) -> list[dict[str, Any]]:
    """Poses in time of the parts that a vehicle carries, seen from its body."""
    if not track.pieces or not names:
        return []
    time, poses = part_frames(track, model)
    return [
        {"t": rounded(time, POSE_DIGITS), "pose": rounded(poses[:, k])} for k in range(len(names))
    ]


def part_frames(track: Track, model: Model) -> tuple[Array, Array]:
    """Times (n,) and poses (n, parts, 3) of the parts, seen from the body."""
    time = np.concatenate([piece.time for piece in track.pieces])
    state = np.concatenate([piece.state for piece in track.pieces])
    return time, np.asarray(model.part_poses(state))


def _arcs(piece: Piece) -> list[tuple[float, Array, Array]]:
    """Begin, first pose and twist of the arcs of a piece."""
    group = group_of(piece.pose.shape[1])
    since = (piece.time - piece.time[0])[:, None]
    along = (group(piece.pose[0]) @ group.exp(since * piece.twist)).pose
    if np.abs(along - piece.pose).max() <= ONE_TWIST:
        return [(float(piece.time[0]), piece.pose[0], piece.twist)]
    steps = (group(piece.pose[:-1]).inverse() @ group(piece.pose[1:])).log()
    spans = np.diff(piece.time)
    return [
        (float(piece.time[k]), piece.pose[k], steps[k] / spans[k])
        for k in np.flatnonzero(spans > 0.0).tolist()
    ]


def _curve(curve: Array) -> dict[str, list[float]]:
    """Corners of a curve (n, 2) over time, without those on a line of constant value."""
    flat = np.zeros(len(curve), dtype=np.bool_)
    flat[1:-1] = (curve[1:-1, 1] == curve[:-2, 1]) & (curve[1:-1, 1] == curve[2:, 1])
    kept = curve[~flat]
    return {"t": rounded(kept[:, 0]), "v": rounded(kept[:, 1])}
