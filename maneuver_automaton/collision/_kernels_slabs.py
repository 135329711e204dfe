"""Boxes around what moving obstacles sweep in slabs of time, and which a motion comes near to.

All boxes are those of a point that moves: the middle of the disc around a body or an obstacle. A
path from one place to another that is no longer than some length lies inside the ellipse around
both places as its foci, and that inside the box around both, grown by the ellipse's smaller half
axis. So a box needs two places and a length, on lines and on arcs alike.
"""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.collision.arrays import Coast, MovingObstacles, Slabs
from maneuver_automaton.collision.body import Body
from maneuver_automaton.groups._kernels import coast, compose

LONGER = 1.0 + 1e-12  # than a straight path by rounding, squared


@bare_inner_kernel
def bulge(length: float, d_x: float, d_y: float) -> float:
    """How far a path is outside the box around its ends, at most, by its length and its chord."""
    square = LONGER * length * length - (d_x * d_x + d_y * d_y)
    return 0.5 * math.sqrt(square) if square > 0.0 else 0.0


@bare_inner_kernel
def pose_after(moving: MovingObstacles, m: int, k: int, time: float) -> tuple[float, float, float]:
    """Pose of an obstacle at a time, as the motion after knot `k` has it."""
    x, y, heading = moving.pose[k, 0], moving.pose[k, 1], moving.pose[k, 2]
    since = time - moving.time[k]
    if since > 0.0 and k + 1 < moving.first_knot[m + 1]:
        if moving.arcs[m]:
            r_x, r_y, r_turn = moving.rate[k, 0], moving.rate[k, 1], moving.rate[k, 2]
            d_x, d_y, turn = coast(r_x, r_y, r_turn, since)
            x, y, heading = compose(x, y, heading, d_x, d_y, turn)
        else:
            share = since / (moving.time[k + 1] - moving.time[k])
            x += share * (moving.pose[k + 1, 0] - x)
            y += share * (moving.pose[k + 1, 1] - y)
            heading += share * (moving.pose[k + 1, 2] - heading)
    return x, y, heading


@bare_inner_kernel
def middle_after(moving: MovingObstacles, m: int, k: int, time: float) -> tuple[float, float]:
    """Place of an obstacle's middle at a time, as the motion after knot `k` has it."""
    x, y, heading = pose_after(moving, m, k, time)
    c, s = math.cos(heading), math.sin(heading)
    m_x, m_y = moving.middle[m, 0], moving.middle[m, 1]
    return x + c * m_x - s * m_y, y + s * m_x + c * m_y


@bare_inner_kernel
def middle_speed(moving: MovingObstacles, m: int, k: int) -> float:
    """How fast an obstacle's middle is after knot `k`, at most; not the last knot."""
    m_x, m_y = moving.middle[m, 0], moving.middle[m, 1]
    if moving.arcs[m]:
        r_x, r_y, turn = moving.rate[k, 0], moving.rate[k, 1], moving.rate[k, 2]
        return math.hypot(r_x - turn * m_y, r_y + turn * m_x)
    d_x, d_y = moving.pose[k + 1, 0] - moving.pose[k, 0], moving.pose[k + 1, 1] - moving.pose[k, 1]
    turn = abs(moving.pose[k + 1, 2] - moving.pose[k, 2])
    most: float = math.hypot(d_x, d_y) + turn * math.hypot(m_x, m_y)
    return most / float(moving.time[k + 1] - moving.time[k])


@bare_inner_kernel
def widen(
    box: Array, row: int, x: float, y: float, to_x: float, to_y: float, around: float
) -> None:
    """Let a box hold two places and all that is `around` the box of these."""
    box[row, 0] = min(box[row, 0], min(x, to_x) - around)
    box[row, 1] = min(box[row, 1], min(y, to_y) - around)
    box[row, 2] = max(box[row, 2], max(x, to_x) + around)
    box[row, 3] = max(box[row, 3], max(y, to_y) + around)


@bare_kernel
def write_slabs(
    moving: MovingObstacles, begin: float, width: float, leaves: int, box: Array
) -> None:
    """Fill the boxes (2 leaves M, 4) of all slabs, as `Slabs` describes them."""
    n = moving.speed.shape[0]
    box[:, :2] = math.inf
    box[:, 2:] = -math.inf
    for m in range(n):
        first, last = moving.first_knot[m], moving.first_knot[m + 1] - 1
        k = first  # the last knot at or before `t`, or the first one
        for leaf in range(leaves):
            row = (leaves + leaf) * n + m
            t = begin + leaf * width if leaf > 0 else -math.inf
            end = begin + (leaf + 1) * width if leaf < leaves - 1 else math.inf
            t, end = max(t, moving.present[m, 0]), min(end, moving.present[m, 1])
            # From knot to knot within the slab, and from its begin and to its end.
            while t <= end:
                while k < last and moving.time[k + 1] <= t:
                    k += 1
                stands = k == last or t < moving.time[k]
                until = end
                if t < moving.time[k]:
                    until = min(until, moving.time[k])
                elif k < last:
                    until = min(until, moving.time[k + 1])
                x, y = middle_after(moving, m, k, t)
                to_x, to_y, around = x, y, moving.reach[m]
                if not stands:
                    to_x, to_y = middle_after(moving, m, k, until)
                    length = middle_speed(moving, m, k) * (until - t)
                    around += bulge(length, to_x - x, to_y - y)
                widen(box, row, x, y, to_x, to_y, around)
                if until >= end:
                    break
                t = until
    # Each longer slab from its halves, the shorter ones first: the same obstacle in both.
    for row in range(leaves * n - 1, n - 1, -1):
        half = 2 * (row - row % n) + row % n
        for other in (half, half + n):
            x, y, to_x, to_y = box[other, 0], box[other, 1], box[other, 2], box[other, 3]
            if x <= to_x:
                widen(box, row, x, y, to_x, to_y, 0.0)


@bare_inner_kernel
def slabs_during(slabs: Slabs, clock: float, duration: float) -> tuple[int, int]:
    """Two slabs side by side, or one twice, that hold all times of a motion."""
    low, high = min(clock, clock + duration), max(clock, clock + duration)
    last = slabs.leaves - 1.0
    a = slabs.leaves + int(min(max((low - slabs.begin) / slabs.width, 0.0), last))
    b = slabs.leaves + int(min(max((high - slabs.begin) / slabs.width, 0.0), last))
    while b - a > 1:
        a, b = a >> 1, b >> 1
    return a, b


@bare_inner_kernel
def swept_box(body: Body, motion: Coast) -> tuple[float, float, float, float]:
    """Box [low x, low y, high x, high y] around the body's middle during a motion."""
    x, y, heading, v_x, v_y, turn_rate, _, duration, _ = motion
    m_x, m_y = body.middle_x, body.middle_y
    from_x, from_y, _ = compose(x, y, heading, m_x, m_y, 0.0)
    d_x, d_y, turn = coast(v_x, v_y, turn_rate, duration)
    end_x, end_y, end_heading = compose(x, y, heading, d_x, d_y, turn)
    to_x, to_y, _ = compose(end_x, end_y, end_heading, m_x, m_y, 0.0)
    speed = math.hypot(v_x - turn_rate * m_y, v_y + turn_rate * m_x)
    around = bulge(speed * duration, to_x - from_x, to_y - from_y)
    return (
        min(from_x, to_x) - around,
        min(from_y, to_y) - around,
        max(from_x, to_x) + around,
        max(from_y, to_y) + around,
    )


@bare_inner_kernel
def apart_during(
    slabs: Slabs, n: int, m: int, during: tuple[int, int], swept: tuple[float, float, float, float]
) -> float:
    """Least distance of obstacle `m` of `n` from a body's middle in two slabs; else below 0."""
    # The proof: in these slabs it is inside its boxes, and the middle inside the box that is
    # `swept`.
    a, b = slabs.first + during[0] * n + m, slabs.first + during[1] * n + m
    box = slabs.box
    in_a: float = max(
        max(box[a, 0] - swept[2], swept[0] - box[a, 2]),
        max(box[a, 1] - swept[3], swept[1] - box[a, 3]),
    )
    in_b: float = max(
        max(box[b, 0] - swept[2], swept[0] - box[b, 2]),
        max(box[b, 1] - swept[3], swept[1] - box[b, 3]),
    )
    return min(in_a, in_b)
