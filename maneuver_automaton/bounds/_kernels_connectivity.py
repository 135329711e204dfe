"""A tree of boxes of poses, and which of them are connected through boxes that may be free."""

from __future__ import annotations

import math
from heapq import heappop, heappush

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, inner_kernel, kernel
from maneuver_automaton.bounds._kernels_boxes import box_state
from maneuver_automaton.bounds.arrays import Cells, Grid, PoseArrays

BLOCKED, UNKNOWN, FREE = 0, 1, 2  # states of a box
START, GOAL = 1, 2  # bits of `Cells.ends`
ROUNDED = 1e-9  # relative, of prices that are added up in another order


@bare_inner_kernel
def middle_of(grid: Grid, cells: Cells, cell: int) -> tuple[float, float, float]:
    """Middle of a cell: x, y, heading."""
    level = cells.level[cell]
    size = grid.size[level]
    x = grid.origin_x + (cells.at[cell, 0] + 0.5) * size
    y = grid.origin_y + (cells.at[cell, 1] + 0.5) * size
    heading = grid.origin_heading + (2.0 * cells.at[cell, 2] + 1.0) * grid.half_turn[level]
    return x, y, heading


@bare_inner_kernel
def ends_in(grid: Grid, ends: Array, bit: int, level: int, x: float, y: float, t: float) -> int:
    """`bit` if a cell touches any of the boxes `ends` (n, 6), otherwise 0."""
    half, half_turn = 0.5 * grid.size[level], grid.half_turn[level]
    for k in range(ends.shape[0]):
        if abs(ends[k, 0] - x) > half + ends[k, 3] + grid.touching:
            continue
        if abs(ends[k, 1] - y) > half + ends[k, 4] + grid.touching:
            continue
        turn = abs((ends[k, 2] - t + math.pi) % (2.0 * math.pi) - math.pi)
        if grid.turns[level] == 1 or turn <= half_turn + ends[k, 5] + grid.touching:
            return bit
    return 0


@bare_inner_kernel
def judge(
    scene: PoseArrays, grid: Grid, cells: Cells, cell: int, starts: Array, goals: Array, give: float
) -> None:
    """Write the state of a new cell, and whether it holds an end."""
    level = cells.level[cell]
    half = 0.5 * grid.size[level]
    x, y, heading = middle_of(grid, cells, cell)
    half_turn = grid.half_turn[level] if grid.turns[level] > 1 else 0.0
    cells.state[cell] = box_state(scene, x, y, heading, half, half, half_turn, give)
    cells.ends[cell] = ends_in(grid, starts, START, level, x, y, heading)
    cells.ends[cell] |= ends_in(grid, goals, GOAL, level, x, y, heading)
    cells.child[cell] = -1


@kernel
def judge_roots(
    scene: PoseArrays, grid: Grid, cells: Cells, starts: Array, goals: Array, give: float
) -> None:
    """Write the roots of the tree."""
    cell = 0
    for k in range(grid.turns[0]):
        for j in range(grid.rows):
            for i in range(grid.columns):
                cells.level[cell] = 0
                cells.at[cell, 0], cells.at[cell, 1], cells.at[cell, 2] = i, j, k
                judge(scene, grid, cells, cell, starts, goals, give)
                cell += 1


@kernel
def split_cells(
    scene: PoseArrays,
    grid: Grid,
    cells: Cells,
    chosen: IntArray,
    used: int,
    starts: Array,
    goals: Array,
    give: float,
) -> int:
    """Split cells into their children, as far as there is room; how many cells there are then."""
    for cell in chosen:
        level = cells.level[cell]
        turned = 2 if grid.splits[level] else 1
        if used + 4 * turned > cells.level.size:
            return used
        cells.child[cell] = used
        for k in range(turned):
            for j in range(2):
                for i in range(2):
                    cells.level[used] = level + 1
                    cells.at[used, 0] = 2 * cells.at[cell, 0] + i
                    cells.at[used, 1] = 2 * cells.at[cell, 1] + j
                    cells.at[used, 2] = turned * cells.at[cell, 2] + k
                    judge(scene, grid, cells, used, starts, goals, give)
                    used += 1
    return used


@bare_inner_kernel
def cell_at(grid: Grid, cells: Cells, level: int, i: int, j: int, k: int) -> int:
    """The cell of a level at a place of its grid, or the larger leaf around it; -1 outside."""
    if i < 0 or j < 0 or i >= grid.columns << level or j >= grid.rows << level:
        return -1
    shift = grid.doublings[level]
    root_k = k >> shift
    cell = ((root_k * grid.rows) + (j >> level)) * grid.columns + (i >> level)
    for depth in range(level):
        if cells.child[cell] < 0:
            return int(cell)
        down = level - depth - 1
        inner = ((i >> down) & 1) + 2 * ((j >> down) & 1)
        if grid.splits[depth]:
            inner += 4 * ((k >> (shift - grid.doublings[depth] - 1)) & 1)
        cell = cells.child[cell] + inner
    return int(cell)


@inner_kernel
def beside(grid: Grid, cells: Cells, cell: int, face: int, stack: IntArray, found: IntArray) -> int:
    """Write the leaves that share a part of a face with a cell; how many there are.

    Faces are numbered low x, high x, low y, high y, low heading, high heading. Boxes are closed:
    where a blocked one touches an edge or a corner, no free pose is there, so faces are enough.
    """
    level, axis, up = cells.level[cell], face // 2, face % 2
    i, j, k = cells.at[cell, 0], cells.at[cell, 1], cells.at[cell, 2]
    step = 2 * up - 1
    if axis == 0:
        i += step
    elif axis == 1:
        j += step
    else:
        k = (k + step) % grid.turns[level]
    first = cell_at(grid, cells, level, i, j, k)
    if first < 0:
        return 0
    n_found, n_stack = 0, 1
    stack[0] = first
    while n_stack:
        n_stack -= 1
        one = stack[n_stack]
        child = cells.child[one]
        if child < 0:
            if cells.state[one] != BLOCKED and n_found < found.size:
                found[n_found] = one
                n_found += 1
            continue
        # Of a cell that is split only the children on the side of the face count.
        for inner in range(8 if grid.splits[cells.level[one]] else 4):
            if axis == 2 and not grid.splits[cells.level[one]]:
                facing = True
            else:
                facing = (inner >> axis) & 1 != up
            if facing and n_stack < stack.size:
                stack[n_stack] = child + inner
                n_stack += 1
    return n_found


@kernel
def spread(
    grid: Grid, cells: Cells, used: int, bit: int, other_way: Array, limit: float, price: Array
) -> None:
    """Write the least price of boxes that are not known to be free on the way to each leaf.

    From the leaves that hold the end `bit`, those themselves included; inf where no way leads, or
    none as cheap as the way to the other end. With the prices of the `other_way` only leaves are
    written through which a way leads that costs at most `limit`. Dijkstra, in which what is free
    costs nothing: a heap holds the leaves that are not known, a list those that are free and as
    near as the last one taken.
    """
    price[:used] = np.inf
    heap = [(0.0, -1)]
    heappop(heap)
    free = [0]
    free.pop()
    stack = np.empty(4096, dtype=np.int64)
    found = np.empty(used, dtype=np.int64)  # no face has more
    most, narrowed = limit, other_way.size > 0
    for cell in range(used):
        if cells.ends[cell] & bit and cells.child[cell] < 0 and cells.state[cell] != BLOCKED:
            if cells.state[cell] == FREE:
                price[cell] = 0.0
                free.append(cell)
            else:
                price[cell] = grid.price[cells.level[cell]]
                heappush(heap, (price[cell], cell))
    while free or heap:
        if free:
            cell = free.pop()
            here = price[cell]
        else:
            here, cell = heappop(heap)
            if here > price[cell]:
                continue
            if here > most:
                return
        if narrowed and other_way[cell] == 0.0:
            continue  # all around is free as far as the other end
        if not narrowed and cells.ends[cell] & (3 - bit):
            most = here * (1.0 + ROUNDED)
        for face in range(6 if grid.turns[0] > 1 else 4):
            for n in range(beside(grid, cells, cell, face, stack, found)):
                other = found[n]
                if narrowed and here + other_way[other] > most:
                    continue
                if cells.state[other] == FREE:
                    if here < price[other]:
                        price[other] = here
                        free.append(other)
                else:
                    there = here + grid.price[cells.level[other]]
                    if there < price[other]:
                        price[other] = there
                        heappush(heap, (there, other))


@kernel
def free_path(grid: Grid, cells: Cells, used: int) -> IntArray:
    """Leaves (n,) along a way from the start to a goal through free ones, as few as there are."""
    before = np.full(used, -2, dtype=np.int64)
    queue = np.empty(used, dtype=np.int64)
    first, last = 0, 0
    stack = np.empty(4096, dtype=np.int64)
    found = np.empty(used, dtype=np.int64)  # no face has more
    for cell in range(used):
        if cells.ends[cell] & START and cells.child[cell] < 0 and cells.state[cell] == FREE:
            before[cell] = -1
            queue[last] = cell
            last += 1
    while first < last:
        cell = queue[first]
        first += 1
        if cells.ends[cell] & GOAL:
            n = 0
            while cell >= 0:
                queue[n] = cell
                n += 1
                cell = before[cell]
            return queue[:n][::-1].copy()
        for face in range(6 if grid.turns[0] > 1 else 4):
            for n in range(beside(grid, cells, cell, face, stack, found)):
                other = found[n]
                if cells.state[other] == FREE and before[other] == -2:
                    before[other] = cell
                    queue[last] = other
                    last += 1
    return queue[:0].copy()
