"""The estimate of the cost to go: from the plane, the climb, a table, and the maneuvers to come."""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, inlined_kernel
from maneuver_automaton.collision.arrays import Field
from maneuver_automaton.search._kernels_distance import distance_at
from maneuver_automaton.search._kernels_nodes import FULL_TURN
from maneuver_automaton.search.arrays import DistanceGrid, Task
from maneuver_automaton.search.cost_to_go import CostTable


@inlined_kernel
def table_value(
    table: CostTable, task: Task, aim: int, x: float, y: float, heading: float
) -> float:
    """Cost to go to one aim from a table made without obstacles; 0 where it does not reach.

    `table.value` (headings, rows, columns) is the cost from a pose seen from its goal; `table.free`
    is the least of it over the headings of the goal.
    """
    g_x, g_y, g_heading = task.aims[aim, 0], task.aims[aim, 1], task.aims[aim, 2]
    values = table.value
    # By symmetry one table serves every goal: only the pose of one end seen from the other counts.
    if task.sign > 0.0:  # this pose seen from the goal
        c, s = math.cos(g_heading), math.sin(g_heading)
        d_x, d_y, turn = x - g_x, y - g_y, heading - g_heading
        if task.aim_free[aim]:
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
def table_to_go(table: CostTable, task: Task, x: float, y: float, heading: float) -> float:
    """Cost to go to the nearest aim by the table; 0 where it does not reach one of them."""
    least = math.inf
    for aim in range(task.aims.shape[0]):
        least = min(least, table_value(table, task, aim, x, y, heading))
        if least == 0.0:
            break
    return least


@inlined_kernel
def cost_to_go(
    task: Task,
    grid: DistanceGrid,
    table: CostTable,
    field: Field,
    pose: tuple[float, float, float, float],
    trim: int,
) -> float:
    """Estimate of the cost from here to the other end; inf if the plane alone forbids it.

    The path in the plane or the climb at the least price, or the table made without obstacles; and
    the maneuvers to the class at the other end, as far as the path does not pay for them.
    """
    x, y, heading, z = pose
    length, rise = math.inf, math.inf
    for g in range(task.aims.shape[0]):
        rise = min(rise, abs(task.aims[g, 3] - z))
    if grid.columns > 0:
        length = distance_at(grid, field, x, y)
    else:
        for g in range(task.aims.shape[0]):
            e_x, e_y = task.aims[g, 0] - x, task.aims[g, 1] - y
            length = min(length, math.sqrt(e_x * e_x + e_y * e_y))
    # The plane comes first: where it forbids the pose, the table is not asked. Each of the three is
    # an estimate of the whole cost, so the largest counts, not the sum.
    estimate = length * task.per_metre
    if estimate < math.inf and table.value.shape[0] > 0:
        estimate = max(estimate, table_to_go(table, task, x, y, heading))
    if rise > 0.0:
        estimate = max(estimate, rise * task.per_climb)
    return estimate + task.lag[trim]  # of no trim, -1, the last
