"""Children of a node: by coasts of the trims of its class, and by maneuvers out of its class."""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, inlined_kernel
from maneuver_automaton.collision._kernels_clearance import field_bound
from maneuver_automaton.collision._kernels_swept import FREE, UNKNOWN, overlaps
from maneuver_automaton.search._kernels_coast import (
    coast_inside,
    coast_proven,
    coasted,
    edge_swept,
    swept_end,
    too_short,
)
from maneuver_automaton.search._kernels_estimate import cost_to_go
from maneuver_automaton.search._kernels_maneuver import edge_end, edge_inside, edge_proven
from maneuver_automaton.search._kernels_nodes import (
    CLEARANCE,
    CLOSED,
    COASTED,
    COST,
    COUNT,
    GEAR,
    GENERATION,
    HEADING,
    QUERIES,
    ROOT,
    RUN,
    TIME,
    TRIM,
    X,
    Y,
    Z,
    add_node,
    cell_key,
    layer_of,
    node_in,
    slot_of,
)
from maneuver_automaton.search.arrays import DistanceGrid, SearchArrays, Task
from maneuver_automaton.search.cost_to_go import CostTable
from maneuver_automaton.search.lattice_arrays import LatticeArrays
from maneuver_automaton.search.scene import Scene
from maneuver_automaton.words._kernels_library import class_of, price_of_switch


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
            child = (n_x, n_y, n_heading, n_z)
            ahead = math.inf
            if not (old >= 0 and nodes[old, COST] <= cost):
                ahead = cost_to_go(task, grid, table, scene.layers.plane, child, trim)
            elif not task.truncated:
                continue
            if cost + ahead >= limit and not task.truncated:
                continue
            # The proof without a test: no point of the body moves farther than `fastest * t`, so
            # the clearance shrinks by no more than that. A climb may lead into another layer, whose
            # obstacles the clearance does not know.
            clearance, free = nodes[node, CLEARANCE] - lib.fastest[trim] * t, t
            if clearance <= scene.margin or climbs or not known:
                state[QUERIES] += 1
                # The price of a proof rises in three steps: one polygon that holds all of the edge;
                # where that meets a solid, whether the vehicle does at the end, unless the time of
                # the contact is asked for; and the proof along the edge.
                motion = trim * lib.edge_durations.shape[1] + q
                met = edge_swept(scene, lib, motion, pose) if known else UNKNOWN
                first = scene.layers.first
                end_cos, end_sin = swept_end(lib, motion, pose)
                if met == FREE:
                    clearance = field_bound(first.field, lib.body, n_x, n_y, end_cos, end_sin)
                    clearance = max(clearance - scene.keep, scene.margin)
                elif (
                    met >= 0
                    and not task.truncated
                    and overlaps(first, lib.body, n_x, n_y, end_cos, end_sin, met)
                ):
                    free = 0.0
                else:
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
