"""The first call of a query: its ends, seen from the world, and the first expansions.

All arguments of a call are made once for many queries (`beginning.Bench`); a query writes its poses
into `desk.poses`, and reads what it needs from the other arrays of the desk and the search. What is
worked out here from the poses is what `lattice_query`, `task_of` and `distance_grid` work out for a
query that goes on: those are its references.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel, inlined_kernel
from maneuver_automaton.collision._kernels_clearance import static_clearance
from maneuver_automaton.collision.world import HALF_TURN, SHARE
from maneuver_automaton.search._kernels_distance import detour_of, grid_layout, sow
from maneuver_automaton.search._kernels_lattice import expanded
from maneuver_automaton.search._kernels_nodes import GENERATION, cells_along
from maneuver_automaton.search.arrays import Desk, DistanceGrid, SearchArrays, Task
from maneuver_automaton.search.cost_to_go import CostTable
from maneuver_automaton.search.lattice_arrays import LatticeArrays
from maneuver_automaton.search.scene import Scene

NOT_BEGUN = -1  # in place of whether a search may go on


@inlined_kernel
def rounded(value: float) -> float:
    """A number as `world.rounded` rounds it."""
    return math.copysign(np.rint(value * SHARE) / SHARE, value)


@bare_inner_kernel
def see_ends(desk: Desk, scene: Scene, lib: LatticeArrays) -> bool:
    """Fill `desk.seen` and `desk.clear`; whether all are clearly free and inside the bounds."""
    to_x, to_y, turn, c, s = desk.frame
    free = True
    for k in range(desk.poses.shape[0]):
        x, y, heading = desk.poses[k, 0], desk.poses[k, 1], desk.poses[k, 2]
        if not (desk.low_x <= x <= desk.high_x and desk.low_y <= y <= desk.high_y):
            free = False
        d_x, d_y = x - to_x, y - to_y
        heading = rounded((heading - turn + math.pi) % (2.0 * math.pi) - math.pi)
        if heading <= -HALF_TURN:  # half a turn to either side is one pose
            heading = -heading
        x, y = rounded(c * d_x - s * d_y), rounded(s * d_x + c * d_y)
        desk.seen[k, 0], desk.seen[k, 1], desk.seen[k, 2] = x, y, heading
        world = scene.layers.first
        clear = static_clearance(world, lib.body, x, y, math.cos(heading), math.sin(heading))
        desk.clear[k] = clear
        if not clear > scene.keep + desk.clearly:
            free = False
    return free


@bare_inner_kernel
def set_window(desk: Desk, scene: Scene) -> None:
    """Fill the window, where it is a box around everything: around what stands, and the ends."""
    if desk.bounded:
        return
    low_x, low_y, high_x, high_y = desk.box
    for k in range(desk.seen.shape[0]):
        low_x, high_x = min(low_x, desk.seen[k, 0]), max(high_x, desk.seen[k, 0])
        low_y, high_y = min(low_y, desk.seen[k, 1]), max(high_y, desk.seen[k, 1])
    window, edges = scene.window, scene.edge_window
    window[0], window[1] = low_x - desk.pad, low_y - desk.pad
    window[2], window[3] = high_x + desk.pad, high_y + desk.pad
    for k in range(4):
        edges[k] = window[k]
        desk.window_box[k] = window[k]


@bare_inner_kernel
def set_task(desk: Desk, task: Task, margin: float) -> Task:
    """The task of a query: its ends written into arrays, its frame that of the first goal."""
    roots, aims, box = task.roots, task.aims, desk.window_box
    for i in range(4):
        roots[0, i] = desk.seen[0, i]
        for k in range(aims.shape[0]):
            aims[k, i] = desk.seen[1 + k, i]
    heading = aims[0, 2]
    far = max(box[2] - box[0], box[3] - box[1])
    _, turns, levels, ticks = task.radix
    return Task(
        sign=task.sign,
        roots=roots,
        root_trims=task.root_trims,
        aims=aims,
        aim_trims=task.aim_trims,
        aim_free=task.aim_free,
        lag=task.lag,
        frame_x=aims[0, 0],
        frame_y=aims[0, 1],
        frame_heading=heading,
        frame_cos=math.cos(heading),
        frame_sin=math.sin(heading),
        cell=task.cell,
        headings=task.headings,
        fine_cell=task.fine_cell,
        fine_headings=task.fine_headings,
        rise=task.rise,
        tick=task.tick,
        radix=(cells_along(task.fine_cell, far, desk.others), turns, levels, ticks),
        weight=task.weight,
        per_metre=task.per_metre,
        per_climb=task.per_climb,
        per_interval=task.per_interval,
        least_interval=task.least_interval,
        most_interval=task.most_interval,
        connection_factor=task.connection_factor,
        connection_slack=task.connection_slack,
        tries=task.tries,
        stop_at_first=task.stop_at_first,
        ends_early=task.ends_early,
        truncated=task.truncated,
        back_off=max(desk.back_off, 2.0 * margin),
        shortest_truncated=task.shortest_truncated,
        clock=task.clock,
        most_time=task.most_time,
        stay_until=task.stay_until,
        most_trims=task.most_trims,
        least_coast=task.least_coast,
        checks_words=task.checks_words,
        by_gear=task.by_gear,
        by_trim=task.by_trim,
        by_count=task.by_count,
    )


@bare_inner_kernel
def set_grid(desk: Desk, scene: Scene, grid: DistanceGrid, aims: Array, aim: Array) -> DistanceGrid:
    """The distances of a query in memory that is there, none known but those of the aims.

    With more cells than there is memory for it has no columns.
    """
    field, box, cell = scene.layers.plane, desk.window_box, grid.cell
    i, columns, x = grid_layout(field.origin_x, box[0], box[2], cell, field.cell, grid.stride)
    j, rows, y = grid_layout(field.origin_y, box[1], box[3], cell, field.cell, grid.stride)
    n = columns * rows
    if n > grid.value.shape[0]:
        columns = rows = n = 0
    for k in range(n):
        grid.mark[k] = 0
    for k in range(grid.heads.shape[0]):
        grid.heads[k] = 0
    for k in range(grid.state.shape[0]):
        grid.state[k] = 0
    laid = DistanceGrid(
        value=grid.value,
        rank=grid.rank,
        mark=grid.mark,
        keys=grid.keys,
        items=grid.items,
        links=grid.links,
        heads=grid.heads,
        state=grid.state,
        origin_x=x,
        origin_y=y,
        cell=cell,
        columns=columns,
        rows=rows,
        stride=grid.stride,
        shift_x=i * grid.stride,
        shift_y=j * grid.stride,
        inflation=grid.inflation,
        wanted=grid.wanted,
        cut=grid.cut,
        detour=detour_of(columns, rows),
        aim_i=math.floor((aim[0] - x) / cell),
        aim_j=math.floor((aim[1] - y) / cell),
    )
    if n > 0:
        sow(laid, aims)
    return laid


@bare_kernel
def begin_search(
    desk: Desk,
    search: SearchArrays,
    task: Task,
    lib: LatticeArrays,
    scene: Scene,
    grid: DistanceGrid,
    table: CostTable,
) -> int:
    """See the ends of a query, and expand up to `desk.asked[0]` nodes from the start.

    Returns -1 where the ends are not clearly free, or the window is too large for the memory: then
    nothing is begun. Otherwise whether the search may go on, as `expanded`.
    """
    if not see_ends(desk, scene, lib):
        return NOT_BEGUN
    # The proven clearance: a share of the body, at most half of what the ends have.
    margin = desk.usual
    for k in range(desk.clear.shape[0]):
        margin = min(margin, 0.5 * (desk.clear[k] - scene.keep))
    margin = max(desk.least, margin)
    desk.margin[0] = margin
    set_window(desk, scene)
    ready = set_task(desk, task, margin)
    laid = set_grid(desk, scene, grid, ready.aims, ready.roots[0])
    if laid.columns == 0:
        return NOT_BEGUN
    state = search.state
    generation = state[GENERATION] + 1  # frees all rows of the hash table at once
    for k in range(state.shape[0]):
        state[k] = 0
    state[GENERATION], search.found[0] = generation, math.inf
    around = Scene(
        layers=scene.layers,
        keep=scene.keep,
        margin=margin,
        far=scene.far,
        window=scene.window,
        edge_window=scene.edge_window,
        lowest=scene.lowest,
        highest=scene.highest,
        zone_trims=scene.zone_trims,
        zone_pieces=scene.zone_pieces,
    )
    return expanded(search, ready, lib, around, laid, table, desk.asked[0], math.inf)
