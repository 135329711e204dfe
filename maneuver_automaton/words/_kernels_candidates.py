"""Words of at most three trims that carry a pose and trim exactly to another, with what they cost.

A word begins and ends in given trims: the transitions out of the first and into the last are folded
into the two poses, and the steering function takes the displacements between its trims. A
vehicle whose trims are all of one class has the identity for every transition: nothing is folded,
and every word is steered from the same pose to the same pose.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_shared_kernel, inner_kernel, kernel
from maneuver_automaton.groups._kernels import back_from, coast, compose, nearest_turn
from maneuver_automaton.words._kernels_library import (
    NO_TRIM,
    cost_between,
    displacement_of,
    distance_cost,
    is_level,
    motion_of,
    price_of_switch,
    rise_of,
    step_of,
    time_between,
)
from maneuver_automaton.words._kernels_steering import (
    extents,
    length,
    steer,
    steer_one,
    steer_two,
    turn_time,
    unit,
)
from maneuver_automaton.words.library import LibraryArrays, Scratch

WHOLE = 1e-9  # share of a full turn that counts as none
PATH, WAYS = 3, 4  # columns of a word, after its trims
NEARLY = 1e-7  # [rad] and share by which a bound is taken lower than it is


@inner_kernel
def trim_and_gear(trim: int, gear: int) -> tuple[int, int]:
    """The trim and gear at an end of a word, as whole numbers of one type."""
    # Numbers known when a kernel is compiled have types of their own: each mixture of them would
    # compile `candidates` once more.
    return np.int64(trim), np.int64(gear)  # type: ignore[return-value]


@inner_kernel
def seen(
    x: float, y: float, heading: float, to_x: float, to_y: float, to_heading: float
) -> tuple[complex, float, complex]:
    """A pose seen from another: complex place, heading, and the heading as a complex number."""
    place = complex(to_x - x, to_y - y) * complex(math.cos(heading), -math.sin(heading))
    turn = to_heading - heading
    return place, turn, unit(turn)


@bare_inner_kernel
def climb_time(
    lib: LibraryArrays,
    word: IntArray,
    goal_trim: int,
    climb: int,
    start_trim: int,
    altitude: float,
    times: Array,
) -> float:
    """Time of the trim `climb` that gains the altitude left; 0 for none, where it fits already."""
    left, before = altitude, start_trim
    for n in range(3):
        trim = word[n]
        if trim >= 0:
            left -= rise_of(lib, before, trim) + times[n] * lib.twists[trim, 3]
            before = trim
    if climb < 0:
        left -= rise_of(lib, before, goal_trim)
        return 0.0 if abs(left) <= lib.rounding.met * (1.0 + abs(altitude)) else math.nan
    left -= rise_of(lib, before, climb) + rise_of(lib, climb, goal_trim)
    return left / lib.twists[climb, 3]


@bare_inner_kernel
def before_climb(
    lib: LibraryArrays, end: tuple[float, float, float], last: int, climb: int, t: float
) -> tuple[float, float, float]:
    """Pose from which the transition to a climb, and the climb for `t`, lead to `end`."""
    x, y, heading = end
    if t > 0.0:
        d_x, d_y, turn = coast(lib.twists[climb, 0], lib.twists[climb, 1], lib.twists[climb, 2], t)
        x, y, heading = back_from(x, y, heading, d_x, d_y, turn)
    d_x, d_y, turn = displacement_of(lib, last, climb)
    return back_from(x, y, heading, d_x, d_y, turn)


@bare_inner_kernel
def word_misses(
    lib: LibraryArrays,
    word: IntArray,
    start: tuple[float, float, float],
    facing: complex,
    goal: tuple[float, float, float],
    times: Array,
) -> float:
    """How far a word of fewer than three trims ends from the goal [m, rad], both poses folded."""
    # `facing`, the start's heading as a complex number, is known: LLVM would take its sine here for
    # every word, also for those of three trims.
    x, y, heading = start
    before = NO_TRIM
    for n in range(3):
        trim = word[n]
        if trim < 0:
            break
        if before != NO_TRIM:
            d_x, d_y, turn = displacement_of(lib, before, trim)
            x, y, heading = compose(x, y, heading, d_x, d_y, turn)
            facing = unit(heading)
        d_x, d_y, turn = coast(
            lib.twists[trim, 0], lib.twists[trim, 1], lib.twists[trim, 2], times[n]
        )
        x, y = x + facing.real * d_x - facing.imag * d_y, y + facing.imag * d_x + facing.real * d_y
        heading += turn
        before = trim
    g_x, g_y, g_heading = goal
    return max(abs(x - g_x), abs(y - g_y), abs(nearest_turn(heading - g_heading)))


@inner_kernel
def lasting(lib: LibraryArrays, trim: int, t: float) -> float:
    """Time of a trim that is driven for `t`: a whole turn counts as none; NaN if negative."""
    if not t >= -lib.rounding.tolerance:
        return math.nan
    if t >= lib.periods[trim] * (1.0 - WHOLE) or t < lib.rounding.shortest:
        return 0.0
    return t


@bare_inner_kernel
def least_prices(lib: LibraryArrays) -> tuple[float, float]:
    """Least cost of a second of driving straight, and of a radian of turning; inf for none."""
    second, radian = math.inf, math.inf
    for n in range(lib.n_trims):
        turn_rate = lib.twists[n, 2]
        if turn_rate != 0.0:
            radian = min(radian, lib.rates[n] / abs(turn_rate))
        elif lib.per_metre[n] < math.inf:
            second = min(second, lib.rates[n])
    return second, radian


@bare_inner_kernel
def ahead(lib: LibraryArrays, word: IntArray, n: int) -> tuple[complex, float]:
    """Motion of a trim of a word, of a straight one as on the path that the word is of."""
    v, turn_rate = motion_of(lib, word[n])
    return (-v if turn_rate == 0.0 and word[WAYS] >> n & 1 else v), turn_rate


@bare_inner_kernel
def solve_path(
    lib: LibraryArrays,
    word: IntArray,
    goal: tuple[complex, float, complex],
    bound: tuple[float, float, float],
    branches: Array,
    out: Array,
) -> None:
    """Fill `out` (2, 3, 2) with times of three trims, each driven either way; inf if costly."""
    # `branches` (2, 3) is room for their `extents`; `bound` what a word has to undercut, and the
    # `least_prices`. Nothing lies between the trims.
    upper_bound, second, radian = bound
    motions = ahead(lib, word, 0), ahead(lib, word, 1), ahead(lib, word, 2)
    # Whatever word it is, its turns add up to the goal's heading, unless that is free.
    least, turn = 0.0, abs(nearest_turn(goal[1])) - NEARLY
    if turn > 0.0 and word[2] < lib.n_trims:
        least = turn * radian
    most = (1.0 + NEARLY) * (upper_bound - least) / second + NEARLY
    limits = lib.rounding.tolerance, -most, most
    extents(motions, ((0j, 0.0), (0j, 0.0)), goal, limits, branches)
    cheap = False
    for branch in range(2):
        least = 0.0
        for n in range(3):
            _, turn_rate = motions[n]
            one, price = branches[branch, n], second
            other = -one
            if turn_rate != 0.0:
                price = abs(turn_rate) * radian if word[n] < lib.n_trims else 0.0
                if not math.isnan(one):
                    one, other = turn_time(one, abs(turn_rate)), turn_time(one, -abs(turn_rate))
            one, other = lasting(lib, word[n], one), lasting(lib, word[n], other)
            out[branch, n, 0], out[branch, n, 1] = one, other
            if math.isnan(one) or other < one:
                one = other
            least += one * price
        cheap = cheap or least * (1.0 - NEARLY) < upper_bound
    if not cheap:
        out[0, 0, 0] = math.inf


@bare_shared_kernel
def candidates(
    lib: LibraryArrays,
    words: IntArray,
    n_words: int,
    start: tuple[float, float, float, float],
    before: tuple[int, int],
    goal: tuple[float, float, float, float],
    after: tuple[int, int],
    upper_bound: float,
    scratch: Scratch,
) -> int:
    """Fill `scratch` with the words that lead from one pose and trim to another; how many.

    The first `n_words` rows of `words` are tried. `start` and `goal` are (x, y, heading, z);
    `before` and `after` are the (trim, gear) there, NO_TRIM and 0 where any will do. What costs
    `upper_bound` or more is left out.
    """
    x, y, heading, z = start
    g_x, g_y, g_heading, g_z = goal
    start_trim, start_gear = before
    goal_trim, goal_gear = after
    # Rounding grows with the distance: what a word may miss is relative to it.
    size = 1.0 + abs(g_x - x) + abs(g_y - y)
    # One class: all transitions are the identity at the price of a switch, so nothing is folded,
    # and every word is steered from the same pose to the same pose.
    one_class = lib.transitions.cost.shape[0] == 1
    bound = (upper_bound, *least_prices(lib))
    count = 0
    # Without a climb first, then each trim that climbs as the last of the word: those that only
    # climb, then those that drive as they do, whose time has to be known before the word is
    # steered.
    for climbing in range(-1, lib.tried.climbs.shape[0]):
        climb = lib.tried.climbs[climbing] if climbing >= 0 else NO_TRIM
        # As long as all words are steered between the same two poses, those that follow one path
        # differ only in which way they turn along it, and are solved for once.
        shared = one_class and climbing < lib.tried.n_upright
        for path in range(scratch.solved.shape[0]):
            scratch.solved[path, 0, 0, 0] = -math.inf  # not yet
        first_before, last_before = -2, -2
        cost_in, cost_out = 0.0, 0.0
        # What a word is steered between: from s, the start after the transition into its first
        # trim, to e, the goal before the transition out of its last one; h is e before a climb is
        # taken off. `rel` is e seen from s, `distance` how far away.
        s_x, s_y, s_heading = x, y, heading
        e_x, e_y, e_heading = g_x, g_y, g_heading
        h_x, h_y, h_heading = g_x, g_y, g_heading
        facing = unit(s_heading)
        rel = seen(s_x, s_y, s_heading, e_x, e_y, e_heading)
        distance = length(rel[0])
        for row in range(n_words):
            a, b, c = words[row, 0], words[row, 1], words[row, 2]
            n_trims = 3 if c >= 0 else 2 if b >= 0 else 1 if a >= 0 else 0
            last = words[row, n_trims - 1] if n_trims else start_trim
            # Rows are sorted by first and last trim, so the ends are folded once for many words.
            if not one_class and (a != first_before or last != last_before):
                first_before, last_before = a, last
                cost_in = cost_between(lib, start_trim, a) if n_trims else 0.0
                cost_out = cost_between(lib, last, goal_trim)
                if climb >= 0:
                    cost_out = cost_between(lib, last, climb) + cost_between(lib, climb, goal_trim)
                if not cost_in + cost_out < upper_bound:
                    continue
                s_x, s_y, s_heading = x, y, heading
                if n_trims:
                    d_x, d_y, turn = displacement_of(lib, start_trim, a)
                    s_x, s_y, s_heading = compose(x, y, heading, d_x, d_y, turn)
                d_x, d_y, turn = displacement_of(lib, climb if climb >= 0 else last, goal_trim)
                e_x, e_y, e_heading = back_from(g_x, g_y, g_heading, d_x, d_y, turn)
                h_x, h_y, h_heading = e_x, e_y, e_heading
                if climb >= 0:
                    e_x, e_y, e_heading = before_climb(lib, (h_x, h_y, h_heading), last, climb, 0.0)
                facing = unit(s_heading)
                rel = seen(s_x, s_y, s_heading, e_x, e_y, e_heading)
                distance = length(rel[0])
            fixed = cost_in + cost_out
            slope = 0.0
            if climbing >= lib.tried.n_upright:  # it drives as it climbs: its time is known before
                if not fixed < upper_bound or not is_level(lib, words[row]):
                    continue
                level = scratch.branches[0]
                level[0], level[1], level[2] = 0.0, 0.0, 0.0
                slope = climb_time(lib, words[row], goal_trim, climb, start_trim, g_z - z, level)
                if not lib.rounding.shortest <= slope <= lib.longest[climb]:
                    continue
                e_x, e_y, e_heading = before_climb(lib, (h_x, h_y, h_heading), last, climb, slope)
                rel = seen(s_x, s_y, s_heading, e_x, e_y, e_heading)
                distance = length(rel[0])
                fixed += slope * lib.rates[climb]
            # A word costs at least the distance at the price per metre of its cheapest trim: what
            # cannot be cheaper than the bound is left out before it is steered. For one class this
            # is the hot test of the search, so it knows no transition.
            if one_class and (shared or n_trims == 3):
                price = lib.per_metre[a] if a >= 0 else math.inf
                if b >= 0:
                    price = min(price, lib.per_metre[b])
                if c >= 0:
                    price = min(price, lib.per_metre[c])
                if distance > lib.rounding.met and not distance * price < upper_bound:
                    continue
            else:
                if n_trims >= 2:
                    fixed += cost_between(lib, a, b)
                if n_trims == 3:
                    fixed += cost_between(lib, b, c)
                if not fixed + distance_cost(lib, distance, a, b, c) < upper_bound:
                    continue
            branches = scratch.branches
            n_branches, cheap = 1, 3  # a bit for each branch that may be cheap enough
            if n_trims == 3:
                # No branch with a time below the least is of use.
                limits = (lib.rounding.tolerance, -lib.rounding.tolerance)
                n_branches = 2
                if shared:
                    solved, ways = scratch.solved[words[row, PATH]], words[row, WAYS]
                    if solved[0, 0, 0] == -math.inf:
                        solve_path(lib, words[row], rel, bound, branches, solved)
                    if solved[0, 0, 0] == math.inf:
                        continue
                    cheap = 0
                    for branch in range(2):
                        times = solved[branch ^ (ways >> 3)]
                        first, second = times[0, ways & 1], times[1, ways >> 1 & 1]
                        third = times[2, ways >> 2 & 1]
                        # Without the prices of switches, NaN where a time is.
                        least = first * lib.rates[a] + second * lib.rates[b] + third * lib.rates[c]
                        if least < upper_bound:
                            cheap |= 1 << branch
                            branches[branch, 0], branches[branch, 1] = first, second
                            branches[branch, 2] = third
                else:
                    motions = motion_of(lib, a), motion_of(lib, b), motion_of(lib, c)
                    nothing = (0j, 0.0)  # displacements known to be none cost no time
                    steps = (nothing, nothing)
                    if not one_class:
                        steps = (step_of(lib, a, b), step_of(lib, b, c))
                    steer(motions, steps, rel, limits, branches)
            elif n_trims == 2:
                pair, tolerance = (motion_of(lib, a), motion_of(lib, b)), lib.rounding.tolerance
                steer_two(pair[0], step_of(lib, a, b), pair[1], rel, tolerance, branches[0])
            elif n_trims == 1:
                steer_one(motion_of(lib, a), rel, branches[0])
            else:
                branches[0, 0], branches[0, 1], branches[0, 2] = 0.0, 0.0, 0.0
            # A branch is usable if all its times are: not negative, where a whole turn counts as
            # none, not above the longest that the trim may last, nor below the least coasting time
            # unless the trim before goes on. Switches are priced between trims that last, as a trim
            # without time is not driven.
            for branch in range(n_branches):
                if not cheap >> branch & 1:
                    continue
                if not shared or n_trims < 3:
                    least = fixed
                    for n in range(n_trims):
                        branches[branch, n] = lasting(lib, words[row, n], branches[branch, n])
                        if branches[branch, n] != 0.0:
                            least += branches[branch, n] * lib.rates[words[row, n]]
                    if not least < upper_bound:
                        continue
                cost, duration, usable, driven = fixed, 0.0, True, 0
                lasted = scratch.times[count]
                trim, gear = start_trim, start_gear
                for n in range(n_trims):
                    t, this = branches[branch, n], words[row, n]
                    lasted[n] = t
                    if t > 0.0:
                        driven += 1
                    if t > 0.0 and this < lib.n_trims:  # the turn of a free heading is no trim
                        cost += t * lib.rates[this] + price_of_switch(lib, trim, gear, this)
                        if t > lib.longest[this] or (t < lib.min_coast and trim != this):
                            usable = False
                            break
                        trim = this
                        if lib.gears[this] != 0:
                            gear = lib.gears[this]
                        duration += t
                if not usable:
                    continue
                if goal_trim != NO_TRIM:
                    # The goal's trim follows: going on into it is a switch as any other.
                    if trim != NO_TRIM and trim != goal_trim:
                        cost += lib.switch
                    if gear * goal_gear < 0:
                        cost += lib.direction_change
                if not cost < upper_bound:
                    continue
                for n in range(n_trims, 3):
                    lasted[n] = 0.0
                t = slope
                if slope > 0.0:
                    duration += slope
                elif lib.tried.climbs.shape[0] > 0:
                    t = climb_time(lib, words[row], goal_trim, climb, start_trim, g_z - z, lasted)
                    if not t >= 0.0 or (climb >= 0 and t < lib.rounding.shortest):
                        continue
                    if climb >= 0:
                        cost += t * lib.rates[climb]
                        duration += t
                if driven < 3:  # fewer times than the goal has coordinates: does it meet the goal?
                    folded, target = (s_x, s_y, s_heading), (e_x, e_y, e_heading)
                    missed = word_misses(lib, words[row], folded, facing, target, lasted)
                    if not missed <= lib.rounding.met * size:
                        continue
                if not one_class:
                    if n_trims:
                        duration += time_between(lib, start_trim, a)
                    if n_trims >= 2:
                        duration += time_between(lib, a, b)
                    if n_trims == 3:
                        duration += time_between(lib, b, c)
                    if climb >= 0:
                        duration += time_between(lib, last, climb)
                        duration += time_between(lib, climb, goal_trim)
                    else:
                        duration += time_between(lib, last, goal_trim)
                scratch.costs[count] = cost
                scratch.durations[count] = duration
                scratch.rows[count] = row
                scratch.climbs[count] = climb
                lasted[3] = t
                count += 1
    return count


@kernel
def candidate_batch(
    lib: LibraryArrays,
    n_words: int,
    starts: Array,
    start_trim: int,
    goals: Array,
    goal_trim: int,
    upper_bound: float,
    scratch: Scratch,
) -> int:
    """Candidates of each of many pairs of poses (n, 4); how many the last pair has, for timing."""
    count = 0
    before, after = trim_and_gear(start_trim, 0), trim_and_gear(goal_trim, 0)
    for k in range(starts.shape[0]):
        start = (starts[k, 0], starts[k, 1], starts[k, 2], starts[k, 3])
        goal = (goals[k, 0], goals[k, 1], goals[k, 2], goals[k, 3])
        count = candidates(
            lib, lib.tried.words, n_words, start, before, goal, after, upper_bound, scratch
        )
    return count
