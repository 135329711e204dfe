"""A search in space and time for a fail-safe trajectory: collision-free, wherever it leads.

A node is a row of two arrays. Columns of `nodes` (n, 6):

    X, Y, HEADING   the pose
    CLOCK           [s] time of the world there
    LASTING         [s] of the coast that leads here
    SAFE            [s] time of the world until which it is safe

and of `links` (n, 2): PARENT (-1 for the root) and TRIM (of that coast). A vehicle that can rest is
safe as long as rest is free there; one that cannot, as long as the trim that led there stays free.

The open list is ordered by safety lost and time spent: the node that is safe for longest comes
first, and of equal ones the one that gets there soonest. The search ends at the first node that is
safe for as long as was asked, because any will do. A cell of space, heading and time is entered
once: what comes there later is as good to go on from, to within the cell.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.collision._kernels_advancement import free_time
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search._kernels_cells import enter
from maneuver_automaton.search._kernels_distance import pop, push
from maneuver_automaton.search._kernels_window import inside_window

if TYPE_CHECKING:
    from maneuver_automaton._arrays import IntArray
    from maneuver_automaton.collision.body import Body
    from maneuver_automaton.collision.world import WorldArrays
    from maneuver_automaton.search.lattice_arrays import LatticeArrays

FULL_TURN = 2.0 * math.pi
X, Y, HEADING, CLOCK, LASTING, SAFE = range(6)
PARENT, TRIM = range(2)
# Rows of `state`: nodes in use, nodes in the open list, 1 once a node is safe for long enough, the
# node that is safe for longest, nodes expanded.
N_NODES, HEAP, FOUND, BEST, EXPANSIONS = range(5)


class FailSafeTask(NamedTuple):
    """Where to begin and what is asked for."""

    x: float
    y: float
    heading: float
    clock: float  # [s]
    until: float  # [s] to be free until then
    rest: int  # number of the trim that rests, -1 for none
    keep: float  # [m] clearance that is kept
    margin: float  # [m] of clearance beyond it that a proof needs
    cell: float  # [m] size of a cell in space
    headings: int  # cells of a full turn
    tick: float  # [s] size of a cell in time
    longest: float  # [s] that a trim which moves is held, if the vehicle can rest
    impatience: float  # seconds of safety that a second of driving is worth
    window: np.ndarray  # as in `_kernels_window.inside_window`


class FailSafeArrays(NamedTuple):
    """Room for the nodes, the cells they are in, and the queue."""

    nodes: np.ndarray  # (n, 6)
    links: np.ndarray  # (n, 2)
    cells: np.ndarray  # (4 n,) keys, `EMPTY` where free; n is a power of two
    heap_key: np.ndarray  # (n,)
    heap_node: np.ndarray  # (n,)
    state: np.ndarray  # (5,)


@bare_inner_kernel
def is_new(
    task: FailSafeTask, cells: IntArray, x: float, y: float, heading: float, clock: float
) -> bool:
    """Whether the cell of a pose and a time is entered for the first time; marks it."""
    # 16 bits for each place, 9 for the heading, the rest for the time: places 65,536 cells apart
    # share a key, which drops a node and never a proof.
    i = math.floor((x - task.x) / task.cell + 0.5) & 0xFFFF
    j = math.floor((y - task.y) / task.cell + 0.5) & 0xFFFF
    turn = (heading - task.heading) / FULL_TURN
    k = math.floor((turn - math.floor(turn)) * task.headings + 0.5) % task.headings
    tick = math.floor((clock - task.clock) / task.tick + 0.5) & 0xFFFF
    key = ((tick * 512 + k) * 65536 + j) * 65536 + i
    return enter(cells, key)


@bare_inner_kernel
def safe_until(
    task: FailSafeTask,
    lib: LatticeArrays,
    world: WorldArrays,
    body: Body,
    x: float,
    y: float,
    heading: float,
    clock: float,
) -> float:
    """Time of the world until which rest at a pose is free, from a time on."""
    proven, _ = free_time(
        world,
        body,
        x,
        y,
        heading,
        0.0,
        0.0,
        0.0,
        0.0,
        max(task.until - clock, 0.0),
        task.keep,
        task.margin,
        clock,
    )
    return clock + proven


@bare_inner_kernel
def add_node(
    task: FailSafeTask,
    search: FailSafeArrays,
    x: float,
    y: float,
    heading: float,
    clock: float,
    lasting: float,
    safe: float,
    parent: int,
    trim: int,
) -> None:
    """Append a node and queue it; the one that is safe for longest is remembered."""
    nodes, links, state = search.nodes, search.links, search.state
    node = state[N_NODES]
    nodes[node, X], nodes[node, Y], nodes[node, HEADING] = x, y, heading
    nodes[node, CLOCK], nodes[node, LASTING], nodes[node, SAFE] = clock, lasting, safe
    links[node, PARENT], links[node, TRIM] = parent, trim
    state[N_NODES] = node + 1
    if node == 0 or safe > nodes[state[BEST], SAFE]:
        state[BEST] = node
    if safe >= task.until:
        state[FOUND] = 1
    key = task.impatience * (clock - task.clock) - safe
    push(search.heap_key, search.heap_node, state[HEAP], key, node)
    state[HEAP] += 1


@bare_kernel
def begin(
    task: FailSafeTask, lib: LatticeArrays, world: WorldArrays, body: Body, search: FailSafeArrays
) -> None:
    """Push the pose to begin at, into arrays whose cells are free."""
    for k in range(search.state.shape[0]):
        search.state[k] = 0
    x, y, heading = task.x, task.y, task.heading
    is_new(task, search.cells, x, y, heading, task.clock)
    safe = task.clock
    if task.rest >= 0:
        safe = safe_until(task, lib, world, body, x, y, heading, task.clock)
    add_node(task, search, x, y, heading, task.clock, 0.0, safe, -1, -1)


@bare_kernel
def expand(
    task: FailSafeTask,
    lib: LatticeArrays,
    world: WorldArrays,
    body: Body,
    search: FailSafeArrays,
    n: int,
) -> int:
    """Expand up to `n` nodes until one is safe for long enough.

    Every trim is held as long as it is free, and left at several moments. Returns whether it may go
    on: 0 when nothing is left, or no room.
    """
    # The times at which a trim is left double: there are at most 32 unless they grow by 2**32.
    nodes, state = search.nodes, search.state
    room = nodes.shape[0] - 32 * lib.library.n_trims
    for _ in range(n):
        if state[FOUND] == 1 or state[HEAP] == 0 or state[N_NODES] > room:
            return 0
        node = pop(search.heap_key, search.heap_node, state[HEAP])
        state[HEAP] -= 1
        state[EXPANSIONS] += 1
        x, y, heading = nodes[node, X], nodes[node, Y], nodes[node, HEADING]
        clock = nodes[node, CLOCK]
        left = task.until - clock
        for trim in range(lib.library.n_trims):
            v_x, v_y, turn = (
                lib.library.twists[trim, 0],
                lib.library.twists[trim, 1],
                lib.library.twists[trim, 2],
            )
            if trim == task.rest:
                proven = nodes[node, SAFE] - clock  # proven when the node was made
            else:
                # One proof for all children by this trim: whatever is left before `proven` is free.
                most = left if task.rest < 0 else min(left, task.longest)
                proven, _ = free_time(
                    world,
                    body,
                    x,
                    y,
                    heading,
                    v_x,
                    v_y,
                    turn,
                    lib.fastest[trim],
                    most,
                    task.keep,
                    task.margin,
                    clock,
                )
            t = lib.edge_durations[trim, 0]
            if task.rest < 0 and proven >= left:
                t = left  # one that cannot rest is done where a trim is free to the end
            while t > 0.0 and t <= proven and t <= left:
                if not inside_window(task.window, x, y, heading, v_x, v_y, turn, t):
                    break
                d_x, d_y, angle = coast(v_x, v_y, turn, t)
                n_x, n_y, n_heading = compose(x, y, heading, d_x, d_y, angle)
                if is_new(task, search.cells, n_x, n_y, n_heading, clock + t):
                    safe = clock + proven
                    if trim == task.rest:
                        safe = nodes[node, SAFE]
                    elif task.rest >= 0:
                        safe = safe_until(task, lib, world, body, n_x, n_y, n_heading, clock + t)
                    add_node(task, search, n_x, n_y, n_heading, clock + t, t, safe, node, trim)
                    if state[FOUND] == 1:
                        return 0
                t *= 2.0
    return 1
