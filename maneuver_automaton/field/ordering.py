"""In which order, and each in which direction, swaths are driven so that turns cost least.

State 2 i + d is swath i in direction d; `costs` (2 n, 2 n) are those of the turn from the end of
one to the begin of another, inf where there is none.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from maneuver_automaton._arrays import Array, IntArray

MOST_EXACT = 12  # swaths; the table has 2^n rows
STARTS = 8  # tours that are improved
DIGITS = 9  # of a cost: equal ones are told apart by their numbers alone, wherever the field is


def cheapest_order(costs: Array) -> tuple[list[int], bool]:
    """States in their order, and whether no order is cheaper.

    Up to 12 swaths by dynamic programming over the sets of swaths driven, beyond that from the
    nearest next one on by reversals of a part and moves of a swath, until none gains.

    Source: Held, Karp (1962), *A Dynamic Programming Approach to Sequencing Problems*; Croes
    (1958), *A Method for Solving Traveling-Salesman Problems*.

    Examples
    --------
    >>> far = np.full((4, 4), np.inf)
    >>> far[2, 1] = 3.0  # from the second, driven forwards, to the first, driven backwards
    >>> cheapest_order(far)
    ([2, 1], True)
    """
    known = _finite(costs)
    known = np.round(known / known.max(), DIGITS)
    if len(costs) // 2 <= MOST_EXACT:
        return _by_sets(known), True
    near = sorted((_from(known, first) for first in range(len(costs))), key=_price(known))
    return min((_improved(known, one) for one in near[:STARTS]), key=_price(known)), False


def least_order_cost(costs: Array) -> float:
    """A number that the turns of no order cost less than: each swath has one next, or is the last.

    Examples
    --------
    >>> least_order_cost(np.full((6, 6), 5.0))
    10.0
    """
    from scipy.optimize import linear_sum_assignment

    n = len(costs) // 2
    table = np.zeros((n + 1, n + 1))  # the last row and column stand for the ends
    table[:n, :n] = _finite(costs).reshape(n, 2, n, 2).min(axis=(1, 3))
    table[n, n] = table.max()
    rows, columns = linear_sum_assignment(table)
    return float(table[rows, columns].sum())


def _finite(costs: Array) -> Array:
    """Costs in which a turn that is missing costs more than all others together."""
    there = np.isfinite(costs)
    return np.where(there, costs, 1.0 + 2.0 * float(costs[there].sum()))


def _by_sets(costs: Array) -> list[int]:
    n = len(costs) // 2
    states = np.arange(2 * n)
    bits = 1 << states // 2
    best = np.full((1 << n, 2 * n), np.inf)
    before = np.full((1 << n, 2 * n), -1, dtype=np.int64)
    best[bits, states] = 0.0
    for driven in range(1, (1 << n) - 1):
        through = best[driven][:, None] + costs
        after = states[(driven & bits) == 0]
        last = np.argmin(through[:, after], axis=0)
        best[driven | bits[after], after] = through[last, after]
        before[driven | bits[after], after] = last
    driven = (1 << n) - 1
    order = [int(np.argmin(best[driven]))]
    while (last := int(before[driven, order[-1]])) >= 0:
        driven ^= int(bits[order[-1]])
        order.append(last)
    return order[::-1]


def _from(costs: Array, first: int) -> list[int]:
    """From a state on always to the nearest one."""
    order, left = [first], np.ones(len(costs), dtype=bool)
    while True:
        left[[order[-1], order[-1] ^ 1]] = False
        after = np.flatnonzero(left)
        if not after.size:
            return order
        order.append(int(after[np.argmin(costs[order[-1], after])]))


def _improved(costs: Array, order: list[int]) -> list[int]:
    """A tour that no reversal of a part and no move of one swath makes cheaper."""
    price, states, n = _price(costs), np.array(order), len(order)
    cost, gains = price(states), True
    while gains:
        gains = False
        for i, j in itertools.combinations(range(n + 1), 2):
            turned = np.concatenate([states[:i], states[i:j][::-1] ^ 1, states[j:]])
            if (less := price(turned)) < cost:
                states, cost, gains = turned, less, True
        for i, j, flip in itertools.product(range(n), range(n), (0, 1)):
            moved = np.insert(np.delete(states, i), j, states[i] ^ flip)
            if (less := price(moved)) < cost:
                states, cost, gains = moved, less, True
    return [int(state) for state in states]


def _price(costs: Array) -> Callable[[Sequence[int] | IntArray], float]:
    """What the turns of an order cost."""
    return lambda order: round(float(costs[order[:-1], order[1:]].sum()), DIGITS)
