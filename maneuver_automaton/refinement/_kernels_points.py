"""Shorten a free word by dynamic programming over its points."""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.refinement._kernels_word import (
    GAIN,
    LENGTH,
    admitted,
    append,
    owner,
    pose_at,
    take,
    unroll,
    word_cost,
)
from maneuver_automaton.search._kernels_motion import free_candidate
from maneuver_automaton.words._kernels_candidates import NO_TRIM, candidates, trim_and_gear


@bare_inner_kernel
def put_points(lib, work, n, points):
    """Fill `work.at` with poses and times of the word, `points` of them at equal times."""
    total = work.times[n]
    for j in range(points):
        time = total * j / (points - 1)
        k = owner(work, n, time)
        x, y, heading, _ = pose_at(lib, work, k, min(time, work.times[k + 1]))
        work.at[j, 0], work.at[j, 1], work.at[j, 2], work.at[j, 3] = x, y, heading, time
        work.best[j] = math.inf
        work.back[j] = -1
    work.best[0] = 0.0


@bare_inner_kernel
def price_along(lib, work, n, j):
    """Price of the word from point `j - 1` to point `j`."""
    begin, end = work.at[j - 1, 3], work.at[j, 3]
    first, last = owner(work, n, begin), owner(work, n, end)
    price = 0.0
    for k in range(first, last + 1):
        low, high = max(work.times[k], begin), min(work.times[k + 1], end)
        price += lib.library.rates[work.trims[k]] * max(high - low, 0.0)
        if k > first:
            price += lib.library.switch
            if lib.library.gears[work.trims[k]] * lib.library.gears[work.trims[k - 1]] < 0:
                price += lib.library.direction_change
    return price


@bare_inner_kernel
def join(lib, task, scene, work, words, i, j, gain):
    """Reach point `j` from point `i` by three trims, if that is cheaper by `gain`, and free."""
    x, y, heading = work.at[i, 0], work.at[i, 1], work.at[i, 2]
    e_x, e_y, e_heading = work.at[j, 0], work.at[j, 1], work.at[j, 2]
    budget = work.best[j] - work.best[i]
    if math.hypot(e_x - x, e_y - y) * task.per_metre >= budget:
        return
    nowhere = trim_and_gear(NO_TRIM, 0)
    count = candidates(
        lib.library,
        words,
        words.shape[0],
        (x, y, heading, 0.0),
        nowhere,
        (e_x, e_y, e_heading, 0.0),
        nowhere,
        budget - gain,
        work.one,
    )
    which = free_candidate(
        scene,
        lib,
        words,
        ((x, y, heading, 0.0), NO_TRIM, NO_TRIM),
        count,
        (task.tries, budget - gain, task.most_time),
        task.clock + work.at[i, 3],
        work.one,
    )
    if which < 0:
        return
    work.best[j] = work.best[i] + work.one.costs[which]
    work.back[j] = i
    row = work.one.rows[which]
    for n_th in range(3):
        work.by_trims[j, n_th] = words[row, n_th]
        work.by_durations[j, n_th] = work.one.times[which, n_th]


@bare_inner_kernel
def unwound(lib, work, n, points):
    """Write the best way to the last point into `work.new_*`; its length."""
    j, n_legs = points - 1, 0
    while j > 0:
        work.legs[n_legs] = j
        n_legs += 1
        j = work.back[j] if work.back[j] >= 0 else j - 1
    size = 0
    for leg in range(n_legs - 1, -1, -1):
        j = work.legs[leg]
        if work.back[j] >= 0:
            for n_th in range(3):
                trim, t = work.by_trims[j, n_th], work.by_durations[j, n_th]
                if t > 0.0 and trim < lib.library.n_trims:
                    size = append(lib, work.new_trims, work.new_durations, size, trim, t)
            continue
        begin, end = work.at[j - 1, 3], work.at[j, 3]
        for k in range(owner(work, n, begin), owner(work, n, end) + 1):
            t = min(work.times[k + 1], end) - max(work.times[k], begin)
            size = append(lib, work.new_trims, work.new_durations, size, work.trims[k], t)
    return size


@bare_kernel
def dynamic_programming(lib, task, scene, work, state, points):
    """Best way over `points` poses of the word, joined by words where that is cheaper.

    Returns the cost. The word changes only if it gains; nothing may move.
    """
    n = state[LENGTH]
    cost = word_cost(lib, work.trims, work.durations, n)
    unroll(lib, work, n)
    if n == 0 or points < 2:
        return cost
    put_points(lib, work, n, points)
    for j in range(1, points):
        work.best[j] = work.best[j - 1] + price_along(lib, work, n, j)
        free_heading = task.free_heading and j == points - 1
        words = lib.library.free_words if free_heading else lib.library.words
        for i in range(j - 1):
            join(lib, task, scene, work, words, i, j, GAIN * cost)
    size = unwound(lib, work, n, points)
    if not admitted(lib, task, work, size):
        return cost
    new_cost = word_cost(lib, work.new_trims, work.new_durations, size)
    if new_cost < cost - GAIN * cost:
        take(work, state, size)
        return new_cost
    return cost
