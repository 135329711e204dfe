"""Insertion: price every trim of a library at every moment of a plan, and insert what pays.

The prices are those of `_kernels_price`. A trim is inserted for no time, and the times of all are
solved again, until nothing pays. A vehicle whose library lacks the trim that it needs alternates
between two others, a b a b ..., the faster the better: such runs are replaced by the trim between
the two, or shortened.

`library` holds all trims; the first `n_priced` of it can be inserted. `word` (S,) are numbers of
them and `times` (S,) how long they last, of which the first n count; the last `free_tail` of these,
0 or 1, are the turn of a free heading.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search._kernels_price import price_of_row, price_positions, word_multipliers
from maneuver_automaton.words._kernels_solve import solve_from
from maneuver_automaton.words._kernels_times import (
    TimesProblem,
    columns_of,
    end_and_columns,
    jacobian,
    least_squares,
    newton_feasible,
)

OUTER = 0.5  # share of its time that either end of a run keeps where a trim replaces the rest


@inner_kernel
def insert_at(word: IntArray, times: Array, n: int, trim: int, position: int, time: float) -> int:
    """Insert a trim for no time into a word, splitting what it interrupts; the new length."""
    if n == 0:
        word[0], times[0] = trim, 0.0
        return 1
    ends = 1e-9 * (1.0 + times[position])
    if time <= ends or time >= times[position] - ends:
        where = position if time <= ends else position + 1
        for i in range(n, where, -1):
            word[i], times[i] = word[i - 1], times[i - 1]
        word[where], times[where] = trim, 0.0
        return n + 1
    for i in range(n + 1, position + 2, -1):
        word[i], times[i] = word[i - 2], times[i - 2]
    word[position + 2], times[position + 2] = word[position], times[position] - time
    word[position + 1], times[position + 1] = trim, 0.0
    times[position] = time
    return n + 2


@inner_kernel
def copy_word(word: IntArray, times: Array, n: int, to_word: IntArray, to_times: Array) -> None:
    """Copy the first `n` trims of a word."""
    for i in range(n):
        to_word[i], to_times[i] = word[i], times[i]


@inner_kernel
def simplify(twists: Array, word: IntArray, times: Array, n: int, free_tail: int) -> int:
    """Drop trims of no time, merge equal neighbours, move rest to the end; the new length."""
    count = 0
    rest_time, rest = 0.0, -1
    kept = n - free_tail
    for i in range(kept):
        if times[i] <= 1e-9:
            continue
        trim = word[i]
        if not (twists[trim, 0] or twists[trim, 1] or twists[trim, 2] or twists[trim, 3]):
            rest_time += times[i]
            rest = trim
        elif count > 0 and word[count - 1] == trim:
            times[count - 1] += times[i]
        else:
            word[count], times[count] = trim, times[i]
            count += 1
    if rest >= 0:
        word[count], times[count] = rest, rest_time
        count += 1
    for i in range(free_tail):
        word[count], times[count] = word[kept + i], times[kept + i]
        count += 1
    return count


@inner_kernel
def solve_word(
    library: TimesProblem, word: IntArray, times: Array, n: int, barrier: float
) -> tuple[int, float]:
    """Best times of a word, in place; (status, cost)."""
    some = columns_of(library, word, n)
    status, _p, _slope = solve_from(some, times[:n], barrier)
    cost = 0.0
    for i in range(n):
        cost += some.rates[i] * times[i]
    return status, cost


@inner_kernel
def refine(library: TimesProblem, word: IntArray, times: Array, n: int, cost: float) -> float:
    """Bring the end back to the goal after trims of next to no time were dropped; the cost."""
    some = columns_of(library, word, n)
    refined = np.empty(n)
    for i in range(n):
        refined[i] = times[i]
    worst = newton_feasible(some, refined, 10)
    after = 0.0
    for i in range(n):
        if refined[i] < 0.0:
            worst = np.inf
        after += some.rates[i] * refined[i]
    if worst > 1e-10:
        return cost
    for i in range(n):
        times[i] = refined[i]
    return after


@inner_kernel
def lengthen(
    library: TimesProblem, word: IntArray, times: Array, n: int, grown: int, share: float
) -> float:
    """Give the trim at position `grown` time, the others making room; the violation left."""
    # The first-order change of the times that keeps the end where it is, `share` of the way to the
    # first time that vanishes, then Newton back to the goal.
    m = library.targets.size
    some = columns_of(library, word, n)
    columns = np.empty((n, 3))
    end_and_columns(some.twists, times[:n], columns)
    matrix = jacobian(columns, some.rows)
    others = np.empty((3 + m, n))
    rhs = np.empty(3 + m)
    for e in range(3 + m):
        rhs[e] = -matrix[e, grown]
        for i in range(n):
            others[e, i] = 0.0 if i == grown else matrix[e, i]
    direction, _rank = least_squares(others, rhs, 1e-11)
    direction[grown] = 1.0
    longest = 1.0
    for i in range(n):
        if direction[i] < 0.0:
            longest = min(longest, -times[i] / direction[i])
        turned = abs(some.twists[i, 2] * direction[i])
        if turned > 0.0:  # a radian at most: the tangent bears no more
            longest = min(longest, 1.0 / turned)
    moved = np.empty(n)
    for i in range(n):
        moved[i] = times[i] + share * longest * direction[i]
    worst = newton_feasible(some, moved, 10)
    for i in range(n):
        if moved[i] < 0.0:
            worst = np.inf
        times[i] = moved[i]
    return worst


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
    library: TimesProblem,
    n_priced: int,
    free_tail: int,
    word: IntArray,
    times: Array,
    n: int,
    cost: float,
    most: int,
) -> tuple[int, float]:
    """Replace two trims that alternate by the one between them, if cheaper; (length, cost)."""
    # Tried are the trims whose reduced cost in the middle of the run is nearest to zero.
    trial = np.empty(word.size, dtype=np.int64)
    trial_times = np.empty(word.size)
    tried = np.empty(n_priced, dtype=np.bool_)
    after = 0
    while True:
        start, end = alternating_run(word, n - free_tail, after)
        if start >= n - free_tail:
            return n, cost
        p = word_multipliers(library, word, times, n)
        some = columns_of(library, word, n).twists
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
                        library.rates[j]
                        + price_of_row(library.rows, p, j)
                        + library.twists[j, 0] * a
                        + library.twists[j, 1] * b
                        + library.twists[j, 2] * turn
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
                    trial[length], trial_times[length] = word[start], OUTER * times[start]
                    trial[length + 1], trial_times[length + 1] = between, total
                    trial[length + 2] = word[end - 1]
                    trial_times[length + 2] = OUTER * times[end - 1]
                    length += 3
            status, trial_cost = solve_word(library, trial, trial_times, length, 1e-3)
            if status == 2:
                continue
            length = simplify(library.twists, trial, trial_times, length, free_tail)
            if trial_cost < cost - 1e-12 * (1.0 + abs(cost)) and length - free_tail <= most:
                n, cost = length, trial_cost
                copy_word(trial, trial_times, n, word, times)
                replaced = True
                break
        after = 0 if replaced else end - 1


@inner_kernel
def shorten_runs(
    library: TimesProblem, free_tail: int, word: IntArray, times: Array, n: int, cost: float
) -> tuple[int, float]:
    """Shorten runs of two trims to a b a or a b a b, at next to no cost; (length, cost)."""
    # Where the trim between the two is missing, ever more switches gain ever less: the infimum is
    # no plan.
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
        status, trial_cost = solve_word(library, trial, trial_times, length, 1e-3)
        if status != 0 or trial_cost > cost + 1e-3 * (1.0 + abs(cost)):
            continue
        n, cost = simplify(library.twists, trial, trial_times, length, free_tail), trial_cost
        copy_word(trial, trial_times, n, word, times)
        after = 0


@kernel
def word_with_short_runs(
    library: TimesProblem,
    n_priced: int,
    free_tail: int,
    word: IntArray,
    times: Array,
    n: int,
    cost: float,
) -> tuple[int, float, float]:
    """`shorten_runs`, and the price then; (length, cost, smallest reduced cost)."""
    n, cost = shorten_runs(library, free_tail, word, times, n, cost)
    p = word_multipliers(library, word, times, n)
    k, values, _, _ = price_positions(library, n_priced, word, times, n - free_tail, p)
    return n, cost, values[k]


@kernel
def improve_word(
    library: TimesProblem,
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
    status, cost = solve_word(library, word, times, n, 1e-3)
    if status == 2:
        return n, np.inf, -np.inf, 0
    n = simplify(library.twists, word, times, n, free_tail)
    least, is_priced = -np.inf, False
    used = 0
    while used < rounds:
        p = word_multipliers(library, word, times, n)
        free = n - free_tail
        k, values, trims, moments = price_positions(library, n_priced, word, times, free, p)
        least, is_priced = values[k], True
        if least >= -accuracy:
            break
        used += 1
        gained = False
        for attempt in range(9):
            if n + 2 > word.size:
                break
            copy_word(word, times, n, trial, trial_times)
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
                violated = lengthen(library, trial, trial_times, length, grown, share)
                if violated > 1e-9:
                    continue
            if attempt < 8:
                status, trial_cost = solve_word(library, trial, trial_times, length, barrier)
                if status == 2:
                    continue
            else:
                trial_cost = 0.0
                for i in range(length):
                    trial_cost += library.rates[trial[i]] * trial_times[i]
            length = simplify(library.twists, trial, trial_times, length, free_tail)
            if trial_cost < cost - 1e-11 * (1.0 + abs(cost)) and length - free_tail <= most:
                gained, is_priced = True, False
                n, cost = length, trial_cost
                copy_word(trial, trial_times, n, word, times)
                break
        if not gained or n - free_tail > 5:
            before = cost
            n, cost = replace_runs(library, n_priced, free_tail, word, times, n, cost, most)
            is_priced = is_priced and cost == before
            if not gained and cost == before:
                break
    if not is_priced:  # what was gained last is another word, with another certificate
        p = word_multipliers(library, word, times, n)
        free = n - free_tail
        k, values, trims, moments = price_positions(library, n_priced, word, times, free, p)
        least = values[k]
    cost = refine(library, word, times, n, cost)
    return n, cost, least, used
