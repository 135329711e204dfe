"""What a plan states: stretches between its samples, each under one control."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Plan, Primitive
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
    poses, lengths = plan.switching_poses, plan.primitive_durations
    rows: list[Stated] = []
    lasting = np.flatnonzero(lengths > NOTHING)
    for _, run in groupby(lasting.tolist(), key=lambda k: _run_of(plan.primitives[k], k)):
        numbers = np.array(list(run))
        pieces = [plan.primitives[k] for k in numbers]
        trims = [one for one in pieces if isinstance(one, Trim)]
        if trims:
            rows.append(_trims(trims, numbers, lengths[numbers], poses[numbers + 1]))
        rows += [
            _maneuver(one, k, poses[k])
            for one, k in zip(pieces, numbers.tolist(), strict=True)
            if isinstance(one, Maneuver)
        ]
    if not rows:
        return _nothing(plan)
    if len(rows) == 1:
        return rows[0]
    return Stated(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def _run_of(piece: Primitive, number: int) -> int:
    """What trims share that follow each other; every maneuver stands alone."""
    return -1 if isinstance(piece, Trim) else number


def _trims(trims: Sequence[Trim], numbers: IntArray, lengths: Array, ends: Array) -> Stated:
    states = np.array([trim.reduced_state for trim in trims])
    controls = np.array([trim.control for trim in trims])
    twists = np.array([trim.body_velocity for trim in trims])
    return Stated(lengths, controls, states, states, ends, twists, numbers)


def _maneuver(maneuver: Maneuver, number: int, begin: Array) -> Stated:
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
        np.full(int(lasting.sum()), number),
    )


def _nothing(plan: Plan) -> Stated:
    trim = plan.trims[0] if plan.trims else None
    states = np.zeros((0, 0 if trim is None else trim.reduced_state.size))
    controls = np.zeros((0, 0 if trim is None else trim.control.size))
    poses = np.zeros((0, plan.start.size))
    none = np.zeros(0, dtype=np.int64)
    return Stated(np.zeros(0), controls, states, states, poses, poses, none)


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
