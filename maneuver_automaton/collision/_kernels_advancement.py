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
from maneuver_automaton.collision._kernels_moving import free_of_moving, moving_clearance
from maneuver_automaton.collision.arrays import WorldArrays
from maneuver_automaton.collision.body import Body
from maneuver_automaton.groups._kernels import coast, compose

FLAT = 1e5  # [m] radius beyond which an arc is not counted from its centre


@bare_shared_kernel
def free_time(
    world: WorldArrays,
    body: Body,
    x: float,
    y: float,
    heading: float,
    v_x: float,
    v_y: float,
    turn_rate: float,
    speed: float,
    duration: float,
    keep: float,
    margin: float,
    clock: float,
) -> tuple[float, float]:
    """How long a motion from a pose is proven free, at most `duration`; and the last clearance.

    No point of the body is faster than `speed`. The clearance is more than `keep + margin` wherever
    it is looked at, and more than `keep` in between. The world's time at the start is `clock`; a
    negative `duration` drives, and dates, the motion backwards.
    """
    free, clearance = free_of_static(
        world, body, x, y, heading, v_x, v_y, turn_rate, speed, duration, keep, margin
    )
    # Where it begins too near to a solid, there is nothing left to prove.
    if world.moving.speed.shape[0] > 0 and (free > 0.0 or clearance > margin):
        t = free if duration >= 0.0 else -free
        lasts, nearest = free_of_moving(
            world.moving, body, x, y, heading, v_x, v_y, turn_rate, speed, t, keep, margin, clock
        )
        clearance = min(clearance, nearest) if lasts == free else nearest
        free = lasts
    return free, clearance


@bare_inner_kernel
def free_of_static(
    world: WorldArrays,
    body: Body,
    x: float,
    y: float,
    heading: float,
    v_x: float,
    v_y: float,
    turn_rate: float,
    speed: float,
    duration: float,
    keep: float,
    margin: float,
) -> tuple[float, float]:
    """How long a motion is proven free of static obstacles, as `free_time`; the last clearance."""
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
        clearance = field_bound(world.field, body, p_x, p_y, c, s)
        if clearance > keep + near:
            nearest = clearance - keep
            # The proof of this step: no point of the body is faster than `speed`, so none comes
            # closer than `keep` for as long as that takes.
            step = nearest / speed if speed > 0.0 else math.inf
        else:
            step, nearest = near_step(
                world.buckets,
                world.solids,
                body,
                p_x,
                p_y,
                c,
                s,
                center_x,
                center_y,
                w_x,
                w_y,
                turning,
                speed,
                keep,
                margin,
                near,
                length - t,
            )
            if step < 0.0:
                return t, nearest
        # The pose at the end was looked at as all others were: only then all of the motion is
        # proven.
        if t >= length or step == math.inf:
            return length, nearest
        t = min(t + step, length)  # the end has to be looked at as every pose


@kernel
def free_times(
    world: WorldArrays,
    body: Body,
    poses: Array,
    twists: Array,
    speeds: Array,
    durations: Array,
    keep: float,
    margin: float,
    clocks: Array,
) -> Array:
    """`free_time` of many motions (k,)."""
    free = np.empty(durations.shape[0])
    for k in range(durations.shape[0]):
        free[k], _ = free_time(
            world,
            body,
            poses[k, 0],
            poses[k, 1],
            poses[k, 2],
            twists[k, 0],
            twists[k, 1],
            twists[k, 2],
            speeds[k],
            durations[k],
            keep,
            margin,
            clocks[k],
        )
    return free


@kernel
def clearances(world: WorldArrays, body: Body, poses: Array, times: Array) -> Array:
    """Clearance (k,) at poses (k, 3): a lower bound, exact near contact, capped by the field."""
    out = np.empty(poses.shape[0])
    for k in range(poses.shape[0]):
        x, y, heading = poses[k, 0], poses[k, 1], poses[k, 2]
        best = static_clearance(world, body, x, y, math.cos(heading), math.sin(heading))
        moving = world.moving
        for m in range(moving.speed.shape[0]):
            if not moving.present[m, 0] <= times[k] <= moving.present[m, 1]:
                continue
            clearance = moving_clearance(moving, m, body, x, y, heading, times[k], 0.0, best)
            best = min(best, clearance)
        out[k] = best
    return out
