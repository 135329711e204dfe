"""A word as two arrays, trims and durations, of which the first `n` entries count."""

from __future__ import annotations

from maneuver_automaton._compile import bare_inner_kernel, inlined_kernel
from maneuver_automaton.search._kernels_motion import coasted

GAIN = 1e-9  # share of the cost that counts as a gain
LENGTH = 0  # place of the word's length in `state`


@bare_inner_kernel
def word_cost(lib, trims, durations, n):
    """Cost of a word with the prices of its switches."""
    cost, gear = 0.0, 0
    for k in range(n):
        trim = trims[k]
        cost += lib.library.rates[trim] * durations[k]
        if k > 0:
            cost += lib.library.switch
        if lib.library.gears[trim] != 0:
            if gear * lib.library.gears[trim] < 0:
                cost += lib.library.direction_change
            gear = lib.library.gears[trim]
    return cost


@bare_inner_kernel
def unroll(lib, work, n):
    """Fill the poses and times at the switches of the word in `work`."""
    x, y, heading = work.start[0], work.start[1], work.start[2]
    time = 0.0
    for k in range(n):
        work.poses[k, 0], work.poses[k, 1], work.poses[k, 2] = x, y, heading
        work.times[k] = time
        trim, t = work.trims[k], work.durations[k]
        x, y, heading, _ = coasted(lib, trim, (x, y, heading, 0.0), t)
        time += t
    work.poses[n, 0], work.poses[n, 1], work.poses[n, 2] = x, y, heading
    work.times[n] = time


@inlined_kernel
def owner(work, n, time):
    """Number of the trim that is driven at a time; the later one at a switch."""
    low, high = 0, n
    while high - low > 1:
        middle = (low + high) // 2
        if work.times[middle] <= time:
            low = middle
        else:
            high = middle
    return low


@inlined_kernel
def pose_at(lib, work, k, time):
    """Pose (x, y, heading, z) at a time within trim `k`."""
    t = time - work.times[k]
    begin = (work.poses[k, 0], work.poses[k, 1], work.poses[k, 2], 0.0)
    return coasted(lib, work.trims[k], begin, t)


@inlined_kernel
def gear_before(lib, work, k):
    """Sign of the last forward speed up to trim `k`, that included."""
    gear = 0
    while k >= 0 and gear == 0:
        gear = lib.library.gears[work.trims[k]]
        k -= 1
    return gear


@inlined_kernel
def gear_after(lib, work, n, k):
    """Sign of the first forward speed from trim `k` on."""
    gear = 0
    while k < n and gear == 0:
        gear = lib.library.gears[work.trims[k]]
        k += 1
    return gear


@bare_inner_kernel
def append(lib, trims, durations, n, trim, t):
    """Put a trim at the end of a word, joined with the last one if that is the same."""
    if t < lib.library.shortest:
        return n
    if n > 0 and trims[n - 1] == trim:
        durations[n - 1] += t
        return n
    if n >= trims.shape[0] - 1:
        return n + 1  # too long: the caller sees it
    trims[n], durations[n] = trim, t
    return n + 1


@bare_inner_kernel
def admitted(lib, task, work, size):
    """Whether the word in `work.new_*` keeps the limits of words."""
    if size > work.new_trims.shape[0] - 1 or (task.most_trims > 0 and size > task.most_trims):
        return False
    duration = 0.0
    for k in range(size):
        if work.new_durations[k] < lib.library.min_coast:
            return False
        duration += work.new_durations[k]
    return duration <= task.most_time


@bare_inner_kernel
def take(work, state, size):
    """Make the word in `work.new_*` the word."""
    for k in range(size):
        work.trims[k], work.durations[k] = work.new_trims[k], work.new_durations[k]
    state[LENGTH] = size
