"""A* on a state lattice: nodes are whole numbers, so that no two of them are taken for one.

A node is a column, a row and a state, which is a heading, and the direction of travel where
changes of it have a price. Rows of nodes are those of `_kernels_nodes`, with the state, the column
and the row in place of the trim, the gear and the count.

With a weight of 1 the estimate is consistent, so a node that is expanded has its least cost, and
the first aim that is expanded the least of all plans. What rests on more than the motions that were
tested is kept in `found`: the least cost that a plan outside of the window may have.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from maneuver_automaton._compile import bare_kernel, inlined_kernel
from maneuver_automaton.collision._kernels_clearance import static_clearance
from maneuver_automaton.collision._kernels_layers import layer_world
from maneuver_automaton.search._kernels_distance import pop, push
from maneuver_automaton.search._kernels_maneuver import edge_inside, edge_proven
from maneuver_automaton.search._kernels_nodes import (
    BEGUN,
    CLEARANCE,
    CLOSED,
    COST,
    COUNT,
    EXPANSIONS,
    FOUND,
    GEAR,
    GENERATION,
    GOAL,
    HEADING,
    HEAP,
    N_NODES,
    NODE,
    QUERIES,
    ROOTED,
    TRIM,
    X,
    Y,
    add_node,
    node_in,
    slot_of,
)

if TYPE_CHECKING:
    from maneuver_automaton._arrays import Array
    from maneuver_automaton.search.lattice_memory import SearchArrays
    from maneuver_automaton.search.state_lattice import Aims, StateLattice, Tested

STATE_BITS, ROW_BITS, SHIFT = 8, 22, 40  # of the number of a node, and where its column begins
MASK = (1 << ROW_BITS) - 1
FREE, SOLID, RIM = range(3)  # what an edge meets
CUT = 1  # place in `found` of the least cost of a plan that leaves the window


@inlined_kernel
def number_of(column: int, row: int, state: int) -> int:
    """Number of a node; columns and rows 2^22 apart share theirs, farther than any search gets.

    `first_slot` folds its high digits onto the low ones: the gap between row and column keeps those
    of a neighbourhood apart, which would share rows of the hash table otherwise.
    """
    return ((column & MASK) << SHIFT) | ((row & MASK) << STATE_BITS) | state


@inlined_kernel
def least_to_go(aims: Aims, x: float, y: float, state: int) -> float:
    """Lower bound of the cost from a place of the lattice [m], in a state, to the nearest aim.

    Each edge costs its displacement at the least price, and a surplus: the least sum of surpluses
    from state to state adds to the straight line. So no edge lowers the bound by more than it
    costs.
    """
    least = math.inf
    for g in range(aims.place.shape[0]):
        d_x, d_y = aims.place[g, 0] - x, aims.place[g, 1] - y
        least = min(least, math.sqrt(d_x * d_x + d_y * d_y) - aims.within[g])
    return float(max(least, 0.0) * aims.per_metre + aims.surplus[state])


@inlined_kernel
def aim_at(aims: Aims, x: float, y: float, state: int) -> int:
    """Number of the aim that holds a place of the lattice [m] in a state; -1 if none does."""
    for g in range(aims.place.shape[0]):
        d_x, d_y = aims.place[g, 0] - x, aims.place[g, 1] - y
        if aims.admits[g, state] and d_x * d_x + d_y * d_y <= aims.within[g] * aims.within[g]:
            return g
    return -1


@inlined_kernel
def clearance_at(tested: Tested, pose: tuple[float, float, float, float]) -> float:
    """Clearance of the body at a pose beyond the distance to keep: a bound, exact near contact."""
    x, y, heading, z = pose
    scene, lib = tested.scene, tested.lib
    layers, c, s = scene.layers, math.cos(heading), math.sin(heading)
    least = scene.far
    for n in range(layers.low.shape[0] - scene.zone_trims.shape[0]):
        if layers.low[n] <= z <= layers.high[n]:
            world = layer_world(layers, n)
            least = min(least, static_clearance(world, lib.body, x, y, c, s) - scene.keep)
    return least


@inlined_kernel
def is_far_inside(window: Array, x: float, y: float, travel: float) -> bool:
    """Whether a pose that moves no farther than `travel` stays inside a window."""
    d_x, d_y = x - window[4], y - window[5]
    a_x, a_y = window[6] * d_x - window[7] * d_y, window[7] * d_x + window[6] * d_y
    return bool(
        a_x - travel > window[0]
        and a_y - travel > window[1]
        and a_x + travel < window[2]
        and a_y + travel < window[3]
    )


@inlined_kernel
def met_along(
    coarse: Tested,
    fine: Tested,
    edge: int,
    pose: tuple[float, float, float, float],
    near: float,
    travel: float,
) -> int:
    """What an edge meets: FREE, a SOLID, or the RIM of the window.

    All of it is at least `near` from any static obstacle, and its path no longer than `travel`. A
    few pieces of its course prove most other edges. Where they do not, all of them are looked at,
    each followed exactly and to within a margin that is next to nothing: what is not proven then is
    met.
    """
    # A call hands over every field of a scene, which takes longer than these tests: they are
    # merged into the loop, and leave most edges to no call at all.
    scene = coarse.scene
    inside = is_far_inside(scene.edge_window, pose[0], pose[1], travel)
    inside = inside or edge_inside(scene, coarse.lib, edge, pose)
    if inside:
        # A zone may forbid what no obstacle does.
        if near > scene.margin and scene.zone_trims.shape[0] == 0:
            return FREE
        if edge_proven(scene, coarse.lib, edge, pose, 0.0) >= 0.0:
            return FREE
    elif not edge_inside(fine.scene, fine.lib, edge, pose):
        return RIM
    return FREE if edge_proven(fine.scene, fine.lib, edge, pose, 0.0) >= 0.0 else SOLID


@bare_kernel
def expand_lattice(
    search: SearchArrays,
    lattice: StateLattice,
    aims: Aims,
    coarse: Tested,
    fine: Tested,
    weight: float,
    n: int,
    upper_bound: float,
) -> int:
    """Expand up to `n` nodes in the order of their cost and the weighted bound of the cost to go.

    Returns whether it may go on: 1, or 0 once an aim is found or nothing is left that leads to a
    plan cheaper than `upper_bound`.
    """
    nodes, links, state = search.nodes, search.links, search.state
    generation = state[GENERATION]
    c, s = lattice.frame[3], lattice.frame[4]
    room = nodes.shape[0] - lattice.most_children - 1  # so that one expansion always fits
    if state[BEGUN] == 0:
        state[BEGUN] = 1
        search.found[CUT] = math.inf
        for r in range(lattice.roots.shape[0]):
            column, row, at = lattice.roots[r, 0], lattice.roots[r, 1], lattice.roots[r, 2]
            u, v = column * lattice.cell, row * lattice.cell
            x, y = lattice.frame[0] + c * u - s * v, lattice.frame[1] + s * u + c * v
            key = number_of(column, row, at)
            slot = slot_of(search.table, generation, key)
            ahead = least_to_go(aims, u, v, at)
            if ahead == math.inf or node_in(search.table, generation, slot) >= 0:
                continue
            turn = lattice.frame[2] + lattice.heading[at]
            # Its clearance, which is not asked for, is 0: nothing rests on that.
            values = (x, y, turn, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            link = (-1, at, column, row, r, ROOTED)
            add_node(search, weight, slot, key, values, link, ahead)
    for _ in range(n):
        # The most promising node that is open; one that was reached at less cost since is closed.
        node = -1
        while node < 0 and state[HEAP] > 0:
            # With a weight above 1 the key is no bound, and each node has to be looked at.
            if weight == 1.0 and search.heap_key[0] >= upper_bound:
                return 0
            node = pop(search.heap_key, search.heap_node, state[HEAP])
            state[HEAP] -= 1
            if links[node, CLOSED]:
                node = -1
        if node < 0:
            return 0
        if state[N_NODES] > room:  # the caller widens the arrays, and comes back
            push(search.heap_key, search.heap_node, state[HEAP], -1.0, node)
            state[HEAP] += 1
            return 1
        links[node, CLOSED] = 1
        state[EXPANSIONS] += 1
        at, column, row = int(links[node, TRIM]), int(links[node, GEAR]), int(links[node, COUNT])
        aim = aim_at(aims, column * lattice.cell, row * lattice.cell, at)
        if aim >= 0:
            state[FOUND], state[NODE], state[GOAL] = 1, node, aim
            search.found[0] = nodes[node, COST]
            return 0
        pose = (nodes[node, X], nodes[node, Y], nodes[node, HEADING], 0.0)
        for e in range(lattice.first[at], lattice.first[at + 1]):
            cost, edge = nodes[node, COST] + lattice.cost[e], lattice.edge[e]
            n_column, n_row = column + lattice.step[e, 0], row + lattice.step[e, 1]
            target = lattice.target[e]
            # The order of the tests is that of their price: duplicates, the bound, the motion.
            key = number_of(n_column, n_row, target)
            slot = slot_of(search.table, generation, key)
            old = node_in(search.table, generation, slot)
            if old >= 0 and (links[old, CLOSED] or nodes[old, COST] <= cost):
                continue
            u, v = n_column * lattice.cell, n_row * lattice.cell
            ahead = least_to_go(aims, u, v, target)
            if cost + ahead >= upper_bound:
                continue
            # The pose follows from the numbers alone: no error adds up along a plan.
            x, y = lattice.frame[0] + c * u - s * v, lattice.frame[1] + s * u + c * v
            there = (x, y, lattice.frame[2] + lattice.heading[target], 0.0)
            # A pose that touches something ends no edge: it is looked at once, and left closed.
            clearance = nodes[old, CLEARANCE] if old >= 0 else clearance_at(fine, there)
            if clearance <= fine.scene.margin:
                node_new = state[N_NODES]
                nodes[node_new, COST], links[node_new, CLOSED] = -math.inf, 1
                search.table[slot, 0], search.table[slot, 1] = key, (generation << 31) | node_new
                state[N_NODES] += 1
                continue
            # No point of the body moves farther than `edge_reach`: where it has moved by t of that,
            # its clearance is at least the first less t, and the last less the rest.
            first, reach = nodes[node, CLEARANCE], coarse.lib.edge_reach[edge]
            near = max(0.5 * (first + clearance - reach), max(first, clearance) - reach)
            state[QUERIES] += 1
            begin = pose if lattice.sign > 0 else there
            met = met_along(coarse, fine, edge, begin, near, lattice.travel[e])
            if met == RIM:
                search.found[CUT] = min(search.found[CUT], cost + ahead)
            if met != FREE:
                continue
            if old >= 0:
                links[old, CLOSED] = 1
            values = (x, y, there[2], 0.0, cost, 0.0, 0.0, 0.0, clearance)
            link = (node, target, n_column, n_row, 0, e)
            add_node(search, weight, slot, key, values, link, ahead)
    return 1
