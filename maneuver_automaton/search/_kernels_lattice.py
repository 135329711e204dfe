"""A* over lattice cells that each hold one exact pose, for every vehicle.

The state is a pose and a class of trims, those that the vehicle changes between at will. An edge is
a transition and a coast: within the class a coast of one of its trims, to another class a maneuver,
after which coasts begin. A kinematic vehicle has one class and no maneuvers; a vehicle whose every
trim is a class of its own has one trim to coast in. Nothing else tells them apart here.

From some nodes the other end is reached by a word in closed form: an analytic expansion.
`_kernels_nodes` explains the arrays and the open list.
"""

from __future__ import annotations

import math

from maneuver_automaton._arrays import IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel, bare_shared_kernel
from maneuver_automaton.collision._kernels_clearance import field_bound, field_look
from maneuver_automaton.collision._kernels_swept import FREE as NOTHING_MET
from maneuver_automaton.collision._kernels_swept import UNKNOWN, overlaps
from maneuver_automaton.collision.arrays import Place
from maneuver_automaton.search._kernels_coast import (
    coast_end,
    coast_inside,
    coast_proven,
    coasted,
    edge_end,
    edge_swept,
    is_one_in_plane,
    may_stay,
    swept_end,
    too_short,
)
from maneuver_automaton.search._kernels_connection import edge_inside, edge_proven, free_candidate
from maneuver_automaton.search._kernels_distance import push
from maneuver_automaton.search._kernels_estimate import cost_to_go
from maneuver_automaton.search._kernels_nodes import (
    BEGUN,
    CLEARANCE,
    CLIMB,
    CLOSED,
    COASTED,
    COST,
    COUNT,
    EXCESS,
    EXPANSIONS,
    FOUND,
    FREE,
    GEAR,
    GENERATION,
    GOAL,
    HEADING,
    HEAP,
    INTERVAL,
    N_NODES,
    NODE,
    PARENT,
    QUERIES,
    ROOT,
    ROOTED,
    ROW,
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
    open_node,
    slot_of,
)
from maneuver_automaton.search._kernels_place import coast_place, edge_place, places_cost
from maneuver_automaton.search.arrays import Joint, LatticeArrays, LatticeSearch, SearchArrays, Task
from maneuver_automaton.words._kernels_candidates import NEARLY, candidates, trim_and_gear
from maneuver_automaton.words._kernels_library import class_of, price_of_switch
from maneuver_automaton.words._kernels_shortest import least_cost

LESS, MORE = 0.95, 2.0  # how what the words tried first may cost changes: were there enough?


@bare_kernel
def expand(search: LatticeSearch, n: int, upper_bound: float) -> int:
    """Expand up to `n` nodes, as `expanded`, for callers from Python."""
    return expanded(search, n, upper_bound)


@bare_shared_kernel
def expanded(search: LatticeSearch, n: int, upper_bound: float) -> int:
    """Expand `n` nodes, roots first, or to the first connection; 1 if it may go on, or 0."""
    # Children that cannot lead to less than `upper_bound` are left out.
    arrays, task, connecting = search.arrays, search.task, search.task.connecting
    grid, table, plane = search.grid, search.table, search.scene.layers.plane
    nodes, links, state = arrays.nodes, arrays.links, arrays.state
    if state[BEGUN] == 0:
        _push_roots(search)
    room = nodes.shape[0] - search.library.most_children - 1  # so that one expansion always fits
    for _ in range(n):
        node = open_node(arrays, task, upper_bound)
        if node < 0:
            return 0
        if state[N_NODES] > room:  # the caller widens the arrays, and comes back
            # Before all others, whose keys are costs and so not below 0.
            push(arrays.heap_key, arrays.heap_node, state[HEAP], -1.0, node)
            state[HEAP] += 1
            return 1
        links[node, CLOSED] = 1
        state[EXPANSIONS] += 1
        pose = (nodes[node, X], nodes[node, Y], nodes[node, HEADING], nodes[node, Z])
        here = cost_to_go(task, grid, table, plane, pose, links[node, TRIM])
        if here == math.inf:
            continue
        # Analytic expansions cost as much as many nodes: the nearer the goal, the more often.
        state[INTERVAL] -= 1
        if state[INTERVAL] < 0:
            interval = min(here / connecting.per_interval, connecting.most_interval)
            state[INTERVAL] = int(max(interval, connecting.least_interval))
            connect_ends(search, node, upper_bound, here)
            if state[FOUND] == 1 and task.stop_at_first:
                return 1
        relax_coasts(search, node, upper_bound)
        if search.library.edges.cost.shape[0] > 0:
            relax_maneuvers(search, node, upper_bound)
    return 1


@bare_inner_kernel
def _push_roots(search: LatticeSearch) -> None:
    """Push the roots of a search."""
    task, lib = search.task, search.library
    arrays, roots = search.arrays, search.task.roots
    grid, table, plane = search.grid, search.table, search.scene.layers.plane
    state, generation = arrays.state, arrays.state[GENERATION]
    state[BEGUN], arrays.found[EXCESS] = 1, 0.25 * task.connecting.slack
    for r in range(roots.poses.shape[0]):
        pose = (roots.poses[r, 0], roots.poses[r, 1], roots.poses[r, 2], roots.poses[r, 3])
        trim = roots.trims[r]
        estimate = cost_to_go(task, grid, table, plane, pose, trim)
        key = cell_key(task.cells, pose, layer_of(task.cells, lib, trim, 0, 0), 0.0, 0)
        slot = slot_of(arrays.table, generation, key)
        # A root that cannot reach an aim, or shares its cell with an earlier one, is left out.
        if estimate == math.inf or node_in(arrays.table, generation, slot) >= 0:
            continue
        row = (*pose, 0.0, 0.0, 0.0, 0.0, 0.0)
        order = 0.0 + task.estimates.weight * estimate
        add_node(arrays, slot, key, row, (-1, trim, 0, 0, r, ROOTED), order)


@bare_inner_kernel
def relax_coasts(search: LatticeSearch, node: int, upper_bound: float) -> None:
    """Children of a node by coasts of the trims of its class, shorter ones first."""
    # Tests come in the order of their price: limits and bound, duplicates in the cell, the
    # estimate, the clearance known from before, and only then the proof that the motion is free. A
    # truncated edge keeps what was driven before a contact: it ends in a finer cell of its own, so
    # duplicates and estimate are asked for again, and rule out nothing before.
    task, lib = search.task, search.library
    scene, arrays = search.scene, search.arrays
    nodes, links = arrays.nodes, arrays.links
    state, cells_of = arrays.state, arrays.table
    grid, table, plane = search.grid, search.table, scene.layers.plane
    generation, cells, limits = state[GENERATION], task.cells, task.limits
    pose = (nodes[node, X], nodes[node, Y], nodes[node, HEADING], nodes[node, Z])
    x, y, heading, z = pose
    weight, cut = task.estimates.weight, task.truncation
    durations, moves = lib.coasts.durations, lib.coasts.moves
    done, spent, run = nodes[node, COST], nodes[node, TIME], nodes[node, RUN]
    # Of 32 bits in the array: the numbers of cells need more.
    before, gear = int(links[node, TRIM]), int(links[node, GEAR])
    limit = min(upper_bound, arrays.found[0])
    # Clearance known from before spares a test, unless obstacles move, since it is that of an
    # earlier time, or there are zones, which it does not count.
    known = scene.layers.moving.speed.shape[0] == 0 and scene.zone_trims.shape[0] == 0
    priced, first = places_cost(scene), scene.layers.first
    cos, sin = math.cos(heading), math.sin(heading)
    place, clear = Place(x, y, cos, sin), nodes[node, CLEARANCE]
    looked, bound = known and is_one_in_plane(scene, lib), -math.inf
    if looked:
        bound = field_bound(first.field, lib.parts.body, place, -math.inf)
        clear = max(clear, bound - scene.keep)
    held = class_of(lib.library, before)
    for listed in range(lib.first_trim[held], lib.first_trim[held + 1]):
        trim = lib.trims_of[listed]
        if before != trim and too_short(lib, before, run, limits.least_coast):
            continue
        count = int(links[node, COUNT]) + (0 if trim == before else 1)
        if limits.most_trims > 0 and count > limits.most_trims:
            continue
        price = price_of_switch(lib.library, before, gear, trim)
        new_gear = lib.library.gears[trim] if lib.library.gears[trim] != 0 else gear
        layer = layer_of(cells, lib, trim, new_gear, count)
        lasted = run if trim == before else 0.0
        climbs = lib.library.twists[trim, 3] != 0.0 and not scene.layers.flat
        # The coasts of a trim pass the same places: after `proven` seconds the clearance is `near`.
        fastest, proven, near = lib.parts.fastest[trim], 0.0, clear
        for q in range(durations.shape[1]):
            t = durations[trim, q]
            if not t > 0.0 or lasted + t > lib.library.longest[trim]:
                continue
            cost, time = done + price + t * lib.library.rates[trim], spent + t
            if cost >= limit or time > limits.most_time:
                break  # durations rise, and cost and time with them
            # `moves` is the displacement of the coast, known before: the child is exact.
            d_x, d_y = moves[trim, q, 0], moves[trim, q, 1]
            n_x, n_y = x + cos * d_x - sin * d_y, y + sin * d_x + cos * d_y
            n_heading, n_z = heading + moves[trim, q, 2], z + moves[trim, q, 3]
            fine, child = 0, (n_x, n_y, n_heading, n_z)
            key = cell_key(cells, child, layer, time, 0)
            slot = slot_of(cells_of, generation, key)
            old = node_in(cells_of, generation, slot)
            ahead = math.inf
            if not (old >= 0 and nodes[old, COST] <= cost):
                ahead = cost_to_go(task, grid, table, plane, child, trim)
            elif not cut.kept:
                continue
            if cost + ahead >= limit and not cut.kept:
                continue
            # The proof without a test: no point of the body moves farther than `fastest` times the
            # time since a place where the clearance is known, so it shrinks by no more than that. A
            # climb may lead into another layer, whose obstacles the clearance does not know.
            clearance, free = near - fastest * abs(t - proven), t
            if clearance <= scene.margin or climbs or not known:
                state[QUERIES] += 1
                # The price of a proof rises in four steps: the field at the end; one polygon that
                # holds all of the edge; where that meets a solid, whether the vehicle does at the
                # end, or where the least that is kept of it ends; and the proof along the edge.
                motion = trim * durations.shape[1] + q
                end, met = swept_end(lib, motion, place, child), UNKNOWN
                if looked:
                    bound, hits = field_look(first.field, lib.parts.body, end)
                    bound -= scene.keep
                    # From both ends: halfway the clearance is not below half of what is left.
                    if bound + clearance > 2.0 * scene.margin:
                        met = NOTHING_MET
                    elif hits and not cut.kept:
                        break  # longer coasts of this trim pass the same place
                    else:
                        met = edge_swept(scene, lib, motion, place)
                if met >= 0 and cut.kept:
                    least = (cut.back_off + cut.shortest) / fastest
                    end = coast_end(lib, trim, pose, task.sign * min(t, least))
                if met == NOTHING_MET:
                    clearance = max(bound, scene.margin)
                elif met >= 0 and overlaps(first, lib.parts.body, end, met):
                    free = 0.0
                else:
                    clock = limits.clock + task.sign * spent
                    free, clearance = coast_proven(scene, lib, trim, pose, task.sign * t, clock)
            if free >= t:
                proven, near = t, clearance
            else:
                if not cut.kept or not fastest > 0.0:
                    break  # longer coasts of this trim pass the same place
                # All before `free` is proven, so what is left of the edge needs no other proof.
                t = free - cut.back_off / fastest
                if t * fastest < cut.shortest:
                    break
                fine, clearance = 1, 0.0
                cost, time = done + price + t * lib.library.rates[trim], spent + t
                child = coasted(lib, trim, pose, task.sign * t)
                key = cell_key(cells, child, layer, time, 1)
                slot = slot_of(cells_of, generation, key)
                old = node_in(cells_of, generation, slot)
                ahead = cost_to_go(task, grid, table, plane, child, trim)
            fits = cost + ahead < limit and (old < 0 or nodes[old, COST] > cost)
            # The window comes last: only now is it known how long the edge is.
            fits = fits and coast_inside(scene, lib, trim, pose, task.sign * t)
            if fits and priced:  # and the price of its places after that: so few edges have one
                cost += coast_place(scene, lib, trim, pose, task.sign * t)
                fits = cost + ahead < limit and (old < 0 or nodes[old, COST] > cost)
            if fits:
                if old >= 0:
                    links[old, CLOSED] = 1
                row = (*child, cost, time, t, lasted + t, max(clearance, 0.0))
                link = (node, trim, new_gear, count, links[node, ROOT], COASTED)
                add_node(arrays, slot, key, row, link, cost + weight * ahead)
            if fine:
                break


@bare_inner_kernel
def relax_maneuvers(search: LatticeSearch, node: int, upper_bound: float) -> None:
    """Children of a node by the maneuvers that lead out of its class."""
    # Coasts begin at the child, so a maneuver is an edge with a coast of no time, never truncated,
    # since within it no trim is driven. The order of the tests is that of `relax_coasts`.
    task, lib = search.task, search.library
    scene, arrays = search.scene, search.arrays
    nodes, links = arrays.nodes, arrays.links
    state, cells_of = arrays.state, arrays.table
    grid, table, plane = search.grid, search.table, scene.layers.plane
    generation, cells, limits = state[GENERATION], task.cells, task.limits
    pose = (nodes[node, X], nodes[node, Y], nodes[node, HEADING], nodes[node, Z])
    weight, edges = task.estimates.weight, lib.edges
    done, spent = nodes[node, COST], nodes[node, TIME]
    before, gear, count = int(links[node, TRIM]), int(links[node, GEAR]), int(links[node, COUNT])
    if too_short(lib, before, nodes[node, RUN], limits.least_coast):
        return
    limit = min(upper_bound, arrays.found[0])
    known = scene.layers.moving.speed.shape[0] == 0 and scene.zone_trims.shape[0] == 0
    priced, held = places_cost(scene), class_of(lib.library, before)
    for edge in range(edges.first[held], edges.first[held + 1]):
        target = edges.target[edge]
        cost, time = done + edges.cost[edge], spent + edges.time[edge]
        if cost >= limit or time > limits.most_time:
            continue
        child = edge_end(lib, edge, pose)
        layer = layer_of(cells, lib, target, gear, count + 1)
        key = cell_key(cells, child, layer, time, 0)
        slot = slot_of(cells_of, generation, key)
        old = node_in(cells_of, generation, slot)
        if old >= 0 and nodes[old, COST] <= cost:
            continue
        ahead = cost_to_go(task, grid, table, plane, child, target)
        if not cost + ahead < limit or not edge_inside(scene, lib, edge, pose):
            continue
        # No point moves farther than `edge_reach`: as for coasts, that may be the proof.
        clearance = nodes[node, CLEARANCE] - edges.reach[edge]
        climbs = edges.high[edge] > edges.low[edge] and not scene.layers.flat
        if clearance <= scene.margin or climbs or not known:
            state[QUERIES] += 1
            clearance = edge_proven(scene, lib, edge, pose, limits.clock + spent)
            if not clearance >= 0.0:
                continue
        if priced:
            cost += edge_place(scene, lib, edge, pose)
            if cost + ahead >= limit or (old >= 0 and nodes[old, COST] <= cost):
                continue
        if old >= 0:
            links[old, CLOSED] = 1
        row = (*child, cost, time, 0.0, 0.0, clearance)
        link = (node, target, gear, count + 1, links[node, ROOT], edge)
        add_node(arrays, slot, key, row, link, cost + weight * ahead)


@bare_inner_kernel
def connect_ends(search: LatticeSearch, node: int, upper_bound: float, estimate: float) -> None:
    """Analytic expansion: reach the other end by a word; keeps the cheapest plan found."""
    # Only words that cost not much more than the estimate are tried: from a root all words of the
    # library, from other nodes those of its few trims.
    task, lib = search.task, search.library
    scene, arrays = search.scene, search.arrays
    nodes, links = arrays.nodes, arrays.links
    state, found = arrays.state, arrays.found
    scratch, aims = arrays.scratch, task.aims
    limits, asked = task.limits, task.connecting
    pose = (nodes[node, X], nodes[node, Y], nodes[node, HEADING], nodes[node, Z])
    done, spent = nodes[node, COST], nodes[node, TIME]
    here = trim_and_gear(int(links[node, TRIM]), int(links[node, GEAR]))
    for g in range(aims.poses.shape[0]):
        free_heading = task.sign > 0.0 and aims.free[g]
        words = lib.library.tried.free_words if free_heading else lib.library.tried.words
        n_words = words.shape[0]
        if not free_heading and links[node, PARENT] >= 0:
            n_words = lib.library.tried.n_few
        aim = (aims.poses[g, 0], aims.poses[g, 1], aims.poses[g, 2], aims.poses[g, 3])
        # What a connection may cost: less than is left to the best plan, and not much more than the
        # estimate.
        left_over = min(upper_bound, found[0]) - done
        most = min(left_over, asked.factor * estimate + asked.slack)
        there = trim_and_gear(aims.trims[g], 0)
        begin, first, end, last = pose, here, aim, there
        if task.sign < 0.0:  # the node is nearer to the goal: the word leads from the start to it
            begin, first, end, last = aim, there, pose, here
        clock = limits.clock + (spent if task.sign > 0.0 else 0.0)
        # In the order of their price: the shortest path, which no word undercuts, words in closed
        # form, limits of words, then the proofs, the cheapest word first, until one is free or
        # `tries` are not.
        state[QUERIES] += 1
        known, left, priced = task.estimates, limits.most_time - spent, places_cost(scene)
        least = least_cost(0.0 if free_heading else known.radius, known.per_metre, begin, end, most)
        if known.radius > 0.0 and least * (1.0 - NEARLY) >= most:
            continue
        # Where nothing but their cost says which words are tried, those that cost not much more
        # than the shortest path come first, and the others only where these are too few.
        judged = asked.checks_words or priced or left < math.inf
        few = most if judged else min(most, least + found[EXCESS])
        # Prices of places may make it cost more than what the estimate allows.
        limit = left_over if priced else most
        joint = Joint(begin, int(first[0]), int(last[0]), clock, asked.tries, limit, left)
        n, which, enough = 0, -1, False
        while not enough:
            n = candidates(lib.library, words, n_words, begin, first, end, last, few, scratch)
            if asked.checks_words:
                for k in range(n):
                    if not word_admitted(arrays, task, lib, words, node, k):
                        scratch.costs[k] = math.inf
            which = free_candidate(scene, lib, words, joint, n, scratch)
            enough = which >= 0 or n >= asked.tries or few >= most
            if few < most:
                found[EXCESS] *= LESS if enough else MORE
            few = most
        if which >= 0 and task.sign > 0.0:
            trim = max(joint.after, 0)
            arrival = clock + scratch.durations[which]
            if not may_stay(scene, lib, trim, aim, arrival, limits.stay_until):
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
    arrays: SearchArrays, task: Task, lib: LatticeArrays, words: IntArray, node: int, k: int
) -> bool:
    """Whether the word through a node and one candidate keeps the limits of single words."""
    # They are the number of trims, the least time of a trim that moves, and the longest of any. The
    # candidate is read away from the node, whose own trim may go on.
    scratch, links, nodes = arrays.scratch, arrays.links, arrays.nodes
    limits = task.limits
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
            if too_short(lib, trim, run, limits.least_coast):
                return False
            count += 1
            trim, run = this, t
        if run > lib.library.longest[trim]:
            return False
    if too_short(lib, trim, run, limits.least_coast):
        return False
    return limits.most_trims == 0 or count <= limits.most_trims
