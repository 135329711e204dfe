"""When vehicles that drive their plans come too near to each other: proven, not sampled."""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.collision._kernels_moving import coast_of, free_of_moving
from maneuver_automaton.collision._kernels_slabs import apart_during, slabs_during, swept_box
from maneuver_automaton.collision.arrays import MovingObstacles, Slabs
from maneuver_automaton.collision.body import Body


@bare_kernel
def first_meetings(
    moving: MovingObstacles, body: Body, coasts: Array, keep: float, margin: float, out: Array
) -> None:
    """When a body first comes within `keep` of each of what moves [s]; inf if it never does.

    `coasts` (n, 9) are motions. Between two looks the bodies keep `keep`, at each of them more than
    that by `margin`.
    """
    slabs, n = moving.slabs, out.shape[0]
    out[:] = math.inf
    for k in range(coasts.shape[0]):
        motion = coast_of(coasts, k)
        during, swept = (0, 0), (0.0, 0.0, 0.0, 0.0)
        if slabs.leaves > 0:
            during = slabs_during(slabs, motion.clock, motion.duration)
            swept = swept_box(body, motion)
        for m in range(n):
            if out[m] < math.inf:
                continue  # by an earlier coast
            if slabs.leaves > 0:
                apart = apart_during(slabs, n, m, during, swept) - body.reach - keep
                if apart > margin:
                    continue
            free, _, _ = free_of_moving(one_of(moving, m), body, motion, keep, margin)
            if free < motion.duration:
                out[m] = motion.clock + free


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
