"""Nodes of the lattice: the arrays they are kept in, the table of their cells, the open list.

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

`state` (13,) are the numbers named below; `found` (6,) is the cost of the cheapest plan found, then
the durations of the three trims of its connection and of the climb, then what words that are tried
first may cost beyond the shortest path. `scratch` holds the candidates of one connection.
"""

from __future__ import annotations

import math

from maneuver_automaton._arrays import IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.search._kernels_distance import pop, push
from maneuver_automaton.search.arrays import CellSizes, LatticeArrays, SearchArrays, Task
from maneuver_automaton.words._kernels_library import class_of

FULL_TURN = 2.0 * math.pi
EMPTY = -1  # no key, in a set of keys
MOST_SIDES = 1 << 15  # cells along a side that have numbers of their own
MOST_KEYS = 1 << 62  # numbers of cells: they are signed and have 64 bits
COASTED, ROOTED = -1, -2  # in place of the maneuver that leads to a node
SIDE_BY_SIDE = 2  # binary digits of a key that number the rows of one line of the cache
NODE_BITS = 0x7FFFFFFF  # of an entry of the hash table: the node; above them the search
X, Y, HEADING, Z, COST, TIME, COAST, RUN, CLEARANCE = range(9)
PARENT, TRIM, GEAR, COUNT, ROOT, EDGE, CLOSED = range(7)
EXCESS = 5  # the last column of `found`
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
    BEGUN,  # 1 once the roots are pushed
) = range(13)


@bare_inner_kernel
def cells_along(cell: float, far: float, others: int) -> int:
    """Number of cells with numbers of their own along a side of a window [m], a power of two."""
    # `others` is the product of what headings, levels, ticks and layers need.
    sides = 2
    # A quotient, which is exact, in place of a product, which might need more than 64 bits.
    while (
        sides < MOST_SIDES and sides * cell < 4.0 * far and others < MOST_KEYS // (2 * sides) ** 2
    ):
        sides *= 2
    return sides


@bare_inner_kernel
def cell_key(
    cells: CellSizes, pose: tuple[float, float, float, float], layer: int, time: float, fine: int
) -> int:
    """Number of the lattice cell a pose is in, seen from the frame of the cells."""
    # `cells.radix`: cells along a side of the window, a power of two, headings, levels of altitude
    # and ticks of the clock; the last two are 1 where they make no difference.
    # The grid is fixed to the first goal, so a moved problem has the moved cells.
    x, y, heading, z = pose
    to_x, to_y, to_heading, c, s = cells.frame
    d_x, d_y = x - to_x, y - to_y
    cell = cells.fine_cell if fine else cells.cell
    n_headings = cells.fine_headings if fine else cells.headings
    sides, turns, levels, ticks = cells.radix
    i = math.floor((c * d_x + s * d_y) / cell + 0.5) & (sides - 1)
    j = math.floor((c * d_y - s * d_x) / cell + 0.5) & (sides - 1)
    turn = (heading - to_heading) / FULL_TURN
    k = math.floor((turn - math.floor(turn)) * n_headings + 0.5)
    k = 0 if k == n_headings else k
    level = math.floor(z / cells.rise + 0.5) & (levels - 1) if levels > 1 else 0
    tick = math.floor(time / cells.tick) & (ticks - 1) if cells.tick > 0.0 else 0
    # Digits of one number, the least last. Cells `sides` apart along an axis share a number, as do
    # times `ticks` apart: that drops a node, and never a proof.
    above = ((layer * 2 + fine) * ticks + tick) * levels + level
    return ((above * turns + k) * sides + j) * sides + i


@bare_inner_kernel
def layer_of(cells: CellSizes, lib: LatticeArrays, trim: int, gear: int, n_trims: int) -> int:
    """Number of a node's layer: its class, and gear, trim and count if prices or limits need it."""
    # Nodes of one pose in different layers do not replace each other.
    layer = class_of(lib.library, trim)
    if cells.by_gear:
        layer = layer * 3 + gear + 1
    if cells.by_trim:
        layer = layer * (lib.library.n_trims + 1) + trim + 1
    if cells.by_count:
        layer = layer * 16 + min(n_trims, 15)
    return layer


@bare_inner_kernel
def first_slot(key: int, mask: int) -> int:
    """Row of a hash table, of `mask` + 1 rows, at which the probes for a key begin."""
    # Fibonacci hashing; Knuth (1998), *The art of computer programming 3*, Sec. 6.4.
    # Neighbours along a row of cells stay side by side: one line of the processor's cache holds
    # four rows of the table, and to wait for memory is most of what a look-up costs.
    block = key >> SIDE_BY_SIDE
    # The high digits of a key (class, time, heading) are folded onto the low ones (place): cells of
    # one place could share a row otherwise. 31 bits times 32 bits stay below the sign.
    mixed = (block ^ (block >> 23) ^ (block >> 41)) & 0x7FFFFFFF
    within = key & ((1 << SIDE_BY_SIDE) - 1)
    return ((((mixed * 0x9E3779B1) >> 15) << SIDE_BY_SIDE) | within) & mask


@bare_inner_kernel
def slot_of(table: IntArray, generation: int, key: int) -> int:
    """Row of a key in the hash table, or the free one where it belongs."""
    # Rows are (key, generation and node); those of another generation are free.
    # Linear probing: nothing is ever deleted within a search, so the first free row ends it.
    mask = table.shape[0] - 1
    slot = first_slot(key, mask)
    while table[slot, 1] >> 31 == generation and table[slot, 0] != key:
        slot = (slot + 1) & mask
    return slot


@bare_inner_kernel
def node_in(table: IntArray, generation: int, slot: int) -> int:
    """Node that a row of the hash table holds; -1 if it is free."""
    entry = table[slot, 1]
    return entry & NODE_BITS if entry >> 31 == generation else -1


@bare_inner_kernel
def add_node(
    arrays: SearchArrays,
    slot: int,
    key: int,
    row: tuple[float, ...],
    link: tuple[int, ...],
    order: float,
) -> None:
    """Append a node, make it the one of its cell, push it, the lesser the `order` the sooner."""
    # `row` are its columns of `nodes`, `link` those of `links` but the last.
    nodes, links, state = arrays.nodes, arrays.links, arrays.state
    node = state[N_NODES]
    for k in range(9):
        nodes[node, k] = row[k]
    parent, trim, gear, count, root, edge = link
    links[node, PARENT], links[node, TRIM], links[node, GEAR] = parent, trim, gear
    links[node, COUNT], links[node, ROOT], links[node, EDGE] = count, root, edge
    links[node, CLOSED] = 0
    state[N_NODES] = node + 1
    arrays.table[slot, 0] = key
    arrays.table[slot, 1] = (state[GENERATION] << 31) | node
    push(arrays.heap_key, arrays.heap_node, state[HEAP], order, node)
    state[HEAP] += 1


@bare_inner_kernel
def open_node(arrays: SearchArrays, task: Task, upper_bound: float) -> int:
    """The most promising node that is open, taken from the heap; -1 if there is none."""
    links, state = arrays.links, arrays.state
    # Only where the task says so does a key end the search: with a weight above 1 it is no bound.
    most = min(upper_bound, arrays.found[0]) if task.ends_early else math.inf
    node = -1
    while node < 0 and state[HEAP] > 0 and not arrays.heap_key[0] >= most:
        node = pop(arrays.heap_key, arrays.heap_node, state[HEAP])
        state[HEAP] -= 1
        if links[node, CLOSED]:
            node = -1
    return node


@bare_kernel
def rehash(table: IntArray, generation: int, wide: IntArray) -> None:
    """Carry the entries of this generation over into a wider hash table."""
    for k in range(table.shape[0]):
        if node_in(table, generation, k) >= 0:
            slot = slot_of(wide, generation, table[k, 0])
            wide[slot, 0], wide[slot, 1] = table[k, 0], table[k, 1]


@bare_inner_kernel
def enter(cells: IntArray, key: int) -> bool:
    """Add a key to a set of keys (n,), never full; whether it is new."""
    mask = cells.shape[0] - 1
    slot = first_slot(key, mask)
    while cells[slot] != EMPTY:
        if cells[slot] == key:
            return False
        slot = (slot + 1) & mask
    cells[slot] = key
    return True
