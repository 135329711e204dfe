"""Insertion: price every trim of a library at every moment of a plan, and insert what pays.

The prices are those of `_kernels_price`. A trim is inserted for no time, and the times of all are
solved again, until nothing pays.
"""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import kernel
from maneuver_automaton.search._kernels_changes import (
    insert_at,
    lengthen,
    refine,
    simplify,
    solve_word,
)
from maneuver_automaton.search._kernels_chatter import replace_runs
from maneuver_automaton.search._kernels_price import price_positions, word_multipliers


@kernel
def improve_word(
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
    most: int,
    accuracy: float,
    rounds: int,
) -> tuple[int, float, float, int]:
    """Insert what pays and solve the times again until nothing pays; `word`, `times` in place.

    Returns (length, cost, smallest reduced cost, rounds used). A round that gains nothing, or
    that exceeds `most` trims, ends it with what was there before.
    """
    trial = np.empty(word.size, dtype=np.int64)
    trial_times = np.empty(word.size)
    status, cost, p = solve_word(twists, rates, goal, rows, targets, word, times, n, 1e-3)
    if status == 2:
        return n, np.inf, -np.inf, 0
    n = simplify(twists, word, times, n, free_tail)
    least, is_priced = -np.inf, False
    used = 0
    values = np.empty(word.size)
    trims = np.empty(word.size, dtype=np.int64)
    moments = np.empty(word.size)
    while used < rounds:
        p = word_multipliers(twists, rates, rows, word, times, n)
        free = n - free_tail
        k = price_positions(
            twists, rates, rows, n_priced, word, times, free, p, values, trims, moments
        )
        least, is_priced = values[k], True
        if least >= -accuracy:
            break
        used += 1
        gained = False
        for attempt in range(9):
            if n + 2 > word.size:
                break
            for i in range(n):
                trial[i], trial_times[i] = word[i], times[i]
            length = n
            if attempt == 0:  # all at once that pay nearly as much
                for i in range(free - 1, -1, -1):
                    if values[i] < 0.3 * least and length + 2 <= min(word.size, most + 2):
                        length = insert_at(trial, trial_times, length, trims[i], i, moments[i])
                if length <= n + 2:
                    continue
            else:
                length = insert_at(trial, trial_times, n, trims[k], k, moments[k])
            barrier = 1e-3
            if attempt > 1:  # a first step along the tangent, shorter and shorter
                grown = k
                while trial_times[grown] != 0.0:
                    grown += 1
                barrier = 1e-5
                share = 0.7 * 0.4**attempt
                violated = lengthen(
                    twists, goal, rows, targets, trial, trial_times, length, grown, share
                )
                if violated > 1e-9:
                    continue
            if attempt < 8:
                status, trial_cost, _p = solve_word(
                    twists, rates, goal, rows, targets, trial, trial_times, length, barrier
                )
                if status == 2:
                    continue
            else:
                trial_cost = 0.0
                for i in range(length):
                    trial_cost += rates[trial[i]] * trial_times[i]
            length = simplify(twists, trial, trial_times, length, free_tail)
            if trial_cost < cost - 1e-11 * (1.0 + abs(cost)) and length - free_tail <= most:
                gained, is_priced = True, False
                n, cost = length, trial_cost
                for i in range(n):
                    word[i], times[i] = trial[i], trial_times[i]
                break
        if not gained or n - free_tail > 5:
            before = cost
            n, cost = replace_runs(
                twists, rates, goal, rows, targets, n_priced, free_tail, word, times, n, cost, most
            )
            is_priced = is_priced and cost == before
            if not gained and cost == before:
                break
    if not is_priced:  # what was gained last is another word, with another certificate
        p = word_multipliers(twists, rates, rows, word, times, n)
        free = n - free_tail
        k = price_positions(
            twists, rates, rows, n_priced, word, times, free, p, values, trims, moments
        )
        least = values[k]
    cost = refine(twists, rates, goal, rows, targets, word, times, n, cost)
    return n, cost, least, used
