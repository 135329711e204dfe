"""Whole turns, which the closed form of a turning time leaves open."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel
from maneuver_automaton.search._kernels_problem import Candidates, WordProblem, propose, time_left


@bare_inner_kernel
def unwrap(
    problem: WordProblem, word: IntArray, triple: IntArray, reference: Array, times: Array
) -> None:
    """Shift the solved turning times by whole turns to lie nearest to `reference`, in place."""
    for s in range(3):
        i = triple[s]
        period = problem.periods[word[i]]
        if period < np.inf:
            times[i] -= period * round((times[i] - reference[i]) / period)


@bare_inner_kernel
def levels(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    start: Array,
    low: Array,
    high: Array,
    span: Array,
) -> None:
    """Propose `start` for all whole turns with which the linear conditions can be met.

    `low` and `high` bound the times in a cell, unwrapped; `span` (m, 2) the conditions' values.
    """
    m = problem.targets.size
    shifts, first, last = candidates.turns[0], candidates.turns[1], candidates.turns[2]
    times = candidates.work
    for i in range(n):
        first[i], last[i] = 0, 0
        period = problem.periods[word[i]]
        if period < np.inf:
            first[i] = -math.floor(high[i] / period)
            last[i] = 1 if low[i] <= 1e-9 else 0
            if problem.more_turns == 1 and m > 0:
                most = (
                    2 if time_left(problem) == np.inf else math.floor(time_left(problem) / period)
                )
                last[i] += int(most)
            last[i] = max(last[i], first[i])
        shifts[i] = first[i]
    while True:
        inside = True
        for i in range(n):
            times[i] = start[i]
            if shifts[i] != 0:
                times[i] += shifts[i] * problem.periods[word[i]]
            if times[i] + (high[i] - low[i]) <= 0.0:
                inside = False
        for r in range(m):
            shift = 0.0
            for i in range(n):
                if shifts[i] != 0:
                    shift += shifts[i] * problem.periods[word[i]] * problem.rows[r, word[i]]
            if not span[r, 0] <= problem.targets[r] - shift <= span[r, 1]:
                inside = False
        if inside:
            propose(problem, candidates, word, n, times)
        k = 0
        while k < n:
            shifts[k] += 1
            if shifts[k] <= last[k]:
                break
            shifts[k] = first[k]
            k += 1
        if k == n:
            return
