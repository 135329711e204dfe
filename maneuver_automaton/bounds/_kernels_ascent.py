"""A function that obeys the rows of the program, raised where it has room, in single precision.

Nothing here is part of a proof, as in `_kernels_dual`, whose blocks of cells these are: the result
is measured in double precision.

Rows of `w` up to 19 are those of `gather`; 20 to 23 hold the directions at both layers, 24 to 28
the differences at one corner, 32 to 37 the room of the nodes that count there (the corner at both
layers, its neighbours along x and y at the lower and at the upper one), 40 to 47 that of all nodes.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.bounds._kernels_dual import LANES, Nodes, gather
from maneuver_automaton.bounds.arrays import Single

ROWS = 48  # of the array `w`

Six: TypeAlias = tuple[np.float32, np.float32, np.float32, np.float32, np.float32, np.float32]


@bare_inner_kernel
def room_of_row(
    least: Six,
    apart: tuple[np.float32, np.float32, np.float32, np.float32, np.float32],
    weights: tuple[np.float32, np.float32, np.float32, np.float32],
    signs: tuple[np.float32, np.float32],
    rate: np.float32,
    never: tuple[np.float32, np.float32],
) -> Six:
    """The lesser room of six nodes if one more row is to hold: its slack, shared by all that count.

    `never` is infinite for a sense that has no row.
    """
    far, tiny = np.float32(np.inf), np.float32(1e-9)
    one, two, zero = np.float32(1.0), np.float32(2.0), np.float32(0.0)
    x_0, x_1, y_0, y_1, turned = apart
    a_0, b_0, a_1, b_1 = weights
    row = a_0 * x_0 + b_0 * y_0 + a_1 * x_1 + b_1 * y_1 + rate * turned
    a_0, b_0, a_1, b_1 = signs[0] * a_0, signs[1] * b_0, signs[0] * a_1, signs[1] * b_1
    here_0, here_1 = -a_0 - b_0 - rate, rate - a_1 - b_1
    total = abs(here_0) + abs(here_1) + abs(a_0) + abs(b_0) + abs(a_1) + abs(b_1)
    share = two / max(total, np.float32(1e-12))
    up = max(max(one - row, zero) * share, never[0])
    down = max(max(one + row, zero) * share, never[1])
    return (
        min(least[0], (up if here_0 > zero else down) if abs(here_0) > tiny else far),
        min(least[1], (up if here_1 > zero else down) if abs(here_1) > tiny else far),
        min(least[2], (up if a_0 > zero else down) if abs(a_0) > tiny else far),
        min(least[3], (up if b_0 > zero else down) if abs(b_0) > tiny else far),
        min(least[4], (up if a_1 > zero else down) if abs(a_1) > tiny else far),
        min(least[5], (up if b_1 > zero else down) if abs(b_1) > tiny else far),
    )


@bare_inner_kernel
def room_at_corner(
    w: Single,
    along: np.float32,
    aside: np.float32,
    rate: np.float32,
    never: tuple[np.float32, np.float32],
) -> None:
    """Room of the nodes that count in the rows of one corner, which lies `along` and `aside`."""
    row = np.uint64(LANES)
    far, zero, half = np.float32(np.inf), np.float32(0.0), np.float32(0.5)
    signs = (along, aside)
    for k in range(row):
        apart = (
            w[np.uint64(24) * row + k],
            w[np.uint64(25) * row + k],
            w[np.uint64(26) * row + k],
            w[np.uint64(27) * row + k],
            w[np.uint64(28) * row + k],
        )
        c_0, s_0 = w[np.uint64(20) * row + k], w[np.uint64(21) * row + k]
        c_1, s_1 = w[np.uint64(22) * row + k], w[np.uint64(23) * row + k]
        lower, upper = (c_0, s_0, zero, zero), (zero, zero, c_1, s_1)
        mixed = (half * c_1, half * s_1, half * c_0, half * s_0)
        least = (far, far, far, far, far, far)
        least = room_of_row(least, apart, lower, signs, rate, never)
        least = room_of_row(least, apart, lower, signs, -rate, never)
        least = room_of_row(least, apart, upper, signs, rate, never)
        least = room_of_row(least, apart, upper, signs, -rate, never)
        least = room_of_row(least, apart, mixed, signs, rate, never)
        least = room_of_row(least, apart, mixed, signs, -rate, never)
        w[np.uint64(32) * row + k] = least[0]
        w[np.uint64(33) * row + k] = least[1]
        w[np.uint64(34) * row + k] = least[2]
        w[np.uint64(35) * row + k] = least[3]
        w[np.uint64(36) * row + k] = least[4]
        w[np.uint64(37) * row + k] = least[5]


@bare_inner_kernel
def copy_row(w: Single, of: int, to: int) -> None:
    """Row `to` becomes another."""
    row = np.uint64(LANES)
    o, t = np.uint64(of) * row, np.uint64(to) * row
    for k in range(row):
        w[t + k] = w[o + k]


@bare_inner_kernel
def lower_row(w: Single, by: int, to: int) -> None:
    """Row `to` becomes the lesser of itself and another."""
    row = np.uint64(LANES)
    b, t = np.uint64(by) * row, np.uint64(to) * row
    for k in range(row):
        w[t + k] = min(w[t + k], w[b + k])


@bare_inner_kernel
def lower_nodes(w: Single, room: Single, base: NDArray[np.int32], nodes: Nodes) -> None:
    """The room of nodes becomes the lesser of itself and that in a block."""
    at, first, over_x, over_y = nodes
    row = np.uint64(LANES)
    for k in range(row):
        n = np.uint64(base[at + k]) + first
        for corner in range(8):
            x, y, up = np.uint64(corner >> 2), np.uint64((corner >> 1) & 1), np.uint64(corner & 1)
            to = n + x * over_x + y * over_y + up
            room[to] = min(room[to], w[np.uint64(40 + corner) * row + k])


@bare_kernel
def room_above(
    value: Single,
    room: Single,
    base: NDArray[np.int32],
    layer: NDArray[np.int32],
    shape: tuple[int, int, int, int],
    table: Single,
    rates: Single,
    side: IntArray,
    gear: IntArray,
    w: Single,
) -> None:
    """Write by how much every node may be raised at once without any row being broken.

    `base` and `layer` (blocks * 64,) are the first node and the layer of each cell, `table`
    (F * 4 * layers,) the directions at the layers below and above. A node counts upwards in some
    rows; of each it gets the slack, divided by the sum of all that count upwards in it. Nodes that
    count nowhere have infinite room.
    """
    far = np.float32(np.inf)
    room[:] = far
    _gears, n_i, n_j, n_k = shape
    over_x, over_y, size = np.uint64(n_j * n_k), np.uint64(n_k), n_i * n_j * n_k
    layers = table.size // (4 * side.size)
    row = np.uint64(LANES)
    for block in range(base.size // LANES):
        at = np.uint64(block * LANES)
        for m in range(side.size):
            nodes = (at, np.uint64(gear[m] * size), over_x, over_y)
            gather(w, value, base, nodes)
            for q in range(4):
                begin = np.uint64((m * 4 + q) * layers)
                to = np.uint64((20 + q) * LANES)
                for k in range(row):
                    w[to + k] = table[begin + np.uint64(layer[at + k])]
            for k in range(np.uint64(40) * row, np.uint64(48) * row):
                w[k] = far
            up = np.float32(0.0) if side[m] >= 0 else far
            down = np.float32(0.0) if side[m] <= 0 else far
            for corner in range(4):
                a, b = corner & 1, corner >> 1
                copy_row(w, 8 + b * 2, 24)
                copy_row(w, 9 + b * 2, 25)
                copy_row(w, 12 + a * 2, 26)
                copy_row(w, 13 + a * 2, 27)
                copy_row(w, 16 + a * 2 + b, 28)
                along, aside = np.float32(1 - 2 * a), np.float32(1 - 2 * b)
                room_at_corner(w, along, aside, rates[m], (up, down))
                here, beside_x, beside_y = a * 4 + b * 2, (1 - a) * 4 + b * 2, a * 4 + (1 - b) * 2
                for upper in range(2):
                    lower_row(w, 32 + upper, 40 + here + upper)
                    lower_row(w, 34 + 2 * upper, 40 + beside_x + upper)
                    lower_row(w, 35 + 2 * upper, 40 + beside_y + upper)
            lower_nodes(w, room, base, nodes)


@bare_kernel
def raise_nodes(value: Single, room: Single, free: Single, price: float) -> None:
    """Raise every node by its room, where it is free (1, not 0) and counts anywhere.

    The values of two gears at a node stay within a price of each other.
    """
    far, zero, apart = np.float32(np.inf), np.float32(0.0), np.float32(price)
    size = np.uint64(free.size)
    if value.size == 2 * free.size:
        for k in range(size):
            gap = value[k] - value[size + k]
            room[k] = min(room[k], max(apart - gap, zero))
            room[size + k] = min(room[size + k], max(apart + gap, zero))
    for first in range(np.uint64(0), np.uint64(value.size), size):
        for k in range(size):
            by = room[first + k]
            value[first + k] += (by if by < far else zero) * free[k]
