"""Obstacle-aware distance in the plane, grown from its seeds only as far as it is asked for."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel, kernel
from maneuver_automaton.collision._kernels_field import known_distance
from maneuver_automaton.collision.arrays import Field
from maneuver_automaton.search.arrays import DistanceGrid

BLOCKED, SETTLED, REACHED = 1, 2, 3  # marks of a cell; 0 is one that nothing is known of
STRAIGHT, DIAGONAL = 29, 41  # a step to a neighbour, in units: 41 / 29 is 0.03 % below sqrt(2)
DETOUR = 4  # [sides of the grid] that are preferred to a path through a wall thinner than a cell
NARROW = 4  # how much costlier a cell is whose middle is no place for the vehicle
BUCKETS = 256  # a power of two, more than ``NARROW * DIAGONAL + DIAGONAL``, see `_queue`
LISTED, N_SETTLED, AT_RIM, FAR, WRITTEN, NOW = range(6)  # places in `grid.state`


@bare_inner_kernel
def grid_layout(
    origin: float, low: float, high: float, cell: float, field_cell: float, stride: int
) -> tuple[int, int, float]:
    """Along one axis: the first cell, how many there are, and where the first begins [m]."""
    # Of cells of `stride` cells of the field, whose origin it is, from `low` to `high`.
    origin -= (stride // 2) * field_cell
    first = math.floor((low - origin) / cell)
    last = math.floor((high - origin) / cell)  # the far rim belongs to it too
    return first, max(last - first, 0) + 1, origin + first * cell


@bare_inner_kernel
def detour_of(columns: int, rows: int) -> int:
    """How much longer a path is preferred to one through a wall thinner than a cell [units]."""
    return DETOUR * (columns + rows) * STRAIGHT


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
    # -inf where no point of the cell is inside the window: no wall stands there, but a bound.
    at, window = grid.layout, grid.window
    x = at.origin_x + (i + 0.5) * at.cell - window[4]
    y = at.origin_y + (j + 0.5) * at.cell - window[5]
    c, s, half_diagonal = window[6], window[7], math.sqrt(0.5) * at.cell + window[8]
    along, aside = c * x - s * y, s * x + c * y
    if along < window[0] - half_diagonal or along > window[2] + half_diagonal:
        return -math.inf
    if aside < window[1] - half_diagonal or aside > window[3] + half_diagonal:
        return -math.inf
    f_i, f_j = i * at.stride + at.shift_x, j * at.stride + at.shift_y
    if 0 <= f_i < field.distance.shape[1] and 0 <= f_j < field.distance.shape[0]:
        return known_distance(field, f_j, f_i)
    return math.inf


@bare_inner_kernel
def blocked_cell(grid: DistanceGrid, field: Field, i: int, j: int) -> bool:
    """Whether no reference point can be anywhere in the cell: sound."""
    # `inflation` is the body's inscribed radius less half a diagonal of the cell. No point of the
    # cell is farther than that half from its middle, so its clearance is below the radius.
    return centre_clearance(grid, field, i, j) < grid.walls.inflation


@bare_inner_kernel
def least_share(grid: DistanceGrid, field: Field, i: int, j: int, room: float) -> float:
    """How much more a step into a cell costs for its place, at least, as a share of its length."""
    at, prices = grid.layout, grid.prices
    share = 0.0
    rows, columns = prices.value.shape
    if rows > 0:
        x, y = at.origin_x + (i + 0.5) * at.cell, at.origin_y + (j + 0.5) * at.cell
        column = min(max(math.floor((x - prices.origin_x) / prices.cell + 0.5), 0), columns - 1)
        row = min(max(math.floor((y - prices.origin_y) / prices.cell + 0.5), 0), rows - 1)
        share = float(prices.value[row, column])
    # The field says no more than `outside`; what is farther from all is not near enough to count.
    if prices.near > 0.0 and room < field.outside:
        near = 1.0 - max(room - prices.reach, 0.0) / prices.within
        if near > 0.0:
            share += prices.near * near * near
    return share


@bare_inner_kernel
def _octile(i: int, j: int) -> int:
    """Length of the shortest way over `i` columns and `j` rows of cells, in units."""
    i, j = abs(i), abs(j)
    return STRAIGHT * max(i, j) + (DIAGONAL - STRAIGHT) * min(i, j)


@bare_inner_kernel
def _queue(grid: DistanceGrid, key: int, item: int) -> None:
    """Put a cell into the open list."""
    # Keys are whole numbers, and none is below that of the cell that is settled at the time: the
    # octile way to where the grid is aimed at, which they add to a rank, is no longer than a step
    # and the way from there. So those of the next `BUCKETS` units need no order but their number.
    # Only what is behind a thin wall is farther away than that; it waits in a binary heap.
    state, queue = grid.state, grid.queue
    if key - state[NOW] < BUCKETS:
        bucket, place = key & (BUCKETS - 1), queue.items.shape[0] - 1 - state[WRITTEN]
        queue.items[place], queue.links[place] = item, queue.heads[bucket]
        queue.heads[bucket] = place + 1  # 0: none
        state[WRITTEN] += 1
        state[LISTED] += 1
    else:
        push(queue.keys, queue.items, state[FAR], float(key), item)
        state[FAR] += 1


@bare_inner_kernel
def _next_cell(grid: DistanceGrid) -> int:
    """Take a cell of the least key out of the open list; -1 if that is empty."""
    state, queue, heads = grid.state, grid.queue, grid.queue.heads
    now = state[NOW]
    if state[LISTED] > 0:
        while heads[now & (BUCKETS - 1)] == 0:
            now += 1
    if state[FAR] > 0 and (state[LISTED] == 0 or queue.keys[0] <= now):
        state[NOW] = int(queue.keys[0])
        item = pop(queue.keys, queue.items, state[FAR])
        state[FAR] -= 1
        return item
    if state[LISTED] == 0:
        return -1
    place = heads[now & (BUCKETS - 1)] - 1
    heads[now & (BUCKETS - 1)] = queue.links[place]
    state[LISTED] -= 1
    state[NOW] = now
    return queue.items[place]


@bare_inner_kernel
def distance_at(grid: DistanceGrid, field: Field, x: float, y: float) -> float:
    """Distance [m] from the nearest seed to the cell of (x, y); inf if there is no path."""
    # Cells in whose middle the vehicle cannot be count more: an estimate, not a bound. Where a wall
    # may pass between the middles of two open cells (the body is small and the wall thin), a path
    # through costs `walls.detour` more in `rank`, by which paths are compared; `value` keeps the
    # length alone, which is compared with costs. Both are whole numbers: the same whatever was
    # asked for before. A metre counts so much more as places cost more there, at least. Grows until
    # that cell is settled, in the order of the rank plus the octile way to where the grid is aimed
    # at, so that cells far from the path are not looked at; the next call goes on from the state
    # kept in the grid.
    # Of the arrays of the grid, one entry a cell: `mark`; `rank` and `value`, the least known so
    # far, final once the cell is settled. Neither holds anything before the mark says so: a large
    # grid of which little is used is not filled first. A cell may stand in the open list several
    # times.
    at, walls = grid.layout, grid.walls
    priced = grid.prices.near > 0.0 or grid.prices.value.shape[0] > 0
    i = math.floor((x - at.origin_x) / at.cell)
    j = math.floor((y - at.origin_y) / at.cell)
    if not (0 <= i < at.columns and 0 <= j < at.rows):
        return math.inf
    wanted = j * at.columns + i
    if grid.mark[wanted] == BLOCKED:
        return math.inf
    aside = centre_clearance(grid, field, i, j)
    if aside < walls.inflation:
        return math.inf
    # Whatever leads into a cell that a wall may cut makes the detour. So the path known is the best
    # one as soon as all that is open is no nearer than it is without: else all the rest of the
    # plane would come first.
    due = _octile(i - at.aim_i, j - at.aim_j) - (walls.detour if aside < walls.cut else 0)
    while grid.mark[wanted] != SETTLED:
        if grid.mark[wanted] == REACHED and grid.rank[wanted] + due <= grid.state[NOW]:
            break
        here = _next_cell(grid)
        if here < 0:
            return math.inf
        if grid.mark[here] == SETTLED:
            continue
        grid.mark[here] = SETTLED
        grid.state[N_SETTLED] += 1
        h_j, h_i = here // at.columns, here % at.columns
        if h_i == 0 or h_j == 0 or h_i == at.columns - 1 or h_j == at.rows - 1:
            grid.state[AT_RIM] = 1  # a path may lead around outside, which is not known
        value, rank = grid.value[here], grid.rank[here]
        for b in range(-1, 2):
            for a in range(-1, 2):
                n_i, n_j = h_i + a, h_j + b
                if not (0 <= n_i < at.columns and 0 <= n_j < at.rows):
                    continue
                there = n_j * at.columns + n_i
                mark = grid.mark[there]
                if mark in (BLOCKED, SETTLED):
                    continue
                step = DIAGONAL if a != 0 and b != 0 else STRAIGHT
                if mark == REACHED and rank + step >= grid.rank[there]:
                    continue  # no step into a cell is cheaper, whatever the field says of it
                # The field is asked once for a blocked cell: then its mark says it.
                room = centre_clearance(grid, field, n_i, n_j)
                if room < walls.inflation:
                    grid.mark[there] = BLOCKED
                    continue
                if room < walls.wanted:
                    step *= NARROW
                if priced:
                    step += int(step * least_share(grid, field, n_i, n_j, room))
                ranked = rank + step + (walls.detour if room < walls.cut else 0)
                if mark != REACHED or ranked < grid.rank[there]:
                    grid.mark[there] = REACHED
                    grid.rank[there], grid.value[there] = ranked, value + step
                    _queue(grid, ranked + _octile(n_i - at.aim_i, n_j - at.aim_j), there)
    return grid.value[wanted] * (at.cell / STRAIGHT)


@bare_kernel
def seed(grid: DistanceGrid, points: Array) -> None:
    """Set the distance of the cells of `points` (n, 2) to 0."""
    sow(grid, points)


@bare_inner_kernel
def sow(grid: DistanceGrid, points: Array) -> None:
    """The same within a kernel; `points` (n, 2 or more)."""
    at = grid.layout
    for k in range(points.shape[0]):
        i = math.floor((points[k, 0] - at.origin_x) / at.cell)
        j = math.floor((points[k, 1] - at.origin_y) / at.cell)
        if 0 <= i < at.columns and 0 <= j < at.rows:
            here = j * at.columns + i
            if grid.mark[here] != REACHED:  # no seed has its cell yet
                grid.mark[here] = REACHED
                grid.rank[here], grid.value[here] = 0, 0
                key = _octile(i - at.aim_i, j - at.aim_j)
                # Which of them is the nearest, and so the first, is not known yet.
                push(grid.queue.keys, grid.queue.items, grid.state[FAR], float(key), here)
                grid.state[FAR] += 1


@kernel
def distances(grid: DistanceGrid, field: Field, points: Array) -> Array:
    """`distance_at` (n,) for points (n, 2)."""
    out = np.empty(points.shape[0])
    for k in range(points.shape[0]):
        out[k] = distance_at(grid, field, points[k, 0], points[k, 1])
    return out


@bare_inner_kernel
def open_cell(grid: DistanceGrid, field: Field, i: int, j: int) -> bool:
    """Whether a pose may be in a cell of the grid; beyond its rim it may."""
    if not (0 <= i < grid.layout.columns and 0 <= j < grid.layout.rows):
        return True
    return not blocked_cell(grid, field, i, j)


@kernel
def corner_path(grid: DistanceGrid, field: Field, goals: Array, x: float, y: float) -> float:
    """Length [m] of the shortest octile path between the corners nearest to (x, y) and a goal."""
    # A* over corners, from the goals to the end: along an edge that an open cell touches, and
    # across open cells. Where the rim of the grid may be left, a path along it is as good as any
    # outside.
    at = grid.layout
    columns, rows = at.columns + 1, at.rows + 1  # of corners
    value = np.full(columns * rows, np.inf)  # [m] to the nearest goal, as far as known
    settled = np.zeros(columns * rows, dtype=np.uint8)  # 1 once that is final
    # The open list, a binary heap. A corner is expanded once and has eight neighbours, and each may
    # be a goal: it is never pushed more than nine times.
    keys = np.empty(9 * columns * rows)
    items = np.empty(9 * columns * rows, dtype=np.int64)
    end_i = min(max(round((x - at.origin_x) / at.cell), 0), columns - 1)
    end_j = min(max(round((y - at.origin_y) / at.cell), 0), rows - 1)
    size = 0
    for g in range(goals.shape[0]):
        i = min(max(round((goals[g, 0] - at.origin_x) / at.cell), 0), columns - 1)
        j = min(max(round((goals[g, 1] - at.origin_y) / at.cell), 0), rows - 1)
        here = j * columns + i
        if value[here] > 0.0:
            value[here] = 0.0
            # No octile path is shorter than the straight line, and its length obeys the triangle
            # inequality: so the first time that a corner is popped, its value is final.
            key = at.cell * math.hypot(i - end_i, j - end_j)
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
                step = at.cell * (1.4142135623730951 if a != 0 and b != 0 else 1.0)
                if value[here] + step < value[there]:
                    value[there] = value[here] + step
                    key = value[there] + at.cell * math.hypot(n_i - end_i, n_j - end_j)
                    push(keys, items, size, key, there)
                    size += 1
    return math.inf
