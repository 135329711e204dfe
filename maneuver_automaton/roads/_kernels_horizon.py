"""Beam search over words of maneuvers in space and time, towards a goal on a road.

All maneuvers last equally long, so the nodes of a level share a time. From each level only the best
go on, by cost and estimated cost-to-go, no two of them in one cell of place, heading and speed.
`pose` of a node: x, y, heading, cost to come. `links`: parent, maneuver, trim, nearest point of the
route. Maneuvers of the first level start at the vehicle's own state. An edge is proven free when
its node is about to be kept, not before.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.groups._kernels import compose, nearest_turn
from maneuver_automaton.roads._kernels_free import Clearing, free_tick, one_tick
from maneuver_automaton.roads._kernels_library import Limits, Maneuvers, Trims
from maneuver_automaton.search._kernels_distance import pop, push

PARENT, MANEUVER, TRIM, NEAR = range(4)
N_NODES, HEAP, KEPT, CHECKS = range(4)
EMPTY = -1
STRIP = 1.0  # [m] width of a strip along the route
TWICE = 2.0  # [m] by which a route may be nearer when it passes a place again
TRIES = 16  # nodes of a level from which a way to stop is looked for
IMPOSSIBLE = 1e4  # cost of what cannot be reached any more


class RouteArrays(NamedTuple):
    """The line to follow."""

    point: np.ndarray  # (n, 2), equally spaced
    heading: np.ndarray  # (n,)
    direction: np.ndarray  # (n, 2) cosine and sine of it
    limit: np.ndarray  # (n,) [m/s]
    spacing: float  # [m]


class GoalArrays(NamedTuple):
    """Goals in world coordinates, and where they are along the route."""

    corner: np.ndarray  # (R, 2) of all places, ring by ring
    ring: np.ndarray  # (P + 1,) first corner of each ring
    place: np.ndarray  # (G + 1,) first ring of each goal
    anywhere: np.ndarray  # (G,) whether a goal is no place
    heading: np.ndarray  # (G, 2) least heading, width of the interval
    speed: np.ndarray  # (G, 2)
    tick: np.ndarray  # (G, 2)
    every: int  # ticks: only at multiples of these is a goal looked at
    way: np.ndarray  # (G, 4) stations and offsets
    turned: np.ndarray  # (G, 2) least and greatest heading, seen from the route's direction there


class Blocks(NamedTuple):
    """What stands on the road, seen along the route, as the vehicle's middle may not be there."""

    way: np.ndarray  # (B, 4) stations and offsets
    passable: np.ndarray  # (B, 2) whether there is road to its right and to its left


class Weights(NamedTuple):
    """What a drive minds, per second."""

    offset: float  # per m^2 from the route
    turned: float  # per rad^2 from the route's direction
    hurry: float  # per (m/s)^2 beyond the speed limit
    pace: float  # per (m/s)^2 from the pace
    progress: float  # [m/s] the pace, nan where the goal sets it
    ahead: float  # per (m/s^2)^2 s, what is still to be sped up or slowed down
    aside: float  # per (m/s^2)^2 s, what is still to be moved sideways
    lateral: float  # [m/s^2] that may be counted on
    braking: float  # [m/s^2]
    gain: float  # [m/s^2]


class HorizonTask(NamedTuple):
    """Where the vehicle is, how far to look."""

    x: float
    y: float
    heading: float
    speed: float
    steering: float
    tick: int
    until: int  # no plan goes on after this tick
    cell: float  # [m] of equal nodes
    turn_cell: float  # [rad]
    speed_cell: float  # [m/s]
    width: int  # nodes of a level that go on at most
    abreast: int  # of these, in one strip along the route
    greed: float  # weight of the cost-to-go


class HorizonArrays(NamedTuple):
    """Room for the nodes and their queue."""

    pose: np.ndarray  # (N, 4)
    links: np.ndarray  # (N, 4)
    kept: np.ndarray  # (levels, W) nodes that go on, best first
    counts: np.ndarray  # (levels,) how many
    strips: np.ndarray  # (n,) how many in each strip, the first and last without an end
    cells: np.ndarray  # (4 W,) a power of two
    heap_key: np.ndarray  # (N,)
    heap_node: np.ndarray  # (N,)
    state: np.ndarray  # (4,)


class Horizon(NamedTuple):
    """All that stays the same from step to step."""

    clearing: Clearing
    limits: Limits
    trims: Trims
    maneuvers: Maneuvers
    route: RouteArrays
    goals: GoalArrays
    blocks: Blocks
    weights: Weights


@inner_kernel
def nearest_point(route, x, y, guess):
    """Index of the point of the route that is nearest, downhill from a guess."""
    last = route.point.shape[0] - 1
    k = min(max(guess, 0), last)
    best = (x - route.point[k, 0]) ** 2 + (y - route.point[k, 1]) ** 2
    for step in (1, -1):
        while 0 <= k + step <= last:
            d_x, d_y = x - route.point[k + step, 0], y - route.point[k + step, 1]
            square = d_x * d_x + d_y * d_y
            if square >= best:
                break
            best, k = square, k + step
    return k


@inner_kernel
def on_route(route, x, y, near):
    """Station and offset of a place whose nearest point of the route is known."""
    c, s = route.direction[near, 0], route.direction[near, 1]
    d_x, d_y = x - route.point[near, 0], y - route.point[near, 1]
    return route.spacing * near + c * d_x + s * d_y, c * d_y - s * d_x


@inner_kernel
def stage(weights, limit, offset, turned, speed):
    """Cost per second of being on the road, the effort of the maneuver apart."""
    over = max(speed - limit, 0.0)
    cost = weights.offset * offset * offset + weights.turned * turned * turned
    cost += weights.hurry * over * over
    if weights.progress == weights.progress:  # the pace is given
        cost += weights.pace * (speed - weights.progress) ** 2
    return cost


@inner_kernel
def rest_of_the_way(weights, goals, g, station, offset, turned, speed, least, most):
    """Estimate of what it costs to be at goal `g` between two times from now [s].

    Constant accelerations along the route and across it that lead there in the time that suits.
    """
    low, high = goals.way[g, 0] - station, goals.way[g, 1] - station
    cost, time = 0.0, most
    if low > -math.inf:
        # In time at this speed? Then when it is first there, else at the end that is nearer.
        enter = math.inf if speed <= 0.0 and low > 0.0 else (low / speed if low > 0.0 else 0.0)
        leave = math.inf if speed <= 0.0 else high / speed
        if high < 0.0:
            return IMPOSSIBLE - high
        if enter > most:
            time, way = most, low
        elif leave < least:
            time, way = least, high
        else:
            time, way = max(enter, least), math.nan
        if way == way:
            if time <= 0.0:
                return IMPOSSIBLE
            needed = 2.0 * (way - speed * time) / (time * time)
            if needed < 0.0 and speed + needed * time < 0.0:
                needed = -0.5 * speed * speed / max(way, 1e-3)  # it has to stop before
            cost += weights.ahead * needed * needed * time
            if needed > weights.gain:
                cost += IMPOSSIBLE * (needed / weights.gain - 1.0 + 0.01)
            elif needed < -weights.braking:
                cost += IMPOSSIBLE * (-needed / weights.braking - 1.0 + 0.01)
            final = max(speed + needed * time, 0.0)
        else:
            final = speed
        slow, fast = goals.speed[g, 0] - final, final - goals.speed[g, 1]
        wrong = max(max(slow, fast), 0.0)
        cost += weights.ahead * wrong * wrong / max(time, 0.5)
    if goals.way[g, 2] > -math.inf:
        aside = 0.0
        reach = offset + speed * math.sin(turned) * time
        if reach < goals.way[g, 2]:
            aside = goals.way[g, 2] - reach
        elif reach > goals.way[g, 3]:
            aside = reach - goals.way[g, 3]
        if aside > 0.0:
            needed = 2.0 * aside / max(time * time, 0.01)
            cost += weights.aside * needed * needed * time
            if needed > weights.lateral:
                cost += IMPOSSIBLE * (needed / weights.lateral - 1.0)
    askew = max(max(goals.turned[g, 0] - turned, turned - goals.turned[g, 1]), 0.0)
    if askew > 0.0:
        needed = askew * speed / max(time, 0.1)
        cost += weights.aside * needed * needed * time
        if needed > weights.lateral:
            cost += IMPOSSIBLE * (needed / weights.lateral - 1.0)
    return cost


@inner_kernel
def around_blocks(weights, blocks, station, offset, turned, speed, goal, most):
    """Estimate of what it costs to get around what stands on the way to a station.

    Each is taken alone: the vehicle is beside it when it gets there, on the nearer side with road,
    and has to be back at the goal's offsets in what time is left then.
    """
    cost = 0.0
    for b in range(blocks.way.shape[0]):
        begin, after = blocks.way[b, 0], blocks.way[b, 1]
        end = goal[0] if goal[0] > -math.inf else station + speed * most
        if station >= after or begin >= end or speed <= 0.0:
            continue
        if goal[0] > -math.inf:
            right, left = goal[2] - blocks.way[b, 2], blocks.way[b, 3] - goal[3]
            back = max(min(right, left), 0.0)
            left_over = max(most - (after - station) / speed, 0.1)
            needed = back / (left_over * left_over)  # half of what it is from straight ahead
            cost += weights.aside * needed * needed * left_over
        time = max(begin - station, 0.0) / speed
        reach = offset + speed * math.sin(turned) * time
        right, left = reach - blocks.way[b, 2], blocks.way[b, 3] - reach
        if right <= 0.0 or left <= 0.0:
            continue  # it will be beside it
        aside = math.inf
        if blocks.passable[b, 0]:
            aside = right
        if blocks.passable[b, 1]:
            aside = min(aside, left)
        if aside == math.inf:
            continue
        time = max(time, 0.1)
        needed = 2.0 * aside / (time * time)
        cost += weights.aside * needed * needed * time
        if needed > weights.lateral:
            cost += IMPOSSIBLE * (needed / weights.lateral - 1.0)
    return cost


@inner_kernel
def cost_to_go(horizon, station, offset, turned, speed, tick):
    """Estimate of what the rest costs to the goal that is nearest."""
    goals = horizon.goals
    best = math.inf
    for g in range(goals.tick.shape[0]):
        if tick > goals.tick[g, 1]:
            best = min(best, 2.0 * IMPOSSIBLE)
            continue
        least = max(goals.tick[g, 0] - tick, 0) * horizon.limits.tick
        most = (goals.tick[g, 1] - tick) * horizon.limits.tick
        cost = rest_of_the_way(
            horizon.weights, goals, g, station, offset, turned, speed, least, most
        )
        cost += around_blocks(
            horizon.weights,
            horizon.blocks,
            station,
            offset,
            turned,
            speed,
            goals.way[g],
            most,
        )
        best = min(best, cost)
    return best


@inner_kernel
def in_ring(goals, ring, x, y):
    """Whether a place is inside a ring of corners."""
    inside = False
    low, high = goals.ring[ring], goals.ring[ring + 1]
    j = high - 1
    for i in range(low, high):
        a_x, a_y = goals.corner[i, 0], goals.corner[i, 1]
        b_x, b_y = goals.corner[j, 0], goals.corner[j, 1]
        if (a_y > y) != (b_y > y) and x < (b_x - a_x) * (y - a_y) / (b_y - a_y) + a_x:
            inside = not inside
        j = i
    return inside


@inner_kernel
def goal_at(horizon, x, y, heading, speed, tick):
    """Number of the goal that a state of the rear axle meets at a tick, -1 for none."""
    goals, ahead = horizon.goals, horizon.clearing.body.ahead
    m_x, m_y = x + ahead * math.cos(heading), y + ahead * math.sin(heading)
    full = 2.0 * math.pi
    for g in range(goals.tick.shape[0]):
        if tick < goals.tick[g, 0] or tick > goals.tick[g, 1]:
            continue
        if speed < goals.speed[g, 0] or speed > goals.speed[g, 1] or tick % goals.every != 0:
            continue
        turn = (heading - goals.heading[g, 0]) / full
        if (turn - math.floor(turn)) * full > goals.heading[g, 1]:
            continue
        if goals.anywhere[g]:
            return g
        for ring in range(goals.place[g], goals.place[g + 1]):
            if in_ring(goals, ring, m_x, m_y):
                return g
    return -1


@inner_kernel
def is_new(task, cells, x, y, heading, speed):
    """Mark the cell of a node; whether it was free."""
    i = math.floor((x - task.x) / task.cell + 0.5) & 0xFFF
    j = math.floor((y - task.y) / task.cell + 0.5) & 0xFFF
    k = math.floor((heading - task.heading) / task.turn_cell + 0.5) & 0xFF
    v = int(speed / task.speed_cell) & 0xFF
    key = (((v << 8 | k) << 12 | j) << 12) | i
    mask = cells.shape[0] - 1
    mixed = (key ^ (key >> 13) ^ (key >> 27)) & 0x7FFFFFFF
    slot = ((mixed * 0x9E3779B1) >> 13) & mask
    while cells[slot] != EMPTY:
        if cells[slot] == key:
            return False
        slot = (slot + 1) & mask
    cells[slot] = key
    return True


@inner_kernel
def strip_of(horizon, search, node):
    """Which strip along the route a node is in."""
    pose, near = search.pose, search.links[node, NEAR]
    _, offset = on_route(horizon.route, pose[node, 0], pose[node, 1], near)
    n = search.strips.shape[0]
    return min(max(math.floor(offset / STRIP) + n // 2, 0), n - 1)


@inner_kernel
def add_children(task, horizon, search, node, maneuvers, low, high, tick, bound):
    """Queue the nodes that maneuvers lead to at a tick, their edges not yet proven.

    Those that cost `bound` or more are left out.
    """
    pose, links, state = search.pose, search.links, search.state
    limits, ahead = horizon.limits, horizon.clearing.body.ahead
    duration = limits.tick * limits.ticks
    x, y, heading, come = pose[node, 0], pose[node, 1], pose[node, 2], pose[node, 3]
    c, s = math.cos(heading), math.sin(heading)
    for e in range(low, high):
        child = state[N_NODES]
        if child >= pose.shape[0]:
            return
        d_x, d_y = maneuvers.pose[e, limits.ticks - 1, 0], maneuvers.pose[e, limits.ticks - 1, 1]
        n_x, n_y = x + c * d_x - s * d_y, y + s * d_x + c * d_y
        n_heading = heading + maneuvers.pose[e, limits.ticks - 1, 2]
        m_x, m_y = n_x + ahead * math.cos(n_heading), n_y + ahead * math.sin(n_heading)
        trim = maneuvers.target[e]
        speed = horizon.trims.speed[trim]
        guess = links[node, NEAR] + int(d_x / horizon.route.spacing)
        near = nearest_point(horizon.route, m_x, m_y, guess)
        station, offset = on_route(horizon.route, m_x, m_y, near)
        turned = nearest_turn(n_heading - horizon.route.heading[near])
        minded = stage(horizon.weights, horizon.route.limit[near], offset, turned, speed)
        cost = come + maneuvers.effort[e] + duration * minded
        if cost >= bound:
            continue
        pose[child, 0], pose[child, 1], pose[child, 2], pose[child, 3] = n_x, n_y, n_heading, cost
        links[child, PARENT], links[child, MANEUVER] = node, e
        links[child, TRIM], links[child, NEAR] = trim, near
        state[N_NODES] = child + 1
        to_go = cost_to_go(horizon, station, offset, turned, speed, tick)
        push(search.heap_key, search.heap_node, state[HEAP], cost + task.greed * to_go, child)
        state[HEAP] += 1


@inner_kernel
def prove_edge(task, horizon, search, maneuvers, node, tick):
    """Prove the edge into a node from `tick` on: whether it is free; tick of a goal on it or -1."""
    pose, links, limits = search.pose, search.links, horizon.limits
    parent, e = links[node, PARENT], links[node, MANEUVER]
    speed = task.speed if parent == 0 else horizon.trims.speed[links[parent, TRIM]]
    x, y, heading = pose[parent, 0], pose[parent, 1], pose[parent, 2]
    p_x, p_y, p_heading = x, y, heading
    for k in range(limits.ticks):
        if tick + k >= task.until:
            return True, -1
        d_x, d_y, turn = maneuvers.pose[e, k, 0], maneuvers.pose[e, k, 1], maneuvers.pose[e, k, 2]
        n_x, n_y, n_heading = compose(x, y, heading, d_x, d_y, turn)
        if not free_tick(horizon.clearing, p_x, p_y, p_heading, n_x, n_y, n_heading, tick + k):
            return False, -1
        faster = speed + maneuvers.control[e, 0] * limits.tick * (k + 1)
        if goal_at(horizon, n_x, n_y, n_heading, faster, tick + k + 1) >= 0:
            return True, tick + k + 1
        p_x, p_y, p_heading = n_x, n_y, n_heading
    return True, -1


@inner_kernel
def braked(horizon, x, y, heading, speed, steering, share, tick, controls):
    """Try to stop from a state, steering to a share of the sharpest angle; ticks, or -1 if hit.

    The share is of the angle that the speed at each moment admits, and the steering follows at its
    rate. `controls` (n, 2) is filled.
    """
    body, limits = horizon.clearing.body, horizon.limits
    k = 0
    while speed > 0.0:
        if k >= controls.shape[0]:
            return -1
        slower = max(speed - body.braking * limits.tick, 0.0)
        square = max(speed * speed, 1.0)
        sharpest = min(math.atan(limits.lateral * limits.wheelbase / square), limits.sharpest)
        rate = (share * sharpest - steering) / limits.tick
        if share != share:  # hold
            rate = 0.0
        rate = min(max(rate, -limits.rate), limits.rate)
        acceleration = (slower - speed) / limits.tick
        n_x, n_y, n_heading, _, n_steering = one_tick(
            body.wheelbase, limits.tick, x, y, heading, speed, steering, acceleration, rate
        )
        if not free_tick(horizon.clearing, x, y, heading, n_x, n_y, n_heading, tick + k):
            return -1
        controls[k, 0], controls[k, 1] = acceleration, rate
        x, y, heading, speed, steering = n_x, n_y, n_heading, slower, n_steering
        k += 1
    return k


@inner_kernel
def stopped(horizon, x, y, heading, speed, steering, tick, shares, controls):
    """Ticks of the first free way to stop, -1 if there is none."""
    for k in range(shares.shape[0]):
        n = braked(horizon, x, y, heading, speed, steering, shares[k], tick, controls)
        if n >= 0:
            return n
    return -1


@inner_kernel
def word_to(search, first, maneuvers, node, ticks, controls):
    """Controls (n, 2), tick by tick, of the way to a node; n."""
    links = search.links
    levels, k = 0, node
    while links[k, PARENT] >= 0:
        levels += 1
        k = links[k, PARENT]
    k = node
    for level in range(levels - 1, -1, -1):
        e = links[k, MANEUVER]
        pair = first.control[e] if level == 0 else maneuvers.control[e]
        for i in range(level * ticks, (level + 1) * ticks):
            controls[i, 0], controls[i, 1] = pair[0], pair[1]
        k = links[k, PARENT]
    return levels * ticks


@inner_kernel
def finish(task, horizon, search, first, node, last, shares, controls):
    """Controls to a node, cut at the tick `last`, and to stop after it; (ticks, ticks in all)."""
    limits = horizon.limits
    n = word_to(search, first, horizon.maneuvers, node, limits.ticks, controls)
    n = min(n, last - task.tick)
    x, y, heading, speed, steering = task.x, task.y, task.heading, task.speed, task.steering
    for k in range(n):
        x, y, heading, speed, steering = one_tick(
            limits.wheelbase,
            limits.tick,
            x,
            y,
            heading,
            speed,
            steering,
            controls[k, 0],
            controls[k, 1],
        )
    more = stopped(horizon, x, y, heading, speed, steering, task.tick + n, shares, controls[n:])
    return n, (-1 if more < 0 else n + more)


@inner_kernel
def nearest_of_all(route, x, y):
    """Index of the point of the route that is nearest.

    Where the route passes a place twice, as at the end of a loop, the first time counts.
    """
    best = math.inf
    for k in range(route.point.shape[0]):
        away = math.hypot(x - route.point[k, 0], y - route.point[k, 1])
        best = min(best, away)
    for k in range(route.point.shape[0]):
        away = math.hypot(x - route.point[k, 0], y - route.point[k, 1])
        if away <= best + TWICE:
            return nearest_point(route, x, y, k)
    return 0


@inner_kernel
def begin(task, horizon, search, first):
    """The node that the vehicle is at, and its children."""
    state, links, pose = search.state, search.links, search.pose
    state[:] = 0
    search.counts[:] = 0
    pose[0, 0], pose[0, 1], pose[0, 2], pose[0, 3] = task.x, task.y, task.heading, 0.0
    m_x = task.x + horizon.clearing.body.ahead * math.cos(task.heading)
    m_y = task.y + horizon.clearing.body.ahead * math.sin(task.heading)
    links[0, PARENT], links[0, MANEUVER], links[0, TRIM] = -1, -1, -1
    links[0, NEAR] = nearest_of_all(horizon.route, m_x, m_y)
    state[N_NODES] = 1
    tick = task.tick + horizon.limits.ticks
    add_children(task, horizon, search, 0, first, 0, first.target.shape[0], tick, math.inf)


@inner_kernel
def furthest(task, horizon, search, first, levels, shares, controls):
    """The proven node that is latest, then best, and can be stopped after; or to stop at once."""
    for level in range(levels - 1, -1, -1):
        last = min(task.tick + (level + 1) * horizon.limits.ticks, task.until)
        for k in range(min(search.counts[level], TRIES)):
            node = search.kept[level, k]
            n, whole = finish(task, horizon, search, first, node, last, shares, controls)
            if whole >= 0:
                return False, n, whole
    whole = stopped(
        horizon,
        task.x,
        task.y,
        task.heading,
        task.speed,
        task.steering,
        task.tick,
        shares,
        controls,
    )
    return False, 0, whole


@kernel
def search_horizon(task, horizon, first, search, shares, controls):
    """Search, level by level, for the cheapest plan to a goal with a way to stop after it.

    Returns whether a goal is reached, the ticks of the plan, and those of the plan and its stop;
    the last are -1 if no plan was found. Where no plan to a goal can be stopped after it, the plan
    is the cheapest one that ends at the goal. Without a goal it is the one that leads furthest, of
    these the cheapest, that can be stopped after.
    """
    state, pose = search.state, search.pose
    ticks = horizon.limits.ticks
    begin(task, horizon, search, first)
    best, best_node, best_tick = math.inf, -1, -1
    rash, rash_node, rash_tick = math.inf, -1, -1  # to a goal, but no way to stop after it
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
            if pose[node, 3] >= best:
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
            if goal_tick < 0:
                search.kept[level, kept] = node
                search.strips[strip] += 1
                kept += 1
                continue
            _, whole = finish(task, horizon, search, first, node, goal_tick, shares, controls)
            if whole >= 0:
                best, best_node, best_tick = pose[node, 3], node, goal_tick
            elif pose[node, 3] < rash:
                rash, rash_node, rash_tick = pose[node, 3], node, goal_tick
        search.counts[level] = kept
        state[KEPT] += kept
        state[HEAP] = 0
        if level + 1 == levels:
            break
        for k in range(kept):
            node = search.kept[level, k]
            if pose[node, 3] >= best:
                continue
            trim = search.links[node, TRIM]
            low, high = horizon.maneuvers.first[trim], horizon.maneuvers.first[trim + 1]
            add_children(
                task, horizon, search, node, horizon.maneuvers, low, high, tick + 2 * ticks, best
            )
    if best_node >= 0:
        n, whole = finish(task, horizon, search, first, best_node, best_tick, shares, controls)
        return True, n, whole
    if rash_node >= 0:
        n, _ = finish(task, horizon, search, first, rash_node, rash_tick, shares, controls)
        return True, n, n
    return furthest(task, horizon, search, first, levels, shares, controls)


@kernel
def price(horizon, states, controls, tick):
    """Cost (stage and effort) of a motion with states (n + 1, 5) and controls (n, 2)."""
    limits, ahead = horizon.limits, horizon.clearing.body.ahead
    total = 0.0
    near = nearest_of_all(horizon.route, states[0, 0], states[0, 1])
    across = states[0, 3] ** 2 * math.tan(states[0, 4]) / limits.wheelbase
    for k in range(controls.shape[0]):
        x, y, heading = states[k + 1, 0], states[k + 1, 1], states[k + 1, 2]
        speed = states[k + 1, 3]
        m_x, m_y = x + ahead * math.cos(heading), y + ahead * math.sin(heading)
        near = nearest_point(horizon.route, m_x, m_y, near)
        _, offset = on_route(horizon.route, m_x, m_y, near)
        turned = nearest_turn(heading - horizon.route.heading[near])
        after = speed**2 * math.tan(states[k + 1, 4]) / limits.wheelbase
        jerk = (after - across) / limits.tick
        cost = stage(horizon.weights, horizon.route.limit[near], offset, turned, speed)
        cost += limits.mind_braking * controls[k, 0] ** 2
        cost += limits.mind_lateral * after * after + limits.mind_jerk * jerk * jerk
        total += limits.tick * cost
        across = after
    return total


@kernel
def first_goal(horizon, states, tick):
    """First of the states (n, 5) at ticks from `tick` on that meets a goal, -1 if none does."""
    for k in range(states.shape[0]):
        if goal_at(horizon, states[k, 0], states[k, 1], states[k, 2], states[k, 3], tick + k) >= 0:
            return k
    return -1
