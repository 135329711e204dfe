"""In which order, and each in which direction, swaths are driven so that turns cost least.

State 2 i + d is swath i in direction d; `costs` (2 n, 2 n) are those of the turn from the end of
one to the begin of another, inf where there is none.
"""

from __future__ import annotations

import itertools

import numpy as np

from maneuver_automaton._arrays import Array, IntArray

MOST_EXACT = 12  # swaths; the table has 2^n rows
STARTS = 8  # tours that are improved
DIGITS = 9  # of a cost: equal ones are told apart by their numbers alone, wherever the field is


def cheapest_order(costs: Array) -> tuple[list[int], float]:
    """States in their order, and a cost that the turns of no order are below.

    Up to 12 swaths by dynamic programming over the sets of swaths driven. Beyond that from the
    nearest next one on by reversals of a part and moves of a swath, until none gains, beside the
    bound of an assignment: each swath has one next, or is the last.

    Source: Held, Karp (1962), *A Dynamic Programming Approach to Sequencing Problems*; Croes
    (1958), *A Method for Solving Traveling-Salesman Problems*.

    Examples
    --------
    >>> far = np.full((4, 4), np.inf)
    >>> far[2, 1] = 3.0  # from the second, driven forwards, to the first, driven backwards
    >>> cheapest_order(far)
    ([2, 1], 3.0)
    """
    from scipy.optimize import linear_sum_assignment

    there, n = np.isfinite(costs), len(costs) // 2
    finite = np.where(there, costs, 1.0 + 2.0 * float(costs[there].sum()))  # more than all others
    known = np.round(finite / finite.max(), DIGITS)
    if n <= MOST_EXACT:
        order = _by_sets(known)
        return order, float(costs[order[:-1], order[1:]].sum())
    tours = []
    for first in range(2 * n):
        order, left = [first], known.copy()
        while len(order) < n:
            left[:, [order[-1], order[-1] ^ 1]] = np.inf
            order.append(int(np.argmin(left[order[-1]])))
        tours.append((_price(known, np.array(order)), order))
    _, best = min(_improved(known, *one) for one in sorted(tours)[:STARTS])
    table = np.pad(finite.reshape(n, 2, n, 2).min(axis=(1, 3)), (0, 1))  # the last are the ends
    table[n, n] = table.max()
    return best, float(table[linear_sum_assignment(table)].sum())


def _by_sets(costs: Array) -> list[int]:
    """The cheapest of all orders, by the least cost to each set of swaths and last state."""
    states = np.arange(len(costs))
    bits, whole = 1 << states // 2, (1 << len(costs) // 2) - 1
    best = np.full((whole + 1, len(costs)), np.inf)
    before = np.full(best.shape, -1)
    best[bits, states] = 0.0
    for driven in range(1, whole):
        after = states[(driven & bits) == 0]
        through = best[driven][:, None] + costs[:, after]
        before[driven | bits[after], after] = through.argmin(axis=0)
        best[driven | bits[after], after] = through.min(axis=0)
    order, driven = [int(np.argmin(best[whole]))], whole
    while (last := int(before[driven, order[0]])) >= 0:
        driven ^= int(bits[order[0]])
        order.insert(0, last)
    return order


def _improved(costs: Array, price: float, order: list[int]) -> tuple[float, list[int]]:
    """The price of an order that no reversal of a part and no move of one swath makes cheaper."""
    states, n, before = np.array(order), len(order), np.inf
    while price < before:
        before = price
        for i, j in itertools.combinations(range(n + 1), 2):
            turned = np.concatenate([states[:i], states[i:j][::-1] ^ 1, states[j:]])
            if (less := _price(costs, turned)) < price:
                states, price = turned, less
        for i, j, flip in itertools.product(range(n), range(n), (0, 1)):
            moved = np.insert(np.delete(states, i), j, states[i] ^ flip)
            if (less := _price(costs, moved)) < price:
                states, price = moved, less
    return price, states.tolist()


def _price(costs: Array, order: IntArray) -> float:
    return round(float(costs[order[:-1], order[1:]].sum()), DIGITS)
