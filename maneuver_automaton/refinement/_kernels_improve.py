"""Shorten a free word by random shortcuts and via-points.

A section of the word is replaced by a new middle: one connection between its ends, or two that meet
at a via-point. Arrays of `work.Work` beside those of `_kernels_word`: `middle_trims` and
`middle_durations` (9,), the new middle, at most twice three trims and a climb with the trim of the
via-point between; `one` and `two`, the candidates of the first and of the second connection.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel, inlined_kernel
from maneuver_automaton.refinement._kernels_word import (
    GAIN,
    LENGTH,
    admitted,
    append_after,
    append_through,
    begun,
    ended,
    gear_after,
    gear_before,
    owner,
    pose_at,
    price_of_transition,
    still_free,
    take,
    unroll,
    word_cost,
)
from maneuver_automaton.refinement.arrays import ImproveTask, Work
from maneuver_automaton.search._kernels_connection import free_candidate
from maneuver_automaton.search.lattice_arrays import LatticeArrays
from maneuver_automaton.search.scene import Scene
from maneuver_automaton.words._kernels_candidates import candidates, trim_and_gear
from maneuver_automaton.words._kernels_library import NO_TRIM
from maneuver_automaton.words.library import Scratch


@bare_inner_kernel
def spliced(
    lib: LatticeArrays, task: ImproveTask, work: Work, n: int, section: Section, m: int
) -> int:
    """Write into `work.new_*` the word with the section replaced; its length.

    The new middle is the word `work.middle_*` of `m` trims.
    """
    # The trims before the section, the last of them cut; the middle; the trims after it, the first
    # of them cut.
    begin, end, first, last = section.begin, section.end, section.first, section.last
    size = begun(task, work)
    for k in range(first + 1):
        t = work.durations[k] if k < first else begin - work.times[k]
        size = append_after(lib, work, size, k, t)
    for k in range(m):
        size = append_through(lib, work, size, work.middle_trims[k], work.middle_durations[k])
    size = append_through(lib, work, size, work.trims[last], work.ends[last] - end)
    for k in range(last + 1, n):
        size = append_after(lib, work, size, k, work.durations[k])
    return ended(task, work, n, size)


@inlined_kernel
def put_middle(
    lib: LatticeArrays, work: Work, words: IntArray, scratch: Scratch, which: int, m: int
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
            work.middle_trims[m], work.middle_durations[m] = trim, t
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
def section_price(
    lib: LatticeArrays, work: Work, begin: float, end: float, first: int, last: int
) -> float:
    """Price of the word between two times, its transitions included."""
    price = 0.0
    for k in range(first, last + 1):
        low, high = max(work.times[k], begin), min(work.ends[k], end)
        price += lib.library.rates[work.trims[k]] * max(high - low, 0.0)
    for k in range(first + 1, last + 1):
        price += price_of_transition(lib, work, k)
    for k in range(first, last):
        if lib.library.gears[work.trims[k]] * lib.library.gears[work.trims[k + 1]] < 0:
            price += lib.library.direction_change
    return price


@bare_inner_kernel
def drawn_section(
    lib: LatticeArrays, task: ImproveTask, work: Work, n: int, cost: float, draw: Array
) -> Section:
    """The section of a word of `cost` that six numbers between 0 and 1 draw.

    It begins and ends in coasts, where the state is known. A trim that a maneuver leads to has been
    entered when its coast begins.
    """
    # The length of the section is drawn evenly in its logarithm, so that short sections of a long
    # word are drawn as often as long ones.
    total = work.times[n]
    middle = draw[1] * total
    shortest = min(task.shortest_span, 0.5 * total)
    span = shortest * (total / shortest) ** draw[2]
    begin = max(middle - 0.5 * span, 0.0)
    end = min(middle + 0.5 * span, total)
    first, last = owner(work, n, begin), owner(work, n, end)
    if begin > work.ends[first]:  # within a maneuver: a section has all of it
        begin = work.ends[first]
    if end > work.ends[last]:
        last += 1
        end = work.times[last]
    if draw[3] < task.snap:
        begin = work.times[first]
    if draw[4] < task.snap:
        end = work.ends[last]
    to_end = end >= total
    led_to = work.edges[first] >= 0 or (first == 0 and task.given_ends)
    entered = first if begin > work.times[first] or led_to else first - 1
    before = NO_TRIM if entered < 0 else work.trims[entered]
    after = NO_TRIM if to_end and not task.given_ends else work.trims[last]
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
def cheapest_of(scratch: Scratch, n: int) -> float:
    """Least cost of `n` candidates; inf if there are none."""
    least = math.inf
    for k in range(n):
        least = min(least, scratch.costs[k])
    return least


@inlined_kernel
def words_to(lib: LatticeArrays, free_heading: bool) -> tuple[IntArray, int]:
    """Words of a connection and how many of them are tried."""
    if free_heading:
        return lib.library.tried.free_words, lib.library.tried.free_words.shape[0]
    return lib.library.tried.words, lib.library.tried.n_few


@bare_inner_kernel
def put_free(
    lib: LatticeArrays,
    task: ImproveTask,
    scene: Scene,
    work: Work,
    words: IntArray,
    ends: tuple[tuple[float, float, float, float], int, int],
    n: int,
    most_cost: float,
    most_time: float,
    clock: float,
    scratch: Scratch,
    m: int,
) -> tuple[int, int]:
    """Append to the new middle, of `m` trims, the cheapest free one of `n` candidates.

    `ends` as in `connection_free`. Returns its number and the middle's new length; -1 and -1 if
    there is none.
    """
    limits = (task.tries, most_cost, most_time)
    which = free_candidate(scene, lib, words, ends, n, limits, clock, scratch)
    if which < 0:
        return -1, -1
    return which, put_middle(lib, work, words, scratch, which, m)


@bare_inner_kernel
def direct_middle(
    lib: LatticeArrays, task: ImproveTask, scene: Scene, work: Work, section: Section
) -> int:
    """Write into the new middle a connection that joins the ends of a section.

    Returns its length, -1 if there is none that is free and cheap enough; so does `via_middle`.
    """
    # In the order of their price: the straight line at the least cost per metre, which no path
    # undercuts; words in closed form; the proof that one of them is free. So in `via_middle`.
    x, y, _, _ = section.start
    e_x, e_y, _, _ = section.goal
    if math.hypot(e_x - x, e_y - y) * task.per_metre >= section.budget:
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
        section.budget,
        work.one,
    )
    _, m = put_free(
        lib,
        task,
        scene,
        work,
        words,
        (section.start, section.entry[0], section.leave[0]),
        n,
        section.budget,
        section.left,
        section.clock,
        work.one,
        0,
    )
    return m


@bare_inner_kernel
def via_pose(
    lib: LatticeArrays,
    task: ImproveTask,
    work: Work,
    n: int,
    section: Section,
    size: float,
    shift: Array,
) -> tuple[tuple[float, float, float, float], tuple[int, int]]:
    """A pose near the middle of a section, and its trim and gear, any where all are of one class.

    It is shifted by normal numbers times the spread of `size`.
    """
    spread = task.spread * (1.0 / 33.0) ** size
    half = 0.5 * (section.begin + section.end)
    k = owner(work, n, half)
    x, y, heading, z = pose_at(lib, work, k, min(half, work.ends[k]))
    x += spread * shift[0]
    y += spread * shift[1]
    heading += 0.5 * spread / task.radius * shift[2]
    trim = work.trims[k] if lib.library.transitions.cost.shape[0] > 1 else NO_TRIM
    return (x, y, heading, z), trim_and_gear(trim, 0)


@bare_inner_kernel
def via_middle(
    lib: LatticeArrays,
    task: ImproveTask,
    scene: Scene,
    work: Work,
    section: Section,
    via: tuple[float, float, float, float],
    there: tuple[int, int],
) -> int:
    """Write into the new middle a connection to the pose `via`, and one from there on."""
    x, y, _, _ = section.start
    v_x, v_y, _, _ = via
    e_x, e_y, _, _ = section.goal
    one, two, budget = work.one, work.two, section.budget
    length = math.hypot(v_x - x, v_y - y) + math.hypot(e_x - v_x, e_y - v_y)
    if length * task.per_metre >= budget:
        return -1
    before, n_before = words_to(lib, False)
    n_1 = candidates(
        lib.library, before, n_before, section.start, section.entry, via, there, budget, one
    )
    cheapest = cheapest_of(one, n_1)
    if cheapest >= budget:
        return -1
    # Each half may cost what the cheapest of the other leaves, whether that is free or not.
    words, n_words = words_to(lib, section.free_heading)
    n_2 = candidates(
        lib.library, words, n_words, via, there, section.goal, section.leave, budget - cheapest, two
    )
    rest = cheapest_of(two, n_2)
    if cheapest + rest >= budget:
        return -1
    which, m = put_free(
        lib,
        task,
        scene,
        work,
        before,
        (section.start, section.entry[0], there[0]),
        n_1,
        budget - rest,
        section.left,
        section.clock,
        one,
        0,
    )
    if which < 0:
        return -1
    # The first half is chosen and proven: the second one begins when it ends, with what it leaves.
    if there[0] >= 0:  # the maneuvers that lead to the trim of the via-point
        work.middle_trims[m], work.middle_durations[m] = there[0], 0.0
        m += 1
    used = one.durations[which]
    _, m = put_free(
        lib,
        task,
        scene,
        work,
        words,
        (via, there[0], section.leave[0]),
        n_2,
        budget - one.costs[which],
        section.left - used,
        section.clock + used,
        two,
        m,
    )
    return m


@bare_kernel
def attempt_all(
    lib: LatticeArrays,
    task: ImproveTask,
    scene: Scene,
    work: Work,
    state: IntArray,
    uniform: Array,
    normal: Array,
) -> float:
    """Cost of the word after one shortcut or via-point per row of the draws has been tried.

    The word is changed in place, and its length in `state`.

    `uniform` (k, 6): kind, middle, span, two chances to snap to a switch, spread of the via-point;
    `normal` (k, 3): its place and heading.
    """
    n = state[LENGTH]
    cost = word_cost(lib, work.trims, work.durations, work.edges, n)
    unroll(lib, work, n)
    changes = scene.layers.moving.speed.shape[0] > 0
    for row in range(uniform.shape[0]):
        if n == 0 or not work.times[n] > 0.0:
            return cost
        draw = uniform[row]
        section = drawn_section(lib, task, work, n, cost, draw)
        if draw[0] < task.via:
            via, there = via_pose(lib, task, work, n, section, draw[5], normal[row])
            m = via_middle(lib, task, scene, work, section, via, there)
        else:
            m = direct_middle(lib, task, scene, work, section)
        if m < 0:
            continue
        size = spliced(lib, task, work, n, section, m)
        if not admitted(lib, task, work, size):
            continue
        new_cost = word_cost(lib, work.new_trims, work.new_durations, work.new_edges, size)
        if not new_cost < cost - GAIN * cost:
            continue
        # What comes after the section is driven at other times: the dearest test, so the last.
        if changes and not still_free(lib, task, scene, work, size, section.begin):
            continue
        take(work, state, size)
        n, cost = size, new_cost
        unroll(lib, work, n)
    return cost
