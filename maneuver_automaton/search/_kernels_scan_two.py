"""Words with two free times: scan a grid, and start in the cells where a solution may lie.

What vanishes at an optimum (the reduced gradient) or at a solution (a linear condition) is
looked for between the corners of a cell; Newton refines it later.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import inner_kernel
from maneuver_automaton.search._kernels_problem import Candidates, WordProblem, condition, time_left
from maneuver_automaton.search._kernels_scan_costs import affordable
from maneuver_automaton.search._kernels_triple import scratch_for, solve_triple, take_branch
from maneuver_automaton.search._kernels_turns import levels, unwrap
from maneuver_automaton.words._kernels_times import assign


@inner_kernel
def scan_two(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    free: IntArray,
    upper_bound: float,
) -> None:
    """Words with two free times: cells of a grid in which both functions change sign."""
    reaches = np.empty(2)
    counts = np.empty(2, dtype=np.int64)
    for k in range(2):
        full = problem.reaches[word[free[k]]]
        reaches[k] = affordable(problem, word, n, word[free[k]], upper_bound)
        if not reaches[k] > 0.0:
            return
        counts[k] = max(4, math.ceil(problem.nodes_2d * reaches[k] / full))
    scratch = scratch_for(problem, word, n, 2)
    n_0, n_1 = counts[0] + 1, counts[1] + 1
    there = np.zeros((2, n_0, n_1), dtype=np.bool_)
    node_times = np.zeros((2, n_0, n_1, n))
    node_values = np.zeros((2, n_0, n_1, 2))
    times = np.zeros(n)
    values = np.zeros(2)
    steering = (problem.twists, problem.goal, problem.tolerance, candidates.counter)
    for i in range(n_0):
        for j in range(n_1):
            times[free[0]] = reaches[0] * i / counts[0]
            times[free[1]] = reaches[1] * j / counts[1]
            total = times[free[0]] + times[free[1]]
            if total > time_left(problem) * (1.0 + 2.0 / problem.nodes_2d):
                continue
            solve_triple(steering, word, n, triple, times, scratch[0])
            for branch in range(2):
                if take_branch(problem, word, n, triple, free, branch, scratch, times, values):
                    there[branch, i, j] = True
                    assign(node_times[branch, i, j], times)
                    assign(node_values[branch, i, j], values)
    for branch in range(2):
        for i in range(n_0 - 1):
            for j in range(n_1 - 1):
                cell(
                    problem, candidates, word, n, triple,
                    there[branch], node_times[branch], node_values[branch], i, j,
                )  # fmt: skip


@inner_kernel
def cell(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    there: NDArray[np.bool_],
    node_times: Array,
    node_values: Array,
    i: int,
    j: int,
) -> None:
    """Propose a start in a cell if what must vanish can vanish in it."""
    m = problem.targets.size
    first_i, first_j = -1, -1
    corners = 0
    low_0, high_0 = np.inf, -np.inf
    low_1, high_1 = np.inf, -np.inf
    for di in range(2):
        for dj in range(2):
            if there[i + di, j + dj]:
                corners += 1
                if first_i < 0:
                    first_i, first_j = i + di, j + dj
                low_0 = min(low_0, node_values[i + di, j + dj, 0])
                high_0 = max(high_0, node_values[i + di, j + dj, 0])
                low_1 = min(low_1, node_values[i + di, j + dj, 1])
                high_1 = max(high_1, node_values[i + di, j + dj, 1])
    if corners == 0:
        return
    if corners == 4 and m <= 1 and not low_0 <= 0.0 <= high_0:
        return
    if corners == 4 and m == 0 and not low_1 <= 0.0 <= high_1:
        return
    reference = node_times[first_i, first_j]
    mean = np.zeros(n)
    low = np.empty(n)
    high = np.empty(n)
    times = np.empty(n)
    for k in range(n):
        low[k], high[k] = np.inf, -np.inf
    span = np.empty((m, 2))
    for r in range(m):
        span[r, 0], span[r, 1] = np.inf, -np.inf
    for di in range(2):
        for dj in range(2):
            if there[i + di, j + dj]:
                assign(times, node_times[i + di, j + dj])
                unwrap(problem, word, triple, reference, times)
                for k in range(n):
                    mean[k] += times[k] / corners
                    low[k] = min(low[k], times[k])
                    high[k] = max(high[k], times[k])
                for r in range(m):
                    value = condition(problem, word, n, r, times)
                    span[r, 0] = min(span[r, 0], value)
                    span[r, 1] = max(span[r, 1], value)
    if corners < 4:  # a branch ends here, and bends sharply: look a little further
        for r in range(m):
            width = span[r, 1] - span[r, 0]
            span[r, 0] -= width
            span[r, 1] += width
    levels(problem, candidates, word, n, mean, low, high, span)
