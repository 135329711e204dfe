"""A* over lattice cells that each hold one exact pose, for every vehicle.

The state is a pose and a class of trims, those that the vehicle changes between at will. An edge is
a transition and a coast: within the class a coast of one of its trims, to another class a maneuver,
after which coasts begin. A kinematic vehicle has one class and no maneuvers; a vehicle whose every
trim is a class of its own has one trim to coast in. Nothing else tells them apart here.

`_kernels_nodes` explains the arrays and the open list.
"""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.search._kernels_distance import push
from maneuver_automaton.search._kernels_estimate import cost_to_go
from maneuver_automaton.search._kernels_expansion import connect_ends
from maneuver_automaton.search._kernels_nodes import (
    BEGUN,
    CLOSED,
    EXPANSIONS,
    FOUND,
    GENERATION,
    HEADING,
    HEAP,
    INTERVAL,
    N_NODES,
    ROOTED,
    TRIM,
    X,
    Y,
    Z,
    add_node,
    cell_key,
    layer_of,
    node_in,
    open_node,
    slot_of,
)
from maneuver_automaton.search._kernels_relax import relax_coasts, relax_maneuvers
from maneuver_automaton.search.arrays import DistanceGrid, SearchArrays, Task
from maneuver_automaton.search.cost_to_go import CostTable
from maneuver_automaton.search.lattice_arrays import LatticeArrays
from maneuver_automaton.search.scene import Scene


@bare_kernel
def expand(
    search: SearchArrays,
    task: Task,
    lib: LatticeArrays,
    scene: Scene,
    grid: DistanceGrid,
    table: CostTable,
    n: int,
    upper_bound: float,
) -> int:
    """Expand up to `n` nodes, as `expanded`, for callers from Python."""
    return expanded(search, task, lib, scene, grid, table, n, upper_bound)


@bare_inner_kernel
def expanded(
    search: SearchArrays,
    task: Task,
    lib: LatticeArrays,
    scene: Scene,
    grid: DistanceGrid,
    table: CostTable,
    n: int,
    upper_bound: float,
) -> int:
    """Expand up to `n` nodes, the roots first; stops at the first connection if the task says so.

    Children that cannot lead to less than `upper_bound` are left out. Returns whether it may go on:
    1, or 0 when nothing is left to expand.
    """
    nodes, links, state = search.nodes, search.links, search.state
    if state[BEGUN] == 0:
        _push_roots(search, task, lib, scene, grid, table)
    room = nodes.shape[0] - lib.most_children - 1  # so that one expansion always fits
    for _ in range(n):
        node = open_node(search, task, upper_bound)
        if node < 0:
            return 0
        if state[N_NODES] > room:  # the caller widens the arrays, and comes back
            # Before all others, whose keys are costs and so not below 0.
            push(search.heap_key, search.heap_node, state[HEAP], -1.0, node)
            state[HEAP] += 1
            return 1
        links[node, CLOSED] = 1
        state[EXPANSIONS] += 1
        pose = (nodes[node, X], nodes[node, Y], nodes[node, HEADING], nodes[node, Z])
        plane = scene.layers.plane
        here = cost_to_go(task, grid, table, plane, pose, links[node, TRIM])
        if here == math.inf:
            continue
        # Analytic expansions cost as much as many nodes: the nearer the goal, the more often.
        state[INTERVAL] -= 1
        if state[INTERVAL] < 0:
            interval = min(here / task.per_interval, task.most_interval)
            state[INTERVAL] = int(max(interval, task.least_interval))
            connect_ends(search, task, lib, scene, node, upper_bound, here)
            if state[FOUND] == 1 and task.stop_at_first:
                return 1
        relax_coasts(search, task, lib, scene, grid, table, node, upper_bound)
        if lib.edge_cost.shape[0] > 0:
            relax_maneuvers(search, task, lib, scene, grid, table, node, upper_bound)
    return 1


@bare_inner_kernel
def _push_roots(
    search: SearchArrays,
    task: Task,
    lib: LatticeArrays,
    scene: Scene,
    grid: DistanceGrid,
    table: CostTable,
) -> None:
    """Push the roots of a search."""
    state, generation = search.state, search.state[GENERATION]
    state[BEGUN] = 1
    for r in range(task.roots.shape[0]):
        pose = (task.roots[r, 0], task.roots[r, 1], task.roots[r, 2], task.roots[r, 3])
        x, y, heading, z = pose
        trim = task.root_trims[r]
        estimate = cost_to_go(task, grid, table, scene.layers.plane, pose, trim)
        key = cell_key(task, x, y, heading, z, layer_of(task, lib, trim, 0, 0), 0.0, 0)
        slot = slot_of(search.table, generation, key)
        # A root that cannot reach an aim, or shares its cell with an earlier one, is left out.
        if estimate == math.inf or node_in(search.table, generation, slot) >= 0:
            continue
        row = (x, y, heading, z, 0.0, 0.0, 0.0, 0.0, 0.0)
        add_node(search, task.weight, slot, key, row, (-1, trim, 0, 0, r, ROOTED), estimate)
