"""A plan as stretches between samples, each under one control: what the audit looks at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan, Trajectory
from maneuver_automaton.groups import group_of
from maneuver_automaton.primitives import Maneuver, Trim


class Stretches(NamedTuple):
    """Stretches between samples of a plan, each under one control."""

    begins: Array  # (n, dof)
    ends: Array  # (n, dof)
    lengths: Array  # (n,) [s]
    states: Array  # (n, n_z) where they begin
    end_states: Array  # (n, n_z)
    controls: Array  # (n, n_u)


def stretches_of(plan: Plan) -> Stretches:
    """All stretches of a plan: along a trim as many as it takes, along a maneuver its samples."""
    parts = [_none_of(plan)]
    for k, primitive in enumerate(plan.primitives):
        begin, end = plan.switching_times[k], plan.switching_times[k + 1]
        if not end - begin > 1e-12:  # shorter ones lead nowhere
            continue
        if isinstance(primitive, Trim):
            times = np.linspace(begin, end, _samples(primitive.body_velocity, end - begin))
            rows = (times.size - 1, 1)
            states = np.tile(primitive.reduced_state, rows)
            controls = np.tile(primitive.control, rows)
            parts.append(_between(plan.pose_at(times), np.diff(times), states, states, controls))
            continue
        course = course_of(primitive)
        group = group_of(plan.start.size)
        poses = (group(plan.switching_poses[k]) @ group(course.pose)).pose
        states = course.reduced_state
        lengths = np.diff(course.time)
        parts.append(_between(poses, lengths, states[:-1], states[1:], course.control[:-1]))
    return Stretches(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _none_of(plan: Plan) -> Stretches:
    poses = np.zeros((0, plan.start.size))
    trim = plan.trims[0] if plan.trims else None
    states = np.zeros((0, 0 if trim is None else trim.reduced_state.size))
    controls = np.zeros((0, 0 if trim is None else trim.control.size))
    return Stretches(poses, poses, np.zeros(0), states, states, controls)


def _between(
    poses: Array, lengths: Array, states: Array, end_states: Array, controls: Array
) -> Stretches:
    return Stretches(poses[:-1], poses[1:], lengths, states, end_states, controls)


def course_of(maneuver: Maneuver) -> Trajectory:
    """The course of a maneuver; a ValueError if it has none."""
    if maneuver.course is None:
        raise ValueError(f"maneuver {maneuver.name!r}: has no course, so it cannot be audited")
    return maneuver.course


def _samples(body_velocity: Array, duration: float) -> int:
    """Samples of one trim: every radian and every metre, two at least, a hundred at most."""
    length = float(np.linalg.norm(body_velocity)) * duration
    return 2 + min(98, int(np.ceil(length)))
