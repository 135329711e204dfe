"""A* over lattice cells that each hold one exact pose, for every vehicle.

The state is a pose and a class of trims, those that the vehicle changes between at will. An edge is
a transition and a coast: within the class a coast of one of its trims, to another class a maneuver,
after which coasts begin. A kinematic vehicle has one class and no maneuvers; a vehicle whose every
trim is a class of its own has one trim to coast in. Nothing else tells them apart here.

A node is a row of two arrays, filled in by `add_node`. Columns of `nodes` (n, 9):

    X, Y, HEADING, Z   the pose, exact: composed edge by edge, never rounded to the cell
    COST, TIME         from the root to here
    COAST              [s] of the coast that leads here, 0 after a maneuver
    RUN                [s] that its trim lasts already, over several coasts
    CLEARANCE          [m] proven here: a motion shorter than that needs no test

and of `links` (n, 7): PARENT (-1 for a root), TRIM (NO_TRIM where any will do), GEAR (sign of the
last forward speed), COUNT (of trims), ROOT, EDGE (the maneuver that leads here, COASTED for none),
and CLOSED (1 once it was expanded, or replaced by a cheaper node of its cell).

The hash table `table` (4 n, 2) holds the cheapest node of each cell: the key of the cell, and the
number of the search with the node below it. So a new search need not clear the table. It is never
more than a quarter full, so that a probe ends soon.

The open list is a binary heap in `heap_key` and `heap_node` (n,), ordered by the cost plus the
weighted cost to go. A node is pushed once, when it is made. A cheaper node of its cell closes it,
and leaves it in the heap; it is passed over when it is popped.

`state` (12,) are the numbers named below; `found` (5,) is the cost of the cheapest plan found, then
the durations of the three trims of its connection and of the climb. `scratch` holds the candidates
of one connection.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from maneuver_automaton._compile import (
    bare_inner_kernel,
    bare_kernel,
    inlined_kernel,
    merged_kernel,
)
from maneuver_automaton.search._kernels_cells import first_slot
from maneuver_automaton.search._kernels_coast import (
    coast_inside,
    coast_proven,
    coasted,
    is_still,
    may_stay,
)
from maneuver_automaton.search._kernels_connection import free_candidate
from maneuver_automaton.search._kernels_distance import distance_at, pop, push
from maneuver_automaton.search._kernels_maneuver import edge_end, edge_inside, edge_proven
from maneuver_automaton.words._kernels_candidates import (
    NO_TRIM,
    candidates,
    class_of,
    price_of_switch,
    trim_and_gear,
)

if TYPE_CHECKING:
    from maneuver_automaton._arrays import IntArray
    from maneuver_automaton.collision.world import Field
    from maneuver_automaton.search.cost_to_go import CostTable
    from maneuver_automaton.search.distance_grid import DistanceGrid
    from maneuver_automaton.search.lattice_arrays import LatticeArrays
    from maneuver_automaton.search.lattice_memory import SearchArrays
    from maneuver_automaton.search.lattice_task import Task
    from maneuver_automaton.search.scene import Scene

FULL_TURN = 2.0 * math.pi
COASTED, ROOTED = -1, -2  # in place of the maneuver that leads to a node
NODE_BITS = 0x7FFFFFFF  # of an entry of the hash table: the node; above them the search
X, Y, HEADING, Z, COST, TIME, COAST, RUN, CLEARANCE = range(9)
PARENT, TRIM, GEAR, COUNT, ROOT, EDGE, CLOSED = range(7)
(
    N_NODES,  # nodes in use
    HEAP,  # entries of the open list
    GENERATION,  # number of this search, which its rows of the hash table carry
    EXPANSIONS,  # nodes expanded
    INTERVAL,  # expansions until the next analytic expansion
    FOUND,  # 1 once a connection is found; the next five say which is the cheapest:
    NODE,  # it leads from this node, ...
    GOAL,  # to this aim, ...
    ROW,  # by this row of the words, ...
    CLIMB,  # with this trim that climbs at its end, ...
    FREE,  # and whether the words are those of a free heading
    QUERIES,  # motions and connections that were tested
) = range(12)


@inlined_kernel
def cell_key(
    task: Task, x: float, y: float, heading: float, z: float, layer: int, time: float, fine: int
) -> int:
    """Number of the lattice cell a pose is in, seen from the task's own frame.

    `task.radix` is the number of cells along a side of the window, a power of two, of headings,
    levels of altitude and ticks of the clock; the last two are 1 where they make no difference.
    """
    # The grid is fixed to the first goal, so a moved problem has the moved cells.
    d_x, d_y = x - task.frame_x, y - task.frame_y
    c, s = task.frame_cos, task.frame_sin
    cell = task.fine_cell if fine else task.cell
    n_headings = task.fine_headings if fine else task.headings
    sides, turns, levels, ticks = task.radix
    i = math.floor((c * d_x + s * d_y) / cell + 0.5) & (sides - 1)
    j = math.floor((c * d_y - s * d_x) / cell + 0.5) & (sides - 1)
    turn = (heading - task.frame_heading) / FULL_TURN
    k = math.floor((turn - math.floor(turn)) * n_headings + 0.5) % n_headings
    level = math.floor(z / task.rise + 0.5) & (levels - 1) if levels > 1 else 0
    tick = math.floor(time / task.tick) & (ticks - 1) if task.tick > 0.0 else 0
    # Digits of one number, the least last. Cells `sides` apart along an axis share a number, as do
    # times `ticks` apart: that drops a node, and never a proof.
    above = ((layer * 2 + fine) * ticks + tick) * levels + level
    return ((above * turns + k) * sides + j) * sides + i


@inlined_kernel
def slot_of(table: IntArray, generation: int, key: int) -> int:
    """Row of a key in the hash table, or the free one where it belongs.

    Rows are (key, generation and node); those of another generation are free.
    """
    # Linear probing: nothing is ever deleted within a search, so the first free row ends it.
    mask = table.shape[0] - 1
    slot = first_slot(key, mask)
    while table[slot, 1] >> 31 == generation and table[slot, 0] != key:
        slot = (slot + 1) & mask
    return slot


@inlined_kernel
def node_in(table: IntArray, generation: int, slot: int) -> int:
    """Node that a row of the hash table holds; -1 if it is free."""
    entry = table[slot, 1]
    return entry & NODE_BITS if entry >> 31 == generation else -1


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


@inlined_kernel
def layer_of(task: Task, lib: LatticeArrays, trim: int, gear: int, n_trims: int) -> int:
    """Number of a node's layer: its class, and the gear, trim and count that prices or limits need.

    Nodes of one pose in different layers do not replace each other.
    """
    layer = class_of(lib.library, trim)
    if task.by_gear:
        layer = layer * 3 + gear + 1
    if task.by_trim:
        layer = layer * (lib.library.n_trims + 1) + trim + 1
    if task.by_count:
        layer = layer * 16 + min(n_trims, 15)
    return layer


@merged_kernel
def connect_ends(
    search: SearchArrays,
    task: Task,
    lib: LatticeArrays,
    scene: Scene,
    node: int,
    upper_bound: float,
    estimate: float,
) -> None:
    """Analytic expansion: reach the other end by a word; keeps the cheapest plan found.

    Only words that cost not much more than the estimate are tried. From a root all words of the
    library are, from other nodes those of its few trims.
    """
    nodes, links, state, found = search.nodes, search.links, search.state, search.found
    scratch = search.scratch
    pose = (nodes[node, X], nodes[node, Y], nodes[node, HEADING], nodes[node, Z])
    done, spent = nodes[node, COST], nodes[node, TIME]
    here = trim_and_gear(int(links[node, TRIM]), int(links[node, GEAR]))
    for g in range(task.aims.shape[0]):
        free_heading = task.sign > 0.0 and task.aim_free[g]
        words = lib.library.free_words if free_heading else lib.library.words
        n_words = words.shape[0]
        if not free_heading and links[node, PARENT] >= 0:
            n_words = lib.library.n_few
        aim = (task.aims[g, 0], task.aims[g, 1], task.aims[g, 2], task.aims[g, 3])
        # What a connection may cost: less than is left to the best plan, and not much more than the
        # estimate.
        most = min(upper_bound, found[0]) - done
        if estimate < math.inf:
            most = min(most, task.connection_factor * estimate + task.connection_slack)
        there = trim_and_gear(task.aim_trims[g], 0)
        begin, first, end, last = pose, here, aim, there
        clock = task.clock + spent
        if task.sign < 0.0:  # the node is nearer to the goal: the word leads from the start to it
            begin, first, end, last = aim, there, pose, here
            clock = task.clock
        # In the order of their price: words in closed form, limits of words, then the proofs, the
        # cheapest word first, until one is free or `tries` are not.
        n = candidates(lib.library, words, n_words, begin, first, end, last, most, scratch)
        if task.checks_words:
            for k in range(n):
                if not word_admitted(search, task, lib, words, node, k):
                    scratch.costs[k] = math.inf
        ends = (begin, int(first[0]), int(last[0]))
        limits = (task.tries, most, task.most_time - spent)
        which = free_candidate(scene, lib, words, ends, n, limits, clock, scratch)
        state[QUERIES] += 1
        if which >= 0 and task.sign > 0.0:
            trim = max(ends[2], 0)
            arrival = clock + scratch.durations[which]
            if not may_stay(scene, lib, trim, aim, arrival, task.stay_until):
                which = -1
        if which >= 0:
            # It is cheaper than what was found before: `most` says so.
            found[0] = done + scratch.costs[which]
            for n_th in range(4):
                found[1 + n_th] = scratch.times[which, n_th]
            state[FOUND], state[NODE], state[GOAL] = 1, node, g
            state[ROW], state[CLIMB] = scratch.rows[which], scratch.climbs[which]
            state[FREE] = 1 if free_heading else 0


@bare_inner_kernel
def word_admitted(
    search: SearchArrays, task: Task, lib: LatticeArrays, words: IntArray, node: int, k: int
) -> bool:
    """Whether the word through a node and one candidate keeps the limits of single words.

    They are the number of trims, the least time of a trim that moves, and the longest of any. The
    candidate is read away from the node, whose own trim may go on.
    """
    scratch, links, nodes = search.scratch, search.links, search.nodes
    row = scratch.rows[k]
    count = links[node, COUNT]
    # (trim, run) is the trim that lasts and its time so far; the last one is judged after the loop.
    trim, run = links[node, TRIM], nodes[node, RUN]
    forward = task.sign > 0.0
    for step in range(4):
        n_th = step if forward else 3 - step
        this, t = scratch.climbs[k], scratch.times[k, 3]
        if n_th < 3:
            this, t = words[row, n_th], scratch.times[k, n_th]
        if t == 0.0 or this < 0 or this >= lib.library.n_trims:
            continue
        if this == trim:
            run += t
        else:
            if too_short(task, lib, trim, run):
                return False
            count += 1
            trim, run = this, t
        if run > lib.library.longest[trim]:
            return False
    if too_short(task, lib, trim, run):
        return False
    return task.most_trims == 0 or count <= task.most_trims


@inlined_kernel
def too_short(task: Task, lib: LatticeArrays, trim: int, run: float) -> bool:
    """Whether a trim that moves has begun, and does not yet last as long as it must."""
    return trim != NO_TRIM and 0.0 < run < task.least_coast and not is_still(lib, trim)


@merged_kernel
def add_node(
    search: SearchArrays,
    weight: float,
    slot: int,
    key: int,
    row: tuple[float, ...],
    link: tuple[int, ...],
    estimate: float,
) -> None:
    """Append a node, make it the one of its cell, and push it.

    `row` are its columns of `nodes`, `link` those of `links` but the last.
    """
    nodes, links, state = search.nodes, search.links, search.state
    node = state[N_NODES]
    for k in range(9):
        nodes[node, k] = row[k]
    parent, trim, gear, count, root, edge = link
    links[node, PARENT], links[node, TRIM], links[node, GEAR] = parent, trim, gear
    links[node, COUNT], links[node, ROOT], links[node, EDGE] = count, root, edge
    links[node, CLOSED] = 0
    state[N_NODES] = node + 1
    search.table[slot, 0] = key
    search.table[slot, 1] = (state[GENERATION] << 31) | node
    push(search.heap_key, search.heap_node, state[HEAP], row[COST] + weight * estimate, node)
    state[HEAP] += 1


@bare_kernel
def begin(
    search: SearchArrays,
    task: Task,
    lib: LatticeArrays,
    scene: Scene,
    grid: DistanceGrid,
    table: CostTable,
) -> None:
    """Push the roots of a search; what was searched before is forgotten."""
    state, found = search.state, search.found
    generation = state[GENERATION] + 1  # which frees all rows of the hash table at once
    for k in range(state.shape[0]):
        state[k] = 0
    state[GENERATION] = generation
    found[0] = math.inf
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


@inlined_kernel
def open_node(search: SearchArrays, task: Task, upper_bound: float) -> int:
    """The most promising node that is open, taken from the heap; -1 if there is none."""
    links, state = search.links, search.state
    # Only where the task says so does a key end the search: with a weight above 1 it is no bound.
    most = min(upper_bound, search.found[0]) if task.ends_early else math.inf
    node = -1
    while node < 0 and state[HEAP] > 0 and not search.heap_key[0] >= most:
        node = pop(search.heap_key, search.heap_node, state[HEAP])
        state[HEAP] -= 1
        if links[node, CLOSED]:
            node = -1
    return node


@inlined_kernel
def relax_coasts(
    search: SearchArrays,
    task: Task,
    lib: LatticeArrays,
    scene: Scene,
    grid: DistanceGrid,
    table: CostTable,
    node: int,
    upper_bound: float,
) -> None:
    """Children of a node by coasts of the trims of its class, shorter ones first.

    Tests come in the order of their price: limits and bound, duplicates in the cell, the estimate,
    the clearance known from before, and only then the proof that the motion is free. A truncated
    edge keeps what was driven before a contact: it ends in a finer cell of its own, so duplicates
    and estimate are asked for again, and rule out nothing before.
    """
    nodes, links, state = search.nodes, search.links, search.state
    generation = state[GENERATION]
    pose = (nodes[node, X], nodes[node, Y], nodes[node, HEADING], nodes[node, Z])
    x, y, heading, z = pose
    done, spent, run = nodes[node, COST], nodes[node, TIME], nodes[node, RUN]
    # Of 32 bits in the array: the numbers of cells need more.
    before, gear = int(links[node, TRIM]), int(links[node, GEAR])
    limit = min(upper_bound, search.found[0])
    # Clearance known from before spares a test, unless obstacles move, since it is that of an
    # earlier time, or there are zones, which it does not count.
    known = scene.layers.moving.speed.shape[0] == 0 and scene.zone_trims.shape[0] == 0
    cos, sin = math.cos(heading), math.sin(heading)
    held = class_of(lib.library, before)
    for place in range(lib.first_trim[held], lib.first_trim[held + 1]):
        trim = lib.trims_of[place]
        if before != trim and too_short(task, lib, before, run):
            continue
        count = int(links[node, COUNT]) + (0 if trim == before else 1)
        if task.most_trims > 0 and count > task.most_trims:
            continue
        price = price_of_switch(lib.library, before, gear, trim)
        new_gear = lib.library.gears[trim] if lib.library.gears[trim] != 0 else gear
        layer = layer_of(task, lib, trim, new_gear, count)
        lasted = run if trim == before else 0.0
        climbs = lib.library.twists[trim, 3] != 0.0 and not scene.layers.flat
        for q in range(lib.edge_durations.shape[1]):
            t = lib.edge_durations[trim, q]
            if not t > 0.0 or lasted + t > lib.library.longest[trim]:
                continue
            cost, time = done + price + t * lib.library.rates[trim], spent + t
            if cost >= limit or time > task.most_time:
                break  # durations rise, and cost and time with them
            # `moves` is the displacement of the coast, known before: the child is exact.
            d_x, d_y = lib.moves[trim, q, 0], lib.moves[trim, q, 1]
            n_x, n_y = x + cos * d_x - sin * d_y, y + sin * d_x + cos * d_y
            n_heading, n_z = heading + lib.moves[trim, q, 2], z + lib.moves[trim, q, 3]
            fine = 0
            key = cell_key(task, n_x, n_y, n_heading, n_z, layer, time, 0)
            slot = slot_of(search.table, generation, key)
            old = node_in(search.table, generation, slot)
            if old >= 0 and nodes[old, COST] <= cost and not task.truncated:
                continue
            child = (n_x, n_y, n_heading, n_z)
            ahead = cost_to_go(task, grid, table, scene.layers.plane, child, trim)
            if cost + ahead >= limit and not task.truncated:
                continue
            # The proof without a test: no point of the body moves farther than `fastest * t`, so
            # the clearance shrinks by no more than that. A climb may lead into another layer, whose
            # obstacles the clearance does not know.
            clearance, free = nodes[node, CLEARANCE] - lib.fastest[trim] * t, t
            if clearance <= scene.margin or climbs or not known:
                state[QUERIES] += 1
                clock = task.clock + task.sign * spent
                free, clearance = coast_proven(scene, lib, trim, pose, task.sign * t, clock)
            if free < t:
                if not task.truncated or not lib.fastest[trim] > 0.0:
                    break  # longer coasts of this trim pass the same place
                # All before `free` is proven, so what is left of the edge needs no other proof.
                t = free - task.back_off / lib.fastest[trim]
                if t * lib.fastest[trim] < task.shortest_truncated:
                    break
                fine, clearance = 1, 0.0
                cost, time = done + price + t * lib.library.rates[trim], spent + t
                child = coasted(lib, trim, pose, task.sign * t)
                n_x, n_y, n_heading, n_z = child
                key = cell_key(task, n_x, n_y, n_heading, n_z, layer, time, 1)
                slot = slot_of(search.table, generation, key)
                old = node_in(search.table, generation, slot)
                ahead = cost_to_go(task, grid, table, scene.layers.plane, child, trim)
            fits = cost + ahead < limit and (old < 0 or nodes[old, COST] > cost)
            # The window comes last: only now is it known how long the edge is.
            if fits and coast_inside(scene, lib, trim, pose, task.sign * t):
                if old >= 0:
                    links[old, CLOSED] = 1
                row = (n_x, n_y, n_heading, n_z, cost, time, t, lasted + t, max(clearance, 0.0))
                link = (node, trim, new_gear, count, links[node, ROOT], COASTED)
                add_node(search, task.weight, slot, key, row, link, ahead)
            if fine:
                break


@bare_inner_kernel
def relax_maneuvers(
    search: SearchArrays,
    task: Task,
    lib: LatticeArrays,
    scene: Scene,
    grid: DistanceGrid,
    table: CostTable,
    node: int,
    upper_bound: float,
) -> None:
    """Children of a node by the maneuvers that lead out of its class.

    Coasts begin at the child, so a maneuver is an edge with a coast of no time. The order of the
    tests is that of `relax_coasts`; a maneuver is not truncated, since within it no trim is driven.
    """
    nodes, links, state = search.nodes, search.links, search.state
    generation = state[GENERATION]
    pose = (nodes[node, X], nodes[node, Y], nodes[node, HEADING], nodes[node, Z])
    done, spent = nodes[node, COST], nodes[node, TIME]
    before, gear, count = int(links[node, TRIM]), int(links[node, GEAR]), int(links[node, COUNT])
    if too_short(task, lib, before, nodes[node, RUN]):
        return
    limit = min(upper_bound, search.found[0])
    known = scene.layers.moving.speed.shape[0] == 0 and scene.zone_trims.shape[0] == 0
    held = class_of(lib.library, before)
    for edge in range(lib.first_edge[held], lib.first_edge[held + 1]):
        target = lib.edge_target[edge]
        cost, time = done + lib.edge_cost[edge], spent + lib.edge_time[edge]
        if cost >= limit or time > task.most_time:
            continue
        child = edge_end(lib, edge, pose)
        n_x, n_y, n_heading, n_z = child
        layer = layer_of(task, lib, target, gear, count + 1)
        key = cell_key(task, n_x, n_y, n_heading, n_z, layer, time, 0)
        slot = slot_of(search.table, generation, key)
        old = node_in(search.table, generation, slot)
        if old >= 0 and nodes[old, COST] <= cost:
            continue
        ahead = cost_to_go(task, grid, table, scene.layers.plane, child, target)
        if not cost + ahead < limit or not edge_inside(scene, lib, edge, pose):
            continue
        # No point moves farther than `edge_reach`: as for coasts, that may be the proof.
        clearance = nodes[node, CLEARANCE] - lib.edge_reach[edge]
        climbs = lib.edge_high[edge] > lib.edge_low[edge] and not scene.layers.flat
        if clearance <= scene.margin or climbs or not known:
            state[QUERIES] += 1
            clearance = edge_proven(scene, lib, edge, pose, task.clock + spent)
            if not clearance >= 0.0:
                continue
        if old >= 0:
            links[old, CLOSED] = 1
        row = (n_x, n_y, n_heading, n_z, cost, time, 0.0, 0.0, clearance)
        link = (node, target, gear, count + 1, links[node, ROOT], edge)
        add_node(search, task.weight, slot, key, row, link, ahead)


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
    """Expand up to `n` nodes; stops at the first connection if the task says so.

    Children that cannot lead to less than `upper_bound` are left out. Returns whether it may go on:
    1, or 0 when nothing is left to expand.
    """
    nodes, links, state = search.nodes, search.links, search.state
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


@bare_kernel
def rehash(table: IntArray, generation: int, wide: IntArray) -> None:
    """Carry the entries of this generation over into a wider hash table."""
    for k in range(table.shape[0]):
        if node_in(table, generation, k) >= 0:
            slot = slot_of(wide, generation, table[k, 0])
            wide[slot, 0], wide[slot, 1] = table[k, 0], table[k, 1]
