"""Shorten a free word by dynamic programming over its points.

Points are states of the word at rising times. A path to a point goes along the word from the point
before, or by a connection from any earlier one. Arrays of `arrays.PointArrays`, with a row a point:

    at         the pose and the time of the point in the word
    owners     the trim that is coasted there
    best       cost of the cheapest path to it
    spent      [s] how long that path lasts
    back       the point that its connection begins at, -1 along the word
    by_trims, by_durations   (4,) of that connection: three trims and a climb
    legs       the points of the cheapest path, the last first
"""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.refinement._kernels_word import (
    GAIN,
    admitted,
    append_after,
    append_through,
    begun,
    ended,
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

X, Y, HEADING, Z, TIME = range(5)  # columns of the points


@bare_inner_kernel
def put_points(lib: LatticeArrays, word: WordArrays, n: int, times: Array) -> None:
    """Fill the points with the word's states at rising times within its coasts."""
    for j in range(times.shape[0]):
        k = owner(word, n, times[j]) if j > 0 else 0
        time = min(times[j], word.ends[k])
        x, y, heading, z = pose_at(lib, word, k, time)
        (
            word.points.at[j, X],
            word.points.at[j, Y],
            word.points.at[j, HEADING],
            word.points.at[j, Z],
        ) = x, y, heading, z
        word.points.at[j, TIME], word.points.owners[j] = time, k
        word.points.best[j] = math.inf
        word.points.back[j] = -1
    word.points.best[0], word.points.spent[0] = 0.0, 0.0


@bare_inner_kernel
def price_along(one: Improving, j: int) -> float:
    """Price of the word from point `j - 1` to point `j`, its places included."""
    lib, word = one.library, one.word
    begin, end = word.points.at[j - 1, TIME], word.points.at[j, TIME]
    first, last = word.points.owners[j - 1], word.points.owners[j]
    price = place_between(one, begin, end, first, last)
    for k in range(first, last + 1):
        low, high = max(word.times[k], begin), min(word.ends[k], end)
        price += lib.library.rates[word.now.trims[k]] * max(high - low, 0.0)
        if k > first:
            price += price_of_transition(lib, word, k)
            if lib.library.gears[word.now.trims[k]] * lib.library.gears[word.now.trims[k - 1]] < 0:
                price += lib.library.direction_change
    return price


@bare_inner_kernel
def trim_at(lib: LatticeArrays, word: WordArrays, j: int) -> tuple[int, int]:
    """Trim at a point, as the search for connections is told: any where all are of one class."""
    trim = (
        word.now.trims[word.points.owners[j]]
        if lib.library.transitions.cost.shape[0] > 1
        else NO_TRIM
    )
    return trim_and_gear(trim, 0)


@bare_inner_kernel
def join(one: Improving, words: IntArray, n_words: int, i: int, j: int, gain: float) -> None:
    """Reach point `j` from point `i` by a connection, if that is cheaper by `gain`, and free."""
    lib, task = one.library, one.task
    word, limits = one.word, one.task.limits
    points, scratch = word.points, word.one
    at = points.at
    start = (at[i, X], at[i, Y], at[i, HEADING], at[i, Z])
    goal = (at[j, X], at[j, Y], at[j, HEADING], at[j, Z])
    # In the order of their price: the shortest path at the least cost per metre, which no word
    # undercuts; words in closed form; the proof that one of them is free.
    budget = points.best[j] - points.best[i] - gain
    radius = 0.0 if task.free_heading and j == at.shape[0] - 1 else task.least_radius
    if least_cost(radius, task.per_metre, start, goal, budget) >= budget:
        return
    here, there = trim_at(lib, word, i), trim_at(lib, word, j)
    count = candidates(lib.library, words, n_words, start, here, goal, there, budget, scratch)
    clock = limits.clock + points.spent[i]  # when the cheapest path gets to point i
    joint = Joint(start, here[0], there[0], clock, task.tries, budget, limits.most_time)
    which = free_candidate(one.scene, lib, words, joint, count, scratch)
    if which < 0:
        return
    points.best[j] = points.best[i] + scratch.costs[which]
    points.spent[j] = points.spent[i] + scratch.durations[which]
    points.back[j] = i
    row = scratch.rows[which]
    for n_th in range(4):
        trim = words[row, n_th] if n_th < 3 else scratch.climbs[which]
        points.by_trims[j, n_th] = trim
        points.by_durations[j, n_th] = scratch.times[which, n_th]


@bare_inner_kernel
def unwound(lib: LatticeArrays, task: ImproveTask, word: WordArrays, n: int, points: int) -> int:
    """Write the cheapest path to the last point into `word.new`; its length."""
    j, n_legs = points - 1, 0
    while j > 0:
        word.points.legs[n_legs] = j
        n_legs += 1
        j = word.points.back[j] if word.points.back[j] >= 0 else j - 1
    passed = (
        lib.library.transitions.cost.shape[0] > 1
    )  # trims that last no time, too, are passed through
    size = begun(task, word)
    for leg in range(n_legs - 1, -1, -1):
        j = word.points.legs[leg]
        if word.points.back[j] >= 0:
            for n_th in range(4):
                trim, t = word.points.by_trims[j, n_th], word.points.by_durations[j, n_th]
                if 0 <= trim < lib.library.n_trims and (t > 0.0 or passed):
                    size = append_through(lib, word, size, trim, t)
            if passed:
                size = append_through(lib, word, size, word.now.trims[word.points.owners[j]], 0.0)
            continue
        begin, end = word.points.at[j - 1, TIME], word.points.at[j, TIME]
        first, last = word.points.owners[j - 1], word.points.owners[j]
        for k in range(first, last + 1):
            t = min(word.ends[k], end) - max(word.times[k], begin)
            if k > first:
                size = append_after(lib, word, size, k, t)
            else:
                size = append_through(lib, word, size, word.now.trims[k], t)
    return ended(task, word, n, size)


@bare_kernel
def begin_program(one: Improving, times: Array) -> float:
    """Cut the word at some times, rising from its begin to its end, all of them within coasts.

    Returns its cost. The points are then joined, in order, by `join_points`, and `take_program`
    makes the word the cheapest path through them: in parts, so that a deadline can end it.
    """
    lib, word = one.library, one.word
    n = word.length[0]
    unroll(lib, word, n)
    put_points(lib, word, n, times)
    return whole_cost(one, word.now, n)


@bare_kernel
def join_points(one: Improving, first: int, points: int, n_words: int, gain: float) -> None:
    """Find the cheapest paths to the points from `first` to before `points`.

    Connections are the first `n_words` words of the library. One has to save at least `gain`
    against the path along the word.
    """
    # Forwards over the points: the cheapest path to each earlier one is final.
    lib, task, word = one.library, one.task, one.word
    for j in range(first, min(points, word.points.at.shape[0])):
        word.points.best[j] = word.points.best[j - 1] + price_along(one, j)
        word.points.spent[j] = (
            word.points.spent[j - 1] + word.points.at[j, TIME] - word.points.at[j - 1, TIME]
        )
        words, tried = lib.library.tried.words, n_words
        if task.free_heading and j == word.points.at.shape[0] - 1:
            words, tried = lib.library.tried.free_words, lib.library.tried.free_words.shape[0]
        for i in range(j - 1):
            join(one, words, tried, i, j, gain)


@bare_kernel
def take_program(one: Improving, cost: float) -> None:
    """Make the word the cheapest path through its points; as it is where that gains nothing."""
    lib, task, word = one.library, one.task, one.word
    n = word.length[0]
    size = unwound(lib, task, word, n, word.points.at.shape[0])
    if not admitted(lib, task, word, size):
        return
    new_cost = whole_cost(one, word.new, size)
    if not new_cost < cost - GAIN * cost:
        return
    # Trims that stay are driven at other times: among moving obstacles all is proven once more.
    moves = one.scene.layers.moving.speed.shape[0] > 0
    if not moves or still_free(one, size, 0.0):
        take(word, size)
