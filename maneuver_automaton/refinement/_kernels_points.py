"""Shorten a free word by dynamic programming over its points.

Points are states of the word at rising times. A path to a point goes along the word from the point
before, or by a connection from any earlier one. Arrays of `work.Work` with a row a point:

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
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel, inlined_kernel
from maneuver_automaton.refinement._kernels_word import (
    GAIN,
    LENGTH,
    admitted,
    append_after,
    append_through,
    begun,
    ended,
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

X, Y, HEADING, Z, TIME = range(5)  # columns of the points


@bare_inner_kernel
def put_points(lib: LatticeArrays, work: Work, n: int, times: Array) -> None:
    """Fill `work.at` and `work.owners` with the word's states at rising times within its coasts."""
    for j in range(times.shape[0]):
        k = owner(work, n, times[j]) if j > 0 else 0
        time = min(times[j], work.ends[k])
        x, y, heading, z = pose_at(lib, work, k, time)
        work.at[j, X], work.at[j, Y], work.at[j, HEADING], work.at[j, Z] = x, y, heading, z
        work.at[j, TIME], work.owners[j] = time, k
        work.best[j] = math.inf
        work.back[j] = -1
    work.best[0], work.spent[0] = 0.0, 0.0


@bare_inner_kernel
def price_along(lib: LatticeArrays, work: Work, j: int) -> float:
    """Price of the word from point `j - 1` to point `j`."""
    begin, end = work.at[j - 1, TIME], work.at[j, TIME]
    first, last = work.owners[j - 1], work.owners[j]
    price = 0.0
    for k in range(first, last + 1):
        low, high = max(work.times[k], begin), min(work.ends[k], end)
        price += lib.library.rates[work.trims[k]] * max(high - low, 0.0)
        if k > first:
            price += price_of_transition(lib, work, k)
            if lib.library.gears[work.trims[k]] * lib.library.gears[work.trims[k - 1]] < 0:
                price += lib.library.direction_change
    return price


@inlined_kernel
def trim_at(lib: LatticeArrays, work: Work, j: int) -> tuple[int, int]:
    """Trim at a point, as the search for connections is told: any where all are of one class."""
    trim = work.trims[work.owners[j]] if lib.library.transitions.cost.shape[0] > 1 else NO_TRIM
    return trim_and_gear(trim, 0)


@bare_inner_kernel
def join(
    lib: LatticeArrays,
    task: ImproveTask,
    scene: Scene,
    work: Work,
    words: IntArray,
    n_words: int,
    i: int,
    j: int,
    gain: float,
) -> None:
    """Reach point `j` from point `i` by a connection, if that is cheaper by `gain`, and free."""
    start = (work.at[i, X], work.at[i, Y], work.at[i, HEADING], work.at[i, Z])
    goal = (work.at[j, X], work.at[j, Y], work.at[j, HEADING], work.at[j, Z])
    # In the order of their price: the straight line at the least cost per metre, which no path
    # undercuts; words in closed form; the proof that one of them is free.
    budget = work.best[j] - work.best[i]
    if math.hypot(goal[0] - start[0], goal[1] - start[1]) * task.per_metre >= budget:
        return
    here, there = trim_at(lib, work, i), trim_at(lib, work, j)
    count = candidates(
        lib.library, words, n_words, start, here, goal, there, budget - gain, work.one
    )
    which = free_candidate(
        scene,
        lib,
        words,
        (start, here[0], there[0]),
        count,
        (task.tries, budget - gain, task.most_time),
        task.clock + work.spent[i],  # when the cheapest path gets to point i
        work.one,
    )
    if which < 0:
        return
    work.best[j] = work.best[i] + work.one.costs[which]
    work.spent[j] = work.spent[i] + work.one.durations[which]
    work.back[j] = i
    row = work.one.rows[which]
    for n_th in range(4):
        trim = words[row, n_th] if n_th < 3 else work.one.climbs[which]
        work.by_trims[j, n_th] = trim
        work.by_durations[j, n_th] = work.one.times[which, n_th]


@bare_inner_kernel
def unwound(lib: LatticeArrays, task: ImproveTask, work: Work, n: int, points: int) -> int:
    """Write the cheapest path to the last point into `work.new_*`; its length."""
    j, n_legs = points - 1, 0
    while j > 0:
        work.legs[n_legs] = j
        n_legs += 1
        j = work.back[j] if work.back[j] >= 0 else j - 1
    passed = (
        lib.library.transitions.cost.shape[0] > 1
    )  # trims that last no time, too, are passed through
    size = begun(task, work)
    for leg in range(n_legs - 1, -1, -1):
        j = work.legs[leg]
        if work.back[j] >= 0:
            for n_th in range(4):
                trim, t = work.by_trims[j, n_th], work.by_durations[j, n_th]
                if 0 <= trim < lib.library.n_trims and (t > 0.0 or passed):
                    size = append_through(lib, work, size, trim, t)
            if passed:
                size = append_through(lib, work, size, work.trims[work.owners[j]], 0.0)
            continue
        begin, end = work.at[j - 1, TIME], work.at[j, TIME]
        first, last = work.owners[j - 1], work.owners[j]
        for k in range(first, last + 1):
            t = min(work.ends[k], end) - max(work.times[k], begin)
            if k > first:
                size = append_after(lib, work, size, k, t)
            else:
                size = append_through(lib, work, size, work.trims[k], t)
    return ended(task, work, n, size)


@bare_kernel
def begin_program(lib: LatticeArrays, work: Work, state: IntArray, times: Array) -> float:
    """Cut the word at some times, rising from its begin to its end, all of them within coasts.

    Returns its cost. The points are then joined, in order, by `join_points`, and `take_program`
    makes the word the cheapest path through them: in parts, so that a deadline can end it.
    """
    n = state[LENGTH]
    unroll(lib, work, n)
    put_points(lib, work, n, times)
    return word_cost(lib, work.trims, work.durations, work.edges, n)


@bare_kernel
def join_points(
    lib: LatticeArrays,
    task: ImproveTask,
    scene: Scene,
    work: Work,
    first: int,
    points: int,
    n_words: int,
    gain: float,
) -> None:
    """Find the cheapest paths to the points from `first` to before `points`.

    Connections are the first `n_words` words of the library. One has to save at least `gain`
    against the path along the word.
    """
    # Forwards over the points: the cheapest path to each earlier one is final.
    for j in range(first, min(points, work.at.shape[0])):
        work.best[j] = work.best[j - 1] + price_along(lib, work, j)
        work.spent[j] = work.spent[j - 1] + work.at[j, TIME] - work.at[j - 1, TIME]
        words, tried = lib.library.tried.words, n_words
        if task.free_heading and j == work.at.shape[0] - 1:
            words, tried = lib.library.tried.free_words, lib.library.tried.free_words.shape[0]
        for i in range(j - 1):
            join(lib, task, scene, work, words, tried, i, j, gain)


@bare_kernel
def take_program(
    lib: LatticeArrays, task: ImproveTask, scene: Scene, work: Work, state: IntArray, cost: float
) -> None:
    """Make the word the cheapest path through its points; as it is where that gains nothing."""
    n = state[LENGTH]
    size = unwound(lib, task, work, n, work.at.shape[0])
    if not admitted(lib, task, work, size):
        return
    new_cost = word_cost(lib, work.new_trims, work.new_durations, work.new_edges, size)
    if not new_cost < cost - GAIN * cost:
        return
    # Trims that stay are driven at other times: among moving obstacles all is proven once more.
    moves = scene.layers.moving.speed.shape[0] > 0
    if not moves or still_free(lib, task, scene, work, size, 0.0):
        take(work, state, size)
