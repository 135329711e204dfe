"""Obstacle-aware distance in the plane, grown from its seeds only as far as it is asked for."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel, kernel

if TYPE_CHECKING:
    from maneuver_automaton._arrays import Array, IntArray
    from maneuver_automaton.collision.world import Field
    from maneuver_automaton.search.distance_grid import DistanceGrid

BLOCKED, SETTLED, REACHED = 1, 2, 3  # marks of a cell; 0 is one that nothing is known of
NARROW = 4.0  # how much dearer a cell is whose middle is no place for the vehicle
QUEUED, N_SETTLED, AT_RIM = range(3)  # places in `grid.state`


@bare_inner_kernel
def push(keys: Array, items: IntArray, size: int, key: float, item: int) -> None:
    """Put (key, item) into a binary heap in arrays that holds `size`."""
    # The children of place k are 2 k + 1 and 2 k + 2. Parents move down until the key fits in, so
    # that it is written once; of equal keys the one that is there stays above.
    k = size
    while k > 0:
        up = (k - 1) >> 1
        if keys[up] <= key:
            break
        keys[k], items[k] = keys[up], items[up]
        k = up
    keys[k], items[k] = key, item


@bare_inner_kernel
def pop(keys: Array, items: IntArray, size: int) -> int:
    """Take the least out of a binary heap that holds `size`; returns its item."""
    # The last entry is let sink from the top: the lesser child moves up until it fits in.
    top = items[0]
    last = size - 1
    key, item = keys[last], items[last]
    k = 0
    while True:
        down = 2 * k + 1
        if down >= last:
            break
        if down + 1 < last and keys[down + 1] < keys[down]:
            down += 1
        if key <= keys[down]:
            break
        keys[k], items[k] = keys[down], items[down]
        k = down
    keys[k], items[k] = key, item
    return top


@bare_inner_kernel
def centre_clearance(grid: DistanceGrid, field: Field, i: int, j: int) -> float:
    """Clearance of a point in the middle of a cell [m], negative inside a solid."""
    f_i, f_j = i * grid.stride + grid.shift_x, j * grid.stride + grid.shift_y
    if 0 <= f_i < field.distance.shape[1] and 0 <= f_j < field.distance.shape[0]:
        return field.distance[f_j, f_i]
    return math.inf


@bare_inner_kernel
def blocked_cell(grid: DistanceGrid, field: Field, i: int, j: int) -> bool:
    """Whether no reference point can be anywhere in the cell: sound."""
    # `inflation` is the body's inscribed radius less half a diagonal of the cell. No point of the
    # cell is farther than that half from its middle, so its clearance is below the radius.
    return centre_clearance(grid, field, i, j) < grid.inflation


@bare_inner_kernel
def distance_at(grid: DistanceGrid, field: Field, x: float, y: float) -> float:
    """Distance [m] from the nearest seed to the cell of (x, y); inf if there is no path.

    Cells in whose middle the vehicle cannot be count more: an estimate, not a bound. Where a wall
    may pass between the middles of two cells although neither is blocked (the body is small and
    the wall thin), a path through costs `grid.detour` more in `rank`, by which paths are compared.
    `value` keeps the length alone: it is compared with costs, and is finite behind every gap that
    the cells cannot show.

    Grows until that cell is settled, in the order of the rank plus the straight line to where the
    grid is aimed at, so that cells far from the path are not looked at. The state of the search is
    kept in the grid: the next call goes on from it.
    """
    # Of the arrays of the grid, one entry a cell: `mark`; `rank` and `value`, the least known so
    # far, final once the cell is settled. Neither holds anything before the mark says so: a large
    # grid of which little is used is not filled first. `keys` and `items` are the open list, a
    # binary heap in which a cell may stand several times.
    i = math.floor((x - grid.origin_x) / grid.cell)
    j = math.floor((y - grid.origin_y) / grid.cell)
    if not (0 <= i < grid.columns and 0 <= j < grid.rows):
        return math.inf
    wanted = j * grid.columns + i
    if grid.mark[wanted] == BLOCKED or blocked_cell(grid, field, i, j):
        return math.inf
    while grid.mark[wanted] != SETTLED:
        size = grid.state[QUEUED]
        if size == 0:
            return math.inf
        here = pop(grid.keys, grid.items, size)
        grid.state[QUEUED] = size - 1
        if grid.mark[here] == SETTLED:
            continue
        grid.mark[here] = SETTLED
        grid.state[N_SETTLED] += 1
        h_j, h_i = here // grid.columns, here % grid.columns
        if h_i == 0 or h_j == 0 or h_i == grid.columns - 1 or h_j == grid.rows - 1:
            grid.state[AT_RIM] = 1  # a path may lead around outside, which is not known
        value, rank = grid.value[here], grid.rank[here]
        for b in range(-1, 2):
            for a in range(-1, 2):
                n_i, n_j = h_i + a, h_j + b
                if not (0 <= n_i < grid.columns and 0 <= n_j < grid.rows):
                    continue
                there = n_j * grid.columns + n_i
                mark = grid.mark[there]
                if mark in (BLOCKED, SETTLED):
                    continue
                # The field is asked once for a blocked cell: then its mark says it.
                room = centre_clearance(grid, field, n_i, n_j)
                if room < grid.inflation:
                    grid.mark[there] = BLOCKED
                    continue
                step = grid.cell * (1.4142135623730951 if a != 0 and b != 0 else 1.0)
                if room < grid.wanted:
                    step *= NARROW
                ranked = rank + step + (grid.detour if room < grid.cut else 0.0)
                if mark != REACHED or ranked < grid.rank[there]:
                    grid.mark[there] = REACHED
                    grid.rank[there], grid.value[there] = ranked, value + step
                    e_x, e_y = (n_i - grid.aim_i) * grid.cell, (n_j - grid.aim_j) * grid.cell
                    key = ranked + math.sqrt(e_x * e_x + e_y * e_y)
                    if grid.state[QUEUED] < grid.keys.shape[0]:
                        push(grid.keys, grid.items, grid.state[QUEUED], key, there)
                        grid.state[QUEUED] += 1
    return grid.value[wanted]


@bare_kernel
def seed(grid: DistanceGrid, points: Array) -> None:
    """Set the distance of the cells of `points` (n, 2) to 0."""
    for k in range(points.shape[0]):
        i = math.floor((points[k, 0] - grid.origin_x) / grid.cell)
        j = math.floor((points[k, 1] - grid.origin_y) / grid.cell)
        if 0 <= i < grid.columns and 0 <= j < grid.rows:
            here = j * grid.columns + i
            if grid.mark[here] != REACHED:  # no seed has its cell yet
                grid.mark[here] = REACHED
                grid.rank[here], grid.value[here] = 0.0, 0.0
                e_x, e_y = (i - grid.aim_i) * grid.cell, (j - grid.aim_j) * grid.cell
                key = math.sqrt(e_x * e_x + e_y * e_y)
                push(grid.keys, grid.items, grid.state[QUEUED], key, here)
                grid.state[QUEUED] += 1


@kernel
def distances(grid: DistanceGrid, field: Field, points: Array) -> Array:
    """`distance_at` (n,) for points (n, 2)."""
    out = np.empty(points.shape[0])
    for k in range(points.shape[0]):
        out[k] = distance_at(grid, field, points[k, 0], points[k, 1])
    return out
