"""Proof that a car meets no moving obstacle within a tick.

`World` of the collision room has no presence in time: a moving obstacle waits there before the
first of its knots and after the last one, while a road user is gone. It also asks every obstacle at
every pose looked at, which takes 2 to 3.5 times as long as one look at a tick. So rectangles at the
ticks are parted here, by axes.

Within a tick both bodies are taken to move on straight lines between their poses at its ends.
Recorded traffic does; the car leaves that line by at most an eighth of its acceleration times the
square of the tick (9 m/s^2 and 0.1 s: 11 mm), which is less than the margin that is kept. Two
bodies that one fixed direction separates at both ends of a straight motion are apart all the way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from maneuver_automaton._compile import bare_inner_kernel

HALVINGS = 2  # how often a tick is cut in two before it counts as hit


class TrafficArrays(NamedTuple):
    """Moving obstacles, as M rectangles at T ticks of the planner's clock."""

    # Poses at every tick, not knots in time: the pose of a tick is one look, without a search.
    pose: np.ndarray  # (M, T, 3) of the middle of a rectangle around each
    first: np.ndarray  # (M,) first and last tick at which it is there
    last: np.ndarray
    half: np.ndarray  # (M, 2) half length and half width [m]
    reach: np.ndarray  # (M,) half the diagonal [m]: discs are compared before any axis
    margin: float  # [m] kept from all of them


@bare_inner_kernel
def extent(half_length, half_width, turn):
    """Half the width of a rectangle's shadow on an axis that is `turn` from its length."""
    return half_length * abs(math.cos(turn)) + half_width * abs(math.sin(turn))


@bare_inner_kernel
def axis_apart(car, half, d_0x, d_0y, h_0, o_0, d_1x, d_1y, h_1, o_1, margin):
    """Whether one direction separates two rectangles at both ends of their motions.

    `d` leads from the middle of the car to that of the other, `h` and `o` are their headings.
    """
    mine, theirs = 0.5 * (h_0 + h_1), 0.5 * (o_0 + o_1)
    # The sides of both: of two rectangles that are apart, one of these four directions parts them.
    # The car's own come first: most others drive along beside it, or ahead of it.
    for k in range(4):
        axis = (mine if k < 2 else theirs) + (k % 2) * 0.5 * math.pi
        a_x, a_y = math.cos(axis), math.sin(axis)
        d_0, d_1 = d_0x * a_x + d_0y * a_y, d_1x * a_x + d_1y * a_y
        r_0 = extent(car.half_length, car.half_width, h_0 - axis)
        r_0 += extent(half[0], half[1], o_0 - axis) + margin
        r_1 = extent(car.half_length, car.half_width, h_1 - axis)
        r_1 += extent(half[0], half[1], o_1 - axis) + margin
        # The same side at both ends: this line is the proof.
        if (d_0 > r_0 and d_1 > r_1) or (d_0 < -r_0 and d_1 < -r_1):
            return True
    return False


@bare_inner_kernel
def user_apart(car, half, d_0x, d_0y, h_0, o_0, d_1x, d_1y, h_1, o_1, margin):
    """`axis_apart`, the tick cut in two and again where no direction separates all of it."""
    parts = 1
    for _ in range(HALVINGS + 1):
        clear = True
        for k in range(parts):
            a, b = k / parts, (k + 1) / parts
            if not axis_apart(
                car,
                half,
                d_0x + a * (d_1x - d_0x),
                d_0y + a * (d_1y - d_0y),
                h_0 + a * (h_1 - h_0),
                o_0 + a * (o_1 - o_0),
                d_0x + b * (d_1x - d_0x),
                d_0y + b * (d_1y - d_0y),
                h_0 + b * (h_1 - h_0),
                o_0 + b * (o_1 - o_0),
                margin,
            ):
                clear = False
                break
        if clear:
            return True
        parts *= 2
    return False


@bare_inner_kernel
def clear_of_traffic(car, traffic, x_0, y_0, h_0, x_1, y_1, h_1, tick):
    """Whether a car meets no moving obstacle from `tick` to the next; poses are of its middle."""
    last = traffic.pose.shape[1] - 1
    k_0, k_1 = min(max(tick, 0), last), min(max(tick + 1, 0), last)
    for m in range(traffic.first.shape[0]):
        # Present at either end is present: it counts from the tick before to the one after.
        if tick + 1 < traffic.first[m] or tick > traffic.last[m]:
            continue
        d_0x, d_0y = traffic.pose[m, k_0, 0] - x_0, traffic.pose[m, k_0, 1] - y_0
        d_1x, d_1y = traffic.pose[m, k_1, 0] - x_1, traffic.pose[m, k_1, 1] - y_1
        # Discs around both, from their distance half way: an obstacle far away costs no cosine.
        swing = 0.5 * math.hypot(d_1x - d_0x, d_1y - d_0y)
        away = math.hypot(0.5 * (d_0x + d_1x), 0.5 * (d_0y + d_1y)) - swing
        if away > car.reach + traffic.reach[m] + traffic.margin:
            continue
        o_0, o_1 = traffic.pose[m, k_0, 2], traffic.pose[m, k_1, 2]
        if not user_apart(
            car, traffic.half[m], d_0x, d_0y, h_0, o_0, d_1x, d_1y, h_1, o_1, traffic.margin
        ):
            return False
    return True
