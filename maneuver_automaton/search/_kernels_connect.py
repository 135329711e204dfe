"""Join two poses by three trims that stay free: the steering function among obstacles."""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, inlined_kernel
from maneuver_automaton.collision._kernels_advancement import free_time
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.words._kernels_steering import steer

NO_TRIM = -1
SAME = 1e-9  # share of a full turn that counts as none


@inlined_kernel
def price_of_switch(lib, before, gear, trim):
    """Price of going on with `trim` after `before`, in `gear` the last that drove."""
    price = 0.0
    if before != NO_TRIM and before != trim:
        price += lib.switch
    if gear * lib.gears[trim] < 0:
        price += lib.direction_change
    return price


@bare_inner_kernel
def candidates(lib, triples, x, y, heading, goal_x, goal_y, goal_heading, first, last, scratch):
    """Fill `scratch` with every triple of trims that leads to the goal; returns how many.

    `first` and `last` are (trim, gear) before and after. Rows of `scratch.times`: three durations;
    `scratch.costs`: their cost with the prices of switches; `scratch.rows`: number of the triple.
    """
    c, s = math.cos(heading), math.sin(heading)
    d_x, d_y = goal_x - x, goal_y - y
    goal = (complex(c * d_x + s * d_y, c * d_y - s * d_x), goal_heading - heading)
    nothing = (0j, 0.0)
    count = 0
    for row in range(triples.shape[0]):
        i, j, k = triples[row, 0], triples[row, 1], triples[row, 2]
        steer(
            (complex(lib.twists[i, 0], lib.twists[i, 1]), lib.twists[i, 2]),
            nothing,
            (complex(lib.twists[j, 0], lib.twists[j, 1]), lib.twists[j, 2]),
            nothing,
            (complex(lib.twists[k, 0], lib.twists[k, 1]), lib.twists[k, 2]),
            goal,
            lib.tolerance,
            scratch.branches,
        )
        for branch in range(2):
            cost, usable = 0.0, True
            trim, gear = first
            duration = 0.0
            for n in range(3):
                t = scratch.branches[branch, n]
                this = triples[row, n]
                if not t >= -lib.tolerance:
                    usable = False
                    break
                if t >= lib.periods[this] * (1.0 - SAME) or t < lib.shortest:
                    t = 0.0
                scratch.times[count, n] = t
                if t > 0.0 and this < lib.n_trims:
                    cost += t * lib.rates[this] + price_of_switch(lib, trim, gear, this)
                    if t < lib.min_coast and trim != this:
                        usable = False
                        break
                    trim = this
                    if lib.gears[this] != 0:
                        gear = lib.gears[this]
                    duration += t
            if not usable:
                continue
            next_trim, next_gear = last
            if next_trim != NO_TRIM:
                if trim != NO_TRIM and trim != next_trim:
                    cost += lib.switch
                if gear * next_gear < 0:
                    cost += lib.direction_change
            scratch.costs[count] = cost
            scratch.durations[count] = duration
            scratch.rows[count] = row
            count += 1
    return count


@inlined_kernel
def driven(lib, trim, x, y, heading, t):
    """Pose after coasting a trim."""
    d_x, d_y, turn = coast(lib.twists[trim, 0], lib.twists[trim, 1], lib.twists[trim, 2], t)
    return compose(x, y, heading, d_x, d_y, turn)


@inlined_kernel
def trim_inside(lib, task, trim, x, y, heading, t):
    """Whether coasting a trim stays inside the task's window."""
    v_x, v_y, turn = lib.twists[trim, 0], lib.twists[trim, 1], lib.twists[trim, 2]
    return inside_window(task.window, x, y, heading, v_x, v_y, turn, t)


@inlined_kernel
def trim_free(lib, task, world, body, trim, x, y, heading, t, clock):
    """Whether coasting a trim from a pose is proven free, the world's time being `clock`."""
    v_x, v_y, turn = lib.twists[trim, 0], lib.twists[trim, 1], lib.twists[trim, 2]
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
def free_candidate(lib, task, world, body, triples, pose, n, most_cost, most_time, clock, scratch):
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
            t, trim = scratch.times[which, n_th], triples[row, n_th]
            if t == 0.0 or trim >= lib.n_trims:
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
