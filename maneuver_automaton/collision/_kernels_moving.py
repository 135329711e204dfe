"""Certified conservative advancement among moving obstacles, each as long as it is there."""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, bare_shared_kernel
from maneuver_automaton.collision._kernels_clearance import NEAR, SHARP, piece_clearance
from maneuver_automaton.collision._kernels_slabs import (
    apart_during,
    pose_after,
    slabs_during,
    swept_box,
)
from maneuver_automaton.collision.arrays import Coast, MovingObstacles, Place
from maneuver_automaton.collision.body import Body
from maneuver_automaton.groups._kernels import coast, compose

SOON = 1e-11  # [s] a knot that is nearer in time counts as reached: in it nothing moves 1e-9 m


@bare_inner_kernel
def coast_of(motions: Array, k: int) -> Coast:
    """One of several motions (n, 9)."""
    row = motions[k]
    return Coast(row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8])


@bare_inner_kernel
def knot_before(moving: MovingObstacles, m: int, time: float) -> int:
    """The last knot at or before `time`, which is after the first one and before the last."""
    low, high = moving.first_knot[m], moving.first_knot[m + 1] - 1
    # Recorded traffic has a knot every tenth of a second. Where knots are evenly spaced, the first
    # one that is looked at is right; where they are not, a search by halves goes on from there.
    share = (time - moving.time[low]) / (moving.time[high] - moving.time[low])
    middle = min(low + int(share * (high - low)), high - 1)
    while True:
        if moving.time[middle] > time:
            high = middle
        elif moving.time[middle + 1] <= time:
            low = middle + 1
        else:
            return middle
        middle = (low + high) // 2


@bare_inner_kernel
def obstacle_pose(moving: MovingObstacles, m: int, time: float) -> tuple[float, float, float]:
    """Pose (x, y, heading) of a moving obstacle, held before its first knot and after."""
    k, last = moving.first_knot[m], moving.first_knot[m + 1] - 1
    if time >= moving.time[last]:
        k = last
    elif time > moving.time[k]:
        k = knot_before(moving, m, time)
    return pose_after(moving, m, k, time)


@bare_inner_kernel
def closing_of(
    moving: MovingObstacles,
    m: int,
    body: Body,
    motion: Coast,
    heading: float,
    time: float,
    most: float,
) -> tuple[float, float]:
    """How fast a body and an obstacle come together at most, and for how long that holds."""
    v_x, v_y, turn_rate = motion.v_x, motion.v_y, motion.turn_rate
    sign = 1.0 if motion.duration >= 0.0 else -1.0  # the direction of time
    k_0, last = moving.first_knot[m], moving.first_knot[m + 1] - 1
    m_x, m_y, m_turn, m_bend = 0.0, 0.0, 0.0, 0.0
    # A knot that is reached just now belongs to what comes next, in either direction.
    now = time + sign * SOON
    if now <= moving.time[k_0]:
        until = moving.time[k_0] - time if sign > 0.0 else math.inf
    elif now >= moving.time[last]:
        until = math.inf if sign > 0.0 else time - moving.time[last]
    else:
        k = knot_before(moving, m, now)
        if moving.arcs[m]:
            r_x, r_y, m_turn = moving.rate[k, 0], moving.rate[k, 1], sign * moving.rate[k, 2]
            m_heading = moving.pose[k, 2] + moving.rate[k, 2] * (time - moving.time[k])
            m_c, m_s = math.cos(m_heading), math.sin(m_heading)
            m_x, m_y = sign * (m_c * r_x - m_s * r_y), sign * (m_s * r_x + m_c * r_y)
            m_bend = abs(m_turn) * math.hypot(r_x, r_y)
        else:
            rate = sign / (moving.time[k + 1] - moving.time[k])
            m_x = rate * (moving.pose[k + 1, 0] - moving.pose[k, 0])
            m_y = rate * (moving.pose[k + 1, 1] - moving.pose[k, 1])
            m_turn = rate * (moving.pose[k + 1, 2] - moving.pose[k, 2])
        until = moving.time[k + 1] - time if sign > 0.0 else time - moving.time[k]
    lasting = min(until + SOON, most)
    # Two points of the two come together no faster than their frames do, and both turns, and as far
    # as the velocities of both turn until then. Of two that drive side by side one hardly moves,
    # seen from the other.
    c, s = math.cos(heading), math.sin(heading)
    w_x, w_y = sign * (c * v_x - s * v_y), sign * (s * v_x + c * v_y)
    far = body.reach + abs(body.middle_x) + abs(body.middle_y)
    m_far = moving.reach[m] + abs(moving.middle[m, 0]) + abs(moving.middle[m, 1])
    closing = math.hypot(w_x - m_x, w_y - m_y) + abs(m_turn) * m_far + m_bend * lasting
    if turn_rate != 0.0:
        closing += abs(turn_rate) * (far + lasting * math.hypot(v_x, v_y))
    return closing, lasting


@bare_inner_kernel
def moving_clearance(
    moving: MovingObstacles,
    m: int,
    body: Body,
    pose: tuple[float, float, float],
    time: float,
    keep: float,
    enough: float,
) -> float:
    """Clearance to a moving obstacle at `time`: a bound, exact around `keep`, up to `enough`."""
    x, y, heading = pose
    o_x, o_y, o_heading = obstacle_pose(moving, m, time)
    d_x, d_y = x - o_x, y - o_y
    # Discs around both frames first: an obstacle far away costs no cosine.
    far = moving.reach[m] + abs(moving.middle[m, 0]) + abs(moving.middle[m, 1])
    far += body.reach + abs(body.middle_x) + abs(body.middle_y)
    square = d_x * d_x + d_y * d_y
    if square > (far + enough) * (far + enough):
        return math.sqrt(square) - far
    c, s = math.cos(o_heading), math.sin(o_heading)
    r_x, r_y = c * d_x + s * d_y, c * d_y - s * d_x  # the vehicle seen from the obstacle
    turn = heading - o_heading
    c, s = math.cos(turn), math.sin(turn)
    m_x = r_x + c * body.middle_x - s * body.middle_y - moving.middle[m, 0]
    m_y = r_y + s * body.middle_x + c * body.middle_y - moving.middle[m, 1]
    # Discs around both: an obstacle far away costs neither pieces nor axes.
    best = math.sqrt(m_x * m_x + m_y * m_y) - body.reach - moving.reach[m]
    if best > enough:
        return best
    best, seen = math.inf, Place(r_x, r_y, c, s)
    # Exact where the distance to keep begins, as in `near_step`.
    near = NEAR * (body.reach + moving.reach[m]) + keep / SHARP
    for p in range(moving.first_piece[m], moving.first_piece[m + 1]):
        for b in range(body.first.shape[0] - 1):
            clearance, _, _ = piece_clearance(
                body, b, seen, moving.solids, p, near, min(best, enough)
            )
            best = min(best, clearance)
            if best <= 0.0:
                return best
    return best


@bare_shared_kernel
def free_of_moving(
    moving: MovingObstacles, body: Body, motion: Coast, keep: float, margin: float
) -> tuple[float, float, int]:
    """How long it is free of what moves, as `free_time`; last clearance; in whose way, or -1."""
    # Those too far away to be met, by where they may be in the meantime, are passed over: the body
    # never comes as near to them as it would stop at. The others are followed as long as they are
    # there.
    x, y, heading, v_x, v_y, turn_rate, speed, duration, clock = motion
    sign = 1.0 if duration >= 0.0 else -1.0
    free, nearest, hit = abs(duration), math.inf, -1
    n, slabs = moving.speed.shape[0], moving.slabs
    during, swept = (0, 0), (0.0, 0.0, 0.0, 0.0)
    if slabs.leaves > 0:
        during = slabs_during(slabs, clock, duration)
        swept = swept_box(body, motion)
    for m in range(n):
        if slabs.leaves > 0:
            apart = apart_during(slabs, n, m, during, swept) - body.reach - keep
            if apart > margin:
                nearest = min(nearest, apart)
                continue
        begin, end = moving.present[m, 0] - clock, moving.present[m, 1] - clock
        if sign < 0.0:
            begin, end = -end, -begin
        if end < 0.0 or begin > free:
            continue
        t, end = max(begin, 0.0), min(end, free)
        # Seen from the obstacle, no point of the body is faster than both together; the obstacle
        # stands before its first knot and after its last.
        first, last = moving.first_knot[m], moving.first_knot[m + 1] - 1
        low, high = (clock + t, clock + end) if sign > 0.0 else (clock - end, clock - t)
        stands = high <= moving.time[first] or low >= moving.time[last]
        fast = speed if stands else speed + moving.speed[m]
        while True:
            pose = (x, y, heading)
            if t > 0.0:
                d_x, d_y, turn = coast(v_x, v_y, turn_rate, sign * t)
                pose = compose(x, y, heading, d_x, d_y, turn)
            time, left = clock + sign * t, end - t
            shrinks = fast * left if fast > 0.0 else 0.0  # until the end, at most
            enough = keep + margin + shrinks
            clearance = moving_clearance(moving, m, body, pose, time, keep, enough)
            clearance -= keep
            if clearance <= margin:
                free, nearest, hit = t, clearance, m
                break
            if clearance - shrinks <= margin:
                closing, lasting = closing_of(moving, m, body, motion, pose[2], time, left)
                shrinks = closing * left if closing > 0.0 else 0.0
                if lasting < left or clearance - shrinks <= margin:
                    step = min(clearance / closing, lasting) if closing > 0.0 else lasting
                    # The end is looked at as every pose.
                    t = min(t + max(step, clearance / fast), end)
                    continue
            # All of the rest is proven, and the clearance at the end.
            if end == free:
                nearest = min(nearest, clearance - shrinks)
            break
    return free, nearest, hit
