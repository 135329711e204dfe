"""Whether poses and plans stay inside the bounds of a problem."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.groups import group_of
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.problem import Bounds


def outside(pose: Array, bounds: Bounds) -> str:
    """Which bound a pose is outside of, in words; empty if it is inside."""
    for name, index in (("x", 0), ("y", 1), ("z", 3)):
        pair = getattr(bounds, name)
        if pair is not None and index < pose.size and not pair[0] <= pose[index] <= pair[1]:
            return f"{name} = {pose[index]:.6g} m, need {pair[0]:.6g} to {pair[1]:.6g} m"
    return ""


def stays_inside(plan: Plan, bounds: Bounds) -> bool:
    """Whether every pose of a plan is inside the bounds, extreme points of arcs included."""
    if bounds.x is None and bounds.y is None and bounds.z is None:
        return True
    times, begins, along = list[Array](), list[Array](), list[Array]()
    for k, primitive in enumerate(plan.primitives):
        if isinstance(primitive, Maneuver):
            if primitive.course is not None:
                along.append(primitive.course.pose)
                begins.append(np.tile(plan.switching_poses[k], (len(along[-1]), 1)))
            continue
        v_x, v_y, turn_rate = primitive.body_velocity[:3]
        duration = plan.primitive_durations[k]
        if turn_rate:  # the path is level with an axis where the velocity's direction is
            heading = plan.switching_poses[k][2] + math.atan2(v_y, v_x)
            quarter = 0.5 * math.pi
            first = math.ceil(min(heading, heading + turn_rate * duration) / quarter)
            last = math.floor(max(heading, heading + turn_rate * duration) / quarter)
            angles = np.arange(first, last + 1) * quarter
            times.append(plan.switching_times[k] + (angles - heading) / turn_rate)
    known = [plan.switching_poses]
    if along:  # all courses at once
        group = group_of(plan.start.size)
        known.append((group(np.concatenate(begins)) @ group(np.concatenate(along))).pose)
    if times:
        known.append(plan.pose_at(np.concatenate(times)))
    poses = np.concatenate(known)
    slack = 1e-9 * (1.0 + float(np.abs(poses).max()))
    for index, pair in ((0, bounds.x), (1, bounds.y), (3, bounds.z)):
        if pair is not None and index < poses.shape[1]:
            values = poses[:, index]
            if values.min() < pair[0] - slack or values.max() > pair[1] + slack:
                return False
    return True
