"""What a plan states: stretches between its samples, each under one control."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Plan
from maneuver_automaton.primitives import Maneuver, Trim

NOTHING = 1e-12  # [s] shorter pieces lead nowhere


class Stated(NamedTuple):
    """Stretches in order; what the plan states of them is compared, and never driven from."""

    lengths: Array  # (n,) [s]
    controls: Array  # (n, n_u)
    states: Array  # (n, n_z) reduced states where they begin
    end_states: Array  # (n, n_z)
    ends: Array  # (n, dof) poses where they end
    twists: Array  # (n, dof) of trims; NaN along maneuvers
    pieces: IntArray  # (n,) number of the primitive


def stated_by(plan: Plan) -> Stated:
    """The stretches of a plan: trims whole, maneuvers from sample to sample.

    Raises
    ------
    ValueError
        If a maneuver has no course.
    """
    poses = plan.switching_poses
    rows: list[Stated] = []
    for k, (piece, duration) in enumerate(
        zip(plan.primitives, plan.primitive_durations.tolist(), strict=True)
    ):
        if duration > NOTHING:
            one = _trim(piece, duration, poses[k + 1]) if isinstance(piece, Trim) else None
            rows.append(one or _maneuver(piece, poses[k]))  # type: ignore[arg-type]
    if not rows:
        return _nothing(plan)
    numbers = np.flatnonzero(plan.primitive_durations > NOTHING)
    pieces = np.repeat(numbers, [row.lengths.size for row in rows])
    whole = Stated(*(np.concatenate(column) for column in zip(*rows, strict=True)))
    return whole._replace(pieces=pieces)


def _trim(trim: Trim, duration: float, end: Array) -> Stated:
    states = trim.reduced_state[None]
    twist = trim.body_velocity[None]
    return Stated(
        np.array([duration]), trim.control[None], states, states, end[None], twist, _UNKNOWN
    )


def _maneuver(maneuver: Maneuver, begin: Array) -> Stated:
    course = maneuver.course
    if course is None:
        raise ValueError(f"maneuver {maneuver.name!r}: has no course, so it cannot be audited")
    lengths = np.diff(course.time)
    lasting = lengths > 0.0
    poses = placed(begin, course.pose[1:])
    return Stated(
        lengths[lasting],
        course.control[:-1][lasting],
        course.reduced_state[:-1][lasting],
        course.reduced_state[1:][lasting],
        poses[lasting],
        np.full_like(poses[lasting], np.nan),
        _UNKNOWN,
    )


def _nothing(plan: Plan) -> Stated:
    trim = plan.trims[0] if plan.trims else None
    states = np.zeros((0, 0 if trim is None else trim.reduced_state.size))
    controls = np.zeros((0, 0 if trim is None else trim.control.size))
    poses = np.zeros((0, plan.start.size))
    return Stated(np.zeros(0), controls, states, states, poses, poses, _UNKNOWN)


_UNKNOWN: IntArray = np.zeros(0, dtype=np.int64)


def placed(frames: Array, seen: Array) -> Array:
    """Poses (..., dof) that are `seen` (..., 3 or more) from frames (..., dof), in the world.

    Examples
    --------
    >>> placed(np.array([1.0, 2.0, np.pi / 2]), np.array([3.0, 0.0, 0.5])).round(3).tolist()
    [1.0, 5.0, 2.071]
    """
    cosine, sine = np.cos(frames[..., 2]), np.sin(frames[..., 2])
    x, y = seen[..., 0], seen[..., 1]
    planar = [cosine * x - sine * y, sine * x + cosine * y, seen[..., 2]]
    higher = [seen[..., k] if k < seen.shape[-1] else 0.0 * x for k in range(3, frames.shape[-1])]
    return np.asarray(frames + np.stack(np.broadcast_arrays(*planar, *higher), axis=-1))
