"""Which of the words that join two poses stays free: the steering function among obstacles."""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, inlined_kernel
from maneuver_automaton.collision._kernels_advancement import free_time
from maneuver_automaton.groups._kernels import coast, compose


@inlined_kernel
def driven(lib, trim, x, y, heading, t):
    """Pose after coasting a trim."""
    d_x, d_y, turn = coast(
        lib.library.twists[trim, 0], lib.library.twists[trim, 1], lib.library.twists[trim, 2], t
    )
    return compose(x, y, heading, d_x, d_y, turn)


@inlined_kernel
def trim_inside(lib, task, trim, x, y, heading, t):
    """Whether coasting a trim stays inside the task's window."""
    v_x, v_y, turn = (
        lib.library.twists[trim, 0],
        lib.library.twists[trim, 1],
        lib.library.twists[trim, 2],
    )
    return inside_window(task.window, x, y, heading, v_x, v_y, turn, t)


@inlined_kernel
def trim_free(lib, task, world, body, trim, x, y, heading, t, clock):
    """Whether coasting a trim from a pose is proven free, the world's time being `clock`."""
    v_x, v_y, turn = (
        lib.library.twists[trim, 0],
        lib.library.twists[trim, 1],
        lib.library.twists[trim, 2],
    )
    fast, keep, margin = lib.speeds[trim], task.keep, task.margin
    proven, _ = free_time(world, body, x, y, heading, v_x, v_y, turn, fast, t, keep, margin, clock)
    return proven >= t


@bare_inner_kernel
def may_stay(task, world, body, x, y, heading, clock):
    """Whether a vehicle that arrives at `clock` is free until the plan's time is over."""
    if not task.stay_until > clock or world.movers.speed.shape[0] == 0:
        return True
    t = task.stay_until - clock
    proven, _ = free_time(
        world, body, x, y, heading, 0.0, 0.0, 0.0, 0.0, t, task.keep, task.margin, clock
    )
    return proven >= t


@bare_inner_kernel
def free_candidate(lib, task, world, body, words, pose, n, most_cost, most_time, clock, scratch):
    """Cheapest of `n` candidates from `pose` that is proven free; -1 if none of `task.tries` is.

    Candidates that cost `most_cost` or more, or last longer than `most_time`, are left out.
    """
    for _ in range(task.tries):
        best, which = most_cost, -1
        for k in range(n):
            if scratch.costs[k] < best and scratch.durations[k] <= most_time:
                best, which = scratch.costs[k], k
        if which < 0:
            return -1
        x, y, heading = pose
        time, free = clock, True
        row = scratch.rows[which]
        for n_th in range(3):
            t, trim = scratch.times[which, n_th], words[row, n_th]
            if t == 0.0 or trim >= lib.library.n_trims:
                continue
            if not trim_inside(lib, task, trim, x, y, heading, t) or not trim_free(
                lib, task, world, body, trim, x, y, heading, t, time
            ):
                free = False
                break
            x, y, heading = driven(lib, trim, x, y, heading, t)
            time += t
        if free:
            return which
        scratch.costs[which] = math.inf
    return -1


@bare_inner_kernel
def inside_window(window, x, y, heading, v_x, v_y, turn, t):
    """Whether a motion stays inside [low x, low y, high x, high y], seen from the bounds' frame.

    `window` is those four, then the frame's (x, y, cos, sin) in the world; extreme points of arcs
    count.
    """
    c, s = window[6], window[7]
    d_x, d_y = x - window[4], y - window[5]
    a_x, a_y = c * d_x - s * d_y, s * d_x + c * d_y
    a_heading = heading + math.atan2(s, c)
    m_x, m_y, angle = coast(v_x, v_y, turn, t)
    e_x, e_y, _ = compose(a_x, a_y, a_heading, m_x, m_y, angle)
    low_x, high_x = min(a_x, e_x), max(a_x, e_x)
    low_y, high_y = min(a_y, e_y), max(a_y, e_y)
    if turn != 0.0:
        radius_x, radius_y = -v_y / turn, v_x / turn  # from the pose to the centre of the circle
        cos, sin = math.cos(a_heading), math.sin(a_heading)
        m_x = a_x + cos * radius_x - sin * radius_y
        m_y = a_y + sin * radius_x + cos * radius_y
        radius = math.hypot(radius_x, radius_y)
        begin = math.atan2(a_y - m_y, a_x - m_x)
        end = begin + angle
        first, last = min(begin, end), max(begin, end)
        quarter = 0.5 * math.pi
        k = math.ceil(first / quarter)
        while k * quarter <= last and k <= math.ceil(first / quarter) + 4:
            side = k % 4
            if side == 0:
                high_x = max(high_x, m_x + radius)
            elif side == 1:
                high_y = max(high_y, m_y + radius)
            elif side == 2:
                low_x = min(low_x, m_x - radius)
            else:
                low_y = min(low_y, m_y - radius)
            k += 1
    slack = window[8]
    return (
        low_x >= window[0] - slack
        and low_y >= window[1] - slack
        and high_x <= window[2] + slack
        and high_y <= window[3] + slack
    )
