"""From a rough start to a solution: refined to machine precision, checked, recorded once."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.search._kernels_problem import word_extra
from maneuver_automaton.words._kernels_times import (
    assign,
    curvature,
    newton_feasible,
    newton_stationary,
)

MOMENT = 1e-6  # of the whole time: shorter trims may be due to rounding


@inner_kernel
def place(found, word, n, times, cost):
    """Record a solution unless the same one is there; keep the list of best costs."""
    count = found.counter[0]
    for k in range(min(count, found.words.shape[0])):
        if abs(found.costs[k] - cost) <= 1e-7 * (1.0 + abs(cost)):
            same = True
            for i in range(found.words.shape[1]):
                w = word[i] if i < n else -1
                if found.words[k, i] != w:
                    same = False
                    break
                if i < n and abs(found.times[k, i] - times[i]) > 1e-6 * (1.0 + times[i]):
                    same = False
                    break
            if same:
                return
    if count < found.words.shape[0]:
        for i in range(found.words.shape[1]):
            found.words[count, i] = word[i] if i < n else -1
            found.times[count, i] = times[i] if i < n else 0.0
        found.costs[count] = cost
    found.counter[0] = count + 1
    k = found.best.size
    if cost < found.best[k - 1]:
        k -= 1
        while k > 0 and found.best[k - 1] > cost:
            found.best[k] = found.best[k - 1]
            k -= 1
        found.best[k] = cost


@inner_kernel
def accept(problem, found, word, n, times, max_trims):
    """Check a polished solution against all limits, and record it."""
    total = 0.0
    cost = 0.0
    trims = 0
    for i in range(n):
        if times[i] <= 1e-9:
            return
        if problem.more_turns == 0 and times[i] > problem.periods[word[i]] * (1.0 + 1e-9):
            return
        if problem.weights[word[i]] > 0.0:
            if times[i] < problem.shortest - 1e-9:
                return
            trims += 1
            total += times[i]
            cost += times[i] * problem.rates[word[i]]
    if total > problem.time_limit + 1e-9:
        return
    padded = 0
    if problem.pad == 1:
        cost += problem.pad_cost
        if problem.time_limit - total > 1e-9:
            padded = 1
    if trims + padded > max_trims:
        return
    cost += word_extra(problem, word, trims) + problem.switch * padded
    place(found, word, n, times, cost)


@inner_kernel
def accept_with_turns(problem, found, word, n, times, max_trims):
    """Record a solution and, where admitted, the same with whole extra turns."""
    accept(problem, found, word, n, times, max_trims)
    if problem.more_turns == 0 or problem.time_limit == np.inf or problem.targets.size > 0:
        return
    total = 0.0
    shortest = np.inf
    for i in range(n):
        total += problem.weights[word[i]] * times[i]
        shortest = min(shortest, problem.periods[word[i]])
    if total + shortest > problem.time_limit + 1e-9:
        return
    extra = np.zeros(n, dtype=np.int64)
    longer = np.empty(n)
    while True:  # an odometer over the numbers of extra turns
        k = 0
        while k < n:
            extra[k] += 1
            total = 0.0
            for i in range(n):
                longer[i] = times[i]
                if extra[i] > 0 and problem.weights[word[i]] > 0.0:
                    longer[i] += extra[i] * problem.periods[word[i]]
                total += problem.weights[word[i]] * longer[i]
            if total <= problem.time_limit + 1e-9 and problem.weights[word[k]] > 0.0:
                break
            extra[k] = 0
            k += 1
        if k == n:
            return
        accept(problem, found, word, n, longer, max_trims)


@inner_kernel
def polish(problem, found, word, n, times, isolated, max_trims):
    """Refine times to machine precision, check that they are locally optimal, and record them."""
    m = problem.targets.size
    twists = np.empty((n, 4))
    rates = np.empty(n)
    rows = np.empty((m, n))
    for i in range(n):
        assign(twists[i], problem.twists[word[i]])
        rates[i] = problem.rates[word[i]]
        for r in range(m):
            rows[r, i] = problem.rows[r, word[i]]
    if isolated == 0:
        p, worst, slope = newton_stationary(
            rates, twists, problem.goal, rows, problem.targets, times, 30
        )
        if not (worst < 1e-10 and slope < 1e-8):
            return
        for i in range(n):
            if times[i] <= 1e-9:
                return
        if not curvature(rates, twists, problem.goal, rows, problem.targets, times, p) > 1e-10:
            return
    worst = newton_feasible(twists, problem.goal, rows, problem.targets, times, 8)
    if worst < 1e-10 and not is_neighbour(problem, twists, rows, n, times):
        accept_with_turns(problem, found, word, n, times, max_trims)


@inner_kernel
def is_neighbour(problem, twists, rows, n, times):
    """Whether a solution is one with a trim less, which rounding gives a moment.

    Where the conditions are tangent, times wrong by the root of the rounding error meet them to
    the last bit. The word without its shortest trim then meets them as well.
    """
    total = 0.0
    k = 0
    for i in range(n):
        total += times[i]
        if times[i] < times[k]:
            k = i
    if n < 2 or times[k] > MOMENT * total:
        return False
    m = rows.shape[0]
    fewer = np.empty((n - 1, 4))
    fewer_rows = np.empty((m, n - 1))
    left = np.empty(n - 1)
    for i in range(n - 1):
        source = i if i < k else i + 1
        assign(fewer[i], twists[source])
        left[i] = times[source]
        for r in range(m):
            fewer_rows[r, i] = rows[r, source]
    worst = newton_feasible(fewer, problem.goal, fewer_rows, problem.targets, left, 8)
    return worst < 1e-13 * (1.0 + abs(problem.goal[0]) + abs(problem.goal[1]))


@kernel
def polish_candidates(problem, candidates, found, max_trims):
    """Polish all candidates in order, and empty their buffer."""
    for k in range(min(candidates.counter[0], candidates.words.shape[0])):
        n = candidates.sizes[k]
        times = np.empty(n)
        for i in range(n):
            times[i] = candidates.times[k, i]
        polish(problem, found, candidates.words[k], n, times, candidates.isolated[k], max_trims)
    candidates.counter[0] = 0
