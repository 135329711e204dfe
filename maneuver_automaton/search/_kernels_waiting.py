"""When to wait along a given path so that moving obstacles pass: only times are searched.

The path is cut into pieces; a state is a joint of them and a tick of the clock at which the vehicle
may stand there.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from maneuver_automaton._compile import bare_kernel
from maneuver_automaton.search._kernels_coast import coast_free, coasted, may_stay

if TYPE_CHECKING:
    from maneuver_automaton.search.lattice_arrays import LatticeArrays
    from maneuver_automaton.search.scene import Scene
    from maneuver_automaton.search.waiting import PathArrays

UNREACHED = -1
WAITED = -2  # the vehicle has stood since the tick before


@bare_kernel
def earliest_arrival(
    lib: LatticeArrays,
    scene: Scene,
    clocks: tuple[float, float, float],
    path: PathArrays,
    rest: int,
    tick: float,
) -> tuple[int, int, float]:
    """Joint and tick of the last departure, and when it arrives; the joint is -1 if none does.

    Fills `path.before` with how each state is reached. `path.trims`, `path.durations`
    (n,) are the pieces, `path.poses` (n + 1, 3) their joints. `path.before` (n + 1, ticks, 2)
    becomes the joint and tick from which a state is reached by driving, or WAITED, or UNREACHED.
    `rest` is the trim that waits, -1 if none. `clocks` are the time of the world at the start, the
    longest duration, and the time of the world until which the goal is kept.
    """
    # Forwards over ticks: a piece and a wait end at later ticks, so when a tick is looked at, all
    # that leads to its states has been. A state is entered once; how does not matter, since what
    # can be driven from it is the same.
    clock_of_start, most_time, stay_until = clocks
    n, ticks = path.trims.shape[0], path.before.shape[1]
    for i in range(n + 1):
        for j in range(ticks):
            path.before[i, j, 0] = UNREACHED
    path.before[0, 0, 0] = 0
    path.before[0, 0, 1] = 0
    best, best_joint, best_tick = math.inf, -1, -1
    for j in range(ticks):
        now = j * tick
        if now >= best:
            break  # what departs later arrives later
        for i in range(n):
            if path.before[i, j, 0] == UNREACHED:
                continue
            pose = (path.poses[i, 0], path.poses[i, 1], path.poses[i, 2], 0.0)
            if (
                rest >= 0
                and j + 1 < ticks
                and path.before[i, j + 1, 0] == UNREACHED
                and coast_free(scene, lib, rest, pose, tick, clock_of_start + now)
            ):
                path.before[i, j + 1, 0] = WAITED
            # Drive on without a wait as far as that is free, and note each joint where it may stand
            # from the arrival until the next tick.
            time = now
            for k in range(i, n):
                trim, t = path.trims[k], path.durations[k]
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
                if rest < 0 or then >= ticks or path.before[k + 1, then, 0] != UNREACHED:
                    continue
                if coast_free(scene, lib, rest, pose, then * tick - time, clock):
                    path.before[k + 1, then, 0] = i
                    path.before[k + 1, then, 1] = j
    return best_joint, best_tick, best
