"""Shorten a free word by random shortcuts and via-points."""

from __future__ import annotations

import math
from typing import NamedTuple

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel, inlined_kernel
from maneuver_automaton.refinement._kernels_word import (
    GAIN,
    LENGTH,
    admitted,
    append,
    gear_after,
    gear_before,
    owner,
    pose_at,
    take,
    unroll,
    word_cost,
)
from maneuver_automaton.search._kernels_motion import (
    coast_free,
    coasted,
    free_candidate,
    may_stay,
)
from maneuver_automaton.words._kernels_candidates import NO_TRIM, candidates, trim_and_gear


@bare_inner_kernel
def spliced(lib, work, n, begin, end, first, last, m):
    """Write into `work.new_*` the word with what is between two times replaced; its length.

    The new middle is the word `work.middle_*` of `m` trims.
    """
    size = 0
    for k in range(first + 1):
        t = work.durations[k] if k < first else begin - work.times[k]
        size = append(lib, work.new_trims, work.new_durations, size, work.trims[k], t)
    for k in range(m):
        t = work.middle_durations[k]
        size = append(lib, work.new_trims, work.new_durations, size, work.middle_trims[k], t)
    for k in range(last, n):
        t = work.durations[k] if k > last else work.times[k + 1] - end
        size = append(lib, work.new_trims, work.new_durations, size, work.trims[k], t)
    return size


@bare_inner_kernel
def still_free(lib, task, scene, work, size, begin):
    """Whether the word in `work.new_*` is free after `begin` [s], where obstacles move."""
    pose = (work.start[0], work.start[1], work.start[2], 0.0)
    time = 0.0
    for k in range(size):
        trim, t = work.new_trims[k], work.new_durations[k]
        begun = time + t > begin
        if begun and not coast_free(scene, lib, trim, pose, t, task.clock + time):
            return False
        pose = coasted(lib, trim, pose, t)
        time += t
    last = work.new_trims[max(size - 1, 0)]
    return may_stay(scene, lib, last, pose, task.clock + time, task.stay_until)


@inlined_kernel
def put_middle(lib, work, words, scratch, which, m):
    """Append a candidate to the new middle; returns its length."""
    row = scratch.rows[which]
    for n_th in range(3):
        trim, t = words[row, n_th], scratch.times[which, n_th]
        if t > 0.0 and trim < lib.library.n_trims:
            work.middle_trims[m], work.middle_durations[m] = trim, t
            m += 1
    return m


class Section(NamedTuple):
    """A stretch of a word for which a new middle is sought."""

    begin: float  # [s]
    end: float
    first: int  # place of the trim that is driven at its begin
    last: int  # and at its end
    start: tuple[float, float, float, float]  # poses [m, m, rad, m]
    goal: tuple[float, float, float, float]
    entry: tuple[int, int]  # trim and gear before
    leave: tuple[int, int]  # and after
    free_heading: bool
    budget: float  # the new middle must be cheaper
    left: float  # [s] it may last so long
    clock: float  # [s] time of the world at its begin


@bare_inner_kernel
def section_price(lib, work, begin, end, first, last):
    """Price of the word between two times, its switches included."""
    price = 0.0
    for k in range(first, last + 1):
        low, high = max(work.times[k], begin), min(work.times[k + 1], end)
        price += lib.library.rates[work.trims[k]] * max(high - low, 0.0)
    if lib.library.switch > 0.0:
        price += lib.library.switch * (last - first)
    for k in range(first, last):
        if lib.library.gears[work.trims[k]] * lib.library.gears[work.trims[k + 1]] < 0:
            price += lib.library.direction_change
    return price


@bare_inner_kernel
def drawn_section(lib, task, work, n, cost, draw):
    """The section of a word of `cost` that six numbers between 0 and 1 draw."""
    total = work.times[n]
    middle = draw[1] * total
    shortest = min(task.shortest_span, 0.5 * total)
    span = shortest * (total / shortest) ** draw[2]
    begin = max(middle - 0.5 * span, 0.0)
    end = min(middle + 0.5 * span, total)
    first, last = owner(work, n, begin), owner(work, n, end)
    if draw[3] < task.snap:
        begin = work.times[first]
    if draw[4] < task.snap:
        end = work.times[last + 1]
    to_end = end >= total
    entered = first if begin > work.times[first] else first - 1
    before = NO_TRIM if entered < 0 else work.trims[entered]
    after = NO_TRIM if to_end else work.trims[last]
    return Section(
        begin,
        end,
        first,
        last,
        pose_at(lib, work, first, begin),
        pose_at(lib, work, last, end),
        trim_and_gear(before, 0 if before == NO_TRIM else gear_before(lib, work, entered)),
        trim_and_gear(after, 0 if after == NO_TRIM else gear_after(lib, work, n, last)),
        task.free_heading and to_end,
        section_price(lib, work, begin, end, first, last) - GAIN * cost,
        task.most_time - total + (end - begin),
        task.clock + begin,
    )


@inlined_kernel
def cheapest_of(scratch, n):
    """Least cost of `n` candidates; inf if there are none."""
    least = math.inf
    for k in range(n):
        least = min(least, scratch.costs[k])
    return least


@bare_inner_kernel
def put_free(lib, task, scene, work, words, pose, n, most_cost, most_time, clock, scratch, m):
    """Append to the new middle, of `m` trims, the cheapest free one of `n` candidates.

    Returns its number and the middle's new length; -1 and -1 if there is none.
    """
    limits = (task.tries, most_cost, most_time)
    ends = (pose, NO_TRIM, NO_TRIM)
    which = free_candidate(scene, lib, words, ends, n, limits, clock, scratch)
    if which < 0:
        return -1, -1
    return which, put_middle(lib, work, words, scratch, which, m)


@bare_inner_kernel
def direct_middle(lib, task, scene, work, section):
    """Write into the new middle three trims that join the ends of a section.

    Returns its length, -1 if there is none that is free and cheap enough; so does `via_middle`.
    """
    x, y, _, _ = section.start
    e_x, e_y, _, _ = section.goal
    if math.hypot(e_x - x, e_y - y) * task.per_metre >= section.budget:
        return -1
    words = lib.library.free_words if section.free_heading else lib.library.words
    n = candidates(
        lib.library,
        words,
        words.shape[0],
        section.start,
        section.entry,
        section.goal,
        section.leave,
        section.budget,
        work.one,
    )
    _, m = put_free(
        lib,
        task,
        scene,
        work,
        words,
        section.start,
        n,
        section.budget,
        section.left,
        section.clock,
        work.one,
        0,
    )
    return m


@bare_inner_kernel
def via_pose(lib, task, work, n, section, size, shift):
    """A pose near the middle of a section, shifted by normal numbers times the spread of `size`."""
    spread = task.spread * (1.0 / 33.0) ** size
    half = 0.5 * (section.begin + section.end)
    x, y, heading, z = pose_at(lib, work, owner(work, n, half), half)
    x += spread * shift[0]
    y += spread * shift[1]
    heading += 0.5 * spread / task.radius * shift[2]
    return x, y, heading, z


@bare_inner_kernel
def via_middle(lib, task, scene, work, section, via):
    """Write into the new middle three trims to the pose `via`, and three from there on."""
    x, y, _, _ = section.start
    v_x, v_y, _, _ = via
    e_x, e_y, _, _ = section.goal
    one, two, budget = work.one, work.two, section.budget
    way = math.hypot(v_x - x, v_y - y) + math.hypot(e_x - v_x, e_y - v_y)
    if way * task.per_metre >= budget:
        return -1
    nowhere = trim_and_gear(NO_TRIM, 0)
    n_1 = candidates(
        lib.library,
        lib.library.words,
        lib.library.words.shape[0],
        section.start,
        section.entry,
        via,
        nowhere,
        budget,
        one,
    )
    cheapest = cheapest_of(one, n_1)
    if cheapest >= budget:
        return -1
    words = lib.library.free_words if section.free_heading else lib.library.words
    n_2 = candidates(
        lib.library,
        words,
        words.shape[0],
        via,
        nowhere,
        section.goal,
        section.leave,
        budget - cheapest,
        two,
    )
    rest = cheapest_of(two, n_2)
    if cheapest + rest >= budget:
        return -1
    which, m = put_free(
        lib,
        task,
        scene,
        work,
        lib.library.words,
        section.start,
        n_1,
        budget - rest,
        section.left,
        section.clock,
        one,
        0,
    )
    if which < 0:
        return -1
    used = one.durations[which]
    _, m = put_free(
        lib,
        task,
        scene,
        work,
        words,
        via,
        n_2,
        budget - one.costs[which],
        section.left - used,
        section.clock + used,
        two,
        m,
    )
    return m


@bare_kernel
def attempt_all(lib, task, scene, work, state, uniform, normal):
    """Try one shortcut or via-point per row of the draws; the length in `state`; returns the cost.

    `uniform` (k, 6): kind, middle, span, two chances to snap to a switch, spread of the via-point;
    `normal` (k, 3): its place and heading.
    """
    n = state[LENGTH]
    cost = word_cost(lib, work.trims, work.durations, n)
    unroll(lib, work, n)
    changes = scene.layers.movers.speed.shape[0] > 0  # what comes after is driven at other times
    for row in range(uniform.shape[0]):
        if n == 0 or not work.times[n] > 0.0:
            return cost
        draw = uniform[row]
        section = drawn_section(lib, task, work, n, cost, draw)
        if draw[0] < task.via:
            via = via_pose(lib, task, work, n, section, draw[5], normal[row])
            m = via_middle(lib, task, scene, work, section, via)
        else:
            m = direct_middle(lib, task, scene, work, section)
        if m < 0:
            continue
        begin, end = section.begin, section.end
        size = spliced(lib, work, n, begin, end, section.first, section.last, m)
        if not admitted(lib, task, work, size):
            continue
        new_cost = word_cost(lib, work.new_trims, work.new_durations, size)
        if not new_cost < cost - GAIN * cost:
            continue
        if changes and not still_free(lib, task, scene, work, size, begin):
            continue
        take(work, state, size)
        n, cost = size, new_cost
        unroll(lib, work, n)
    return cost
