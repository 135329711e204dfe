"""Insertion: price every trim of a library at every moment of a plan, and insert what pays.

The multipliers of the switching-time problem are the price (p_x, p_y, p_turn) of the end pose. A
trim j that is inserted for an instant at the pose (x, y, heading) moves the end by its twist, so
it saves unless ``rate_j + price of time + p_turn(t) w_j + a(t) v_j + b(t) u_j >= 0``. Along a
trim the momentum (a, b, p_turn) moves by the coadjoint action: sines along an arc, straight lines
along a straight. That is Pontryagin's condition over the whole library and all times.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.words._kernels_solve import solve_from
from maneuver_automaton.words._kernels_times import (
    assign,
    end_and_columns,
    jacobian,
    least_squares,
    multipliers,
    newton_feasible,
)

if TYPE_CHECKING:
    from maneuver_automaton._arrays import Array, IntArray


@inner_kernel
def price_of_row(rows: Array, p: Array, trim: int) -> float:
    """What the linear conditions add to the rate of a trim."""
    value = 0.0
    for r in range(rows.shape[0]):
        value += p[3 + r] * rows[r, trim]
    return value


@inner_kernel
def price_positions(
    twists: Array,
    rates: Array,
    rows: Array,
    n_priced: int,
    word: IntArray,
    times: Array,
    n: int,
    p: Array,
    values: Array,
    trims: IntArray,
    moments: Array,
) -> int:
    """Smallest reduced cost of all trims within each of the first `n` trims of a word.

    Fills `values`, `trims` and `moments` (the time within the trim); returns the position of the
    least. A turn on the spot that follows does not move the end's position.
    """
    some = np.empty((n, 4))
    for i in range(n):
        assign(some[i], twists[word[i]])
    columns = np.empty((n, 3))
    end_x, end_y, _ = end_and_columns(some, times[:n], columns)
    least_position = 0
    base = np.empty(n_priced)
    for j in range(n_priced):
        base[j] = rates[j] + price_of_row(rows, p, j)
    x, y, heading = 0.0, 0.0, 0.0
    for i in range(max(n, 1)):
        c, s = math.cos(heading), math.sin(heading)
        a = p[0] * c + p[1] * s
        b = p[1] * c - p[0] * s
        turn = p[2] - p[0] * (end_y - y) + p[1] * (end_x - x)
        v_i, u_i, w_i, time = 0.0, 0.0, 0.0, 0.0
        best, best_trim, best_time = np.inf, -1, 0.0
        if n > 0:
            v_i, u_i, w_i, time = some[i, 0], some[i, 1], some[i, 2], times[i]
        if w_i == 0.0:
            # a and b stay, the momentum of turning runs linearly: an end is the least
            slope = u_i * a - v_i * b
            late = turn + slope * time
            for j in range(n_priced):
                level = base[j] + twists[j, 0] * a + twists[j, 1] * b
                early_value = level + twists[j, 2] * turn
                late_value = level + twists[j, 2] * late
                if early_value < best:
                    best, best_trim, best_time = early_value, j, 0.0
                if late_value < best:
                    best, best_trim, best_time = late_value, j, time
        else:
            angle = w_i * time
            cos_end, sin_end = math.cos(angle), math.sin(angle)
            centre = turn + (a * v_i + b * u_i) / w_i
            for j in range(n_priced):
                ratio = twists[j, 2] / w_i
                along = twists[j, 0] - ratio * v_i
                aside = twists[j, 1] - ratio * u_i
                level = base[j] + twists[j, 2] * centre
                cosine = along * a + aside * b
                sine = along * b - aside * a
                if level - abs(cosine) - abs(sine) >= best:
                    continue
                if level + cosine < best:
                    best, best_trim, best_time = level + cosine, j, 0.0
                value = level + cosine * cos_end + sine * sin_end
                if value < best:
                    best, best_trim, best_time = value, j, time
                least = level - math.hypot(cosine, sine)
                if least < best:
                    where = math.atan2(-sine, -cosine) / w_i
                    period = 2.0 * math.pi / abs(w_i)
                    where -= period * math.floor(where / period)
                    if where < time:
                        best, best_trim, best_time = least, j, where
        values[i], trims[i], moments[i] = best, best_trim, best_time
        if best < values[least_position]:
            least_position = i
        if n > 0:
            dx, dy, dh = coast(v_i, u_i, w_i, time)
            x, y, heading = compose(x, y, heading, dx, dy, dh)
    return least_position


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
def word_multipliers(
    twists: Array, rates: Array, rows: Array, word: IntArray, times: Array, n: int
) -> Array:
    """Multipliers that best explain a word's times as optimal."""
    some = np.empty((n, 4))
    some_rates = np.empty(n)
    some_rows = np.empty((rows.shape[0], n))
    for i in range(n):
        assign(some[i], twists[word[i]])
        some_rates[i] = rates[word[i]]
        for r in range(rows.shape[0]):
            some_rows[r, i] = rows[r, word[i]]
    columns = np.empty((n, 3))
    end_and_columns(some, times[:n], columns)
    return multipliers(jacobian(columns, some_rows), some_rates)


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


@kernel
def price_word(
    twists: Array,
    rates: Array,
    rows: Array,
    n_priced: int,
    word: IntArray,
    times: Array,
    first: int,
    last: int,
    p: Array,
) -> tuple[float, int, int, float]:
    """Smallest reduced cost of all trims at any time of a stretch: (value, trim, position, time).

    The stretch reaches from the trim at position `first` of the word to the one before `last`.
    """
    n = word.size
    values = np.empty(n)
    trims = np.empty(n, dtype=np.int64)
    moments = np.empty(n)
    price_positions(twists, rates, rows, n_priced, word, times, n, p, values, trims, moments)
    k = first
    for i in range(first, last):
        if values[i] < values[k]:
            k = i
    return values[k], trims[k], k, moments[k]


@kernel
def multipliers_of_word(
    twists: Array, rates: Array, rows: Array, word: IntArray, times: Array
) -> Array:
    """Multipliers (3 + m,) of a plan."""
    return word_multipliers(twists, rates, rows, word, times, word.size)


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
    least = -np.inf
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
        least = values[k]
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
                gained = True
                n, cost = length, trial_cost
                for i in range(n):
                    word[i], times[i] = trial[i], trial_times[i]
                break
        if not gained or n - free_tail > 5:
            before = cost
            n, cost = replace_runs(
                twists, rates, goal, rows, targets, n_priced, free_tail, word, times, n, cost, most
            )
            if not gained and cost == before:
                break
    cost = refine(twists, rates, goal, rows, targets, word, times, n, cost)
    return n, cost, least, used
