"""When vehicles that drive their plans come too near to each other: proven, not sampled."""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.collision._kernels_moving import free_of_moving
from maneuver_automaton.collision._kernels_slabs import apart_during, slabs_during, swept_box
from maneuver_automaton.collision.arrays import MovingObstacles, Slabs
from maneuver_automaton.collision.body import Body


@bare_kernel
def first_meetings(
    moving: MovingObstacles, body: Body, coasts: Array, keep: float, margin: float, out: Array
) -> None:
    """When a body first comes within `keep` of each of what moves [s]; inf if it never does.

    Rows of `coasts` (n, 9) are a pose, a twist, the speed of the body's fastest point, and how long
    and from when it coasts so. Between two looks the bodies keep `keep`, at each of them more than
    that by `margin`.
    """
    slabs, n = moving.slabs, out.shape[0]
    out[:] = math.inf
    for k in range(coasts.shape[0]):
        x, y, heading = coasts[k, 0], coasts[k, 1], coasts[k, 2]
        v_x, v_y, turn_rate, speed = coasts[k, 3], coasts[k, 4], coasts[k, 5], coasts[k, 6]
        duration, clock = coasts[k, 7], coasts[k, 8]
        during, swept = (0, 0), (0.0, 0.0, 0.0, 0.0)
        if slabs.leaves > 0:
            during = slabs_during(slabs, clock, duration)
            swept = swept_box(body, x, y, heading, v_x, v_y, turn_rate, duration)
        for m in range(n):
            if out[m] < math.inf:
                continue  # by an earlier coast
            if slabs.leaves > 0:
                apart = apart_during(slabs, n, m, during, swept) - body.reach - keep
                if apart > margin:
                    continue
            free, _ = free_of_moving(
                one_of(moving, m),
                body,
                x,
                y,
                heading,
                v_x,
                v_y,
                turn_rate,
                speed,
                duration,
                keep,
                margin,
                clock,
            )
            if free < duration:
                out[m] = clock + free


@bare_inner_kernel
def one_of(moving: MovingObstacles, m: int) -> MovingObstacles:
    """One of several moving obstacles by itself."""
    return MovingObstacles(
        moving.solids,
        moving.first_piece[m : m + 2],
        moving.first_knot[m : m + 2],
        moving.time,
        moving.pose,
        moving.speed[m : m + 1],
        moving.middle[m : m + 1],
        moving.reach[m : m + 1],
        moving.present[m : m + 1],
        moving.rate,
        moving.arcs[m : m + 1],
        Slabs(0.0, 1.0, 0, 0, moving.slabs.box),
    )
