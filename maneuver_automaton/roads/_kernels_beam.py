"""Beam search over words of maneuvers in space and time, towards a goal on a road.

All maneuvers last equally long, so the nodes of a level share a time, and a table of their cells
and strips serves a whole level. From each level only the best go on, by cost and cost-to-go, no two
of them in one cell of place, heading and speed. Maneuvers of the first level start at the vehicle's
own state, which need not be a trim. An edge is proven free when its node is about to be kept, not
when it is made: of some sixty children of a node one or two are ever popped.
"""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.groups._kernels import compose, nearest_turn
from maneuver_automaton.roads._kernels_costs import (
    cost_to_go,
    goal_at,
    is_too_fast,
    limit_at,
    nearest_of_all,
    nearest_point,
    on_route,
    rate_at,
    stage_rate,
)
from maneuver_automaton.roads._kernels_motion import first_free_stop, free_tick, one_tick
from maneuver_automaton.roads.arrays import BeamArrays, HorizonTask, Maneuvers, RoadArrays
from maneuver_automaton.search._kernels_distance import pop, push
from maneuver_automaton.search._kernels_nodes import EMPTY, enter

PARENT, MANEUVER, TRIM, NEAR = range(4)  # columns of `links`
N_NODES, HEAP, KEPT, CHECKS, N_CHILDREN = range(5)  # places of `state`
STOPPING, UNSAFE = range(2)  # rows of `reached`
COST, NODE, TICK = range(3)  # columns of `reached`
STRIP = 1.0  # [m] width of a strip along the route
TRIES = 16  # nodes of a level from which a fail-safe stop is looked for


@bare_inner_kernel
def is_new(
    task: HorizonTask, cells: IntArray, x: float, y: float, heading: float, speed: float
) -> bool:
    """Mark the cell of a node; whether it was free."""
    i = math.floor((x - task.x) / task.cell + 0.5) & 0xFFF
    j = math.floor((y - task.y) / task.cell + 0.5) & 0xFFF
    k = math.floor((heading - task.heading) / task.turn_cell + 0.5) & 0xFF
    v = int(speed / task.speed_cell) & 0xFF
    key = (((v << 8 | k) << 12 | j) << 12) | i
    return enter(cells, key)


@bare_inner_kernel
def strip_of(horizon: RoadArrays, search: BeamArrays, node: int) -> int:
    """Which strip along the route a node is in."""
    pose, near = search.pose, search.links[node, NEAR]
    _, offset = on_route(horizon.route, pose[node, 0], pose[node, 1], near)
    n = search.strips.shape[0]
    return min(max(math.floor(offset / STRIP) + n // 2, 0), n - 1)


@bare_inner_kernel
def speed_of(task: HorizonTask, horizon: RoadArrays, search: BeamArrays, node: int) -> float:
    """Speed at a node [m/s]: of its trim, or, at the start, that of the vehicle."""
    return task.speed if node == 0 else float(horizon.trims.speed[search.links[node, TRIM]])


@bare_inner_kernel
def add_children(
    task: HorizonTask,
    horizon: RoadArrays,
    search: BeamArrays,
    node: int,
    maneuvers: Maneuvers,
    low: int,
    high: int,
    tick: int,
) -> None:
    """Queue the nodes that maneuvers lead to at a tick, their edges not yet proven.

    Those that cost as much as a plan that is known are left out: costs only rise.
    """
    pose, links, state = search.pose, search.links, search.state
    limits, ahead = horizon.limits, horizon.clearing.car.ahead
    duration, last = limits.tick * limits.ticks, limits.ticks - 1
    x, y, heading, come = pose[node, 0], pose[node, 1], pose[node, 2], pose[node, 3]
    before = speed_of(task, horizon, search, node)
    c, s = math.cos(heading), math.sin(heading)
    for e in range(low, high):
        child = pose.shape[0] - search.heap_key.shape[0] + state[N_CHILDREN]
        if child >= pose.shape[0]:
            return
        d_x, d_y = maneuvers.pose[e, last, 0], maneuvers.pose[e, last, 1]
        n_x, n_y = x + c * d_x - s * d_y, y + s * d_x + c * d_y
        n_heading = heading + maneuvers.pose[e, last, 2]
        m_x, m_y = n_x + ahead * math.cos(n_heading), n_y + ahead * math.sin(n_heading)
        trim = maneuvers.target[e]
        speed = horizon.trims.speed[trim]
        # The parent's nearest point and the distance driven: the descent takes a step or two.
        guess = links[node, NEAR] + int(d_x / horizon.route.spacing)
        near = nearest_point(horizon.route, m_x, m_y, guess)
        station, offset = on_route(horizon.route, m_x, m_y, near)
        limit = limit_at(horizon.route, near, offset)
        if is_too_fast(horizon.route, limit, before, speed, duration):
            continue
        turned = nearest_turn(n_heading - horizon.route.heading[near])
        rate = stage_rate(horizon.weights, limit, offset, turned, speed)
        cost = come + maneuvers.effort[e] + duration * rate
        if cost >= search.reached[STOPPING, COST]:
            continue
        pose[child, 0], pose[child, 1], pose[child, 2], pose[child, 3] = n_x, n_y, n_heading, cost
        links[child, PARENT], links[child, MANEUVER] = node, e
        links[child, TRIM], links[child, NEAR] = trim, near
        state[N_CHILDREN] += 1
        to_go = cost_to_go(horizon, station, offset, turned, speed, tick)
        push(search.heap_key, search.heap_node, state[HEAP], cost + task.greed * to_go, child)
        state[HEAP] += 1


@bare_inner_kernel
def prove_edge(
    task: HorizonTask,
    horizon: RoadArrays,
    search: BeamArrays,
    maneuvers: Maneuvers,
    node: int,
    tick: int,
) -> tuple[bool, int]:
    """Prove the edge into a node from `tick` on: whether it is free; tick of a goal on it or -1."""
    pose, links, limits = search.pose, search.links, horizon.limits
    parent, e = links[node, PARENT], links[node, MANEUVER]
    speed = speed_of(task, horizon, search, parent)
    x, y, heading = pose[parent, 0], pose[parent, 1], pose[parent, 2]
    before = (x, y, heading)
    for k in range(limits.ticks):
        if tick + k >= task.until:
            return True, -1
        d_x, d_y, turn = maneuvers.pose[e, k, 0], maneuvers.pose[e, k, 1], maneuvers.pose[e, k, 2]
        after = compose(x, y, heading, d_x, d_y, turn)
        if not free_tick(horizon.clearing, before, after, tick + k):
            return False, -1
        faster = speed + maneuvers.control[e, 0] * limits.tick * (k + 1)
        # A goal counts at every tick of the edge, and what follows it need not be free.
        if goal_at(horizon, after[0], after[1], after[2], faster, tick + k + 1) >= 0:
            return True, tick + k + 1
        before = after
    return True, -1


@bare_inner_kernel
def cost_along(
    task: HorizonTask,
    horizon: RoadArrays,
    search: BeamArrays,
    maneuvers: Maneuvers,
    node: int,
    ticks: int,
) -> float:
    """Cost to come of a node after so many ticks of the edge into it; inf beyond a speed limit."""
    pose, links, limits = search.pose, search.links, horizon.limits
    parent, e = links[node, PARENT], links[node, MANEUVER]
    speed = speed_of(task, horizon, search, parent)
    x, y, heading, near = pose[parent, 0], pose[parent, 1], pose[parent, 2], links[parent, NEAR]
    cost = pose[parent, 3] + maneuvers.effort[e] * ticks / limits.ticks
    for k in range(ticks):
        d_x, d_y, turn = maneuvers.pose[e, k, 0], maneuvers.pose[e, k, 1], maneuvers.pose[e, k, 2]
        n_x, n_y, n_heading = compose(x, y, heading, d_x, d_y, turn)
        before, speed = speed, speed + maneuvers.control[e, 0] * limits.tick
        rate, near, limit = rate_at(horizon, n_x, n_y, n_heading, speed, near)
        if is_too_fast(horizon.route, limit, before, speed, limits.tick):
            return math.inf
        cost += limits.tick * rate
    return cost


@bare_inner_kernel
def word_to(
    search: BeamArrays,
    first: Maneuvers,
    maneuvers: Maneuvers,
    node: int,
    ticks: int,
    controls: Array,
) -> int:
    """Write the controls (n, 2), tick by tick, of the word that leads to a node; n."""
    links = search.links
    levels, k = 0, node
    while links[k, PARENT] >= 0:
        levels += 1
        k = links[k, PARENT]
    k = node
    for level in range(levels - 1, -1, -1):
        e = links[k, MANEUVER]
        along = first.control[e, 0] if level == 0 else maneuvers.control[e, 0]
        rate = first.control[e, 1] if level == 0 else maneuvers.control[e, 1]
        for i in range(level * ticks, (level + 1) * ticks):
            controls[i, 0], controls[i, 1] = along, rate
        k = links[k, PARENT]
    return levels * ticks


@bare_inner_kernel
def finish(
    task: HorizonTask,
    horizon: RoadArrays,
    search: BeamArrays,
    first: Maneuvers,
    node: int,
    last: int,
    shares: Array,
    controls: Array,
    rests: bool,
) -> tuple[int, int]:
    """Controls to a node, cut at the tick `last`, and to stop after it; (ticks, ticks in all).

    The latter are -1 if no stop is free or, if it `rests`, none ends where nobody comes. The word
    is driven once more to its end, as the stop begins from the exact state there.
    """
    limits = horizon.limits
    n = word_to(search, first, horizon.maneuvers, node, limits.ticks, controls)
    n = min(n, last - task.tick)
    state = (task.x, task.y, task.heading, task.speed, task.steering)
    for k in range(n):
        state = one_tick(limits.wheelbase, limits.tick, state, controls[k, 0], controls[k, 1])
    more = first_free_stop(horizon, state, task.tick + n, shares, controls, n, rests)
    return n, (-1 if more < 0 else n + more)


@bare_inner_kernel
def keep_node(search: BeamArrays, node: int, row: int) -> None:
    """Copy a node to a row that the next level does not write over."""
    for i in range(4):
        search.pose[row, i], search.links[row, i] = search.pose[node, i], search.links[node, i]


@bare_inner_kernel
def begin(task: HorizonTask, horizon: RoadArrays, search: BeamArrays, first: Maneuvers) -> None:
    """The node that the vehicle is at, and its children."""
    state, links, pose = search.state, search.links, search.pose
    for k in range(state.shape[0]):
        state[k] = 0
    for level in range(search.counts.shape[0]):
        search.counts[level] = 0
    for row in (STOPPING, UNSAFE):
        search.reached[row, COST], search.reached[row, NODE] = task.below, -1.0
    pose[0, 0], pose[0, 1], pose[0, 2], pose[0, 3] = task.x, task.y, task.heading, 0.0
    m_x = task.x + horizon.clearing.car.ahead * math.cos(task.heading)
    m_y = task.y + horizon.clearing.car.ahead * math.sin(task.heading)
    links[0, PARENT], links[0, MANEUVER], links[0, TRIM] = -1, -1, -1
    links[0, NEAR] = nearest_of_all(horizon.route, m_x, m_y)
    state[N_NODES] = 3
    tick = task.tick + horizon.limits.ticks
    add_children(task, horizon, search, 0, first, 0, first.target.shape[0], tick)


@bare_inner_kernel
def furthest(
    task: HorizonTask,
    horizon: RoadArrays,
    search: BeamArrays,
    first: Maneuvers,
    levels: int,
    shares: Array,
    controls: Array,
) -> tuple[int, int]:
    """The proven node that is latest, then best, and can be stopped after; or to stop at once.

    Where nobody comes until the goals are over, and only if there is no such place, anywhere.
    """
    whole = -1
    for rests in (True, False):
        for level in range(levels - 1, -1, -1):
            last = min(task.tick + (level + 1) * horizon.limits.ticks, task.until)
            for k in range(min(search.counts[level], TRIES)):
                node = search.kept[level, k]
                n, whole = finish(task, horizon, search, first, node, last, shares, controls, rests)
                if whole >= 0:
                    return n, whole
        start = (task.x, task.y, task.heading, task.speed, task.steering)
        whole = first_free_stop(horizon, start, task.tick, shares, controls, 0, rests)
        if whole >= 0:
            break
    return 0, whole


@bare_inner_kernel
def note_goal(
    task: HorizonTask,
    horizon: RoadArrays,
    search: BeamArrays,
    first: Maneuvers,
    node: int,
    tick: int,
    shares: Array,
    controls: Array,
) -> None:
    """Note a node that meets a goal at a tick, if it is the cheapest with, or without, a stop."""
    _, whole = finish(task, horizon, search, first, node, tick, shares, controls, False)
    row, cost = (STOPPING if whole >= 0 else UNSAFE), search.pose[node, 3]
    if cost < search.reached[row, COST]:
        keep_node(search, node, 1 + row)
        search.reached[row, COST], search.reached[row, NODE] = cost, 1 + row
        search.reached[row, TICK] = tick


@bare_kernel
def search_beam(
    task: HorizonTask,
    horizon: RoadArrays,
    first: Maneuvers,
    search: BeamArrays,
    shares: Array,
    controls: Array,
) -> tuple[bool, int, int]:
    """Search, level by level, for the cheapest plan to a goal with a stop after it.

    Returns whether a goal is reached, the ticks of the plan, and those of the plan and its stop;
    the last are -1 if no plan was found. Where no plan to a goal can be stopped after it, the plan
    is the cheapest one that ends at the goal. Without a goal it is the one that leads furthest, of
    these the cheapest, that can be stopped after.
    """
    state, pose, reached, ticks = search.state, search.pose, search.reached, horizon.limits.ticks
    begin(task, horizon, search, first)
    levels = (task.until - task.tick + ticks - 1) // ticks
    for level in range(levels):
        search.cells[:] = EMPTY
        search.strips[:] = 0
        tick = task.tick + level * ticks
        maneuvers = first if level == 0 else horizon.maneuvers
        kept = 0
        while state[HEAP] > 0 and kept < task.width:
            node = pop(search.heap_key, search.heap_node, state[HEAP])
            state[HEAP] -= 1
            # Cheap tests first; the proof of the edge costs more than all others together.
            if pose[node, 3] >= reached[STOPPING, COST]:
                continue
            strip = strip_of(horizon, search, node)
            if search.strips[strip] >= task.abreast:
                continue
            speed = horizon.trims.speed[search.links[node, TRIM]]
            if not is_new(task, search.cells, pose[node, 0], pose[node, 1], pose[node, 2], speed):
                continue
            state[CHECKS] += 1
            free, goal_tick = prove_edge(task, horizon, search, maneuvers, node, tick)
            if not free:
                continue
            # Of a node that goes on, the cost is known as exactly as that of a whole plan.
            driven = min(goal_tick if goal_tick >= 0 else tick + ticks, task.until) - tick
            pose[node, 3] = cost_along(task, horizon, search, maneuvers, node, driven)
            if pose[node, 3] == math.inf:
                continue
            if goal_tick >= 0:
                note_goal(task, horizon, search, first, node, goal_tick, shares, controls)
            elif pose[node, 3] < reached[STOPPING, COST]:
                search.kept[level, kept] = state[N_NODES]
                keep_node(search, node, state[N_NODES])
                state[N_NODES] += 1
                search.strips[strip] += 1
                kept += 1
        search.counts[level] = kept
        state[KEPT] += kept
        state[HEAP] = state[N_CHILDREN] = 0  # a beam: the other nodes of the level are dropped
        if level + 1 == levels:
            break
        for k in range(kept):
            node = search.kept[level, k]
            if pose[node, 3] >= reached[STOPPING, COST]:
                continue
            trim = search.links[node, TRIM]
            low, high = horizon.maneuvers.first[trim], horizon.maneuvers.first[trim + 1]
            add_children(
                task, horizon, search, node, horizon.maneuvers, low, high, tick + 2 * ticks
            )
    for row in (STOPPING, UNSAFE):
        node, last = int(reached[row, NODE]), int(reached[row, TICK])
        if node >= 0:
            n, whole = finish(task, horizon, search, first, node, last, shares, controls, False)
            return True, n, (whole if row == STOPPING else n)
    if task.below < math.inf:
        return False, 0, -1
    n, whole = furthest(task, horizon, search, first, levels, shares, controls)
    return False, n, whole
