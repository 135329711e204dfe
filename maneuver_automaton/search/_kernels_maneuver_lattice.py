"""A* over the trims and maneuvers of an automaton; every node holds one exact pose.

A node is a row of two arrays. `nodes`: x, y, heading, altitude, cost so far, time so far, time of
the coast that leads here, time in its trim, clearance. `links`: parent, trim, edge (or COAST, or
ROOT), whether expanded.
"""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel, inlined_kernel
from maneuver_automaton.groups._kernels import compose
from maneuver_automaton.search._kernels_distance import distance_at, pop, push
from maneuver_automaton.search._kernels_lattice import node_in, slot_of
from maneuver_automaton.search._kernels_maneuver_motion import (
    coasts_long_enough,
    edge_inside,
    edge_proven,
    transfer_free,
    trim_inside,
    trim_proven,
)
from maneuver_automaton.words._kernels_candidates import candidates

FULL_TURN = 2.0 * math.pi
COAST, ROOT = -1, -2
N_NODES, HEAP, GENERATION, EXPANSIONS, PATIENCE, FOUND, NODE, GOAL, ROW, CLIMB, QUERIES = range(11)


@inlined_kernel
def cell_key(task, x, y, heading, z, trim, time):
    """Number of the lattice cell of a pose, trim and time, seen from the task's own frame."""
    d_x, d_y = x - task.frame_x, y - task.frame_y
    c, s = task.frame_cos, task.frame_sin
    i = math.floor((c * d_x + s * d_y) / task.cell + 0.5) & 0x3FFF
    j = math.floor((c * d_y - s * d_x) / task.cell + 0.5) & 0x3FFF
    level = math.floor(z / task.rise + 0.5) & 0xFF
    turn = (heading - task.frame_heading) / FULL_TURN
    k = math.floor((turn - math.floor(turn)) * task.headings + 0.5) % task.headings
    tick = math.floor(time / task.tick) & 0x7FF if task.tick > 0.0 else 0
    key = ((int(trim) * 2048 + tick) * 256 + level) * task.headings + k
    return (key * 16384 + j) * 16384 + i


@inlined_kernel
def cost_to_go(task, grid, layers, x, y, z, trim):
    """Estimate of the cost from here to a goal; inf if the plane alone forbids it."""
    way, rise = math.inf, math.inf
    for g in range(task.aims.shape[0]):
        e_x, e_y = task.aims[g, 0] - x, task.aims[g, 1] - y
        way = min(way, math.sqrt(e_x * e_x + e_y * e_y))
        rise = min(rise, abs(task.aims[g, 3] - z))
    if grid.columns > 0:
        way = distance_at(grid, layers.plane, x, y)
    estimate = way * task.per_metre
    if rise > 0.0:
        estimate = max(estimate, rise * task.per_climb)
    return estimate + task.lag[trim]


@bare_inner_kernel
def connect(search, task, lib, layers, node, ceiling, estimate):
    """Try to reach a goal from a node by a transfer; keeps the cheapest plan found."""
    nodes, links, state, found = search.nodes, search.links, search.state, search.found
    scratch = search.scratch
    done, spent = nodes[node, 4], nodes[node, 5]
    trim = links[node, 1]
    start = (nodes[node, 0], nodes[node, 1], nodes[node, 2], nodes[node, 3])
    n_words = lib.transfer.words.shape[0] if links[node, 0] < 0 else lib.transfer.n_few
    for g in range(task.aims.shape[0]):
        goal = (task.aims[g, 0], task.aims[g, 1], task.aims[g, 2], task.aims[g, 3])
        goal_trim = task.aim_trims[g]
        most = min(ceiling, found[0]) - done
        most = min(most, task.patience * estimate + task.slack)
        words = lib.transfer.words
        here, there = (trim, 0), (goal_trim, 0)
        n = candidates(lib.transfer, words, n_words, start, here, goal, there, most, scratch)
        state[QUERIES] += 1
        left = task.most_time - spent
        for _ in range(task.tries):
            best, which = most, -1
            for k in range(n):
                if scratch.costs[k] < best and scratch.durations[k] <= left:
                    if task.least_coast > 0.0 and not coasts_long_enough(
                        task,
                        lib,
                        trim,
                        nodes[node, 7],
                        lib.transfer.words[scratch.rows[k]],
                        scratch.climbs[k],
                        scratch.times[k],
                    ):
                        continue
                    best, which = scratch.costs[k], k
            if which < 0:
                break
            word = lib.transfer.words[scratch.rows[which]]
            run = nodes[node, 7] + scratch.times[which, 0]
            fits = word[0] != trim or run <= lib.transfer.longest[trim]
            if fits and transfer_free(
                task,
                lib,
                layers,
                start,
                trim,
                goal_trim,
                word,
                scratch.climbs[which],
                scratch.times[which],
                task.clock + spent,
            ):
                found[0] = done + scratch.costs[which]
                for n_th in range(4):
                    found[1 + n_th] = scratch.times[which, n_th]
                state[FOUND], state[NODE], state[GOAL] = 1, node, g
                state[ROW], state[CLIMB] = scratch.rows[which], scratch.climbs[which]
                break
            scratch.costs[which] = math.inf


@bare_inner_kernel
def add_node(search, task, slot, key, row, link, estimate):
    """Append a node and queue it."""
    nodes, links, state = search.nodes, search.links, search.state
    node = state[N_NODES]
    for k in range(9):
        nodes[node, k] = row[k]
    links[node, 0], links[node, 1], links[node, 2], links[node, 3] = link[0], link[1], link[2], 0
    state[N_NODES] = node + 1
    search.table[slot, 0] = key
    search.table[slot, 1] = (state[GENERATION] << 31) | node
    push(search.heap_key, search.heap_node, state[HEAP], row[4] + task.weight * estimate, node)
    state[HEAP] += 1


@bare_kernel
def begin(search, task, layers, grid):
    """Queue the start of a search; what was searched before is forgotten."""
    state = search.state
    generation = state[GENERATION] + 1
    for k in range(state.shape[0]):
        state[k] = 0
    state[GENERATION] = generation
    search.found[0] = math.inf
    x, y, heading, z = task.start[0], task.start[1], task.start[2], task.start[3]
    estimate = cost_to_go(task, grid, layers, x, y, z, task.start_trim)
    key = cell_key(task, x, y, heading, z, task.start_trim, 0.0)
    slot = slot_of(search.table, generation, key)
    if estimate < math.inf:
        row = (x, y, heading, z, 0.0, 0.0, 0.0, 0.0, 0.0)
        add_node(search, task, slot, key, row, (-1, task.start_trim, ROOT), estimate)


@bare_inner_kernel
def worth(search, task, grid, layers, x, y, heading, z, trim, cost, time, limit):
    """Slot and key of a child, and its estimate; the estimate is inf if it is not worth a node."""
    key = cell_key(task, x, y, heading, z, trim, time)
    slot = slot_of(search.table, search.state[GENERATION], key)
    old = node_in(search.table, search.state[GENERATION], slot)
    if old >= 0 and search.nodes[old, 4] <= cost:
        return slot, key, old, math.inf
    ahead = cost_to_go(task, grid, layers, x, y, z, trim)
    if not cost + ahead < limit:
        ahead = math.inf
    return slot, key, old, ahead


@bare_kernel
def expand(search, task, lib, layers, grid, n, ceiling):
    """Expand up to `n` nodes; stops at the first connection if the task says so.

    Children that cannot lead to less than `ceiling` are left out. Returns whether it may go on:
    1, or 0 when nothing is left to expand that could lead to less.
    """
    nodes, links, state = search.nodes, search.links, search.state
    room = nodes.shape[0] - lib.most_children - 1
    # clearance known from before spares a test, unless obstacles move or zones are in the way
    moving = layers.movers.speed.shape[0] > 0 or task.zone_trims.shape[0] > 0
    for _ in range(n):
        node = -1
        while state[HEAP] > 0:
            key_of_top = search.heap_key[0]
            if key_of_top >= min(ceiling, search.found[0]):
                return 0
            node = pop(search.heap_key, search.heap_node, state[HEAP])
            state[HEAP] -= 1
            if links[node, 3] == 0:
                break
            node = -1
        if node < 0:
            return 0
        if state[N_NODES] > room:
            push(search.heap_key, search.heap_node, state[HEAP], -1.0, node)
            state[HEAP] += 1
            return 1
        links[node, 3] = 1
        state[EXPANSIONS] += 1
        x, y, heading, z = nodes[node, 0], nodes[node, 1], nodes[node, 2], nodes[node, 3]
        done, spent, run, clearance = nodes[node, 4], nodes[node, 5], nodes[node, 7], nodes[node, 8]
        trim = links[node, 1]
        state[PATIENCE] -= 1
        if state[PATIENCE] < 0:
            here = cost_to_go(task, grid, layers, x, y, z, trim)
            wait = min(here / task.per_shot, task.most_patience)
            state[PATIENCE] = int(max(wait, task.least_patience))
            connect(search, task, lib, layers, node, ceiling, here)
            if state[FOUND] == 1 and task.stop_at_first:
                return 1
        limit = min(ceiling, search.found[0])
        cos, sin = math.cos(heading), math.sin(heading)
        for q in range(lib.quanta.shape[1]):
            t = lib.quanta[trim, q]
            if not t > 0.0 or run + t > lib.transfer.longest[trim]:
                continue
            cost, time = done + t * lib.transfer.rates[trim], spent + t
            if cost >= limit or time > task.most_time:
                break
            d_x, d_y = lib.moves[trim, q, 0], lib.moves[trim, q, 1]
            n_x, n_y = x + cos * d_x - sin * d_y, y + sin * d_x + cos * d_y
            n_heading, n_z = heading + lib.moves[trim, q, 2], z + lib.moves[trim, q, 3]
            slot, key, old, ahead = worth(
                search, task, grid, layers, n_x, n_y, n_heading, n_z, trim, cost, time, limit
            )
            if ahead == math.inf or not trim_inside(task, lib, trim, x, y, heading, z, t):
                continue
            gap = clearance - lib.fastest[trim] * t
            climbs = lib.transfer.twists[trim, 3] != 0.0 and not layers.flat
            if gap <= task.margin or moving or climbs:
                state[QUERIES] += 1
                gap = trim_proven(task, lib, layers, trim, x, y, heading, z, t, task.clock + spent)
                if not gap >= 0.0:
                    break
            if old >= 0:
                links[old, 3] = 1
            row = (n_x, n_y, n_heading, n_z, cost, time, t, run + t, gap)
            add_node(search, task, slot, key, row, (node, trim, COAST), ahead)
        for edge in range(lib.first_edge[trim], lib.first_edge[trim + 1]):
            target = lib.edge_target[edge]
            cost, time = done + lib.edge_cost[edge], spent + lib.edge_time[edge]
            if cost >= limit or time > task.most_time:
                continue
            n_x, n_y, n_heading = compose(
                x,
                y,
                heading,
                lib.edge_shift[edge, 0],
                lib.edge_shift[edge, 1],
                lib.edge_shift[edge, 2],
            )
            n_z = z + lib.edge_shift[edge, 3]
            slot, key, old, ahead = worth(
                search, task, grid, layers, n_x, n_y, n_heading, n_z, target, cost, time, limit
            )
            if ahead == math.inf or not edge_inside(task, lib, edge, x, y, heading, z):
                continue
            gap = clearance - lib.edge_reach[edge]
            climbs = lib.edge_high[edge] > lib.edge_low[edge] and not layers.flat
            stays = lib.edge_time[edge] == 0.0  # a switch: what was proven here is all there is
            if not stays and (gap <= task.margin or moving or climbs):
                state[QUERIES] += 1
                gap = edge_proven(task, lib, layers, edge, x, y, heading, z, task.clock + spent)
                if not gap >= 0.0:
                    continue
            if old >= 0:
                links[old, 3] = 1
            row = (n_x, n_y, n_heading, n_z, cost, time, 0.0, 0.0, gap)
            add_node(search, task, slot, key, row, (node, target, edge), ahead)
    return 1
