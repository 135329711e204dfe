"""When vehicles that drive their plans come too near to each other: proven, not sampled."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from maneuver_automaton._compile import bare_kernel
from maneuver_automaton.collision._kernels_moving import free_of_moving
from maneuver_automaton.collision.world import MovingObstacles

if TYPE_CHECKING:
    from maneuver_automaton._arrays import Array
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
    for m in range(out.shape[0]):
        one = MovingObstacles(
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
        )
        out[m] = math.inf
        for k in range(coasts.shape[0]):
            free, _ = free_of_moving(
                one,
                body,
                coasts[k, 0],
                coasts[k, 1],
                coasts[k, 2],
                coasts[k, 3],
                coasts[k, 4],
                coasts[k, 5],
                coasts[k, 6],
                coasts[k, 7],
                keep,
                margin,
                coasts[k, 8],
            )
            if free < coasts[k, 7]:
                out[m] = coasts[k, 8] + free
                break
