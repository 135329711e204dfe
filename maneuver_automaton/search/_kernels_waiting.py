"""When to wait along a given path so that moving obstacles pass: only times are searched.

The path is cut into pieces. A state is a joint between two of them, and the time for which the
vehicle may stand there from its arrival on: as long as that lasts, later arrivals lead nowhere that
waiting does not (safe intervals, Phillips and Likhachev 2011).
"""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel, inlined_kernel
from maneuver_automaton.search._kernels_coast import coast_free, coast_proven, may_stay
from maneuver_automaton.search._kernels_distance import pop, push
from maneuver_automaton.search.arrays import PathArrays
from maneuver_automaton.search.lattice_arrays import LatticeArrays
from maneuver_automaton.search.scene import Scene

HALVINGS = 10  # of a tick, for the time at which the way is free again
PATIENT = 16  # departures that are blocked before ticks become longer
MOST_ASKED = 20_000  # departures tried in all
JOINT, PARENT = range(2)  # columns of `path.links`
ARRIVAL, UNTIL, DEPARTURE = range(3)  # columns of `path.times`; the last is that of the parent


@bare_kernel
def earliest_arrival(
    lib: LatticeArrays,
    scene: Scene,
    clocks: tuple[float, float, float, float],
    path: PathArrays,
    rest: int,
    tick: float,
) -> int:
    """The state that arrives first where the path ends; -1 if none does.

    Fills `path.links` (s, 2), the joint and parent of each state, and `path.times` (s, 3): when it
    is reached, until when the vehicle may stand there, and when it left its parent's joint [s since
    the start]. `rest` is the trim that waits, -1 if none. `clocks` are the time of the world at the
    start, the longest duration, the time of the world until which the goal is kept, and the time
    since the start after which nothing changes any more.
    """
    clock, most_time, stay_until, quiet = clocks
    n, asked = path.trims.shape[0], 0
    used, queued, _ = _reach(lib, scene, path, rest, clock, quiet, 0, 0.0, -1, 0.0, 0, 0)
    while queued > 0:
        state = pop(path.keys, path.items, queued)
        queued -= 1
        joint, arrival = path.links[state, JOINT], path.times[state, ARRIVAL]
        pose = _pose(path, joint)
        if joint == n:
            if may_stay(scene, lib, path.trims[n - 1], pose, clock + arrival, stay_until):
                return state
            continue
        trim, t = path.trims[joint], path.durations[joint]
        # Departures are tried a tick apart; where the way is blocked for long, ever further apart.
        leave, last, step, blocked = arrival, path.times[state, UNTIL], 0.0, 0
        while leave <= last and leave + t <= most_time and asked < MOST_ASKED:
            asked += 1
            if not coast_free(scene, lib, trim, pose, t, clock + leave):
                if leave > quiet:
                    break  # nothing moves any more
                step = tick * (1 + blocked // PATIENT)
                leave, blocked = leave + step, blocked + 1
                continue
            if blocked > 0:  # when exactly it is free again
                low, high = leave - step, leave
                for _ in range(HALVINGS):
                    middle = 0.5 * (low + high)
                    if coast_free(scene, lib, trim, pose, t, clock + middle):
                        high = middle
                    else:
                        low = middle
                leave = high
            there = leave + t
            used, queued, until = _reach(
                lib, scene, path, rest, clock, quiet, joint + 1, there, state, leave, used, queued
            )
            if used < 0:
                return -1  # no room for more
            if leave > quiet:
                break
            # What arrives while it may stand there anyway is of no use.
            leave, blocked = max(leave, until - t) + tick, 0
    return -1


@bare_inner_kernel
def _reach(
    lib: LatticeArrays,
    scene: Scene,
    path: PathArrays,
    rest: int,
    clock: float,
    quiet: float,
    joint: int,
    arrival: float,
    parent: int,
    left: float,
    used: int,
    queued: int,
) -> tuple[int, int, float]:
    """Note that a joint is reached, unless it was before, in the same stretch of time.

    Returns the numbers of states and of those in the open list, and until when the vehicle may
    stand there.
    """
    latest = path.latest[joint]
    while latest >= 0:
        if path.times[latest, ARRIVAL] <= arrival <= path.times[latest, UNTIL]:
            return used, queued, path.times[latest, UNTIL]
        latest = path.before[latest]
    if used == path.links.shape[0]:
        return -1, queued, arrival
    pose = _pose(path, joint)
    until = arrival
    if rest >= 0:
        lasting = max(quiet - arrival, 0.0) + 1.0
        stands, _ = coast_proven(scene, lib, rest, pose, lasting, clock + arrival)
        until = arrival + stands if stands < lasting else math.inf
    path.links[used, JOINT], path.links[used, PARENT] = joint, parent
    path.times[used, ARRIVAL], path.times[used, UNTIL] = arrival, until
    path.times[used, DEPARTURE] = left
    path.before[used], path.latest[joint] = path.latest[joint], used
    push(path.keys, path.items, queued, arrival, used)
    return used + 1, queued + 1, until


@inlined_kernel
def _pose(path: PathArrays, joint: int) -> tuple[float, float, float, float]:
    """Pose (x, y, heading, z) at a joint."""
    return path.poses[joint, 0], path.poses[joint, 1], path.poses[joint, 2], path.poses[joint, 3]
