"""The first call of a query: its ends, seen from the world, and the first expansions.

All arguments of a call are made once for many queries (`beginning.FirstCall`); a query writes its
poses into `call.poses`, and reads what it needs from the other arrays of the call and the search.
What is worked out here from the poses is what `lattice_query`, `task_of` and `distance_grid` work
out for a query that goes on: those are its references.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.collision._kernels_clearance import static_clearance
from maneuver_automaton.collision.arrays import Place
from maneuver_automaton.collision.world import HALF_TURN, SHARE
from maneuver_automaton.search._kernels_distance import detour_of, grid_layout, sow
from maneuver_automaton.search._kernels_lattice import expanded
from maneuver_automaton.search._kernels_nodes import GENERATION, cells_along
from maneuver_automaton.search.arrays import (
    CellSizes,
    DistanceGrid,
    FirstCallArrays,
    GridLayout,
    GridWalls,
    LatticeArrays,
    LatticeSearch,
    Scene,
    Task,
    Truncation,
)

NOT_BEGUN = -1  # in place of whether a search may go on


@bare_inner_kernel
def rounded(value: float) -> float:
    """A number as `world.rounded` rounds it."""
    return math.copysign(np.rint(value * SHARE) / SHARE, value)


@bare_inner_kernel
def see_ends(call: FirstCallArrays, scene: Scene, lib: LatticeArrays) -> bool:
    """Fill `call.seen` and `call.clear`; whether all are clearly free and inside the bounds."""
    to_x, to_y, turn, c, s = call.frame
    low_x, low_y, high_x, high_y = call.bounds
    free = True
    for k in range(call.poses.shape[0]):
        x, y, heading = call.poses[k, 0], call.poses[k, 1], call.poses[k, 2]
        if not (low_x <= x <= high_x and low_y <= y <= high_y):
            free = False
        d_x, d_y = x - to_x, y - to_y
        heading = rounded((heading - turn + math.pi) % (2.0 * math.pi) - math.pi)
        if heading <= -HALF_TURN:  # half a turn to either side is one pose
            heading = -heading
        x, y = rounded(c * d_x - s * d_y), rounded(s * d_x + c * d_y)
        call.seen[k, 0], call.seen[k, 1], call.seen[k, 2] = x, y, heading
        world = scene.layers.first
        place = Place(x, y, math.cos(heading), math.sin(heading))
        clear = static_clearance(world, lib.parts.body, place)
        call.clear[k] = clear
        if not clear > scene.keep + call.margins.clearly:
            free = False
    return free


@bare_inner_kernel
def set_window(call: FirstCallArrays, scene: Scene) -> None:
    """Fill the window, where it is a box around everything: around what stands, and the ends."""
    if call.bounded:
        return
    low_x, low_y, high_x, high_y = call.box
    for k in range(call.seen.shape[0]):
        low_x, high_x = min(low_x, call.seen[k, 0]), max(high_x, call.seen[k, 0])
        low_y, high_y = min(low_y, call.seen[k, 1]), max(high_y, call.seen[k, 1])
    window, edges = scene.window, scene.edge_window
    window[0], window[1] = low_x - call.pad, low_y - call.pad
    window[2], window[3] = high_x + call.pad, high_y + call.pad
    for k in range(4):
        edges[k] = window[k]
        call.window_box[k] = window[k]


@bare_inner_kernel
def set_task(call: FirstCallArrays, task: Task, margin: float) -> Task:
    """The task of a query: its ends written into arrays, its frame that of the first goal."""
    roots, aims = task.roots.poses, task.aims.poses
    box, cells = call.window_box, task.cells
    for i in range(4):
        roots[0, i] = call.seen[0, i]
        for k in range(aims.shape[0]):
            aims[k, i] = call.seen[1 + k, i]
    heading = aims[0, 2]
    far = max(box[2] - box[0], box[3] - box[1])
    _, turns, levels, ticks = cells.radix
    # Only the frame and the radix of the cells, and the distance before a contact, are the query's.
    return Task(
        task.sign,
        task.roots,
        task.aims,
        CellSizes(
            (aims[0, 0], aims[0, 1], heading, math.cos(heading), math.sin(heading)),
            cells.cell,
            cells.headings,
            cells.fine_cell,
            cells.fine_headings,
            cells.rise,
            cells.tick,
            (cells_along(cells.fine_cell, far, call.others), turns, levels, ticks),
            cells.by_gear,
            cells.by_trim,
            cells.by_count,
        ),
        task.estimates,
        task.connecting,
        Truncation(
            task.truncation.kept, max(call.margins.back_off, 2.0 * margin), task.truncation.shortest
        ),
        task.limits,
        task.stop_at_first,
        task.ends_early,
    )


@bare_inner_kernel
def set_grid(
    call: FirstCallArrays, scene: Scene, grid: DistanceGrid, aims: Array, aim: Array
) -> DistanceGrid:
    """The distances of a query in memory that is there; without columns where that is too small."""
    field, box = scene.layers.plane, call.window_box
    was, walls = grid.layout, grid.walls
    cell, stride = was.cell, was.stride
    i, columns, x = grid_layout(field.origin_x, box[0], box[2], cell, field.cell, stride)
    j, rows, y = grid_layout(field.origin_y, box[1], box[3], cell, field.cell, stride)
    n = columns * rows
    if n > grid.value.shape[0]:
        columns = rows = n = 0
    for k in range(n):
        grid.mark[k] = 0
    for k in range(grid.queue.heads.shape[0]):
        grid.queue.heads[k] = 0
    for k in range(grid.state.shape[0]):
        grid.state[k] = 0
    aim_i, aim_j = math.floor((aim[0] - x) / cell), math.floor((aim[1] - y) / cell)
    layout = GridLayout(x, y, cell, columns, rows, stride, i * stride, j * stride, aim_i, aim_j)
    beside = GridWalls(walls.inflation, walls.wanted, walls.cut, detour_of(columns, rows))
    laid = DistanceGrid(
        grid.value,
        grid.rank,
        grid.mark,
        grid.state,
        grid.queue,
        layout,
        beside,
        grid.prices,
        scene.window,
    )
    if n > 0:
        sow(laid, aims)
    return laid


@bare_kernel
def begin_search(call: FirstCallArrays, search: LatticeSearch) -> int:
    """See the ends of a query, expand up to `call.asked[0]` nodes; whether more, as `expanded`."""
    # -1, and nothing is begun, where the ends are not clearly free or the window exceeds the
    # memory.
    scene, margins = search.scene, call.margins
    if not see_ends(call, scene, search.library):
        return NOT_BEGUN
    # The proven clearance: a share of the body, at most half of what the ends have.
    margin = margins.usual
    for k in range(call.clear.shape[0]):
        margin = min(margin, 0.5 * (call.clear[k] - scene.keep))
    margin = max(margins.least, margin)
    call.margin[0] = margin
    set_window(call, scene)
    ready = set_task(call, search.task, margin)
    laid = set_grid(call, scene, search.grid, ready.aims.poses, ready.roots.poses[0])
    if laid.layout.columns == 0:
        return NOT_BEGUN
    state = search.arrays.state
    generation = state[GENERATION] + 1  # frees all rows of the hash table at once
    for k in range(state.shape[0]):
        state[k] = 0
    state[GENERATION], search.arrays.found[0] = generation, math.inf
    around = Scene(
        scene.layers,
        scene.keep,
        margin,
        scene.far,
        scene.window,
        scene.edge_window,
        scene.lowest,
        scene.highest,
        scene.zone_trims,
        scene.zone_pieces,
        scene.place,
    )
    begun = LatticeSearch(search.arrays, ready, search.library, around, laid, search.table)
    return expanded(begun, call.asked[0], math.inf)
