"""Steps of the primal-dual method for the linear program of a lower bound, in single precision.

Nothing here is part of a proof: `_kernels_certificate` measures what comes out, in double
precision. Cells are taken in blocks of 64: what their corners hold is gathered into one array
`w` of rows of 64 numbers, so that all between gathering and scattering runs in the processor's
vector unit. Offsets are unsigned, without which the compiler asks each of them for its sign.

Rows of `w`: 0 values at the corners (x, y, heading), 8 differences along x, 12 along y, 16 in
heading, 20 weights and steps of the layer, 27 rows of one corner of the cells, 30 their share of
the turn, 32 to 43 what differences 8 to 19 get back.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.bounds.arrays import Rows, Single

LANES = 64  # cells of a block
ROWS = 44  # of the array `w`

# The first cell of a block, the first node of its gear, and how far apart neighbours lie along x, y
Nodes: TypeAlias = tuple[np.uint64, np.uint64, np.uint64, np.uint64]


@bare_inner_kernel
def corner_rows(w: Single, along: np.uint64, aside: np.uint64) -> None:
    """Change of the value by driving, at one corner of each cell: both headings, and between."""
    row = np.uint64(LANES)
    for k in range(row):
        x_0, x_1 = w[along + k], w[along + row + k]
        y_0, y_1 = w[aside + k], w[aside + row + k]
        c_0, s_0 = w[np.uint64(20) * row + k], w[np.uint64(21) * row + k]
        c_1, s_1 = w[np.uint64(22) * row + k], w[np.uint64(23) * row + k]
        w[np.uint64(27) * row + k] = c_0 * x_0 + s_0 * y_0
        w[np.uint64(28) * row + k] = c_1 * x_1 + s_1 * y_1
        mixed = c_1 * x_0 + s_1 * y_0 + c_0 * x_1 + s_0 * y_1
        w[np.uint64(29) * row + k] = np.float32(0.5) * mixed


@bare_inner_kernel
def both_ways(
    w: Single, kind: np.uint64, turned: np.uint64, dual: Single, at: np.uint64, over: np.float32
) -> None:
    """Dual step of rows that hold forwards and backwards: ``-1 <= driven +- turned <= 1``."""
    zero = np.float32(0.0)
    row = np.uint64(LANES)
    for k in range(row):
        step = w[np.uint64(24) * row + kind + k]
        driven, by_turn = w[np.uint64(27) * row + kind + k], w[turned + k]
        y = dual[at + k]
        z = y + step * (driven + by_turn)
        left = y + over * (max(z - step, zero) + min(z + step, zero) - y)
        y = dual[at + row + k]
        z = y + step * (driven - by_turn)
        right = y + over * (max(z - step, zero) + min(z + step, zero) - y)
        dual[at + k] = left
        dual[at + row + k] = right
        w[np.uint64(27) * row + kind + k] = left + right
        w[np.uint64(30) * row + k] += left - right


@bare_inner_kernel
def one_way(
    w: Single,
    kind: np.uint64,
    turned: np.uint64,
    dual: Single,
    at: np.uint64,
    over: np.float32,
    side: np.float32,
) -> None:
    """Dual step of rows of one sense of driving: ``side (driven +- turned) <= 1``."""
    zero = np.float32(0.0)
    row = np.uint64(LANES)
    for k in range(row):
        step = w[np.uint64(24) * row + kind + k]
        driven, by_turn = w[np.uint64(27) * row + kind + k], w[turned + k]
        y = dual[at + k]
        z = side * max(side * (y + step * (driven + by_turn)) - step, zero)
        left = y + over * (z - y)
        y = dual[at + row + k]
        z = side * max(side * (y + step * (driven - by_turn)) - step, zero)
        right = y + over * (z - y)
        dual[at + k] = left
        dual[at + row + k] = right
        w[np.uint64(27) * row + kind + k] = left + right
        w[np.uint64(30) * row + k] += left - right


@bare_inner_kernel
def corner_back(
    w: Single, along: np.uint64, aside: np.uint64, turned: np.uint64, rate: np.float32
) -> None:
    """What `corner_rows` has read gets its share of the dual values."""
    row = np.uint64(LANES)
    back = np.uint64(24) * row
    for k in range(row):
        c_0, s_0 = w[np.uint64(20) * row + k], w[np.uint64(21) * row + k]
        c_1, s_1 = w[np.uint64(22) * row + k], w[np.uint64(23) * row + k]
        lower, upper = w[np.uint64(27) * row + k], w[np.uint64(28) * row + k]
        mixed = np.float32(0.5) * w[np.uint64(29) * row + k]
        w[along + back + k] += c_0 * lower + c_1 * mixed
        w[along + back + row + k] += c_1 * upper + c_0 * mixed
        w[aside + back + k] += s_0 * lower + s_1 * mixed
        w[aside + back + row + k] += s_1 * upper + s_0 * mixed
    for k in range(row):
        w[turned + back + k] += rate * w[np.uint64(30) * row + k]
        w[np.uint64(30) * row + k] = np.float32(0.0)


@bare_inner_kernel
def subtract(w: Single, plus: int, minus: int, to: int) -> None:
    """Row `to` becomes one row less another."""
    row = np.uint64(LANES)
    p, q, t = np.uint64(plus) * row, np.uint64(minus) * row, np.uint64(to) * row
    for k in range(row):
        w[t + k] = w[p + k] - w[q + k]


@bare_inner_kernel
def scale(w: Single, first: int, last: int, factor: np.float32) -> None:
    """Multiply some rows."""
    row = np.uint64(LANES)
    for k in range(np.uint64(first) * row, np.uint64(last) * row):
        w[k] *= factor


@bare_inner_kernel
def gather(w: Single, x: Single, base: NDArray[np.int32], nodes: Nodes) -> None:
    """Values at the corners of a block of cells, and their differences."""
    at, first, over_x, over_y = nodes
    row = np.uint64(LANES)
    one = np.uint64(1)
    for k in range(row):
        n = np.uint64(base[at + k]) + first
        w[k] = x[n]
        w[row + k] = x[n + one]
        w[np.uint64(2) * row + k] = x[n + over_y]
        w[np.uint64(3) * row + k] = x[n + over_y + one]
        w[np.uint64(4) * row + k] = x[n + over_x]
        w[np.uint64(5) * row + k] = x[n + over_x + one]
        w[np.uint64(6) * row + k] = x[n + over_x + over_y]
        w[np.uint64(7) * row + k] = x[n + over_x + over_y + one]
    for a in range(2):
        for b in range(2):
            subtract(w, 4 + a * 2 + b, a * 2 + b, 8 + a * 2 + b)
            subtract(w, a * 4 + 2 + b, a * 4 + b, 12 + a * 2 + b)
            subtract(w, a * 4 + b * 2 + 1, a * 4 + b * 2, 16 + a * 2 + b)
    for k in range(np.uint64(32) * row, np.uint64(ROWS) * row):
        w[k] = np.float32(0.0)


@bare_inner_kernel
def scatter(w: Single, back: Single, base: NDArray[np.int32], nodes: Nodes) -> None:
    """Add what the differences get back to the nodes."""
    at, first, over_x, over_y = nodes
    row = np.uint64(LANES)
    one = np.uint64(1)
    for k in range(row):
        n = np.uint64(base[at + k]) + first
        x_00, x_01 = w[np.uint64(32) * row + k], w[np.uint64(33) * row + k]
        x_10, x_11 = w[np.uint64(34) * row + k], w[np.uint64(35) * row + k]
        y_00, y_01 = w[np.uint64(36) * row + k], w[np.uint64(37) * row + k]
        y_10, y_11 = w[np.uint64(38) * row + k], w[np.uint64(39) * row + k]
        t_00, t_01 = w[np.uint64(40) * row + k], w[np.uint64(41) * row + k]
        t_10, t_11 = w[np.uint64(42) * row + k], w[np.uint64(43) * row + k]
        back[n] -= x_00 + y_00 + t_00
        back[n + one] += t_00 - x_01 - y_01
        back[n + over_y] += y_00 - x_10 - t_01
        back[n + over_y + one] += y_01 + t_01 - x_11
        back[n + over_x] += x_00 - y_10 - t_10
        back[n + over_x + one] += x_01 + t_10 - y_11
        back[n + over_x + over_y] += x_10 + y_10 - t_11
        back[n + over_x + over_y + one] += x_11 + y_11 + t_11


@bare_kernel
def dual_step(
    x: Single,
    dual: Single,
    back: Single,
    base: NDArray[np.int32],
    layer: NDArray[np.int32],
    shape: tuple[int, int, int, int],
    rows: Rows,
    w: Single,
    over: float,
) -> None:
    """One step of all dual values by the values x; `back` becomes the rows' transpose times them.

    `base` and `layer` (blocks * 64,) are the first node and the layer of each cell; cells that
    only fill a block have a layer without weights. Dual values (blocks, families, corners, kinds,
    senses of turning, 64) go `over` times as far as the method says.
    """
    back[:] = np.float32(0.0)
    _gears, n_i, n_j, n_k = shape
    over_x, over_y, size = np.uint64(n_j * n_k), np.uint64(n_k), n_i * n_j * n_k
    families = rows.side.size
    layers = rows.table.size // (7 * families)
    relaxed = np.float32(over)
    row = np.uint64(LANES)
    for block in range(base.size // LANES):
        at = np.uint64(block * LANES)
        for m in range(families):
            nodes = (at, np.uint64(rows.gear[m] * size), over_x, over_y)
            if m == 0 or rows.gear[m - 1] != rows.gear[m]:
                gather(w, x, base, nodes)
            for q in range(7):
                begin = np.uint64((m * 7 + q) * layers)
                to = np.uint64((20 + q) * LANES)
                for k in range(row):
                    w[to + k] = rows.table[begin + np.uint64(layer[at + k])]
            scale(w, 16, 20, rows.turn[m])
            duals = (block * families + m) * 24 * LANES
            for corner in range(4):
                a, b = corner & 1, corner >> 1
                along, aside = np.uint64((8 + b * 2) * LANES), np.uint64((12 + a * 2) * LANES)
                turned = np.uint64((16 + a * 2 + b) * LANES)
                corner_rows(w, along, aside)
                for kind in range(3):
                    part = np.uint64(kind * LANES)
                    to = np.uint64(duals + (corner * 6 + kind * 2) * LANES)
                    if rows.side[m] == 0:
                        both_ways(w, part, turned, dual, to, relaxed)
                    else:
                        one_way(w, part, turned, dual, to, relaxed, np.float32(rows.side[m]))
                corner_back(w, along, aside, turned, rows.turn[m])
            if m + 1 < families and rows.gear[m + 1] == rows.gear[m]:
                scale(w, 16, 20, np.float32(1.0) / rows.turn[m])
            else:
                scatter(w, back, base, nodes)


@bare_kernel
def primal_step(
    x: Single,
    ahead: Single,
    back: Single,
    step: Single,
    aim: Single,
    shape: tuple[int, int, int, int],
    round_trip: bool,
    price: float,
    over: float,
) -> None:
    """One step of the values x; `ahead` is where the rows are asked next.

    Where the headings are a whole turn, the last layer of nodes is the first one. The values of
    two gears at a node are brought within a price of each other.
    """
    gears, n_i, n_j, n_k = shape
    size = np.uint64(n_i * n_j * n_k)
    relaxed, half, zero = np.float32(over), np.float32(0.5), np.float32(0.0)
    apart = np.float32(price)
    if round_trip:
        for column in range(gears * n_i * n_j):
            low = np.uint64(column * n_k)
            high = np.uint64(column * n_k + n_k - 1)
            both = back[low] + back[high]
            back[low] = both
            back[high] = both
    for k in range(np.uint64(gears) * size):
        ahead[k] = x[k] + step[k] * (aim[k] - back[k])
    if gears == 2:
        for k in range(size):
            gap = ahead[k] - ahead[size + k]
            moved = half * (max(gap - apart, zero) + min(gap + apart, zero))
            ahead[k] -= moved
            ahead[size + k] += moved
    for k in range(np.uint64(gears) * size):
        moved = ahead[k] - x[k]
        ahead[k] += moved
        x[k] += relaxed * moved
