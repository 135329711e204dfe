"""Octile paths over the corners of cells."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, kernel
from maneuver_automaton.collision.arrays import Field
from maneuver_automaton.search._kernels_distance import blocked_cell, pop, push
from maneuver_automaton.search.arrays import DistanceGrid


@bare_inner_kernel
def open_cell(grid: DistanceGrid, field: Field, i: int, j: int) -> bool:
    """Whether a pose may be in a cell of the grid; beyond its rim it may."""
    if not (0 <= i < grid.columns and 0 <= j < grid.rows):
        return True
    return not blocked_cell(grid, field, i, j)


@kernel
def corner_path(grid: DistanceGrid, field: Field, goals: Array, x: float, y: float) -> float:
    """Length [m] of the shortest octile path between the corners nearest to (x, y) and a goal.

    A* over corners, from the goals to the end: along an edge that an open cell touches, and across
    open cells. Where the rim of the grid may be left, a path along it is as good as any outside.
    """
    columns, rows = grid.columns + 1, grid.rows + 1  # of corners
    value = np.full(columns * rows, np.inf)  # [m] to the nearest goal, as far as known
    settled = np.zeros(columns * rows, dtype=np.uint8)  # 1 once that is final
    # The open list, a binary heap. A corner is expanded once and has eight neighbours, and each may
    # be a goal: it is never pushed more than nine times.
    keys = np.empty(9 * columns * rows)
    items = np.empty(9 * columns * rows, dtype=np.int64)
    end_i = min(max(round((x - grid.origin_x) / grid.cell), 0), columns - 1)
    end_j = min(max(round((y - grid.origin_y) / grid.cell), 0), rows - 1)
    size = 0
    for g in range(goals.shape[0]):
        i = min(max(round((goals[g, 0] - grid.origin_x) / grid.cell), 0), columns - 1)
        j = min(max(round((goals[g, 1] - grid.origin_y) / grid.cell), 0), rows - 1)
        here = j * columns + i
        if value[here] > 0.0:
            value[here] = 0.0
            # No octile path is shorter than the straight line, and its length obeys the triangle
            # inequality: so the first time that a corner is popped, its value is final.
            key = grid.cell * math.hypot(i - end_i, j - end_j)
            push(keys, items, size, key, here)
            size += 1
    end = end_j * columns + end_i
    while size > 0:
        here = pop(keys, items, size)
        size -= 1
        if settled[here]:
            continue
        settled[here] = 1
        if here == end:
            return value[here]
        j, i = here // columns, here % columns
        for b in range(-1, 2):
            for a in range(-1, 2):
                n_i, n_j = i + a, j + b
                if not (0 <= n_i < columns and 0 <= n_j < rows) or (a == 0 and b == 0):
                    continue
                there = n_j * columns + n_i
                if settled[there]:
                    continue
                # A step across a cell needs that cell open; one along an edge needs one of the two
                # cells beside it.
                low_i, low_j = min(i, n_i), min(j, n_j)
                if a != 0 and b != 0:
                    passable = open_cell(grid, field, low_i, low_j)
                elif b == 0:
                    passable = open_cell(grid, field, low_i, j - 1) or open_cell(
                        grid, field, low_i, j
                    )
                else:
                    passable = open_cell(grid, field, i - 1, low_j) or open_cell(
                        grid, field, i, low_j
                    )
                if not passable:
                    continue
                step = grid.cell * (1.4142135623730951 if a != 0 and b != 0 else 1.0)
                if value[here] + step < value[there]:
                    value[there] = value[here] + step
                    key = value[there] + grid.cell * math.hypot(n_i - end_i, n_j - end_j)
                    push(keys, items, size, key, there)
                    size += 1
    return math.inf
