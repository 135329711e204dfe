"""Runs of two trims that chatter, a b a b ...: replaced by the trim between them, or shortened.

A vehicle whose library lacks the trim that it needs alternates between two others, the faster the
better.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search._kernels_changes import simplify, solve_word
from maneuver_automaton.search._kernels_price import price_of_row, price_positions, word_multipliers
from maneuver_automaton.words._kernels_times import assign, end_and_columns


@inner_kernel
def alternating_run(word: IntArray, n: int, after: int) -> tuple[int, int]:
    """First run a b a ... of at least three at position `after` or later: (start, end)."""
    for i in range(after, n - 2):
        end = i + 2
        while end < n and word[end] == word[end - 2]:
            end += 1
        if end - i >= 3:
            return i, end
    return n, n


@inner_kernel
def replace_runs(
    twists: Array,
    rates: Array,
    goal: Array,
    rows: Array,
    targets: Array,
    n_priced: int,
    free_tail: int,
    word: IntArray,
    times: Array,
    n: int,
    cost: float,
    most: int,
) -> tuple[int, float]:
    """Replace two trims that chatter by the one between them, if that is cheaper; (length, cost).

    Tried are the trims whose reduced cost in the middle of the run is nearest to zero.
    """
    trial = np.empty(word.size, dtype=np.int64)
    trial_times = np.empty(word.size)
    tried = np.empty(n_priced, dtype=np.bool_)
    after = 0
    while True:
        start, end = alternating_run(word, n - free_tail, after)
        if start >= n - free_tail:
            return n, cost
        p = word_multipliers(twists, rates, rows, word, times, n)
        some = np.empty((n, 4))
        for i in range(n):
            assign(some[i], twists[word[i]])
        columns = np.empty((n, 3))
        end_x, end_y, _ = end_and_columns(some, times[:n], columns)
        x, y, heading, total = 0.0, 0.0, 0.0, 0.0
        for i in range(end):
            share = 1.0
            if i >= start:
                total += times[i]
            if i == (start + end) // 2:
                share = 0.5
            if i <= (start + end) // 2:
                dx, dy, dh = coast(some[i, 0], some[i, 1], some[i, 2], share * times[i])
                x, y, heading = compose(x, y, heading, dx, dy, dh)
        c, s = math.cos(heading), math.sin(heading)
        a = p[0] * c + p[1] * s
        b = p[1] * c - p[0] * s
        turn = p[2] - p[0] * (end_y - y) + p[1] * (end_x - x)
        for j in range(n_priced):
            tried[j] = j == word[start] or j == word[start + 1]
        replaced = False
        for _attempt in range(4):
            nearest, between = np.inf, -1
            for j in range(n_priced):
                if not tried[j]:
                    value = abs(
                        rates[j]
                        + price_of_row(rows, p, j)
                        + twists[j, 0] * a
                        + twists[j, 1] * b
                        + twists[j, 2] * turn
                    )
                    if value < nearest:
                        nearest, between = value, j
            if between < 0:
                break
            tried[between] = True
            length = 0
            for i in range(n):
                if i < start or i >= end:
                    trial[length], trial_times[length] = word[i], times[i]
                    length += 1
                elif i == start:  # the outer two may stay, the rest gives way
                    trial[length], trial_times[length] = word[start], 0.5 * times[start]
                    trial[length + 1], trial_times[length + 1] = between, total
                    trial[length + 2], trial_times[length + 2] = (
                        word[end - 1], 0.5 * times[end - 1],
                    )  # fmt: skip
                    length += 3
            status, trial_cost, _p = solve_word(
                twists, rates, goal, rows, targets, trial, trial_times, length, 1e-3
            )
            if status == 2:
                continue
            length = simplify(twists, trial, trial_times, length, free_tail)
            if trial_cost < cost - 1e-12 * (1.0 + abs(cost)) and length - free_tail <= most:
                n, cost = length, trial_cost
                for i in range(n):
                    word[i], times[i] = trial[i], trial_times[i]
                replaced = True
                break
        after = 0 if replaced else end - 1


@inner_kernel
def calm(
    twists: Array,
    rates: Array,
    goal: Array,
    rows: Array,
    targets: Array,
    free_tail: int,
    word: IntArray,
    times: Array,
    n: int,
    cost: float,
) -> tuple[int, float]:
    """Shorten runs of two trims that chatter to a b a or a b a b, at next to no cost.

    Where the trim between the two is missing, ever more switches gain ever less: the infimum is
    no plan. Returns (length, cost).
    """
    trial = np.empty(word.size, dtype=np.int64)
    trial_times = np.empty(word.size)
    after = 0
    while True:
        start, end = alternating_run(word, n - free_tail, after)
        if start >= n - free_tail:
            return n, cost
        after = end - 1
        if end - start < 5:
            continue
        kept = 3 if (end - start) % 2 == 1 else 4
        first, second = 0.0, 0.0  # time of the two trims, the outermost left out
        for i in range(start + 1, end - 1):
            if (i - start) % 2 == 0:
                first += times[i]
            else:
                second += times[i]
        length = 0
        for i in range(n):
            if start < i < end and i - start >= kept:
                continue
            trial[length], trial_times[length] = word[i], times[i]
            if i == start:
                trial_times[length] = times[start] + 0.5 * first
            elif i == start + 1:
                trial_times[length] = second if kept == 3 else 0.5 * second
            elif i == start + 2:
                trial_times[length] = 0.5 * first + (times[end - 1] if kept == 3 else 0.0)
            elif i == start + 3 and kept == 4:
                trial_times[length] = times[end - 1] + 0.5 * second
            length += 1
        status, trial_cost, _p = solve_word(
            twists, rates, goal, rows, targets, trial, trial_times, length, 1e-3
        )
        if status != 0 or trial_cost > cost + 1e-3 * (1.0 + abs(cost)):
            continue
        n, cost = simplify(twists, trial, trial_times, length, free_tail), trial_cost
        for i in range(n):
            word[i], times[i] = trial[i], trial_times[i]
        after = 0


@kernel
def calm_word(
    twists: Array,
    rates: Array,
    goal: Array,
    rows: Array,
    targets: Array,
    n_priced: int,
    free_tail: int,
    word: IntArray,
    times: Array,
    n: int,
    cost: float,
) -> tuple[int, float, float]:
    """`calm`, and the smallest reduced cost then; (length, cost, smallest reduced cost)."""
    n, cost = calm(twists, rates, goal, rows, targets, free_tail, word, times, n, cost)
    p = word_multipliers(twists, rates, rows, word, times, n)
    values = np.empty(word.size)
    trims = np.empty(word.size, dtype=np.int64)
    moments = np.empty(word.size)
    k = price_positions(
        twists, rates, rows, n_priced, word, times, n - free_tail, p, values, trims, moments
    )
    return n, cost, values[k]
