"""Certified conservative advancement: a proof that a whole motion is free, not a sample of it."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, bare_shared_kernel, kernel
from maneuver_automaton.collision._kernels_clearance import (
    NEAR,
    field_bound,
    near_step,
    static_clearance,
)
from maneuver_automaton.collision._kernels_moving import coast_of, free_of_moving, moving_clearance
from maneuver_automaton.collision.arrays import AboutCenter, Coast, Place, WorldArrays
from maneuver_automaton.collision.body import Body
from maneuver_automaton.groups._kernels import coast, compose

FLAT = 1e5  # [m] radius beyond which an arc is not counted from its centre


@bare_shared_kernel
def free_time(
    world: WorldArrays, body: Body, motion: Coast, keep: float, margin: float
) -> tuple[float, float]:
    """How long a motion is proven free, at most its duration; and the last clearance."""
    # The clearance is more than `keep + margin` wherever it is looked at, more than `keep` between.
    free, clearance = free_of_static(world, body, motion, keep, margin)
    # Where it begins too near to a solid, there is nothing left to prove.
    if world.moving.speed.shape[0] > 0 and (free > 0.0 or clearance > margin):
        x, y, heading, v_x, v_y, turn_rate, speed, duration, clock = motion
        t = free if duration >= 0.0 else -free
        begun = Coast(x, y, heading, v_x, v_y, turn_rate, speed, t, clock)
        lasts, nearest, _ = free_of_moving(world.moving, body, begun, keep, margin)
        clearance = min(clearance, nearest) if lasts == free else nearest
        free = lasts
    return free, clearance


@bare_inner_kernel
def free_of_static(
    world: WorldArrays, body: Body, motion: Coast, keep: float, margin: float
) -> tuple[float, float]:
    """How long a motion is proven free of static obstacles, as `free_time`; the last clearance."""
    x, y, heading, v_x, v_y, turn_rate, speed, duration, _ = motion
    # Backwards in time the same poses are passed in the other order: only velocities change their
    # sign, and the clock runs down.
    sign = 1.0 if duration >= 0.0 else -1.0
    length = abs(duration)
    # Where the field says less than this, solids are looked at one by one: a share of the body, but
    # not less than a share of the field's cell, by which the field may be off, nor than twice the
    # margin.
    near = max(max(NEAR * body.reach, 0.25 * world.field.cell), 2.0 * margin)
    c, s = math.cos(heading), math.sin(heading)
    # The world velocity of a straight motion, which holds all the way.
    w_x, w_y, turning = sign * (c * v_x - s * v_y), sign * (s * v_x + c * v_y), sign * turn_rate
    # The instantaneous centre of a turn stays where it is, so poses are counted from it: one cosine
    # and one sine a pose, and no error that adds up.
    center_x, center_y = x, y
    if turn_rate != 0.0:
        center_x = x - (s * v_x + c * v_y) / turn_rate
        center_y = y + (c * v_x - s * v_y) / turn_rate
    # A centre too far away to count from?
    flat = v_x * v_x + v_y * v_y > (FLAT * turn_rate) * (FLAT * turn_rate)
    # Beyond that radius the centre loses digits: poses come from `coast`, and no axis is followed.
    if flat and turn_rate != 0.0:
        turning = math.inf
    course = AboutCenter(center_x, center_y, w_x, w_y, turning)
    # The state of the loop: all before time `t` is proven; (p_x, p_y, p_heading) with cosine and
    # sine (c, s) is the pose at `t`; `nearest` is the least bound of the clearance met so far at
    # the last pose.
    t, nearest = 0.0, math.inf
    p_x, p_y, p_heading = x, y, heading
    while True:
        if t > 0.0:
            if turn_rate == 0.0:
                p_x, p_y = x + w_x * t, y + w_y * t
            elif flat:
                d_x, d_y, turn = coast(v_x, v_y, turn_rate, sign * t)
                p_x, p_y, p_heading = compose(x, y, heading, d_x, d_y, turn)
                c, s = math.cos(p_heading), math.sin(p_heading)
            else:
                p_heading = heading + sign * turn_rate * t
                c, s = math.cos(p_heading), math.sin(p_heading)
                p_x = center_x + (s * v_x + c * v_y) / turn_rate
                p_y = center_y - (c * v_x - s * v_y) / turn_rate
        # The order of the tests: the field, a few look-ups, decides most poses in the open. Solids
        # are asked where it does not.
        place = Place(p_x, p_y, c, s)
        clearance = field_bound(world.field, body, place, keep + near)
        if clearance > keep + near:
            nearest = clearance - keep
            # The proof of this step: no point of the body is faster than `speed`, so none comes
            # closer than `keep` for as long as that takes.
            step = nearest / speed if speed > 0.0 else math.inf
        else:
            step, nearest = near_step(
                world, body, place, course, speed, keep, margin, near, length - t
            )
            if step < 0.0:
                return t, nearest
        # The pose at the end was looked at as all others were: only then all of the motion is
        # proven.
        if t >= length or step == math.inf:
            return length, nearest
        t = min(t + step, length)  # the end has to be looked at as every pose


@kernel
def free_times(world: WorldArrays, body: Body, motions: Array, keep: float, margin: float) -> Array:
    """`free_time` of many motions (k, 9)."""
    free = np.empty(motions.shape[0])
    for k in range(motions.shape[0]):
        free[k], _ = free_time(world, body, coast_of(motions, k), keep, margin)
    return free


@kernel
def clearances(world: WorldArrays, body: Body, poses: Array, times: Array) -> Array:
    """Clearance (k,) at poses (k, 3): a lower bound, exact near contact, capped by the field."""
    out = np.empty(poses.shape[0])
    for k in range(poses.shape[0]):
        x, y, heading = poses[k, 0], poses[k, 1], poses[k, 2]
        place = Place(x, y, math.cos(heading), math.sin(heading))
        best = static_clearance(world, body, place)
        moving = world.moving
        for m in range(moving.speed.shape[0]):
            if not moving.present[m, 0] <= times[k] <= moving.present[m, 1]:
                continue
            clearance = moving_clearance(moving, m, body, (x, y, heading), times[k], 0.0, best)
            best = min(best, clearance)
        out[k] = best
    return out
