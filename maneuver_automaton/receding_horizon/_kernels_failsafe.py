"""A search in space and time for a fail-safe trajectory: collision-free, wherever it leads.

A node is a row of two arrays. Columns of `nodes` (n, 8):

    X, Y, HEADING, Z   the pose
    CLOCK              [s] time of the world there
    LASTING            [s] of the coast that leads here, 0 after a maneuver
    SAFE               [s] time of the world until which it is proven free
    HOPE               [s] the same of the node that it is expanded as

and of `links` (n, 3): PARENT (-1 for the root), TRIM (in which it is), and EDGE (the maneuver that
leads here, -1 for a coast). A vehicle that can rest in a class of trims is safe there as long as
rest is free; in a trim that moves as long as it has been driven, and it hopes for as much as where
it last could rest. One that cannot rest at all is safe as long as its trim stays free.

The open list is ordered by safety lost and time spent: the node that is safe for longest comes
first, and of equal ones the one that gets there soonest. The search ends at the first node that
leads to one that is safe for as long as was asked: to the soonest of these. A cell of space,
heading and time is entered once in a class of trims: what comes there later is as good to go on
from, to within the cell.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel, bare_shared_kernel
from maneuver_automaton.search._kernels_coast import coast_inside, coast_proven, coasted, edge_end
from maneuver_automaton.search._kernels_connection import edge_free
from maneuver_automaton.search._kernels_distance import pop, push
from maneuver_automaton.search._kernels_nodes import enter
from maneuver_automaton.search.arrays import LatticeArrays, Scene

FULL_TURN = 2.0 * math.pi
X, Y, HEADING, Z, CLOCK, LASTING, SAFE, HOPE = range(8)
PARENT, TRIM, EDGE = range(3)
# Rows of `state`: nodes in use, nodes in the open list, the node that is safe for long enough (-1
# for none), the node that is safe for longest, nodes expanded.
N_NODES, HEAP, FOUND, BEST, EXPANSIONS = range(5)


class FailSafeTask(NamedTuple):
    """Where to begin and what is asked for."""

    pose: tuple[float, float, float, float]
    trim: int  # in which it begins; any, for a vehicle that switches at will
    clock: float  # [s]
    until: float  # [s] to be free until then
    rests: bool  # whether any trim rests
    rest_of: np.ndarray  # (C,) number of the trim of each class that rests, -1 for none
    holds: np.ndarray  # (m,) [s] least time that each trim is held
    cell: float  # [m] size of a cell in space
    headings: int  # cells of a full turn
    tick: float  # [s] size of a cell in time
    longest: float  # [s] that a trim which moves is held, if the vehicle can rest
    impatience: float  # seconds of safety that a second of driving is worth


class FailSafeArrays(NamedTuple):
    """Room for the nodes, the cells they are in, and the queue."""

    nodes: np.ndarray  # (n, 8)
    links: np.ndarray  # (n, 3)
    cells: np.ndarray  # (4 n,) keys, `EMPTY` where free; n is a power of two
    heap_key: np.ndarray  # (n,)
    heap_node: np.ndarray  # (n,)
    state: np.ndarray  # (5,)


@bare_inner_kernel
def is_new(
    task: FailSafeTask,
    cells: IntArray,
    pose: tuple[float, float, float, float],
    clock: float,
    group: int,
) -> bool:
    """Whether the cell of a pose, a time and a class is entered for the first time; marks it."""
    # 16 bits for each place, 9 for the heading, 16 for the time, the rest for altitude and class:
    # places 65,536 cells apart share a key, which drops a node and never a proof.
    i = math.floor((pose[0] - task.pose[0]) / task.cell + 0.5) & 0xFFFF
    j = math.floor((pose[1] - task.pose[1]) / task.cell + 0.5) & 0xFFFF
    turn = (pose[2] - task.pose[2]) / FULL_TURN
    k = math.floor((turn - math.floor(turn)) * task.headings + 0.5) % task.headings
    tick = math.floor((clock - task.clock) / task.tick + 0.5) & 0xFFFF
    level = math.floor((pose[3] - task.pose[3]) / task.cell + 0.5)
    kind = (group + 31 * level) & 0x3F
    key = (((kind * 65536 + tick) * 512 + k) * 65536 + j) * 65536 + i
    return enter(cells, key)


@bare_shared_kernel
def add_node(
    task: FailSafeTask,
    lib: LatticeArrays,
    scene: Scene,
    search: FailSafeArrays,
    pose: tuple[float, float, float, float],
    clock: float,
    lasting: float,
    known: float,
    parent: int,
    trim: int,
    edge: int,
) -> None:
    """Append a node and queue it; the one that is safe for longest is remembered.

    `known` is the time [s] of the world until which rest, or the trim, is proven free; -inf if
    that is not known yet.
    """
    nodes, links, state = search.nodes, search.links, search.state
    node = state[N_NODES]
    rest = task.rest_of[lib.library.class_of[trim]]
    safe, hope = clock, task.clock if parent < 0 else nodes[parent, HOPE]
    if rest >= 0:
        safe = known
        if known < clock:
            left = max(task.until - clock, 0.0)
            stands, _ = coast_proven(scene, lib, rest, pose, left, clock)
            safe = clock + stands
        hope = safe
    elif not task.rests:
        safe = max(known, clock)
        hope = safe
    nodes[node, X], nodes[node, Y], nodes[node, HEADING] = pose[0], pose[1], pose[2]
    nodes[node, Z], nodes[node, CLOCK], nodes[node, LASTING] = pose[3], clock, lasting
    nodes[node, SAFE], nodes[node, HOPE] = safe, hope
    links[node, PARENT], links[node, TRIM], links[node, EDGE] = parent, trim, edge
    state[N_NODES] = node + 1
    if node == 0 or (state[FOUND] < 0 and safe > nodes[state[BEST], SAFE]):
        state[BEST] = node
    is_sooner = state[FOUND] < 0 or clock < nodes[state[FOUND], CLOCK]
    if is_sooner and safe >= task.until and (rest >= 0 or not task.rests):
        state[FOUND] = node
        state[BEST] = node
    key = task.impatience * (clock - task.clock) - hope
    push(search.heap_key, search.heap_node, state[HEAP], key, node)
    state[HEAP] += 1


@bare_kernel
def begin(task: FailSafeTask, lib: LatticeArrays, scene: Scene, search: FailSafeArrays) -> None:
    """Push the pose to begin at, into arrays whose cells are free."""
    for k in range(search.state.shape[0]):
        search.state[k] = 0
    search.state[FOUND] = -1
    group = lib.library.class_of[task.trim]
    is_new(task, search.cells, task.pose, task.clock, group)
    add_node(task, lib, scene, search, task.pose, task.clock, 0.0, -math.inf, -1, task.trim, -1)


@bare_kernel
def expand(
    task: FailSafeTask, lib: LatticeArrays, scene: Scene, search: FailSafeArrays, n: int
) -> int:
    """Expand up to `n` nodes until one is safe for long enough.

    Every trim of the node's class is held as long as it is free, and left at several moments; every
    maneuver out of the class is driven. Returns whether it may go on: 0 when nothing is left, or no
    room.
    """
    # The times at which a trim is left double: there are at most 32 unless they grow by 2**32.
    nodes, state = search.nodes, search.state
    room = nodes.shape[0] - 32 * lib.library.n_trims - lib.edges.cost.shape[0]
    for _ in range(n):
        if state[FOUND] >= 0 or state[HEAP] == 0 or state[N_NODES] > room:
            return 0
        node = pop(search.heap_key, search.heap_node, state[HEAP])
        state[HEAP] -= 1
        state[EXPANSIONS] += 1
        pose = (nodes[node, X], nodes[node, Y], nodes[node, HEADING], nodes[node, Z])
        clock = nodes[node, CLOCK]
        left = task.until - clock
        group = lib.library.class_of[search.links[node, TRIM]]
        rest = task.rest_of[group]
        for place in range(lib.first_trim[group], lib.first_trim[group + 1]):
            trim = lib.trims_of[place]
            if trim == rest:
                proven = nodes[node, SAFE] - clock  # proven when the node was made
            else:
                longest = lib.library.longest[trim]
                if longest < math.inf and trim == search.links[node, TRIM]:
                    continue  # how long it has lasted already is not known
                # One proof for all children by this trim: whatever is left before `proven` is free.
                most = min(left, longest)
                if task.rests:
                    most = min(most, task.longest)
                proven, _ = coast_proven(scene, lib, trim, pose, max(most, 0.0), clock)
            t = task.holds[trim]
            if not task.rests and proven >= left:
                t = left  # one that cannot rest is done where a trim is free to the end
            goes_on = not task.rests and coast_inside(scene, lib, trim, pose, proven)
            while t > 0.0 and t <= proven and t <= left:
                if not coast_inside(scene, lib, trim, pose, t):
                    break
                then = coasted(lib, trim, pose, t)
                if is_new(task, search.cells, then, clock + t, group):
                    known = -math.inf
                    if trim == rest:
                        known = nodes[node, SAFE]
                    elif goes_on:
                        known = clock + proven
                    add_node(task, lib, scene, search, then, clock + t, t, known, node, trim, -1)
                t *= 2.0
                if state[FOUND] >= 0 and clock + t >= nodes[state[FOUND], CLOCK]:
                    break  # the one that was found is sooner
        for edge in range(lib.edges.first[group], lib.edges.first[group + 1]):
            if not edge_free(scene, lib, edge, pose, clock):
                continue
            trim, later = lib.edges.target[edge], clock + lib.edges.time[edge]
            then = edge_end(lib, edge, pose)
            if not is_new(task, search.cells, then, later, lib.library.class_of[trim]):
                continue
            known = -math.inf
            if not task.rests:
                ahead = min(max(task.until - later, 0.0), lib.library.longest[trim])
                proven, _ = coast_proven(scene, lib, trim, then, ahead, later)
                if coast_inside(scene, lib, trim, then, proven):
                    known = later + proven
            add_node(task, lib, scene, search, then, later, 0.0, known, node, trim, edge)
    return 1
