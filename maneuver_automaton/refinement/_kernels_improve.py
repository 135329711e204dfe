"""Shorten a free word by random shortcuts and via-points.

A section of the word is replaced by a new middle: one connection between its ends, or two that meet
at a via-point. Arrays of `arrays.WordArrays` beside those of `_kernels_word`: `middle_trims` and
`middle_durations` (9,), the new middle, at most twice three trims and a climb with the trim of the
via-point between; `one` and `two`, the candidates of the first and of the second connection.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.refinement._kernels_word import (
    GAIN,
    admitted,
    append_after,
    append_through,
    begun,
    ended,
    gear_after,
    gear_before,
    owner,
    place_between,
    pose_at,
    price_of_transition,
    still_free,
    take,
    unroll,
    whole_cost,
)
from maneuver_automaton.refinement.arrays import ImproveTask, Improving, WordArrays
from maneuver_automaton.search._kernels_connection import free_candidate
from maneuver_automaton.search.arrays import Joint, LatticeArrays
from maneuver_automaton.words._kernels_candidates import candidates, trim_and_gear
from maneuver_automaton.words._kernels_library import NO_TRIM
from maneuver_automaton.words._kernels_shortest import least_cost
from maneuver_automaton.words.library import Scratch

LEAST_SPREAD = 33.0  # times smaller than the greatest spread of a via-point is the least


@bare_inner_kernel
def spliced(
    lib: LatticeArrays, task: ImproveTask, word: WordArrays, n: int, section: Section, m: int
) -> int:
    """Write into `word.new` the word with the section replaced; its length.

    The new middle is the word `word.middle_*` of `m` trims.
    """
    # The trims before the section, the last of them cut; the middle; the trims after it, the first
    # of them cut.
    begin, end, first, last = section.begin, section.end, section.first, section.last
    size = begun(task, word)
    for k in range(first + 1):
        t = word.now.durations[k] if k < first else begin - word.times[k]
        size = append_after(lib, word, size, k, t)
    for k in range(m):
        size = append_through(lib, word, size, word.middle_trims[k], word.middle_durations[k])
    size = append_through(lib, word, size, word.now.trims[last], word.ends[last] - end)
    for k in range(last + 1, n):
        size = append_after(lib, word, size, k, word.now.durations[k])
    return ended(task, word, n, size)


@bare_inner_kernel
def put_middle(
    lib: LatticeArrays, word: WordArrays, words: IntArray, scratch: Scratch, which: int, m: int
) -> int:
    """Append a candidate to the new middle; returns its length.

    Between classes a trim counts also where it lasts no time: maneuvers lead to it and on.
    """
    row = scratch.rows[which]
    passed = lib.library.transitions.cost.shape[0] > 1
    for n_th in range(4):
        trim = words[row, n_th] if n_th < 3 else scratch.climbs[which]
        t = scratch.times[which, n_th]
        if 0 <= trim < lib.library.n_trims and (t > 0.0 or passed):
            word.middle_trims[m], word.middle_durations[m] = trim, t
            m += 1
    return m


class Section(NamedTuple):
    """A stretch of a word for which a new middle is sought."""

    begin: float  # [s] since the word began
    end: float  # [s]
    first: int  # place of the trim that is driven at its begin
    last: int  # and at its end
    start: tuple[float, float, float, float]  # poses [m, m, rad, m]
    goal: tuple[float, float, float, float]
    entry: tuple[int, int]  # trim and gear before
    leave: tuple[int, int]  # and after
    free_heading: bool
    budget: float  # cost that the new middle has to undercut
    left: float  # [s] that it may last
    clock: float  # [s] time of the world at its begin


@bare_inner_kernel
def section_price(one: Improving, begin: float, end: float, first: int, last: int) -> float:
    """Price of the word between two times, its transitions and places included."""
    lib, word = one.library, one.word
    price = place_between(one, begin, end, first, last)
    for k in range(first, last + 1):
        low, high = max(word.times[k], begin), min(word.ends[k], end)
        price += lib.library.rates[word.now.trims[k]] * max(high - low, 0.0)
    for k in range(first + 1, last + 1):
        price += price_of_transition(lib, word, k)
    for k in range(first, last):
        if lib.library.gears[word.now.trims[k]] * lib.library.gears[word.now.trims[k + 1]] < 0:
            price += lib.library.direction_change
    return price


@bare_inner_kernel
def drawn_section(one: Improving, n: int, cost: float, draw: Array) -> Section:
    """The section of a word of `cost` that six numbers between 0 and 1 draw.

    It begins and ends in coasts, where the state is known. A trim that a maneuver leads to has been
    entered when its coast begins.
    """
    lib, task, word = one.library, one.task, one.word
    # The length of the section is drawn evenly in its logarithm, so that short sections of a long
    # word are drawn as often as long ones.
    total = word.times[n]
    middle = draw[1] * total
    shortest = min(task.shortest_span, 0.5 * total)
    span = shortest * (total / shortest) ** draw[2]
    begin = max(middle - 0.5 * span, 0.0)
    end = min(middle + 0.5 * span, total)
    first, last = owner(word, n, begin), owner(word, n, end)
    if begin > word.ends[first]:  # within a maneuver: a section has all of it
        begin = word.ends[first]
    if end > word.ends[last]:
        last += 1
        end = word.times[last]
    if draw[3] < task.snap:
        begin = word.times[first]
    if draw[4] < task.snap:
        end = word.ends[last]
    to_end = end >= total
    led_to = word.now.edges[first] >= 0 or (first == 0 and task.given_ends)
    entered = first if begin > word.times[first] or led_to else first - 1
    before = NO_TRIM if entered < 0 else word.now.trims[entered]
    after = NO_TRIM if to_end and not task.given_ends else word.now.trims[last]
    return Section(
        begin,
        end,
        first,
        last,
        pose_at(lib, word, first, begin),
        pose_at(lib, word, last, end),
        trim_and_gear(before, 0 if before == NO_TRIM else gear_before(lib, word, entered)),
        trim_and_gear(after, 0 if after == NO_TRIM else gear_after(lib, word, n, last)),
        task.free_heading and to_end,
        section_price(one, begin, end, first, last) - GAIN * cost,
        task.limits.most_time - total + (end - begin),
        task.limits.clock + begin,
    )


@bare_inner_kernel
def cheapest_of(scratch: Scratch, n: int) -> float:
    """Least cost of `n` candidates; inf if there are none."""
    least = math.inf
    for k in range(n):
        least = min(least, scratch.costs[k])
    return least


@bare_inner_kernel
def words_to(lib: LatticeArrays, free_heading: bool) -> tuple[IntArray, int]:
    """Words of a connection and how many of them are tried."""
    if free_heading:
        return lib.library.tried.free_words, lib.library.tried.free_words.shape[0]
    return lib.library.tried.words, lib.library.tried.n_few


@bare_inner_kernel
def put_free(
    one: Improving, words: IntArray, joint: Joint, n: int, scratch: Scratch, m: int
) -> tuple[int, int]:
    """Append to the new middle, of `m` trims, the cheapest free one of `n` candidates.

    Returns its number and the middle's new length; -1 and -1 if there is none.
    """
    which = free_candidate(one.scene, one.library, words, joint, n, scratch)
    if which < 0:
        return -1, -1
    return which, put_middle(one.library, one.word, words, scratch, which, m)


@bare_inner_kernel
def direct_middle(one: Improving, section: Section) -> int:
    """Write into the new middle a connection that joins the ends of a section.

    Returns its length, -1 if there is none that is free and cheap enough; so does `via_middle`.
    """
    # In the order of their price: the shortest path at the least cost per metre, which no word
    # undercuts; words in closed form; the proof that one of them is free. So in `via_middle`.
    lib, task = one.library, one.task
    scratch, budget = one.word.one, section.budget
    radius = 0.0 if section.free_heading else task.least_radius
    if least_cost(radius, task.per_metre, section.start, section.goal, budget) >= budget:
        return -1
    words, n_words = words_to(lib, section.free_heading)
    n = candidates(
        lib.library,
        words,
        n_words,
        section.start,
        section.entry,
        section.goal,
        section.leave,
        budget,
        scratch,
    )
    before, after, clock = section.entry[0], section.leave[0], section.clock
    joint = Joint(section.start, before, after, clock, task.tries, budget, section.left)
    _, m = put_free(one, words, joint, n, scratch, 0)
    return m


@bare_inner_kernel
def via_pose(
    lib: LatticeArrays,
    task: ImproveTask,
    word: WordArrays,
    section: Section,
    size: float,
    shift: Array,
) -> tuple[tuple[float, float, float, float], tuple[int, int]]:
    """A pose near the middle of a section, and its trim and gear, any where all are of one class.

    It is shifted by normal numbers times the spread of `size`.
    """
    spread = task.spread * (1.0 / LEAST_SPREAD) ** size
    half = 0.5 * (section.begin + section.end)
    k = owner(word, word.length[0], half)
    x, y, heading, z = pose_at(lib, word, k, min(half, word.ends[k]))
    x += spread * shift[0]
    y += spread * shift[1]
    heading += 0.5 * spread / task.radius * shift[2]
    trim = word.now.trims[k] if lib.library.transitions.cost.shape[0] > 1 else NO_TRIM
    return (x, y, heading, z), trim_and_gear(trim, 0)


@bare_inner_kernel
def via_middle(
    one: Improving, section: Section, via: tuple[float, float, float, float], there: tuple[int, int]
) -> int:
    """Write into the new middle a connection to the pose `via`, and one from there on."""
    lib, task, word = one.library, one.task, one.word
    first, second, budget = word.one, word.two, section.budget
    radius = 0.0 if section.free_heading else task.least_radius
    least = least_cost(task.least_radius, task.per_metre, section.start, via, budget)
    most = budget - least_cost(radius, task.per_metre, via, section.goal, budget - least)
    if least >= most:
        return -1
    before, n_before = words_to(lib, False)
    n_1 = candidates(
        lib.library, before, n_before, section.start, section.entry, via, there, most, first
    )
    cheapest = cheapest_of(first, n_1)
    if cheapest >= most:
        return -1
    # Each half may cost what the cheapest of the other leaves, whether that is free or not.
    words, n_words = words_to(lib, section.free_heading)
    n_2 = candidates(
        lib.library,
        words,
        n_words,
        via,
        there,
        section.goal,
        section.leave,
        budget - cheapest,
        second,
    )
    rest = cheapest_of(second, n_2)
    if cheapest + rest >= budget:
        return -1
    left, clock, tries = section.left, section.clock, task.tries
    joint = Joint(section.start, section.entry[0], there[0], clock, tries, budget - rest, left)
    which, m = put_free(one, before, joint, n_1, first, 0)
    if which < 0:
        return -1
    # The first half is chosen and proven: the second one begins when it ends, with what it leaves.
    if there[0] >= 0:  # the maneuvers that lead to the trim of the via-point
        word.middle_trims[m], word.middle_durations[m] = there[0], 0.0
        m += 1
    used, most = first.durations[which], budget - first.costs[which]
    after = section.leave[0]
    joint = Joint(via, there[0], after, clock + used, tries, most, left - used)
    _, m = put_free(one, words, joint, n_2, second, m)
    return m


@bare_kernel
def attempt_all(one: Improving, uniform: Array, normal: Array) -> float:
    """Cost of the word after one shortcut or via-point per row of the draws has been tried.

    The word is changed in place.

    `uniform` (k, 6): kind, middle, span, two chances to snap to a switch, spread of the via-point;
    `normal` (k, 3): its place and heading.
    """
    lib, task = one.library, one.task
    word, scene = one.word, one.scene
    n = word.length[0]
    cost = whole_cost(one, word.now, n)
    unroll(lib, word, n)
    changes = scene.layers.moving.speed.shape[0] > 0
    for row in range(uniform.shape[0]):
        if n == 0 or not word.times[n] > 0.0:
            return cost
        draw = uniform[row]
        section = drawn_section(one, n, cost, draw)
        if draw[0] < task.via:
            via, there = via_pose(lib, task, word, section, draw[5], normal[row])
            m = via_middle(one, section, via, there)
        else:
            m = direct_middle(one, section)
        if m < 0:
            continue
        size = spliced(lib, task, word, n, section, m)
        if not admitted(lib, task, word, size):
            continue
        new_cost = whole_cost(one, word.new, size)
        if not new_cost < cost - GAIN * cost:
            continue
        # What comes after the section is driven at other times: the costliest test, so the last.
        if changes and not still_free(one, size, section.begin):
            continue
        take(word, size)
        n, cost = size, new_cost
        unroll(lib, word, n)
    return cost
