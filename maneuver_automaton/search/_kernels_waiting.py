"""When to wait along a given way so that what moves is let pass: times are all that is searched.

The way is cut into pieces; a state is a joint of them and a tick of the clock at which the vehicle
may stand there.
"""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_kernel
from maneuver_automaton.search._kernels_motion import coast_free, coasted, may_stay

UNREACHED = -1
WAITED = -2  # stood since the tick before


@bare_kernel
def earliest_arrival(lib, scene, clocks, way, rest, tick):
    """Fill `way.before` with how each state is reached; the joint and tick of the last departure.

    Returns (joint, tick, duration), the joint -1 if there is no way. `way.trims`, `way.durations`
    (n,) are the pieces, `way.poses` (n + 1, 3) their joints; `way.before` (n + 1, ticks, 2) becomes
    the joint and tick a state was left from, or WAITED. `rest` is the trim that waits, -1 if none.
    `clocks` are the time of the world at the start, the longest duration, and the time of the world
    until which the goal is kept.
    """
    clock_of_start, most_time, stay_until = clocks
    n, ticks = way.trims.shape[0], way.before.shape[1]
    for i in range(n + 1):
        for j in range(ticks):
            way.before[i, j, 0] = UNREACHED
    way.before[0, 0, 0] = 0
    way.before[0, 0, 1] = 0
    best, best_joint, best_tick = math.inf, -1, -1
    for j in range(ticks):
        now = j * tick
        if now >= best:
            break
        for i in range(n):
            if way.before[i, j, 0] == UNREACHED:
                continue
            pose = (way.poses[i, 0], way.poses[i, 1], way.poses[i, 2], 0.0)
            if (
                rest >= 0
                and j + 1 < ticks
                and way.before[i, j + 1, 0] == UNREACHED
                and coast_free(scene, lib, rest, pose, tick, clock_of_start + now)
            ):
                way.before[i, j + 1, 0] = WAITED
            time = now
            for k in range(i, n):
                trim, t = way.trims[k], way.durations[k]
                if not coast_free(scene, lib, trim, pose, t, clock_of_start + time):
                    break
                pose = coasted(lib, trim, pose, t)
                time += t
                clock = clock_of_start + time
                if k + 1 == n:
                    stays = may_stay(scene, lib, trim, pose, clock, stay_until)
                    if stays and time < best and time <= most_time:
                        best, best_joint, best_tick = time, i, j
                    break
                then = math.ceil(time / tick)
                if rest < 0 or then >= ticks or way.before[k + 1, then, 0] != UNREACHED:
                    continue
                if coast_free(scene, lib, rest, pose, then * tick - time, clock):
                    way.before[k + 1, then, 0] = i
                    way.before[k + 1, then, 1] = j
    return best_joint, best_tick, best
