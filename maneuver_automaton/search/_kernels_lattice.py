"""A* over lattice cells that each hold one exact pose.

A node is a row of two arrays. `nodes`: x, y, heading, cost so far, time so far, duration of the
edge that leads here, time in its trim, clearance. `links`: parent, trim, gear, number of trims,
root, whether expanded.
"""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel, inlined_kernel
from maneuver_automaton.collision._kernels_advancement import free_time
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search._kernels_connect import (
    free_candidate,
    inside_window,
    may_stay,
)
from maneuver_automaton.search._kernels_distance import distance_at, pop, push
from maneuver_automaton.words._kernels_candidates import NO_TRIM, candidates, price_of_switch

FULL_TURN = 2.0 * math.pi
N_NODES, HEAP, GENERATION, EXPANSIONS, PATIENCE, FOUND, NODE, GOAL, ROW, FREE, QUERIES = range(11)


@inlined_kernel
def cell_key(task, x, y, heading, layer, time, fine):
    """Number of the lattice cell a pose is in, seen from the task's own frame."""
    d_x, d_y = x - task.frame_x, y - task.frame_y
    c, s = task.frame_cos, task.frame_sin
    cell = task.fine_cell if fine else task.cell
    n_headings = task.fine_headings if fine else task.headings
    i = math.floor((c * d_x + s * d_y) / cell + 0.5) & 0x7FFF
    j = math.floor((c * d_y - s * d_x) / cell + 0.5) & 0x7FFF
    turn = (heading - task.frame_heading) / FULL_TURN
    k = math.floor((turn - math.floor(turn)) * n_headings + 0.5) % n_headings
    tick = math.floor(time / task.tick) & 0x7FF if task.tick > 0.0 else 0
    return ((((layer * 2 + fine) * 2048 + tick) * 512 + k) * 32768 + j) * 32768 + i


@inlined_kernel
def slot_of(table, generation, key):
    """Row of a key in the hash table, or the free one where it belongs.

    Rows are (key, generation and node); those of another generation are free.
    """
    mask = table.shape[0] - 1
    mixed = (key ^ (key >> 23) ^ (key >> 41)) & 0x7FFFFFFF
    slot = ((mixed * 0x9E3779B1) >> 15) & mask
    while table[slot, 1] >> 31 == generation and table[slot, 0] != key:
        slot = (slot + 1) & mask
    return slot


@inlined_kernel
def node_in(table, generation, slot):
    """Node that a row of the hash table holds; -1 if it is free."""
    entry = table[slot, 1]
    return entry & 0x7FFFFFFF if entry >> 31 == generation else -1


@inlined_kernel
def table_value(table, task, aim, x, y, heading):
    """Cost to go to one aim from a table made without obstacles; 0 where it does not reach."""
    g_x, g_y, g_heading = task.aims[aim, 0], task.aims[aim, 1], task.aims[aim, 2]
    values = table.value
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
    return value if value < math.inf else 0.0


@bare_inner_kernel
def table_to_go(table, task, x, y, heading):
    """Cost to go to the nearest aim by the table; 0 where it does not reach one of them."""
    if table.value.shape[0] == 0:
        return 0.0
    least = math.inf
    for aim in range(task.aims.shape[0]):
        least = min(least, table_value(table, task, aim, x, y, heading))
        if least == 0.0:
            break
    return least


@inlined_kernel
def cost_to_go(task, grid, table, world, x, y, heading):
    """Estimate of the cost from here to the other end; inf if the plane alone forbids it."""
    if grid.columns > 0:
        way = distance_at(grid, world.field, x, y)
    else:
        way = math.inf
        for g in range(task.aims.shape[0]):
            e_x, e_y = task.aims[g, 0] - x, task.aims[g, 1] - y
            way = min(way, math.sqrt(e_x * e_x + e_y * e_y))
    estimate = way * task.per_metre
    if estimate < math.inf:
        estimate = max(estimate, table_to_go(table, task, x, y, heading))
    return estimate


@inlined_kernel
def layer_of(task, lib, trim, gear, n_trims):
    """What beside the pose makes two nodes different."""
    layer = 0
    if task.by_gear:
        layer = gear + 1
    if task.by_trim:
        layer = layer * (lib.library.n_trims + 1) + trim + 1
    if task.by_count:
        layer = layer * 16 + min(n_trims, 15)
    return layer


@bare_inner_kernel
def connect_ends(search, task, lib, world, body, node, ceiling, estimate):
    """Try to reach the other end from a node by three trims; keeps the cheapest plan found."""
    nodes, links, state, found = search.nodes, search.links, search.state, search.found
    scratch = search.scratch
    x, y, heading = nodes[node, 0], nodes[node, 1], nodes[node, 2]
    done, spent = nodes[node, 3], nodes[node, 4]
    here = (links[node, 1], links[node, 2])
    nowhere = (NO_TRIM, 0)
    for g in range(task.aims.shape[0]):
        free_heading = task.sign > 0.0 and task.aim_free[g]
        words = lib.library.free_words if free_heading else lib.library.words
        aim = (task.aims[g, 0], task.aims[g, 1], task.aims[g, 2], 0.0)
        most = min(ceiling, found[0]) - done
        if estimate < math.inf:
            most = min(most, task.patience * estimate + task.slack)
        begin, end, first, last, clock = (
            (x, y, heading, 0.0),
            aim,
            here,
            nowhere,
            task.clock + spent,
        )
        if task.sign < 0.0:  # the node is nearer to the goal: the word leads from the start to it
            begin, end, first, last, clock = aim, begin, nowhere, here, task.clock
        n = candidates(lib.library, words, words.shape[0], begin, first, end, last, most, scratch)
        if task.most_trims > 0 or lib.library.min_coast > 0.0:
            for k in range(n):
                if not word_admitted(search, task, lib, words, node, k):
                    scratch.costs[k] = math.inf
        left = task.most_time - spent
        pose = (begin[0], begin[1], begin[2])
        which = free_candidate(lib, task, world, body, words, pose, n, most, left, clock, scratch)
        state[QUERIES] += 1
        if which >= 0 and task.sign > 0.0:
            arrival = clock + scratch.durations[which]
            if not may_stay(task, world, body, aim[0], aim[1], aim[2], arrival):
                which = -1
        if which >= 0:
            found[0] = done + scratch.costs[which]
            for n_th in range(3):
                found[1 + n_th] = scratch.times[which, n_th]
            found[4] = spent + scratch.durations[which]
            state[FOUND], state[NODE], state[GOAL] = 1, node, g
            state[ROW], state[FREE] = scratch.rows[which], 1 if free_heading else 0


@bare_inner_kernel
def word_admitted(search, task, lib, words, node, k):
    """Whether the word through a node and one candidate keeps the limits of single words."""
    scratch, links, nodes = search.scratch, search.links, search.nodes
    row = scratch.rows[k]
    count = links[node, 3]
    trim, run = links[node, 1], nodes[node, 6]
    forward = task.sign > 0.0
    for step in range(3):
        n_th = step if forward else 2 - step  # away from the node
        this, t = words[row, n_th], scratch.times[k, n_th]
        if t == 0.0 or this >= lib.library.n_trims:
            continue
        if this == trim:
            run += t
            continue
        if trim != NO_TRIM and run < lib.library.min_coast:
            return False
        count += 1
        trim, run = this, t
    if trim != NO_TRIM and run < lib.library.min_coast:
        return False
    return task.most_trims == 0 or count <= task.most_trims


@bare_inner_kernel
def add_node(search, task, lib, key_slot, key, row, link, estimate):
    """Append a node and queue it."""
    nodes, links, state = search.nodes, search.links, search.state
    node = state[N_NODES]
    for k in range(8):
        nodes[node, k] = row[k]
    links[node, 0], links[node, 1], links[node, 2] = link[0], link[1], link[2]
    links[node, 3], links[node, 4], links[node, 5] = link[3], link[4], 0
    state[N_NODES] = node + 1
    search.table[key_slot, 0] = key
    search.table[key_slot, 1] = (state[GENERATION] << 31) | node
    push(search.heap_key, search.heap_node, state[HEAP], row[3] + task.weight * estimate, node)
    state[HEAP] += 1


@bare_kernel
def begin(search, task, lib, world, grid, table):
    """Queue the roots of a search; what was searched before is forgotten."""
    state, found = search.state, search.found
    generation = state[GENERATION] + 1
    for k in range(state.shape[0]):
        state[k] = 0
    state[GENERATION] = generation
    found[0] = math.inf
    for r in range(task.roots.shape[0]):
        x, y, heading = task.roots[r, 0], task.roots[r, 1], task.roots[r, 2]
        estimate = cost_to_go(task, grid, table, world, x, y, heading)
        key = cell_key(task, x, y, heading, layer_of(task, lib, NO_TRIM, 0, 0), 0.0, 0)
        slot = slot_of(search.table, generation, key)
        if estimate == math.inf or node_in(search.table, generation, slot) >= 0:
            continue
        row = (x, y, heading, 0.0, 0.0, 0.0, 0.0, 0.0)
        add_node(search, task, lib, slot, key, row, (-1, NO_TRIM, 0, 0, r), estimate)


@bare_kernel
def expand(search, task, lib, world, body, grid, table, n, ceiling):
    """Expand up to `n` nodes; stops at the first connection if the task says so.

    Children that cannot lead to less than `ceiling` are left out. Returns whether it may go on:
    1, or 0 when nothing is left to expand, or no room for more nodes.
    """
    nodes, links, state = search.nodes, search.links, search.state
    room = nodes.shape[0] - lib.library.n_trims * lib.quanta.shape[1] - 1
    generation = state[GENERATION]
    for _ in range(n):
        node = -1
        while state[HEAP] > 0:
            node = pop(search.heap_key, search.heap_node, state[HEAP])
            state[HEAP] -= 1
            if links[node, 5] == 0:
                break
            node = -1
        if node < 0:
            return 0
        if state[N_NODES] > room:
            push(search.heap_key, search.heap_node, state[HEAP], -1.0, node)
            state[HEAP] += 1
            return 1
        links[node, 5] = 1
        state[EXPANSIONS] += 1
        x, y, heading = nodes[node, 0], nodes[node, 1], nodes[node, 2]
        done, spent, run = nodes[node, 3], nodes[node, 4], nodes[node, 6]
        clearance = nodes[node, 7]
        here = cost_to_go(task, grid, table, world, x, y, heading)
        if here == math.inf:
            continue
        state[PATIENCE] -= 1
        if state[PATIENCE] < 0:
            state[PATIENCE] = int(here / task.per_shot)
            connect_ends(search, task, lib, world, body, node, ceiling, here)
            if state[FOUND] == 1 and task.stop_at_first:
                return 1
        limit = min(ceiling, search.found[0])
        cos, sin = math.cos(heading), math.sin(heading)
        before, gear = int(links[node, 1]), int(links[node, 2])  # of 32 bits: keys need more
        for trim in range(lib.library.n_trims):
            if before != NO_TRIM and before != trim and run < lib.library.min_coast:
                continue
            count = int(links[node, 3]) + (0 if trim == before else 1)
            if task.most_trims > 0 and count > task.most_trims:
                continue
            v_x, v_y, turn = (
                lib.library.twists[trim, 0],
                lib.library.twists[trim, 1],
                lib.library.twists[trim, 2],
            )
            price = price_of_switch(lib.library, before, gear, trim)
            new_gear = lib.library.gears[trim] if lib.library.gears[trim] != 0 else gear
            layer = layer_of(task, lib, trim, new_gear, count)
            for q in range(lib.quanta.shape[1]):
                t = lib.quanta[trim, q]
                if not t > 0.0:
                    continue
                cost = done + price + t * lib.library.rates[trim]
                time = spent + t
                if cost >= limit or time > task.most_time:
                    break
                d_x, d_y = lib.moves[trim, q, 0], lib.moves[trim, q, 1]
                n_x, n_y = x + cos * d_x - sin * d_y, y + sin * d_x + cos * d_y
                n_heading = heading + lib.moves[trim, q, 2]
                fine = 0
                key = cell_key(task, n_x, n_y, n_heading, layer, time, 0)
                slot = slot_of(search.table, generation, key)
                old = node_in(search.table, generation, slot)
                if old >= 0 and nodes[old, 3] <= cost and not task.contact:
                    continue
                ahead = cost_to_go(task, grid, table, world, n_x, n_y, n_heading)
                if (cost + ahead >= limit) and not task.contact:
                    continue
                gap = clearance - lib.speeds[trim] * t
                if gap <= task.margin or world.movers.speed.shape[0] > 0:
                    state[QUERIES] += 1
                    proven, gap = free_time(
                        world,
                        body,
                        x,
                        y,
                        heading,
                        v_x,
                        v_y,
                        turn,
                        lib.speeds[trim],
                        task.sign * t,
                        task.keep,
                        task.margin,
                        task.clock + task.sign * spent,
                    )
                else:
                    proven = t
                if proven < t:
                    if not task.contact or not lib.speeds[trim] > 0.0:
                        break
                    t = proven - task.back_off / lib.speeds[trim]
                    if t * lib.speeds[trim] < task.shortest_contact:
                        break
                    fine = 1
                    cost, time = done + price + t * lib.library.rates[trim], spent + t
                    d_x, d_y, angle = coast(v_x, v_y, turn, task.sign * t)
                    n_x, n_y, n_heading = compose(x, y, heading, d_x, d_y, angle)
                    key = cell_key(task, n_x, n_y, n_heading, layer, time, 1)
                    slot = slot_of(search.table, generation, key)
                    old = node_in(search.table, generation, slot)
                    ahead = cost_to_go(task, grid, table, world, n_x, n_y, n_heading)
                    gap = 0.0
                fits = cost + ahead < limit and (old < 0 or nodes[old, 3] > cost)
                if fits and inside_window(
                    task.window, x, y, heading, v_x, v_y, turn, task.sign * t
                ):
                    if old >= 0:
                        links[old, 5] = 1
                    so_far = t + (run if trim == before else 0.0)
                    row = (n_x, n_y, n_heading, cost, time, t, so_far, max(gap, 0.0))
                    link = (node, trim, new_gear, count, links[node, 4])
                    add_node(search, task, lib, slot, key, row, link, ahead)
                if fine:
                    break
    return 1


@bare_kernel
def rehash(table, generation, wide):
    """Carry the entries of this generation over into a wider hash table."""
    for k in range(table.shape[0]):
        if node_in(table, generation, k) >= 0:
            slot = slot_of(wide, generation, table[k, 0])
            wide[slot, 0], wide[slot, 1] = table[k, 0], table[k, 1]
