"""Exact search of a state lattice in time: when each node is reached counts beside what it costs.

The arrays of a search, `TimedArrays`:

    table (4 p, 2)     hash table of places, as in `_kernels_state_lattice`
    latest (p, S)      the newest label of each state at a place that was expanded; -1 for none
    links, times, cost (n, 6), (n, 3), (n,) of each label: COLUMN, ROW, STATE, PARENT, EDGE, BEFORE
                       (another label of its node); ARRIVAL, UNTIL (as long as the body may stand
                       there), WAITED (at the parent, before the edge) [s]; the cost from the start
    heap_key, heap_item (m,) the open list: -1 - label; or a motion that was not tested, its label,
                       its edge, and how many ticks it waits before it
    state, found       the numbers named below; the least cost of a plan that departs between two
                       ticks at which the way is blocked

Of two labels of a node one is of no use where the other may wait there until it would arrive, and
costs no more then. So of all departures along an edge only the first counts for each stretch of
time in which it is free. They are tried a tick apart, and then found to a small part of a tick. The
costs and times to go among all that stands are known: nodes without lead to no plan that is asked
for.

Source: Phillips, Likhachev (2011), *SIPP: Safe Interval Path Planning for Dynamic Environments*,
ICRA, here with a cost beside the time.
"""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.search._kernels_coast import coast_proven
from maneuver_automaton.search._kernels_connection import edge_proven
from maneuver_automaton.search._kernels_distance import pop, push
from maneuver_automaton.search._kernels_state_lattice import (
    FREE,
    SEARCH,
    aim_at,
    met_along,
    place_in,
    pose_in,
)
from maneuver_automaton.search.arrays import KnownCosts, TimedQuery

EDGE_BITS, WAIT_BITS = 16, 20  # of an entry of the open list; above them its label
MOST_WAITS = (1 << WAIT_BITS) - 1
HALVINGS = 20  # of a tick, for the time at which the way is free again
SAME = 1e-9  # [s] between times that count as one, and share of costs that do
COLUMN, ROW, STATE, PARENT, EDGE, BEFORE = range(6)
ARRIVAL, UNTIL, WAITED = range(3)
N_LABELS, N_PLACES, HEAP, QUERIES, FOUND, AIM, BEGUN = range(7)


@bare_inner_kernel
def cost_in(known: KnownCosts, column: int, row: int, state: int) -> float:
    """The cost to go from a node."""
    i, j = column - known.column, row - known.row
    if 0 <= i < known.value.shape[0] and 0 <= j < known.value.shape[1]:
        return float(known.value[i, j, state])
    return math.inf


@bare_inner_kernel
def useless_until(
    query: TimedQuery, node: tuple[int, int, int], arrival: float, paid: float
) -> float:
    """Until when a label may wait that makes one of such a cost useless; -1 if none does."""
    # Whatever arrives by then, and costs as much more as it is later, is useless too.
    search, quiet, ends = query.arrays, query.timing.quiet, query.timing.most_time < math.inf
    place, _, _ = place_in(search.table, node[0], node[1])
    if place < 0:
        return -1.0
    label, most = search.latest[place, node[2]], paid + SAME * (1.0 + abs(paid))
    while label >= 0:
        before, until = float(search.times[label, ARRIVAL]), float(search.times[label, UNTIL])
        cost, later = search.cost[label], arrival - before
        at_rest = min(before, arrival) >= quiet and (later > 0.0 or not ends)
        if cost <= most and (at_rest or abs(later) <= SAME):
            return until
        if (
            later > 0.0
            and arrival <= until
            and cost + query.timing.rate * later + query.timing.pause <= most
        ):
            return until
        label = search.links[label, BEFORE]
    return -1.0


@bare_inner_kernel
def is_free_at(query: TimedQuery, label: int, e: int, leave: float) -> bool:
    """Whether an edge from where a label is, begun `leave` [s] after the start, meets nothing."""
    links, lattice, moving = query.arrays.links, query.lattice, query.moving
    column, row, at = links[label, COLUMN], links[label, ROW], links[label, STATE]
    pose, clock = pose_in(query.frame, lattice, column, row, at), query.timing.clock + leave
    query.arrays.state[QUERIES] += 1
    return bool(edge_proven(moving.scene, moving.lib, lattice.edge[e], pose, clock) >= 0.0)


@bare_inner_kernel
def list_motion(query: TimedQuery, label: int, e: int, ticks: int, upper_bound: float) -> None:
    """Put a motion on the open list that begins so many ticks after a label, or one less."""
    # Nothing where it cannot wait so long, comes too late, or leads to no plan below a cost.
    search, lattice = query.arrays, query.lattice
    links, waited = search.links, query.timing.tick * (ticks - 1) if ticks > 0 else 0.0
    leave = search.times[label, ARRIVAL] + waited
    if ticks > 0 and (leave > search.times[label, UNTIL] or leave > query.timing.quiet):
        return
    column, row = links[label, COLUMN] + lattice.step[e, 0], links[label, ROW] + lattice.step[e, 1]
    target, key = (
        lattice.target[e],
        search.cost[label] + lattice.cost[e] + query.timing.rate * waited,
    )
    if ticks > 0:
        key += query.timing.pause
    arrival = leave + query.moving.lib.edges.time[lattice.edge[e]]
    if arrival + cost_in(query.soon, column, row, target) > query.timing.most_time:
        return
    key += cost_in(query.free, column, row, target)
    if key < upper_bound and ticks <= MOST_WAITS:
        item = (((label << EDGE_BITS) | e) << WAIT_BITS) | ticks
        push(search.heap_key, search.heap_item, search.state[HEAP], key, item)
        search.state[HEAP] += 1


@bare_inner_kernel
def try_motion(query: TimedQuery, item: int, key: float, upper_bound: float) -> None:
    """Test a motion of the open list: what it leads to is a label, if it is free."""
    search, lattice = query.arrays, query.lattice
    label, e = item >> (WAIT_BITS + EDGE_BITS), (item >> WAIT_BITS) & ((1 << EDGE_BITS) - 1)
    ticks, links = item & MOST_WAITS, search.links
    begun, until = search.times[label, ARRIVAL], search.times[label, UNTIL]
    column, row, at = links[label, COLUMN], links[label, ROW], links[label, STATE]
    node = column + lattice.step[e, 0], row + lattice.step[e, 1], lattice.target[e]
    takes = query.moving.lib.edges.time[lattice.edge[e]]
    low, leave, paid = begun, begun, search.cost[label] + lattice.cost[e]
    if ticks > 0:
        low = begun + (ticks - 1) * query.timing.tick
        leave = min(begun + ticks * query.timing.tick, until)
        paid += query.timing.pause
    useless = useless_until(query, node, low + takes, paid + query.timing.rate * (low - begun))
    if useless >= leave + takes:
        if useless < math.inf:
            after = math.ceil((useless - takes - begun) / query.timing.tick)
            list_motion(query, label, e, max(ticks + 1, after), upper_bound)
        return
    if ticks == 0:
        pose = pose_in(lattice.frame, lattice, column, row, at)
        met = met_along(query.coarse, query.fine, lattice.edge[e], pose, -1.0, lattice.travel[e])
        if met != FREE:
            return
    if not is_free_at(query, label, e, leave):
        if ticks > 0:
            search.found[0] = min(search.found[0], key)
        list_motion(query, label, e, ticks + 1, upper_bound)
        return
    if ticks > 0 and not is_free_at(query, label, e, low):
        for _ in range(HALVINGS):
            middle = 0.5 * (low + leave)
            if is_free_at(query, label, e, middle):
                leave = middle
            else:
                low = middle
    if ticks > 0 and leave - begun < query.timing.least_wait:
        leave = min(begun + query.timing.tick, until)
    list_motion(query, label, e, ticks + 1, upper_bound)  # the way may be free once more
    if leave + takes > query.timing.most_time:
        return
    new = search.state[N_LABELS]
    search.state[N_LABELS] += 1
    links[new, COLUMN], links[new, ROW], links[new, STATE] = node[0], node[1], node[2]
    links[new, PARENT], links[new, EDGE] = label, e
    search.times[new, ARRIVAL], search.times[new, WAITED] = leave + takes, leave - begun
    search.cost[new] = paid + query.timing.rate * (leave - begun)
    ahead = cost_in(query.free, node[0], node[1], node[2])
    push(search.heap_key, search.heap_item, search.state[HEAP], search.cost[new] + ahead, -1 - new)
    search.state[HEAP] += 1


@bare_kernel
def expand_in_time(query: TimedQuery, n: int, upper_bound: float) -> int:
    """Take up to `n` labels and motions from the open list, by their cost and the cost to go."""
    # Returns as `expand_lattice`.
    search, lattice = query.arrays, query.lattice
    links, state, times = search.links, search.state, search.times
    if state[BEGUN] == 0:
        state[BEGUN], state[N_LABELS], state[HEAP] = 1, 1, 1
        for k in range(3):
            links[0, k] = lattice.roots[0, k]
        links[0, PARENT] = links[0, EDGE] = -1
        times[0, ARRIVAL] = times[0, WAITED] = search.cost[0] = 0.0
        search.heap_key[0], search.heap_item[0] = 0.0, -1
    for _ in range(n):
        if state[HEAP] == 0 or search.heap_key[0] >= upper_bound:
            return 0
        if (
            state[N_LABELS] == search.cost.shape[0]
            or state[N_PLACES] == search.latest.shape[0]
            or state[HEAP] + lattice.most_links > search.heap_key.shape[0]
        ):
            return 1
        key = search.heap_key[0]
        item = pop(search.heap_key, search.heap_item, state[HEAP])
        state[HEAP] -= 1
        if item >= 0:
            try_motion(query, item, key, upper_bound)
            continue
        label = -1 - item
        column, row, at = links[label, COLUMN], links[label, ROW], links[label, STATE]
        arrival = times[label, ARRIVAL]
        if useless_until(query, (column, row, at), arrival, search.cost[label]) >= 0.0:
            continue
        place, slot, known = place_in(search.table, column, row)
        if place < 0:
            place = state[N_PLACES]
            state[N_PLACES] += 1
            search.table[slot, 0], search.table[slot, 1] = known, (SEARCH << 31) | place
            for k in range(search.latest.shape[1]):
                search.latest[place, k] = -1
        until = math.inf
        if arrival < query.timing.quiet:
            pose = pose_in(query.frame, lattice, column, row, at)
            trim, lasting = at // query.directed, query.timing.quiet - arrival + 1.0
            scene, lib, clock = query.moving.scene, query.moving.lib, query.timing.clock + arrival
            stands, _ = coast_proven(scene, lib, trim, pose, lasting, clock)
            until = arrival + stands if stands < lasting else math.inf
        times[label, UNTIL] = until
        links[label, BEFORE], search.latest[place, at] = search.latest[place, at], label
        aim = aim_at(query.aims, column * lattice.cell, row * lattice.cell, at)
        if aim >= 0 and (until == math.inf or not query.timing.stays):
            state[FOUND], state[AIM] = label, aim
            return 0
        for e in range(lattice.first[at], lattice.first[at + 1]):
            list_motion(query, label, e, 0, upper_bound)
    return 1
