"""Write the field of distances and the buckets of a world, piece by piece."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, inner_kernel, kernel, shared_kernel
from maneuver_automaton.collision.arrays import Buckets, Field, Place

TILE = 8  # cells along a side of what is written at once


@shared_kernel
def write_tile(field: Field, row: int, column: int) -> None:
    """Write distances to the solids of a field, negative inside one, around a cell."""
    cell, cap = field.cell, field.outside
    edges, first, plates = field.solids.edges, field.solids.first, field.solids.plates
    rows, columns = field.distance.shape
    j_0, i_0 = row // TILE * TILE, column // TILE * TILE
    n_rows, n_columns = min(TILE, rows - j_0), min(TILE, columns - i_0)
    x, y = np.empty(TILE * TILE), np.empty(TILE * TILE)
    for j in range(TILE):
        for i in range(TILE):
            x[j * TILE + i] = field.origin_x + (i_0 + i + 0.5) * cell
            y[j * TILE + i] = field.origin_y + (j_0 + j + 0.5) * cell
    lowest, square, left = np.full(x.size, cap), np.empty(x.size), np.empty(x.size)
    most = cap  # of `lowest`: what is further away lowers nothing
    for p in range(plates.shape[0]):
        off_x = max(max(plates[p, 0] - x[-1], x[0] - plates[p, 2]), 0.0)
        off_y = max(max(plates[p, 1] - y[-1], y[0] - plates[p, 3]), 0.0)
        if off_x * off_x + off_y * off_y > most * most:
            continue
        square[:] = math.inf
        # A line and a disc's middle have no inside.
        left[:] = math.inf if first[p + 1] - first[p] > 2 else -1.0
        before = first[p + 1] - 1
        for k in range(first[p], first[p + 1]):
            a_x, a_y = edges[before, 0], edges[before, 1]
            e_x, e_y = edges[k, 0] - a_x, edges[k, 1] - a_y
            length = e_x * e_x + e_y * e_y
            length = length if length > 0.0 else math.inf  # its first end is the nearest point
            for i in range(x.size):  # several cells at once, with a division each
                to_x, to_y = x[i] - a_x, y[i] - a_y
                share = min(max((to_x * e_x + to_y * e_y) / length, 0.0), 1.0)
                off_x, off_y = to_x - share * e_x, to_y - share * e_y
                square[i] = min(square[i], off_x * off_x + off_y * off_y)
                left[i] = min(left[i], e_x * to_y - e_y * to_x)
            before = k
        most = -math.inf
        for i in range(x.size):
            # Rounded by its radius, a piece is nearer by as much.
            apart = math.sqrt(square[i])
            apart = (-apart if left[i] >= 0.0 else apart) - plates[p, 4]
            lowest[i] = min(lowest[i], apart)
            most = max(most, lowest[i])
    for j in range(n_rows):
        for i in range(n_columns):
            field.distance[j_0 + j, i_0 + i] = lowest[j * TILE + i]


@bare_inner_kernel
def known_distance(field: Field, row: int, column: int) -> float:
    """The distance in a cell, which is written when it is first asked for."""
    if field.distance[row, column] == 0.0 and field.solids.plates.shape[0] > 0:
        write_tile(field, row, column)
    return field.distance[row, column]


@kernel
def write_all(field: Field) -> None:
    """Write all distances of a field to its solids."""
    if field.solids.plates.shape[0] == 0:
        return
    rows, columns = field.distance.shape
    for j in range(0, rows, TILE):
        for i in range(0, columns, TILE):
            write_tile(field, j, i)


@inner_kernel
def rows_to(blocked: NDArray[np.bool_], wanted: bool) -> NDArray[np.int32]:
    """Rows (rows, columns) from each cell to the nearest of its column that is as `wanted`."""
    n_rows, n_columns = blocked.shape
    # As good as infinite: a row that far away is outside of the map, and `to_cells` skips it.
    far = n_rows + n_columns
    # Upwards first, then downwards with the better of both: two passes over a column.
    away = np.full((n_rows, n_columns), far, dtype=np.int32)
    for i in range(n_columns):
        last = -far
        for j in range(n_rows):
            if blocked[j, i] == wanted:
                last = j
            away[j, i] = min(j - last, far)
        last = 2 * far
        for j in range(n_rows - 1, -1, -1):
            if blocked[j, i] == wanted:
                last = j
            away[j, i] = min(away[j, i], last - j)
    return away


@inner_kernel
def to_cells(
    blocked: NDArray[np.bool_],
    wanted: bool,
    away: NDArray[np.int32],
    x: float,
    y: float,
    most: float,
) -> float:
    """Distance of a point, in cells, to the nearest that is as `wanted`; at most `most`."""
    n_rows, n_columns = blocked.shape
    row = min(max(math.floor(y), 0), n_rows - 1)
    column = min(max(math.floor(x), 0), n_columns - 1)
    # Columns from the nearest outwards, right and left in turn. A column whose own edge is further
    # away than the best cell so far holds nothing better, and neither does any beyond it on that
    # side; if both sides are at that, the search ends.
    best = most * most
    for reach in range(n_columns + 1):
        ended = True
        for side in range(2):
            k = column + reach if side == 0 else column - reach
            if (side == 1 and reach == 0) or k < 0 or k >= n_columns:
                continue
            a_x = max(max(k - x, x - k - 1.0), 0.0)
            if a_x * a_x >= best:
                continue
            ended = False
            for sign in range(2):  # the nearest cell of this column, up or down
                r = row + away[row, k] if sign == 0 else row - away[row, k]
                if 0 <= r < n_rows and blocked[r, k] == wanted:
                    a_y = max(max(r - y, y - r - 1.0), 0.0)
                    best = min(best, a_x * a_x + a_y * a_y)
        if ended and reach > 0:
            break
    return math.sqrt(best)


@kernel
def write_map(field: Field, blocked: NDArray[np.bool_], resolution: float, place: Place) -> None:
    """Lower the distances of a field to the exact ones of a map in its place, negative inside."""
    # Two passes: along each column the rows to the nearest cell, then the least hypotenuse over
    # columns.
    distance, cell = field.distance, field.cell
    origin_x, origin_y = field.origin_x, field.origin_y
    m_x, m_y, c, s = place
    n_rows, n_columns = blocked.shape
    to_blocked, to_free = rows_to(blocked, True), rows_to(blocked, False)
    rows, columns = distance.shape
    for j in range(rows):
        w_y = origin_y + (j + 0.5) * cell
        for i in range(columns):
            w_x = origin_x + (i + 0.5) * cell
            d_x, d_y = w_x - m_x, w_y - m_y
            x, y = (c * d_x + s * d_y) / resolution, (c * d_y - s * d_x) / resolution
            # Cells further away than the distance known already are not looked for.
            most = max(distance[j, i], 0.0) / resolution
            value = to_cells(blocked, True, to_blocked, x, y, most)
            if value <= 0.0:  # inside: to the nearest free cell, or out over the rim of the map
                most = min(min(x, n_columns - x), min(y, n_rows - y))
                value = -to_cells(blocked, False, to_free, x, y, max(most, 0.0))
            distance[j, i] = min(distance[j, i], resolution * value)


@bare_inner_kernel
def cells_around(buckets: Buckets, plate: Array, around: float) -> tuple[int, int, int, int]:
    """First column that a plate comes near, the one after the last, and the rows."""
    left, right = plate[0] - around - buckets.origin_x, plate[2] + around - buckets.origin_x
    below, above = plate[1] - around - buckets.origin_y, plate[3] + around - buckets.origin_y
    return (
        max(0, math.floor(left / buckets.cell)),
        min(buckets.columns, math.floor(right / buckets.cell) + 1),
        max(0, math.floor(below / buckets.cell)),
        min(buckets.rows, math.floor(above / buckets.cell) + 1),
    )


@kernel
def fill_buckets(buckets: Buckets, plates: Array, around: float) -> IntArray:
    """The pieces that are `around` each bucket, in order; where those of each begin is written."""
    start, columns = buckets.start, buckets.columns
    for p in range(plates.shape[0]):
        i_0, i_1, j_0, j_1 = cells_around(buckets, plates[p], around)
        for j in range(j_0, j_1):
            for i in range(i_0, i_1):
                start[j * columns + i + 1] += 1
    start[:] = np.cumsum(start)
    items, ends = np.empty(start[-1], dtype=np.int64), start[:-1].copy()
    for p in range(plates.shape[0]):
        i_0, i_1, j_0, j_1 = cells_around(buckets, plates[p], around)
        for j in range(j_0, j_1):
            for i in range(i_0, i_1):
                k = j * columns + i
                items[ends[k]] = p
                ends[k] += 1
    return items
