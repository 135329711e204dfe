"""Transfers: words of at most three trims, joined by maneuvers, that carry a pose to another.

A word begins and ends in given trims: the maneuvers out of the first and into the last are folded
into the two poses, what is left is the steering function with displacements between its trims.
"""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, inner_kernel, kernel
from maneuver_automaton.groups._kernels import coast, compose, nearest_turn
from maneuver_automaton.words._kernels_steering import phase, steer, turn_time, two_lines, unit

NONE = -1
WHOLE = 1e-9  # share of a full turn that counts as none


@inner_kernel
def back_from(x, y, heading, d_x, d_y, turn):
    """Pose from which the motion (d_x, d_y, turn) leads to (x, y, heading)."""
    before = heading - turn
    c, s = math.cos(before), math.sin(before)
    return x - c * d_x + s * d_y, y - s * d_x - c * d_y, before


@inner_kernel
def seen(x, y, heading, to_x, to_y, to_heading):
    """A pose seen from another, as a displacement (complex place, heading)."""
    place = complex(to_x - x, to_y - y) * complex(math.cos(heading), -math.sin(heading))
    return place, to_heading - heading


@inner_kernel
def straight_time(way, velocity):
    """Time after which a straight trim is nearest to the end of `way`."""
    return (way * velocity.conjugate()).real / (velocity * velocity.conjugate()).real


@bare_inner_kernel
def steer_one(trim, goal, out):
    """Fill `out` (3,) with the time of one trim that may meet `goal`; NaN if none can."""
    v, w = trim
    z, heading = goal
    out[0], out[1], out[2] = math.nan, 0.0, 0.0
    if w != 0.0:
        out[0] = turn_time(heading, w)
    elif abs(v) > 0.0:
        out[0] = straight_time(z, v)


@bare_inner_kernel
def steer_two(a, gap, b, goal, tolerance, out):
    """Fill `out` (3,) with times of two trims that may meet `goal`; NaN if none can."""
    v_a, w_a = a
    d, e = gap
    v_b, w_b = b
    z, heading = goal
    out[0], out[1], out[2] = math.nan, math.nan, 0.0
    if w_a != 0.0 and w_b != 0.0:
        r_a, r_b = -1j * v_a / w_a, -1j * v_b / w_b
        arm, way = r_a + d - r_b * unit(e), z + r_a - r_b * unit(heading)
        if abs(arm) > tolerance * (abs(r_a) + abs(r_b) + abs(d)):
            angle = phase(way) - phase(arm)
            out[0] = turn_time(angle, w_a)
            out[1] = turn_time(heading - e - angle, w_b)
    elif w_a != 0.0 and abs(v_b) > 0.0:
        angle = heading - e
        r_a = -1j * v_a / w_a
        out[0] = turn_time(angle, w_a)
        out[1] = straight_time(z - r_a * (unit(angle) - 1.0) - d * unit(angle), v_b * unit(heading))
    elif w_b != 0.0 and abs(v_a) > 0.0:
        r_b = -1j * v_b / w_b
        out[0] = straight_time(z - d - r_b * (unit(heading) - unit(e)), v_a)
        out[1] = turn_time(heading - e, w_b)
    elif w_a == 0.0 and w_b == 0.0 and abs(v_a) > 0.0 and abs(v_b) > 0.0:
        out[0], out[1] = two_lines(z - d, v_a, v_b * unit(heading), tolerance)


@bare_inner_kernel
def climb_time(lib, word, last, goal_trim, climb, start_trim, altitude, times):
    """Time of the vertical trim `climb` that ends at the altitude; 0 where the library has none.

    `altitude` is that of the goal above the start; without a climb it has to fit already.
    """
    left, before = altitude, start_trim
    for n in range(3):
        trim = word[n]
        if trim >= 0:
            left -= lib.shift[before, trim, 3] + times[n] * lib.twists[trim, 3]
            before = trim
    if climb < 0:
        left -= lib.shift[before, goal_trim, 3]
        return 0.0 if abs(left) <= lib.met * (1.0 + abs(altitude)) else math.nan
    left -= lib.shift[before, climb, 3] + lib.shift[climb, goal_trim, 3]
    return left / lib.twists[climb, 3]


@bare_inner_kernel
def before_climb(lib, end, last, climb, t):
    """Pose from which the transition to a climb, and the climb for `t`, lead to `end`."""
    x, y, heading = end
    if t > 0.0:
        d_x, d_y, turn = coast(lib.twists[climb, 0], lib.twists[climb, 1], lib.twists[climb, 2], t)
        x, y, heading = back_from(x, y, heading, d_x, d_y, turn)
    return back_from(
        x,
        y,
        heading,
        lib.shift[last, climb, 0],
        lib.shift[last, climb, 1],
        lib.shift[last, climb, 2],
    )


@inner_kernel
def is_level(lib, word):
    """Whether no trim of a word climbs."""
    level = True
    for n in range(3):
        level = level and (word[n] < 0 or lib.twists[word[n], 3] == 0.0)
    return level


@bare_inner_kernel
def word_misses(lib, word, start, goal, times):
    """How far a word of fewer than three trims ends from the goal [m, rad], both poses folded."""
    x, y, heading = start
    before = NONE
    for n in range(3):
        trim = word[n]
        if trim < 0:
            break
        if before != NONE:
            d_x, d_y, turn = (
                lib.shift[before, trim, 0],
                lib.shift[before, trim, 1],
                lib.shift[before, trim, 2],
            )
            x, y, heading = compose(x, y, heading, d_x, d_y, turn)
        d_x, d_y, turn = coast(
            lib.twists[trim, 0], lib.twists[trim, 1], lib.twists[trim, 2], times[n]
        )
        x, y, heading = compose(x, y, heading, d_x, d_y, turn)
        before = trim
    g_x, g_y, g_heading = goal
    return max(abs(x - g_x), abs(y - g_y), abs(nearest_turn(heading - g_heading)))


@inner_kernel
def motion_of(lib, trim):
    """A trim as a planar velocity and a turn rate."""
    return complex(lib.twists[trim, 0], lib.twists[trim, 1]), lib.twists[trim, 2]


@inner_kernel
def gap_of(lib, before, trim):
    """The transition between two trims as a planar displacement."""
    return (
        complex(lib.shift[before, trim, 0], lib.shift[before, trim, 1]),
        lib.shift[before, trim, 2],
    )


@inner_kernel
def way_cost(lib, way, a, b, c):
    """Least cost of coasting `way` by these trims: the way that transitions do not make."""
    left, price = abs(way), math.inf
    if a >= 0:
        price = lib.per_metre[a]
    if b >= 0:
        left -= lib.length[a, b]
        price = min(price, lib.per_metre[b])
    if c >= 0:
        left -= lib.length[b, c]
        price = min(price, lib.per_metre[c])
    return left * price if left > lib.met else 0.0


@bare_inner_kernel
def transfer_candidates(lib, n_words, start, start_trim, goal, goal_trim, ceiling, scratch):
    """Fill `scratch` with the words that lead from one pose and trim to another; how many.

    The first `n_words` of the library are tried. `start` and `goal` are (x, y, heading, z). What
    costs `ceiling` or more is left out.
    """
    x, y, heading, z = start
    g_x, g_y, g_heading, g_z = goal
    size = 1.0 + abs(g_x - x) + abs(g_y - y)
    count = 0
    for climbing in range(-1, lib.climbs.shape[0]):
        climb = lib.climbs[climbing] if climbing >= 0 else NONE
        first_before, last_before = -2, -2
        way_in, way_out = 0.0, 0.0
        s_x, s_y, s_heading = x, y, heading
        e_x, e_y, e_heading = g_x, g_y, g_heading
        h_x, h_y, h_heading = g_x, g_y, g_heading
        rel = (0j, 0.0)
        for row in range(n_words):
            word = lib.words[row]
            a, b, c = word[0], word[1], word[2]
            n_trims = 3 if c >= 0 else 2 if b >= 0 else 1 if a >= 0 else 0
            last = word[n_trims - 1] if n_trims else start_trim
            if a != first_before or last != last_before:
                first_before, last_before = a, last
                way_in = lib.cost[start_trim, a] if n_trims else 0.0
                way_out = lib.cost[last, goal_trim]
                if climb >= 0:
                    way_out = lib.cost[last, climb] + lib.cost[climb, goal_trim]
                if not way_in + way_out < ceiling:
                    continue
                s_x, s_y, s_heading = x, y, heading
                if n_trims:
                    s_x, s_y, s_heading = compose(
                        x,
                        y,
                        heading,
                        lib.shift[start_trim, a, 0],
                        lib.shift[start_trim, a, 1],
                        lib.shift[start_trim, a, 2],
                    )
                end = climb if climb >= 0 else last
                e_x, e_y, e_heading = back_from(
                    g_x,
                    g_y,
                    g_heading,
                    lib.shift[end, goal_trim, 0],
                    lib.shift[end, goal_trim, 1],
                    lib.shift[end, goal_trim, 2],
                )
                h_x, h_y, h_heading = e_x, e_y, e_heading
                if climb >= 0:
                    e_x, e_y, e_heading = before_climb(lib, (h_x, h_y, h_heading), last, climb, 0.0)
                rel = seen(s_x, s_y, s_heading, e_x, e_y, e_heading)
            fixed = way_in + way_out
            slope = 0.0
            if climbing >= lib.n_upright:  # it drives as it climbs: its time is known before
                if not fixed < ceiling or not is_level(lib, word):
                    continue
                level = scratch.branches[0]
                level[0], level[1], level[2] = 0.0, 0.0, 0.0
                slope = climb_time(lib, word, last, goal_trim, climb, start_trim, g_z - z, level)
                if not lib.shortest <= slope <= lib.longest[climb]:
                    continue
                e_x, e_y, e_heading = before_climb(lib, (h_x, h_y, h_heading), last, climb, slope)
                rel = seen(s_x, s_y, s_heading, e_x, e_y, e_heading)
                fixed += slope * lib.rates[climb]
            if n_trims >= 2:
                fixed += lib.cost[a, b]
            if n_trims == 3:
                fixed += lib.cost[b, c]
            if not fixed + way_cost(lib, rel[0], a, b, c) < ceiling:
                continue
            branches = scratch.branches
            n_branches = 1
            if n_trims == 3:
                steer(
                    motion_of(lib, a),
                    gap_of(lib, a, b),
                    motion_of(lib, b),
                    gap_of(lib, b, c),
                    motion_of(lib, c),
                    rel,
                    lib.tolerance,
                    branches,
                )
                n_branches = 2
            elif n_trims == 2:
                steer_two(
                    motion_of(lib, a),
                    gap_of(lib, a, b),
                    motion_of(lib, b),
                    rel,
                    lib.tolerance,
                    branches[0],
                )
            elif n_trims == 1:
                steer_one(motion_of(lib, a), rel, branches[0])
            else:
                branches[0, 0], branches[0, 1], branches[0, 2] = 0.0, 0.0, 0.0
            for branch in range(n_branches):
                cost, duration, usable = fixed, 0.0, True
                for n in range(n_trims):
                    t, trim = branches[branch, n], word[n]
                    if not t >= -lib.tolerance:
                        usable = False
                        break
                    if t >= lib.periods[trim] * (1.0 - WHOLE) or t < lib.shortest:
                        t = 0.0
                    branches[branch, n] = t
                    cost += t * lib.rates[trim]
                    duration += t
                    if t > lib.longest[trim]:
                        usable = False
                        break
                if not (usable and cost < ceiling):
                    continue
                times = branches[branch]
                t = slope
                if slope > 0.0:
                    duration += slope
                elif lib.climbs.shape[0] > 0:
                    t = climb_time(lib, word, last, goal_trim, climb, start_trim, g_z - z, times)
                    if not t >= 0.0 or (climb >= 0 and t < lib.shortest):
                        continue
                    if climb >= 0:
                        cost += t * lib.rates[climb]
                        duration += t
                if n_trims < 3:
                    folded, target = (s_x, s_y, s_heading), (e_x, e_y, e_heading)
                    if not word_misses(lib, word, folded, target, times) <= lib.met * size:
                        continue
                if n_trims:
                    duration += lib.time[start_trim, a]
                if n_trims >= 2:
                    duration += lib.time[a, b]
                if n_trims == 3:
                    duration += lib.time[b, c]
                if climb >= 0:
                    duration += lib.time[last, climb] + lib.time[climb, goal_trim]
                else:
                    duration += lib.time[last, goal_trim]
                scratch.costs[count] = cost
                scratch.durations[count] = duration
                scratch.rows[count] = row
                scratch.climbs[count] = climb
                for n in range(3):
                    scratch.times[count, n] = times[n] if n < n_trims else 0.0
                scratch.times[count, 3] = t
                count += 1
    return count


@kernel
def transfer_batch(lib, n_words, starts, start_trim, goals, goal_trim, ceiling, scratch):
    """Candidates of each of many transfers (n, 4) to (n, 4); how many of the last, for timing."""
    count = 0
    for k in range(starts.shape[0]):
        start = (starts[k, 0], starts[k, 1], starts[k, 2], starts[k, 3])
        goal = (goals[k, 0], goals[k, 1], goals[k, 2], goals[k, 3])
        count = transfer_candidates(
            lib, n_words, start, start_trim, goal, goal_trim, ceiling, scratch
        )
    return count
