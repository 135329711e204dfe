"""When to wait along a given path so that moving obstacles pass: only times are searched.

The path is cut into pieces. A state is a joint between two of them, and the time for which the
vehicle may stand there from its arrival on: as long as that lasts, later arrivals lead nowhere that
waiting does not (safe intervals, Phillips and Likhachev 2011).
"""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.collision._kernels_moving import free_of_moving, moving_clearance
from maneuver_automaton.collision.arrays import Coast
from maneuver_automaton.search._kernels_coast import (
    clear_of_static,
    coast_free,
    coast_proven,
    coasted,
    is_one_in_plane,
    may_stay,
)
from maneuver_automaton.search._kernels_distance import pop, push
from maneuver_automaton.search.arrays import PathArrays, PathSearch

HALVINGS = 10  # of a tick, for the time at which the way is free again
PATIENT = 16  # departures that are blocked before ticks become longer
MOST_ASKED = 20_000  # departures tried in all
ROUNDED = 1e-9  # [s] by which sums of durations may be off
FREE, UNKNOWN = -1, -2  # in whose way a departure is
USED, QUEUED = range(2)  # places in `path.state`
JOINT, PARENT = range(2)  # columns of `path.links`
ARRIVAL, UNTIL, DEPARTURE = range(3)  # columns of `path.times`; the last is that of the parent


@bare_kernel
def earliest_arrival(search: PathSearch) -> int:
    """The state that arrives first where the path ends; -1 if none does.

    Fills `path.links` (s, 2), the joint and parent of each state, and `path.times` (s, 3): when it
    is reached, until when the vehicle may stand there, and when it left its parent's joint [s since
    the start].
    """
    path, lib, scene, limits = search.path, search.library, search.scene, search.limits
    clock, tick, quiet = limits.clock, search.tick, search.quiet
    n, asked, last = path.trims.shape[0], 0, math.inf
    path.state[USED] = path.state[QUEUED] = 0
    if search.rest >= 0:  # what never moves is in the way at all times: none need be tried
        for joint in range(n):
            trim, t = path.trims[joint], path.durations[joint]
            if not clear_of_static(scene, lib, trim, _pose(path, joint), t):
                return -1
        # What is in the way for ever once it rests has to be passed before: who leaves this joint,
        # or one before it, too late for that never ends the path.
        for joint in range(n - 1, -1, -1):
            last -= path.durations[joint]
            m, _ = _in_the_way(search, joint, quiet + 1.0, (FREE, 0.0))
            if m >= 0:
                moving = scene.layers.first.moving
                rests = max(moving.time[moving.first_knot[m + 1] - 1], moving.present[m, 0])
                last = min(last, rests - clock)
            path.last[joint] = last
    _reach(search, 0, 0.0, -1, 0.0)
    while path.state[QUEUED] > 0:
        state = pop(path.keys, path.items, path.state[QUEUED])
        path.state[QUEUED] -= 1
        joint, arrival = path.links[state, JOINT], path.times[state, ARRIVAL]
        if joint == n:
            pose, trim = _pose(path, n), path.trims[n - 1]
            if may_stay(scene, lib, trim, pose, clock + arrival, limits.stay_until):
                return state
            continue
        t, met = path.durations[joint], (FREE, 0.0)
        # Departures are tried a tick apart; where the way is blocked for long, ever further apart.
        leave, step, blocked = arrival, 0.0, 0
        until = min(path.times[state, UNTIL], limits.most_time - t)
        while leave <= until and leave - step <= path.last[joint] + ROUNDED and asked < MOST_ASKED:
            asked += 1
            hit = _in_the_way(search, joint, leave, met)
            if hit[0] != FREE:
                if leave > quiet:
                    break  # nothing moves any more
                met, step = hit, tick * (1 + blocked // PATIENT)
                leave, blocked = leave + step, blocked + 1
                continue
            if blocked > 0:  # when exactly it is free again
                low, high = leave - step, leave
                for _ in range(HALVINGS):
                    middle = 0.5 * (low + high)
                    if _in_the_way(search, joint, middle, met)[0] == FREE:
                        high = middle
                    else:
                        low = middle
                leave = high
            stands = _reach(search, joint + 1, leave + t, state, leave)
            if stands < 0.0:
                return -1
            if leave > quiet:
                break
            # What arrives while it may stand there anyway is of no use.
            leave, step, blocked = max(leave, stands - t) + tick, 0.0, 0
    return -1


@bare_inner_kernel
def _in_the_way(
    search: PathSearch, joint: int, leave: float, last: tuple[int, float]
) -> tuple[int, float]:
    """Who is in the way if it leaves a joint at a time [s], and how long after that; or FREE."""
    # What stands was looked at before. Who was in the way a moment ago, the `last`, most often
    # still is: one look shows that, where a body is no farther off than no proof lets it be.
    path, lib, scene = search.path, search.library, search.scene
    trim, t, pose = path.trims[joint], path.durations[joint], _pose(path, joint)
    clock = search.limits.clock + leave
    if search.rest < 0 or not is_one_in_plane(scene, lib):
        return (FREE if coast_free(scene, lib, trim, pose, t, clock) else UNKNOWN), 0.0
    moving, body, m = scene.layers.first.moving, lib.parts.body, last[0]
    for since in (last[1], t, 0.0):
        if m >= 0 and moving.present[m, 0] <= clock + since <= moving.present[m, 1]:
            x, y, heading, _ = coasted(lib, trim, pose, since)
            place, keep = (x, y, heading), scene.keep
            if moving_clearance(moving, m, body, place, clock + since, keep, keep) <= keep:
                return m, since
    twist, fastest = lib.library.twists[trim], lib.parts.fastest[trim]
    motion = Coast(pose[0], pose[1], pose[2], twist[0], twist[1], twist[2], fastest, t, clock)
    free, _, hit = free_of_moving(moving, body, motion, scene.keep, scene.margin)
    return (FREE if free >= t else hit), free


@bare_inner_kernel
def _reach(search: PathSearch, joint: int, arrival: float, parent: int, left: float) -> float:
    """Note a joint that is reached, if new in this stretch of time; until when it may stand."""
    # -1: there is no room for more states.
    path, quiet = search.path, search.quiet
    latest = path.latest[joint]
    while latest >= 0:
        if path.times[latest, ARRIVAL] <= arrival <= path.times[latest, UNTIL]:
            return path.times[latest, UNTIL]
        latest = path.before[latest]
    used = path.state[USED]
    if used == path.links.shape[0]:
        return -1.0
    until = arrival
    if search.rest >= 0:
        lasting, clock = max(quiet - arrival, 0.0) + 1.0, search.limits.clock + arrival
        pose = _pose(path, joint)
        stands, _ = coast_proven(search.scene, search.library, search.rest, pose, lasting, clock)
        until = arrival + stands if stands < lasting else math.inf
    path.links[used, JOINT], path.links[used, PARENT] = joint, parent
    path.times[used, ARRIVAL], path.times[used, UNTIL] = arrival, until
    path.times[used, DEPARTURE] = left
    path.before[used], path.latest[joint] = path.latest[joint], used
    push(path.keys, path.items, path.state[QUEUED], arrival, used)
    path.state[USED] += 1
    path.state[QUEUED] += 1
    return until


@bare_inner_kernel
def _pose(path: PathArrays, joint: int) -> tuple[float, float, float, float]:
    """Pose (x, y, heading, z) at a joint."""
    return path.poses[joint, 0], path.poses[joint, 1], path.poses[joint, 2], path.poses[joint, 3]
