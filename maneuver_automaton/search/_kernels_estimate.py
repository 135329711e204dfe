"""The estimate of the cost to go: from the plane, the climb, a table, and the maneuvers to come.

The table knows no obstacles: one dynamic program backwards from the goal fills it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, kernel
from maneuver_automaton.collision.arrays import Field
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search._kernels_distance import distance_at, pop, push
from maneuver_automaton.search._kernels_nodes import FULL_TURN
from maneuver_automaton.search.arrays import CostTable, DistanceGrid, Task


@bare_inner_kernel
def table_value(
    table: CostTable, task: Task, aim: int, x: float, y: float, heading: float
) -> float:
    """Cost to go to one aim from a table made without obstacles; 0 where it does not reach."""
    # `table.value` (headings, rows, columns) is the cost from a pose seen from its goal;
    # `table.free` is the least of it over the headings of the goal.
    aims = task.aims.poses
    g_x, g_y, g_heading = aims[aim, 0], aims[aim, 1], aims[aim, 2]
    values = table.value
    # By symmetry one table serves every goal: only the pose of one end seen from the other counts.
    if task.sign > 0.0:  # this pose seen from the goal
        c, s = math.cos(g_heading), math.sin(g_heading)
        d_x, d_y, turn = x - g_x, y - g_y, heading - g_heading
        if task.aims.free[aim]:
            values = table.free
    else:  # the start seen from this pose
        c, s = math.cos(heading), math.sin(heading)
        d_x, d_y, turn = g_x - x, g_y - y, g_heading - heading
    i = math.floor((c * d_x + s * d_y) / table.cell + 0.5) + table.half
    j = math.floor((c * d_y - s * d_x) / table.cell + 0.5) + table.half
    if not (0 <= i <= 2 * table.half and 0 <= j <= 2 * table.half):
        return 0.0
    n = values.shape[0]
    share = turn / FULL_TURN
    k = math.floor((share - math.floor(share)) * n + 0.5) % n
    value = values[k, j, i]
    return value if value < math.inf else 0.0  # not reached says nothing: 0 is always right


@bare_inner_kernel
def cost_to_go(
    task: Task,
    grid: DistanceGrid,
    table: CostTable,
    plane: Field,
    pose: tuple[float, float, float, float],
    trim: int,
) -> float:
    """Estimate of the cost from here to the other end; inf if the plane alone forbids it."""
    # The path in the plane or the climb at the least price, or the table made without obstacles;
    # and the maneuvers to the class at the other end, as far as the path does not pay for them.
    aims, known = task.aims.poses, task.estimates
    x, y, heading, z = pose
    length, rise = math.inf, math.inf
    for g in range(aims.shape[0]):
        rise = min(rise, abs(aims[g, 3] - z))
    if grid.layout.columns > 0:
        length = distance_at(grid, plane, x, y)
    else:
        for g in range(aims.shape[0]):
            e_x, e_y = aims[g, 0] - x, aims[g, 1] - y
            length = min(length, math.sqrt(e_x * e_x + e_y * e_y))
    # The plane comes first: where it forbids the pose, the table is not asked. Each of the three is
    # an estimate of the whole cost, so the largest counts, not the sum.
    estimate = length * known.per_metre
    if estimate < math.inf and table.value.shape[0] > 0:
        least = math.inf
        for g in range(aims.shape[0]):
            least = min(least, table_value(table, task, g, x, y, heading))
        estimate = max(estimate, least)
    if rise > 0.0:
        estimate = max(estimate, rise * known.per_climb)
    return estimate + known.surplus[trim]  # of no trim, -1, the last


@bare_inner_kernel
def cell_of(x: float, y: float, heading: float, cell: float, half: int, n_headings: int) -> int:
    """Number of the cell of a pose, of all headings, rows and columns; -1 outside."""
    i = math.floor(x / cell + 0.5) + half
    j = math.floor(y / cell + 0.5) + half
    size = 2 * half + 1
    if not (0 <= i < size and 0 <= j < size):
        return -1
    turn = heading / FULL_TURN
    k = math.floor((turn - math.floor(turn)) * n_headings + 0.5) % n_headings
    return (k * size + j) * size + i


@kernel
def fill_table(
    twists: Array,
    rates: Array,
    edge_durations: Array,
    cell: float,
    shape: tuple[int, int],
    mirrored: bool,
) -> NDArray[np.float32]:
    """Cost (headings, rows, columns) from each cell to the goal in the middle; inf for none."""
    # Dijkstra over cells that each hold the exact pose of the cheapest path found; `shape`:
    # headings, and cells from the middle to the rim. Where the library is its own mirror image,
    # only poses on the left are looked at, and written twice.
    n_headings, half = shape
    size = 2 * half + 1
    n = n_headings * size * size
    value = np.full(n, np.inf)  # least cost from each cell to the goal that is known so far
    poses = np.empty((n, 3))  # where the path of that cost begins, of cells with a finite value
    closed = np.zeros(n, dtype=np.uint8)  # 1 once the value of a cell is final
    # The open list, a binary heap. A cell is pushed again each time that its value falls; its older
    # entries are passed over once it is closed. Where the heap is full, a lower value is left out.
    room = 4 * n + 16
    keys, items = np.empty(room), np.empty(room, dtype=np.int64)
    goal = cell_of(0.0, 0.0, 0.0, cell, half, n_headings)
    value[goal] = 0.0
    poses[goal, 0] = poses[goal, 1] = poses[goal, 2] = 0.0
    push(keys, items, 0, 0.0, goal)
    queued = 1
    while queued > 0:
        here = pop(keys, items, queued)
        queued -= 1
        if closed[here]:
            continue
        closed[here] = 1
        x, y, heading, cost = poses[here, 0], poses[here, 1], poses[here, 2], value[here]
        for trim in range(twists.shape[0]):
            for q in range(edge_durations.shape[1]):
                t = edge_durations[trim, q]
                if not t > 0.0:
                    continue
                # Backwards in time: from there the coast leads here.
                d_x, d_y, turn = coast(twists[trim, 0], twists[trim, 1], twists[trim, 2], -t)
                n_x, n_y, n_heading = compose(x, y, heading, d_x, d_y, turn)
                if mirrored and n_y < 0.0:
                    n_y, n_heading = -n_y, -n_heading  # costs as much as its image
                there = cell_of(n_x, n_y, n_heading, cell, half, n_headings)
                if there < 0 or closed[there]:
                    continue
                candidate = cost + t * rates[trim]
                if candidate < value[there] and queued < room:
                    value[there] = candidate
                    poses[there, 0], poses[there, 1], poses[there, 2] = n_x, n_y, n_heading
                    push(keys, items, queued, candidate, there)
                    queued += 1
    out = np.empty((n_headings, size, size), dtype=np.float32)
    for k in range(n_headings):
        for j in range(size):
            for i in range(size):
                best = value[(k * size + j) * size + i]
                if mirrored:  # (x, -y, -heading)
                    image = ((n_headings - k) % n_headings * size + size - 1 - j) * size + i
                    best = min(best, value[image])
                out[k, j, i] = best
    return out
