"""Words with one free time: scan it, bracket the roots, and halve the brackets.

What vanishes at an optimum (the reduced gradient) or at a solution (a linear condition) is
bracketed between neighbouring nodes; Newton refines it later. Both branches of the closed form
are continuous, so a change of sign is a root.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, inner_kernel
from maneuver_automaton.search._kernels_cell_costs import (
    ClosedForm,
    closed_form,
    has_bounds,
    least_costs,
    mark_cheap_cells,
)
from maneuver_automaton.search._kernels_cell_turns import TINY
from maneuver_automaton.search._kernels_problem import (
    Candidates,
    WordProblem,
    condition,
    word_extra,
)
from maneuver_automaton.search._kernels_scan_costs import (
    affordable,
    coasting_cost,
    may_be_cheap,
    nearly_cheap,
)
from maneuver_automaton.search._kernels_triple import (
    FreeTime,
    evaluate,
    levels,
    solve_triple,
    take_branch,
    unwrap,
    with_free_time,
)
from maneuver_automaton.words._kernels_times import assign


@inner_kernel
def scan_one(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    upper_bound: float,
) -> None:
    """Words with one free time: roots of a scalar function along both branches."""
    q = 6 - triple[0] - triple[1] - triple[2]
    m = problem.library.targets.size
    reach = affordable(problem, word, n, word[q], upper_bound)
    if not reach > 0.0:
        return
    nodes = max(8, math.ceil(problem.scan.nodes * reach / problem.trims.reaches[word[q]]))
    # cells between nodes in which a branch may be cheap enough: the others have no solution that
    # counts, and most words have none of these
    live = np.ones((2, nodes), dtype=np.bool_)
    known = closed_form(problem, word, triple, q)
    cheap = np.inf  # what its trims may cost
    if m == 0 and upper_bound < np.inf and has_bounds(problem, word, triple, q):
        cheap = upper_bound + TINY * (1.0 + abs(upper_bound))
        cheap -= problem.terms.pad_cost + word_extra(problem, word, n)
        if not mark_cheap_cells(known, reach, cheap, live):
            return
    four = with_free_time(problem, word, n, triple)
    needed = np.zeros((2, nodes + 1), dtype=np.bool_)  # a cell's nodes, and one on either side
    for branch in range(2):
        for j in range(nodes):
            if live[branch, j]:
                for k in range(max(j - 1, 0), min(j + 2, nodes) + 1):
                    needed[branch, k] = True
    times = np.zeros(n)
    there = np.zeros((2, nodes + 1), dtype=np.bool_)
    node_times = np.zeros((2, nodes + 1, n))
    node_values = np.zeros((2, nodes + 1))
    costs = np.zeros((2, nodes + 1))
    steering = (
        problem.library.twists,
        problem.library.goal,
        problem.scan.tolerance,
        candidates.counter,
    )
    most = nearly_cheap(problem, word, n, upper_bound)
    for j in range(nodes + 1):
        if not (needed[0, j] or needed[1, j]):
            continue
        times[q] = reach * j / nodes
        solve_triple(steering, word, n, triple, times, four.both)
        for branch in range(2):
            if not needed[branch, j]:
                continue
            costs[branch, j] = coasting_cost(problem, word, triple, q, times[q], four.both[branch])
            value = take_branch(problem, four, branch, times)
            if not math.isnan(value):
                there[branch, j] = True
                assign(node_times[branch, j], times)
                if m == 0:
                    node_values[branch, j] = value
                elif j > 0 and there[branch, j - 1]:  # continuous from node to node
                    unwrap(problem, word, triple, node_times[branch, j - 1], times)
                    step = condition(problem, word, n, m - 1, times)
                    step -= condition(problem, word, n, m - 1, node_times[branch, j - 1])
                    node_values[branch, j] = node_values[branch, j - 1] + step
                else:
                    node_values[branch, j] = condition(problem, word, n, m - 1, times)
    ends = np.full(nodes, math.nan)  # free times at which branches end, where they do in a cell
    stack = (np.zeros((24, n)), np.zeros((24, n)), np.zeros((24, 4)))
    for branch in range(2):
        for j in range(nodes):
            if not live[branch, j]:
                continue
            if not may_be_cheap(costs[branch, j], costs[branch, j + 1], most):
                continue
            if not (there[branch, j] or there[branch, j + 1]):
                continue
            bend = np.inf
            if j > 0 and j + 2 <= nodes and there[branch, j] and there[branch, j + 1]:
                bend = 0.0
                for k in range(j, j + 2):
                    if there[branch, k - 1] and there[branch, k + 1]:
                        second = node_values[branch, k - 1] - 2.0 * node_values[branch, k]
                        bend = max(bend, 0.5 * abs(second + node_values[branch, k + 1]))
                    else:
                        bend = np.inf
            low, high, numbers = stack
            assign(low[0], node_times[branch, j])
            assign(high[0], node_times[branch, j + 1])
            low[0, q], high[0, q] = reach * j / nodes, reach * (j + 1) / nodes
            numbers[0, 0], numbers[0, 1] = node_values[branch, j], node_values[branch, j + 1]
            numbers[0, 2], numbers[0, 3] = bend, 0.0
            here, beyond = (j, j + 1) if there[branch, j] else (j + 1, j)
            if not there[branch, beyond]:  # both branches end in between, where they meet
                if math.isnan(ends[j]):
                    between = reach * here / nodes, reach * beyond / nodes
                    ends[j] = end_of_branches(problem, candidates, four, between, branch)
                edge = high[0] if beyond > here else low[0]
                edge[q] = ends[j]
                numbers[0, beyond - j] = evaluate(problem, candidates, four, edge, branch)
            bisect(problem, candidates, four, branch, stack, known, cheap)


@inner_kernel
def end_of_branches(
    problem: WordProblem,
    candidates: Candidates,
    four: FreeTime,
    between: tuple[float, float],
    branch: int,
) -> float:
    """How far both branches go from a free time with solutions towards one without."""
    good, beyond = between
    times = np.empty(four.n)
    for _ in range(30):
        times[four.q] = 0.5 * (good + beyond)
        if math.isnan(evaluate(problem, candidates, four, times, branch)):
            beyond = times[four.q]
        else:
            good = times[four.q]
    return good


@inner_kernel
def bisect(
    problem: WordProblem,
    candidates: Candidates,
    four: FreeTime,
    branch: int,
    stack: tuple[Array, Array, Array],
    known: ClosedForm,
    cheap: float,
) -> None:
    """Halve the interval on the stack if below `cheap` and bent enough for roots; propose these."""
    lows, highs, numbers = stack
    word, n, triple, q = four.word, four.n, four.triple, four.q
    m = problem.library.targets.size
    middle = np.empty(n)
    ends = np.empty((2, n))
    span = np.empty((m, 2))
    top = 0
    while top >= 0:
        low, high = lows[top], highs[top]
        value_low, value_high, bend, depth = (
            numbers[top, 0], numbers[top, 1], numbers[top, 2], numbers[top, 3],
        )  # fmt: skip
        top -= 1
        if cheap < np.inf and least_costs(known, low[q], high[q])[branch] > cheap:
            continue
        for i in range(n):
            middle[i] = 0.5 * (low[i] + high[i])
        if m == 0:
            change = abs(value_high - value_low)
            possible = min(abs(value_low), abs(value_high)) <= bend or value_low * value_high <= 0.0
            if max(abs(value_low), abs(value_high)) < 1e-9:
                possible = False  # flat: all these times cost the same
            settled = bend <= 0.5 * change
            if possible and settled and value_low < 0.0 <= value_high:
                ends_of_root = (low[q], value_low, high[q], value_high)
                secant(problem, candidates, four, branch, ends_of_root, middle, span)
        else:
            unwrap(problem, word, triple, low, high)
            at_low = condition(problem, word, n, m - 1, low)
            at_high = condition(problem, word, n, m - 1, high)
            change = abs(at_high - at_low)
            wide = bend if bend < np.inf else 1e300
            span[0, 0], span[0, 1] = min(at_low, at_high) - wide, max(at_low, at_high) + wide
            for i in range(n):
                middle[i] = 0.5 * (low[i] + high[i])
            settled = bend <= 0.5 * change
            before = candidates.counter[0]
            for i in range(n):
                ends[0, i], ends[1, i] = min(low[i], high[i]), max(low[i], high[i])
            levels(problem, candidates, word, n, middle, ends[0], ends[1], span)
            possible = candidates.counter[0] > before
            if bend > 0.0:  # that was with room for the bend: only what is left counts
                candidates.counter[0] = before
                if possible and (settled or depth >= 8.0):
                    span[0, 0], span[0, 1] = min(at_low, at_high), max(at_low, at_high)
                    levels(problem, candidates, word, n, middle, ends[0], ends[1], span)
        if not possible or depth >= 8.0 or (settled and bend <= 0.25 * change):
            continue
        middle[q] = 0.5 * (low[q] + high[q])
        value = evaluate(problem, candidates, four, middle, branch)
        if math.isnan(value):
            continue
        if m == 0:
            off = abs(value - 0.5 * (value_low + value_high))
        else:
            unwrap(problem, word, triple, low, middle)
            off = abs(condition(problem, word, n, m - 1, middle) - 0.5 * (at_low + at_high))
        # upper half first onto the stack: it overwrites the interval that was taken off
        assign(lows[top + 2], middle)
        assign(highs[top + 2], high)
        assign(highs[top + 1], middle)
        numbers[top + 2, 0], numbers[top + 2, 1] = value, value_high
        numbers[top + 1, 0], numbers[top + 1, 1] = value_low, value
        for k in range(1, 3):
            numbers[top + k, 2], numbers[top + k, 3] = off, depth + 1.0
        top += 2


@bare_inner_kernel
def secant(
    problem: WordProblem,
    candidates: Candidates,
    four: FreeTime,
    branch: int,
    ends: tuple[float, float, float, float],
    middle: Array,
    span: Array,
) -> None:
    """Narrow down where the reduced gradient rises through zero, and propose it."""
    q = four.q
    left, value_low, right, value_high = ends
    for step in range(12):
        share = 0.5
        if step % 3 != 2 and value_high > value_low:
            share = min(0.9, max(0.1, -value_low / (value_high - value_low)))
        middle[q] = left + share * (right - left)
        value = evaluate(problem, candidates, four, middle, branch)
        if math.isnan(value):
            return
        if value < 0.0:
            left, value_low = middle[q], value
        else:
            right, value_high = middle[q], value
        if right - left < 1e-3:
            break
    levels(problem, candidates, four.word, four.n, middle, middle, middle, span)
