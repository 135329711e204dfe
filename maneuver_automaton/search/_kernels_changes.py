"""Changes of one word in place: trims inserted and dropped, its times solved again."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import inner_kernel
from maneuver_automaton.words._kernels_solve import solve_from
from maneuver_automaton.words._kernels_times import (
    assign,
    end_and_columns,
    jacobian,
    least_squares,
    newton_feasible,
)


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
    twists: Array,
    rates: Array,
    goal: Array,
    rows: Array,
    targets: Array,
    word: IntArray,
    times: Array,
    n: int,
    barrier: float,
) -> tuple[int, float, Array]:
    """Best times of a word, in place; (status, cost, multipliers)."""
    m = targets.size
    some = np.empty((n, 4))
    some_rates = np.empty(n)
    some_rows = np.empty((m, n))
    some_times = np.empty(n)
    for i in range(n):
        assign(some[i], twists[word[i]])
        some_rates[i] = rates[word[i]]
        some_times[i] = times[i]
        for r in range(m):
            some_rows[r, i] = rows[r, word[i]]
    status, p, _slope = solve_from(some_rates, some, goal, some_rows, targets, some_times, barrier)
    cost = 0.0
    for i in range(n):
        times[i] = some_times[i]
        cost += some_rates[i] * some_times[i]
    return status, cost, p


@inner_kernel
def refine(
    twists: Array,
    rates: Array,
    goal: Array,
    rows: Array,
    targets: Array,
    word: IntArray,
    times: Array,
    n: int,
    cost: float,
) -> float:
    """Bring the end back to the goal after trims of next to no time were dropped; the cost."""
    m = targets.size
    some = np.empty((n, 4))
    some_rows = np.empty((m, n))
    refined = np.empty(n)
    for i in range(n):
        assign(some[i], twists[word[i]])
        refined[i] = times[i]
        for r in range(m):
            some_rows[r, i] = rows[r, word[i]]
    worst = newton_feasible(some, goal, some_rows, targets, refined, 10)
    after = 0.0
    for i in range(n):
        if refined[i] < 0.0:
            worst = np.inf
        after += rates[word[i]] * refined[i]
    if worst > 1e-10:
        return cost
    for i in range(n):
        times[i] = refined[i]
    return after


@inner_kernel
def lengthen(
    twists: Array,
    goal: Array,
    rows: Array,
    targets: Array,
    word: IntArray,
    times: Array,
    n: int,
    grown: int,
    share: float,
) -> float:
    """Give the trim at position `grown` some time and let the others make room, in place.

    The first-order change of the times that keeps the end where it is, `share` of the way to the
    first time that vanishes, then Newton back to the goal. Returns the cost-free violation.
    """
    m = targets.size
    some = np.empty((n, 4))
    some_rows = np.empty((m, n))
    for i in range(n):
        assign(some[i], twists[word[i]])
        for r in range(m):
            some_rows[r, i] = rows[r, word[i]]
    columns = np.empty((n, 3))
    end_and_columns(some, times[:n], columns)
    matrix = jacobian(columns, some_rows)
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
        if some[i, 2] != 0.0:
            longest = min(
                longest, 1.0 / abs(some[i, 2] * direction[i]) if direction[i] != 0.0 else 1.0
            )
    moved = np.empty(n)
    for i in range(n):
        moved[i] = times[i] + share * longest * direction[i]
    worst = newton_feasible(some, goal, some_rows, targets, moved, 10)
    for i in range(n):
        if moved[i] < 0.0:
            worst = np.inf
        times[i] = moved[i]
    return worst
