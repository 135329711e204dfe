"""What is proven about a function on cells of poses, in double precision.

A function is given by its values (gears, I + 1, J + 1, K + 1) at the nodes of a grid of places and
headings; in a cell it is bilinear in the place and linear in the heading.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_kernel
from maneuver_automaton.bounds.families import Families


@bare_kernel
def steepest(
    value: Array,
    columns: IntArray,
    families: Families,
    ahead: Array,
    cell: float,
    turn: float,
    price: float,
) -> float:
    """Upper bound of how fast the function falls along any motion, per unit of cost.

    `columns` (C, 4) are i, j, first k and number of the cells in question; `ahead` (F, K + 1, 2)
    the directions of each family of motions at the headings of the nodes.

    The direction at a heading within a cell is a combination of those at the two layers of nodes,
    with weights of at least 0 that add up to 1 at least and ``1 / cos(turn / 2)`` at most; so is
    the slope, and the weights of the two mixed products differ by at most 0.02 turn^2. For a given
    heading all is bilinear in the place, so the four corners are enough.
    """
    worst = 0.0
    widened = 1.0 / math.cos(0.5 * turn)
    for r in range(columns.shape[0]):
        i, j, low, n = columns[r, 0], columns[r, 1], columns[r, 2], columns[r, 3]
        for m in range(families.side.size):
            g, side = families.gear[m], families.side[m]
            speed, rate = families.speed[m] / cell, families.turn_rate[m] / turn
            for k in range(low, low + n):
                c_0, s_0 = ahead[m, k, 0], ahead[m, k, 1]
                c_1, s_1 = ahead[m, k + 1, 0], ahead[m, k + 1, 1]
                for a in range(2):
                    for b in range(2):
                        x_0 = value[g, i + 1, j + b, k] - value[g, i, j + b, k]
                        x_1 = value[g, i + 1, j + b, k + 1] - value[g, i, j + b, k + 1]
                        y_0 = value[g, i + a, j + 1, k] - value[g, i + a, j, k]
                        y_1 = value[g, i + a, j + 1, k + 1] - value[g, i + a, j, k + 1]
                        lower, upper = c_0 * x_0 + s_0 * y_0, c_1 * x_1 + s_1 * y_1
                        one, two = c_1 * x_0 + s_1 * y_0, c_0 * x_1 + s_0 * y_1
                        mixed = 0.5 * (one + two)
                        up = max(lower, max(mixed, upper))
                        down = -min(lower, min(mixed, upper))
                        up, down = max(up, up * widened), max(down, down * widened)
                        steep = max(up, down) if side == 0 else (up if side > 0 else down)
                        steep = speed * (steep + 0.01 * turn * turn * abs(one - two))
                        turned = abs(value[g, i + a, j + b, k + 1] - value[g, i + a, j + b, k])
                        worst = max(worst, steep + rate * turned)
        if value.shape[0] == 2:
            for k in range(low, low + n + 1):
                for a in range(2):
                    for b in range(2):
                        apart = value[0, i + a, j + b, k] - value[1, i + a, j + b, k]
                        worst = max(worst, abs(apart) / price)
    return worst


@bare_kernel
def least_in_cells(value: Array, columns: IntArray, least: Array) -> None:
    """Write the least value of the function in each cell (I, J, K) of the columns."""
    for r in range(columns.shape[0]):
        i, j, low, n = columns[r, 0], columns[r, 1], columns[r, 2], columns[r, 3]
        for k in range(low, low + n):
            found = math.inf
            for g in range(value.shape[0]):
                for a in range(2):
                    for b in range(2):
                        one, two = value[g, i + a, j + b, k], value[g, i + a, j + b, k + 1]
                        found = min(found, min(one, two))
            least[i, j, k] = found


@bare_kernel
def connected(
    active: NDArray[np.uint8],
    seen: NDArray[np.uint8],
    stack: IntArray,
    found: int,
    round_trip: bool,
) -> None:
    """Mark in `seen` every cell that hangs together with the first `found` ones of the stack."""
    n_i, n_j, n_k = active.shape
    while found:
        found -= 1
        flat = stack[found]
        k = flat % n_k
        j = (flat // n_k) % n_j
        i = flat // (n_k * n_j)
        for a in range(max(i - 1, 0), min(i + 2, n_i)):
            for b in range(max(j - 1, 0), min(j + 2, n_j)):
                for c in range(k - 1, k + 2):
                    e = c % n_k if round_trip else c
                    if 0 <= e < n_k and active[a, b, e] and not seen[a, b, e]:
                        seen[a, b, e] = 1
                        stack[found] = (a * n_j + b) * n_k + e
                        found += 1
