"""A* on a state lattice: nodes are whole numbers, so that no two of them are taken for one.

A node is a column, a row and a state, which is a heading, and the direction of travel where
changes of it have a price. The arrays of a search, `GraphArrays`:

    table (4 p, 2)     hash table of places, as in `_kernels_nodes`: key, 1 << 31 and the place
    node, least (p, S) of each state at a place: the node, or UNKNOWN, REFUSED (a motion to it hits
                       something) or SOLID (its pose does); what a motion to it has to cost less
                       than to be listed, -inf where none has to be, inf where all have to
    cost, clearance,   (n,), (n,), (n, 5) of each node that was expanded: the cost from a root, the
    links              clearance of its pose; COLUMN, ROW, STATE, PARENT (-1 for a root), and EDGE,
                       the number of the root for a root
    heap_key, heap_item (m,) the open list, a binary heap of motions: the node they begin at times
                       2^32, and their edge; -1 - r for root r
    state, found       the numbers named below; `found` holds the least cost of a plan that leaves
                       the window
    places, costs      (e,) where the edges of a node lead, and `least` there

The search is lazy: the open list holds motions that were not tested, by the cost to where they end
and the weighted bound of the cost to go. What is taken from it is tested, and gives a node if it is
free. So one motion is tested for most nodes, and none for those that are never expanded. Motions
that are no cheaper than one to the same node are left out, until one to it hits something: then all
of them are listed.

With a weight of 1 the estimate is consistent, so a node that is expanded has its least cost, and
the first aim that is expanded the least of all plans. What rests on more than the motions that were
tested is kept in `found`.

Source: Cohen, Phillips, Likhachev (2014), *Planning single-arm manipulations with n-arm robots*,
RSS, for lazy A*; Irnich, Desaulniers (2005), *Shortest path problems with resource constraints*,
for prices of a resource, here the displacement, as a bound of the cost to go.
"""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.collision._kernels_clearance import static_clearance
from maneuver_automaton.collision._kernels_layers import layer_world
from maneuver_automaton.collision.arrays import Place
from maneuver_automaton.search._kernels_connection import edge_inside, edge_proven
from maneuver_automaton.search._kernels_distance import pop, push
from maneuver_automaton.search._kernels_nodes import node_in, slot_of
from maneuver_automaton.search.arrays import Aims, GraphArrays, GraphQuery, StateLattice, Tested

ROW_BITS = 32  # of the number of a place; its column is above them
ITEM_BITS = 32  # of an entry of the open list: its edge; above them its node
EDGES = (1 << ITEM_BITS) - 1
SEARCH = 1  # number of each search in its hash table, which no other one uses
FREE, BLOCKED, RIM = range(3)  # what an edge meets
UNKNOWN, REFUSED, SOLID = -1, -2, -3  # in place of a node
COLUMN, ROW, STATE, PARENT, EDGE = range(5)
(
    N_NODES,  # nodes expanded
    N_PLACES,  # places in use
    HEAP,  # entries of the open list
    QUERIES,  # motions that were tested
    FOUND,  # 1 once the last node is an aim, ...
    AIM,  # this one
    BEGUN,  # 1 once the roots are pushed
) = range(7)


@bare_inner_kernel
def place_in(table: IntArray, column: int, row: int) -> tuple[int, int, int]:
    """Number of a place, -1 if it has none; its row of the hash table, and its key there."""
    key = ((column & 0x3FFFFFFF) << ROW_BITS) | (row & 0x3FFFFFFF)
    slot = slot_of(table, SEARCH, key)
    return node_in(table, SEARCH, slot), slot, key


@bare_inner_kernel
def place_of(search: GraphArrays, column: int, row: int) -> int:
    """Number of a place, a new one if it has none."""
    place, slot, key = place_in(search.table, column, row)
    if place < 0:
        place = search.state[N_PLACES]
        search.state[N_PLACES] += 1
        search.table[slot, 0], search.table[slot, 1] = key, (SEARCH << 31) | place
        for k in range(search.node.shape[1]):
            search.node[place, k], search.least[place, k] = UNKNOWN, math.inf
    return place


@bare_inner_kernel
def least_to_go(aims: Aims, cell: float, column: int, row: int, state: int) -> float:
    """Lower bound of the cost from a node to the nearest aim."""
    # By each slope an edge costs the price of its displacement and what is left, whose least sum
    # from state to state is the offset. So no edge lowers the bound by more than it costs.
    x, y, least = column * cell, row * cell, math.inf
    slope, offset = aims.slope, aims.offset
    for g in range(aims.place.shape[0]):
        d_x, d_y = aims.place[g, 0] - x, aims.place[g, 1] - y
        a = b = c = d = 0.0  # four at a time, none of which waits for the others
        for k in range(0, slope.shape[1], 4):
            a = max(a, slope[0, k] * d_x + slope[1, k] * d_y + offset[g, state, k])
            b = max(b, slope[0, k + 1] * d_x + slope[1, k + 1] * d_y + offset[g, state, k + 1])
            c = max(c, slope[0, k + 2] * d_x + slope[1, k + 2] * d_y + offset[g, state, k + 2])
            d = max(d, slope[0, k + 3] * d_x + slope[1, k + 3] * d_y + offset[g, state, k + 3])
        least = min(least, max(max(a, b), max(c, d)))
    return least


@bare_kernel
def lower_offsets(lattice: StateLattice, slope: Array, offset: Array, steady: IntArray) -> None:
    """Lower offsets (S, K) until no edge leads to a lower one, by the Bellman-Ford algorithm."""
    # `steady` (K,) becomes 1, or 0 for a slope by which a cycle of edges costs less than nothing.
    n, cell = offset.shape[0], lattice.cell
    for k in range(slope.shape[1]):
        steady[k] = 0
        for _ in range(n + 1):
            steady[k] = 1
            for e in range(lattice.cost.shape[0]):
                price = slope[0, k] * lattice.step[e, 0] + slope[1, k] * lattice.step[e, 1]
                through = lattice.cost[e] - cell * price + offset[lattice.target[e], k]
                if through < offset[lattice.source[e], k]:
                    offset[lattice.source[e], k], steady[k] = through, 0
            if steady[k] == 1:
                break


@bare_inner_kernel
def aim_at(aims: Aims, x: float, y: float, state: int) -> int:
    """Number of the aim that holds a place of the lattice [m] in a state; -1 if none does."""
    for g in range(aims.place.shape[0]):
        d_x, d_y = aims.place[g, 0] - x, aims.place[g, 1] - y
        if aims.admits[g, state] and d_x * d_x + d_y * d_y <= aims.within[g] * aims.within[g]:
            return g
    return -1


@bare_inner_kernel
def clearance_at(tested: Tested, pose: tuple[float, float, float, float]) -> float:
    """Clearance of the body at a pose beyond the distance to keep: a bound, exact near contact."""
    x, y, heading, z = pose
    scene, lib = tested.scene, tested.lib
    layers, place = scene.layers, Place(x, y, math.cos(heading), math.sin(heading))
    least = scene.far
    for n in range(layers.low.shape[0] - scene.zone_trims.shape[0]):
        if layers.low[n] <= z <= layers.high[n]:
            world = layer_world(layers, n)
            least = min(least, static_clearance(world, lib.parts.body, place) - scene.keep)
    return least


@bare_inner_kernel
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


@bare_inner_kernel
def met_along(
    coarse: Tested,
    fine: Tested,
    edge: int,
    pose: tuple[float, float, float, float],
    near: float,
    travel: float,
) -> int:
    """What an edge meets: FREE, BLOCKED, or the RIM of the window."""
    # All of it is at least `near` from any static obstacle, and its path no longer than `travel`. A
    # few pieces of its course prove most other edges. Where they do not, all are looked at, each
    # followed exactly and to within a margin that is next to nothing: what is not proven then is
    # met.
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
    return FREE if edge_proven(fine.scene, fine.lib, edge, pose, 0.0) >= 0.0 else BLOCKED


@bare_inner_kernel
def pose_in(
    frame: tuple[float, float, float, float, float],
    lattice: StateLattice,
    column: int,
    row: int,
    state: int,
) -> tuple[float, float, float, float]:
    """Pose of a node: it follows from the numbers alone, so that no error adds up along a plan."""
    u, v, (x, y, turn, c, s) = column * lattice.cell, row * lattice.cell, frame
    return x + c * u - s * v, y + s * u + c * v, turn + lattice.heading[state], 0.0


@bare_inner_kernel
def end_of(
    search: GraphArrays, lattice: StateLattice, item: int
) -> tuple[int, int, int, int, int, float]:
    """Node and edge of an entry of the open list, column, row, state and cost where it ends."""
    if item < 0:
        r = -1 - item
        return -1, r, lattice.roots[r, 0], lattice.roots[r, 1], lattice.roots[r, 2], 0.0
    node, e = item >> ITEM_BITS, item & EDGES
    column = search.links[node, COLUMN] + lattice.step[e, 0]
    row = search.links[node, ROW] + lattice.step[e, 1]
    return node, e, column, row, lattice.target[e], search.cost[node] + lattice.cost[e]


@bare_kernel
def expand_lattice(query: GraphQuery, n: int, upper_bound: float) -> int:
    """Take up to `n` motions in the order of their cost and weighted bound of the cost to go."""
    # Returns 1 if it may go on, 0 once an aim is found or nothing is left that leads to a plan
    # cheaper than `upper_bound`.
    search, lattice = query.arrays, query.lattice
    aims, coarse, fine, weight = query.aims, query.coarse, query.fine, query.weight
    links, state, cell = search.links, search.state, lattice.cell
    if state[BEGUN] == 0:
        state[BEGUN] = 1
        for r in range(lattice.roots.shape[0]):
            column, row, at = lattice.roots[r, 0], lattice.roots[r, 1], lattice.roots[r, 2]
            ahead = least_to_go(aims, cell, column, row, at)
            place = place_of(search, column, row)
            if ahead < math.inf and search.least[place, at] == math.inf:
                search.least[place, at] = 0.0
                push(search.heap_key, search.heap_item, state[HEAP], weight * ahead, -1 - r)
                state[HEAP] += 1
    for _ in range(n):
        # With a weight above 1 the key is no bound, and each motion has to be looked at.
        if state[HEAP] == 0 or (weight == 1.0 and search.heap_key[0] >= upper_bound):
            return 0
        # One node always fits: where it might not, the caller widens the arrays, and comes back.
        if (
            state[N_NODES] == search.cost.shape[0]
            or state[N_PLACES] + lattice.most_links > search.node.shape[0]
            or state[HEAP] + lattice.most_links > search.heap_key.shape[0]
        ):
            return 1
        item = pop(search.heap_key, search.heap_item, state[HEAP])
        state[HEAP] -= 1
        parent, e, column, row, at, cost = end_of(search, lattice, item)
        place = place_of(search, column, row)
        known = search.node[place, at]
        if known >= 0 or known == SOLID:
            continue  # a cheaper motion led there, or none can
        clearance = 0.0  # that of a root is not asked for: nothing rests on it
        if item >= 0:
            there = pose_in(lattice.frame, lattice, column, row, at)
            clearance = clearance_at(fine, there)
            if clearance <= fine.scene.margin:
                search.node[place, at], search.least[place, at] = SOLID, -math.inf
                continue
            # No point of the body moves farther than `edge_reach`: where it has moved by t of that,
            # its clearance is at least the first less t, and the last less the rest.
            edge, first = lattice.edge[e], search.clearance[parent]
            reach = coarse.lib.edges.reach[edge]
            near = max(0.5 * (first + clearance - reach), max(first, clearance) - reach)
            begin = there
            if lattice.sign > 0:
                begin = pose_in(
                    lattice.frame,
                    lattice,
                    links[parent, COLUMN],
                    links[parent, ROW],
                    links[parent, STATE],
                )
            state[QUERIES] += 1
            met = met_along(coarse, fine, edge, begin, near, lattice.travel[e])
            if met != FREE:
                ahead = least_to_go(aims, cell, column, row, at)
                if met == RIM:
                    search.found[0] = min(search.found[0], cost + ahead)
                if known == UNKNOWN:
                    search.node[place, at], search.least[place, at] = REFUSED, math.inf
                    push_others(search, lattice, item, (column, row, at), weight * ahead)
                continue
        node = state[N_NODES]
        state[N_NODES] += 1
        search.node[place, at], search.least[place, at] = node, -math.inf
        search.cost[node], search.clearance[node] = cost, clearance
        links[node, COLUMN], links[node, ROW], links[node, STATE] = column, row, at
        links[node, PARENT], links[node, EDGE] = parent, e
        aim = aim_at(aims, column * cell, row * cell, at)
        if aim >= 0:
            state[FOUND], state[AIM] = 1, aim
            return 0
        # What each edge needs lies anywhere in memory, and is asked for at once: to wait for one
        # after the other would take longer than all the rest.
        begin, end = lattice.first[at], lattice.first[at + 1]
        for e in range(begin, end):
            n_column, n_row = column + lattice.step[e, 0], row + lattice.step[e, 1]
            search.places[e - begin] = place_of(search, n_column, n_row)
        for e in range(begin, end):
            search.costs[e - begin] = search.least[search.places[e - begin], lattice.target[e]]
        for e in range(begin, end):
            n_cost, target = cost + lattice.cost[e], lattice.target[e]
            if n_cost >= search.costs[e - begin]:
                continue
            n_column, n_row = column + lattice.step[e, 0], row + lattice.step[e, 1]
            ahead = least_to_go(aims, cell, n_column, n_row, target)
            if n_cost + ahead >= upper_bound:
                continue
            place = search.places[e - begin]
            if search.node[place, target] == UNKNOWN:
                search.least[place, target] = n_cost
            key = n_cost + weight * ahead
            push(search.heap_key, search.heap_item, state[HEAP], key, (node << ITEM_BITS) | e)
            state[HEAP] += 1
    return 1


@bare_inner_kernel
def push_others(
    search: GraphArrays, lattice: StateLattice, item: int, node: tuple[int, int, int], ahead: float
) -> None:
    """List all motions from nodes that were expanded to `node`, but for one of them."""
    # A node is its column, row and state; `ahead` is the weighted bound of the cost to go from it.
    column, row, at = node
    # Some of them are listed already. To test these once more costs little.
    for k in range(lattice.into_first[at], lattice.into_first[at + 1]):
        e = lattice.into_edge[k]
        place, _, _ = place_in(search.table, column - lattice.step[e, 0], row - lattice.step[e, 1])
        if place < 0:
            continue
        before = int(search.node[place, lattice.source[e]])  # a number of 32 bits has no room
        other = (before << ITEM_BITS) | e
        if before >= 0 and other != item:
            key = search.cost[before] + lattice.cost[e] + ahead
            push(search.heap_key, search.heap_item, search.state[HEAP], key, other)
            search.state[HEAP] += 1
