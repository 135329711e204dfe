"""Times of a word corrected until it ends at its goal: Gauss-Newton with the smallest change.

Poses and twists have four components, x, y, heading, z; the goal's place is the origin. Trims that
follow a maneuver come in as conjugated twists, `product` is that of all displacements.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.groups._kernels import back_from, coast, compose, nearest_turn

STEPS = 8
MET = 1e-9  # [m, rad, s] below this a condition is met, and no step that misses more is followed
EXACT = 1e-15  # nothing is left to be closed
SWEEPS = 30  # of rotations at most; a handful does
ORTHOGONAL = 1e-15  # cosine of the angle between two columns that are taken to be orthogonal


@inner_kernel
def missing(
    start: Array,
    twists: Array,
    heading: float,
    product: Array,
    free_heading: bool,
    rows: Array,
    targets: Array,
    times: Array,
    gap: Array,
    columns: Array,
) -> float:
    """Fill `gap` (4 + m,) with what is missing, `columns` (n, 4 + m) with slopes; the worst."""
    # The first four conditions are those of the end, the others ``rows @ times = targets``.
    n = times.size
    x, y, turn, z = start[0], start[1], start[2], start[3]
    for i in range(n):
        d_x, d_y, d_turn = coast(twists[i, 0], twists[i, 1], twists[i, 2], times[i])
        x, y, turn = compose(x, y, turn, d_x, d_y, d_turn)
        z += twists[i, 3] * times[i]
        # The place where trim i ends, and its velocity there, until the end is known.
        c, s = math.cos(turn), math.sin(turn)
        columns[i, 0], columns[i, 1] = x, y
        columns[i, 2] = c * twists[i, 0] - s * twists[i, 1]
        columns[i, 3] = s * twists[i, 0] + c * twists[i, 1]
    # A trim that lasts longer turns all that follows: its own velocity, and an arm to the end.
    for i in range(n):
        arm_x, arm_y, rate = x - columns[i, 0], y - columns[i, 1], twists[i, 2]
        columns[i, 0] = columns[i, 2] - rate * arm_y
        columns[i, 1] = columns[i, 3] + rate * arm_x
        columns[i, 2], columns[i, 3] = rate, twists[i, 3]
    # Of a free heading the word keeps what it has, and the aim turns with it: the displacements
    # lead from there to the goal, d in the frame of the end, so the aim is at ``-R(turn) d``.
    aim = turn + product[2] if free_heading else heading
    aim_x, aim_y, aim_turn = back_from(0.0, 0.0, aim, product[0], product[1], product[2])
    gap[0], gap[1], gap[3] = aim_x - x, aim_y - y, -product[3] - z
    gap[2] = nearest_turn(aim_turn - turn)
    if free_heading:
        c, s = math.cos(turn), math.sin(turn)
        for i in range(n):
            columns[i, 0] -= (s * product[0] + c * product[1]) * columns[i, 2]
            columns[i, 1] -= (s * product[1] - c * product[0]) * columns[i, 2]
            columns[i, 2] = 0.0
        gap[2] = 0.0
    for r in range(targets.size):
        gap[4 + r] = targets[r]
        for i in range(n):
            columns[i, 4 + r] = rows[r, i]
            gap[4 + r] -= rows[r, i] * times[i]
    worst = 0.0
    for e in range(gap.size):
        worst = max(worst, abs(gap[e]))
    return worst


@inner_kernel
def smallest_change(columns: Array, gap: Array, rank: float, change: Array) -> None:
    """Fill `change` (n,) with the least solution of ``columns^T change = gap``; both are spoilt."""
    # Columns (n, k) are turned in pairs until they are orthogonal: then their lengths are the
    # singular values, each to all its digits, and the solution is a sum over them, but for those
    # below `rank` times the greatest. One-sided Jacobi; Golub, Van Loan (2013), Sec. 8.6.3.
    n, k = columns.shape
    for _ in range(SWEEPS):
        turned = False
        for p in range(k - 1):
            for q in range(p + 1, k):
                a, b, d = 0.0, 0.0, 0.0
                for i in range(n):
                    a += columns[i, p] * columns[i, p]
                    b += columns[i, q] * columns[i, q]
                    d += columns[i, p] * columns[i, q]
                # Products of next to nothing vanish: a column that has no length turns with none.
                if a == 0.0 or b == 0.0 or not abs(d) > ORTHOGONAL * math.sqrt(a) * math.sqrt(b):
                    continue
                turned = True
                zeta = (b - a) / (2.0 * d)
                t = math.copysign(1.0, zeta) / (abs(zeta) + math.hypot(1.0, zeta))
                c = 1.0 / math.sqrt(1.0 + t * t)
                s = c * t
                for i in range(n):
                    one, other = columns[i, p], columns[i, q]
                    columns[i, p], columns[i, q] = c * one - s * other, s * one + c * other
                one, other = gap[p], gap[q]  # the conditions are mixed alike
                gap[p], gap[q] = c * one - s * other, s * one + c * other
        if not turned:
            break
    greatest = 0.0
    for p in range(k):
        square = 0.0
        for i in range(n):
            square += columns[i, p] * columns[i, p]
        greatest = max(greatest, square)
    for i in range(n):
        change[i] = 0.0
    for p in range(k):
        square = 0.0
        for i in range(n):
            square += columns[i, p] * columns[i, p]
        if square > rank * rank * greatest:
            for i in range(n):
                change[i] += columns[i, p] * (gap[p] / square)


@kernel
def close_times(
    start: Array,
    twists: Array,
    heading: float,
    product: Array,
    free_heading: bool,
    rows: Array,
    targets: Array,
    durations: Array,
    rank: float,
    at_least: float,
) -> tuple[Array, float]:
    """Times (n,) near `durations` (n,) that miss the least, as `closing.closest_times`."""
    n, k = durations.size, 4 + targets.size
    best, least = durations.copy(), np.inf
    now, change = durations.copy(), np.empty(n)
    columns, gap = np.empty((n, k)), np.empty(k)
    lasts, any_lasts = np.empty(n, dtype=np.bool_), False
    for i in range(n):
        lasts[i] = durations[i] != 0.0 or at_least < 0.0
        any_lasts = any_lasts or lasts[i]
    for _ in range(STEPS):
        worst = missing(
            start, twists, heading, product, free_heading, rows, targets, now, gap, columns
        )
        if worst < least:
            best, least = now.copy(), worst
        elif least < MET:
            break
        if worst < EXACT or not any_lasts:
            break
        for i in range(n):
            if not lasts[i]:
                for e in range(k):
                    columns[i, e] = 0.0
        smallest_change(columns, gap, rank, change)
        for i in range(n):
            if lasts[i]:
                now[i] = max(now[i] + change[i], at_least)
    return best, least
