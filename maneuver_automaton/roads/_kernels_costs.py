"""Where a state is along the route, whether it meets a goal, what it costs, and the cost-to-go.

Stage cost: offset and heading from the route, speed beyond the limit, pace, comfort. Cost-to-go:
constant accelerations along the route and across it that lead to the goal in the time left, at
limits of speed and past closed lines. It is an estimate, not a bound: the beam search needs an
order of nodes, and promises no optimum.
"""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.groups._kernels import nearest_turn
from maneuver_automaton.roads.arrays import (
    GoalArrays,
    RoadArrays,
    RouteArrays,
    StaticObstacles,
    Weights,
)

AGAIN = 2.0  # [m] by which a route may be nearer when it passes a place again
IMPOSSIBLE = 1e4  # cost beyond the car's limits, far above any stage cost
# A small share keeps a step between the last possible value and the first impossible one.
STEP = 0.01
SOON = 1e-3  # [s] and [m] left at least, where a value is divided by what is left
CRAWL = 2.0  # [m/s] at which who is slower is taken to come to a line
AT_LINE = 0.5  # [m] beyond where it should wait, a vehicle still waits
ROUNDING = 1e-6  # [m/s] that is not beyond a limit


@bare_inner_kernel
def nearest_point(route: RouteArrays, x: float, y: float, guess: int) -> int:
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


@bare_inner_kernel
def nearest_of_all(route: RouteArrays, x: float, y: float) -> int:
    """Index of the point of the route that is nearest.

    Where the route passes a place twice, as at the end of a loop, the first time counts.
    """
    best = math.inf
    for k in range(route.point.shape[0]):
        away = math.hypot(x - route.point[k, 0], y - route.point[k, 1])
        best = min(best, away)
    for k in range(route.point.shape[0]):
        away = math.hypot(x - route.point[k, 0], y - route.point[k, 1])
        if away <= best + AGAIN:
            return nearest_point(route, x, y, k)
    return 0


@bare_inner_kernel
def on_route(route: RouteArrays, x: float, y: float, near: int) -> tuple[float, float]:
    """Station and offset of a place whose nearest point of the route is known."""
    c, s = route.direction[near, 0], route.direction[near, 1]
    d_x, d_y = x - route.point[near, 0], y - route.point[near, 1]
    return route.spacing * near + c * d_x + s * d_y, c * d_y - s * d_x


@bare_inner_kernel
def limit_at(route: RouteArrays, near: int, offset: float) -> float:
    """Speed limit [m/s] at an offset from a point of the route, ready to brake for the next."""
    n = route.limit.shape[1]
    column = math.floor(offset / route.aside + 0.5) + n // 2
    return float(route.limit[near, min(max(column, 0), n - 1)])


@bare_inner_kernel
def is_too_fast(
    route: RouteArrays, limit: float, before: float, speed: float, duration: float
) -> bool:
    """Whether a speed is beyond a limit, and was not braked to from the one a time before.

    The limits ahead of a place leave the room that less braking takes: whoever keeps them here can
    keep them further on.
    """
    slower = before - route.slowing * duration
    return speed > limit + ROUNDING and speed > slower + ROUNDING


@bare_inner_kernel
def in_ring(goals: GoalArrays, ring: int, x: float, y: float) -> bool:
    """Whether a place is inside a ring of corners, by the parity of crossings."""
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


@bare_inner_kernel
def goal_at(
    horizon: RoadArrays, x: float, y: float, heading: float, speed: float, tick: int
) -> int:
    """Number of the goal that a state of the rear axle meets at a tick, -1 for none."""
    goals, ahead = horizon.goals, horizon.clearing.car.ahead
    m_x, m_y = x + ahead * math.cos(heading), y + ahead * math.sin(heading)
    full = 2.0 * math.pi
    for g in range(goals.tick.shape[0]):
        # Numbers first, rings last: most states are too early.
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


@bare_kernel
def first_goal(horizon: RoadArrays, states: Array, tick: int) -> int:
    """First of the states (n, 5) at ticks from `tick` on that meets a goal, -1 if none does."""
    for k in range(states.shape[0]):
        if goal_at(horizon, states[k, 0], states[k, 1], states[k, 2], states[k, 3], tick + k) >= 0:
            return k
    return -1


@bare_inner_kernel
def stage_rate(weights: Weights, limit: float, offset: float, turned: float, speed: float) -> float:
    """Cost per second of being on the road, the effort of the maneuver apart."""
    over = max(speed - limit, 0.0)
    cost = weights.offset * offset * offset + weights.turned * turned * turned
    cost += weights.hurry * over * over
    if weights.progress == weights.progress:  # no nan: the pace is given
        cost += weights.pace * (speed - weights.progress) ** 2
    return cost


@bare_inner_kernel
def rate_at(
    horizon: RoadArrays, x: float, y: float, heading: float, speed: float, guess: int
) -> tuple[float, int, float]:
    """`stage_rate` of a state, the point of the route that is nearest to a guess, the limit."""
    ahead, route = horizon.clearing.car.ahead, horizon.route
    m_x, m_y = x + ahead * math.cos(heading), y + ahead * math.sin(heading)
    near = nearest_point(route, m_x, m_y, guess)
    _, offset = on_route(route, m_x, m_y, near)
    limit, turned = limit_at(route, near, offset), nearest_turn(heading - route.heading[near])
    return stage_rate(horizon.weights, limit, offset, turned, speed), near, limit


@bare_inner_kernel
def to_speed(weights: Weights, goals: GoalArrays, g: int, speed: float, time: float) -> float:
    """Cost to come to a speed of goal `g` within a time [s], at a constant acceleration."""
    slow, fast = goals.speed[g, 0] - speed, speed - goals.speed[g, 1]
    wrong, time = max(max(slow, fast), 0.0), max(time, SOON)
    most, lasting, pace = (weights.braking if fast > 0.0 else weights.gain) * time, time, 0.0
    if weights.progress == weights.progress:  # away from the pace no longer than effort is saved
        pace = weights.pace / 3.0
        lasting = min(time, math.sqrt(weights.ahead / pace))
    cost = wrong * wrong * (weights.ahead / lasting + pace * lasting)
    if wrong > most:
        cost += IMPOSSIBLE * (wrong / most - 1.0)
    return cost


@bare_inner_kernel
def acceleration_cost(weights: Weights, needed: float, time: float) -> float:
    """Cost of an acceleration along the route, which may be beyond the limits, for a time [s]."""
    cost = weights.ahead * needed * needed * time
    if needed > weights.gain:
        cost += IMPOSSIBLE * (needed / weights.gain - 1.0 + STEP)
    elif needed < -weights.braking:
        cost += IMPOSSIBLE * (-needed / weights.braking - 1.0 + STEP)
    return cost


@bare_inner_kernel
def time_at_limits(route: RouteArrays, begin: float, end: float) -> float:
    """Time [s] from a station to a later one as fast as limits allow; 0 where there are none."""
    last, times = route.time.shape[0] - 1, 0.0
    for station, sign in ((end, 1.0), (begin, -1.0)):
        at = min(max(station / route.spacing, 0.0), float(last))
        k = min(int(at), last - 1)
        times += sign * (route.time[k] + (at - k) * (route.time[k + 1] - route.time[k]))
    return max(times, 0.0)


@bare_inner_kernel
def in_time(
    weights: Weights, speed: float, most: float, distance: float, time: float
) -> tuple[float, float]:
    """Cost to drive a distance in a time [s], no faster than `most` [m/s]; the speed at the end."""
    needed = 2.0 * (distance - speed * time) / (time * time)
    if needed <= 0.0:
        if speed + needed * time < 0.0:
            needed = -0.5 * speed * speed / max(distance, SOON)  # it has to stop before
    elif speed + needed * time > most:
        # At the limit before it is there: what is left to gain by then has to be gained sooner.
        if most * time <= distance or speed >= most:
            late = distance / max(most * time, SOON) - 1.0
            return IMPOSSIBLE * (max(late, 0.0) + STEP), most
        needed = 0.5 * (most - speed) ** 2 / (most * time - distance)
        return acceleration_cost(weights, needed, (most - speed) / needed), most
    return acceleration_cost(weights, needed, time), max(speed + needed * time, 0.0)


@bare_inner_kernel
def cost_between(
    weights: Weights, speed: float, end: float, most: float, distance: float, time: float
) -> float:
    """Cost to drive a distance in a time [s] from one speed to another, no faster than `most`.

    The least integral of squared acceleration, which then is linear in time. What the limits can
    do at best is to accelerate, hold a speed, and brake, or the other way round.
    """
    time, gain, braking = max(time, SOON), weights.gain, weights.braking
    changes = max((end - speed) / gain, (speed - end) / braking) / time
    beyond = changes - 1.0
    if changes <= 1.0:
        each = 1.0 / gain + 1.0 / braking
        high = min((time + speed / gain + end / braking) / each, max(most, speed, end))
        low = max((speed / braking + end / gain - time) / each, 0.0)
        far = high * time - 0.5 * ((high - speed) ** 2 / gain + (high - end) ** 2 / braking)
        near = low * time + 0.5 * ((speed - low) ** 2 / braking + (end - low) ** 2 / gain)
        beyond = max(distance / max(far, SOON), near / max(distance, SOON)) - 1.0
    # Who has more time than that to stop on the way stands for the rest of it.
    both = speed + end
    lasting = 3.0 * distance / max(both - math.sqrt(speed * end), SOON)
    lasting = max(min(time, lasting), SOON)
    mean = distance / lasting
    effort = 4.0 * (both * both - speed * end - 3.0 * mean * (both - mean)) / lasting
    return weights.ahead * effort + (IMPOSSIBLE * (beyond + STEP) if beyond > 0.0 else 0.0)


@bare_inner_kernel
def along_to_goal(
    horizon: RoadArrays, g: int, station: float, speed: float, least: float, most: float
) -> tuple[float, float]:
    """Cost to be at the stations of goal `g` between two times from now [s], and that time [s].

    The time is negative if it cannot be: then the cost is the answer.
    """
    goals, weights = horizon.goals, horizon.weights
    low, high = goals.extent[g, 0] - station, goals.extent[g, 1] - station
    if high < 0.0:
        return IMPOSSIBLE - high, -1.0  # passed; the further, the worse
    quickest = time_at_limits(horizon.route, station, goals.extent[g, 0]) if low > 0.0 else 0.0
    fastest = low / quickest if quickest > 0.0 else math.inf  # in the mean, on the way there
    # In time at this speed? Then when it is first there, else at the end that is nearer.
    enter = math.inf if speed <= 0.0 and low > 0.0 else (low / speed if low > 0.0 else 0.0)
    enter = max(enter, quickest)
    leave = math.inf if speed <= 0.0 else high / speed
    if enter > most:
        time, distance = most, low
    elif leave < least:
        time, distance = least, high
    else:
        time, distance = max(enter, least), math.nan  # nothing to be done
        # A speed may still be changed until it leaves at the mean of both.
        wanted = min(max(speed, goals.speed[g, 0]), goals.speed[g, 1])
        if wanted != speed:
            time = max(min(2.0 * high / (speed + wanted), most), time)
    cost, final = 0.0, speed
    if distance == distance:
        if time <= 0.0:
            return IMPOSSIBLE, -1.0
        if speed >= fastest and distance == low:
            cost, final = IMPOSSIBLE * (quickest / time - 1.0 + STEP), fastest
        else:
            cost, final = in_time(weights, speed, fastest, distance, time)
    wanted = min(max(final, goals.speed[g, 0]), goals.speed[g, 1])
    if wanted == final or cost >= IMPOSSIBLE * STEP:
        return cost + to_speed(weights, goals, g, final, time), time
    distance = min(max(0.5 * (speed + wanted) * time, low, 0.0), high)
    return cost_between(weights, speed, wanted, fastest, distance, time), time


@bare_inner_kernel
def past_lines(
    horizon: RoadArrays, station: float, speed: float, tick: int, end: float
) -> tuple[float, float, float, float]:
    """Cost to come past closed lines before a station, and from where it goes on after the last.

    The rest of the answer: that station, the speed there, the time until then [s].
    """
    route, cost, waited = horizon.route, 0.0, 0.0
    for b in range(route.closed.shape[0]):
        line, closes, opens = route.closed[b, 0], route.closed[b, 1], route.closed[b, 2]
        if station > line + AT_LINE or line >= end:
            continue
        away = max(line - station, 0.0)
        now = tick * horizon.limits.tick + waited
        arrives = now + away / max(speed, CRAWL)
        if arrives < closes or arrives >= opens:
            continue
        wait = opens - now
        if opens == math.inf:  # the line of a stop sign: until it stands there
            wait = 2.0 * away / max(speed, CRAWL)
        rolling = 2.0 * away / max(wait, SOON) - speed  # after braking all the way
        if opens == math.inf or rolling < 0.0:
            rolling = 0.0
            cost += acceleration_cost(
                horizon.weights,
                -0.5 * speed * speed / max(away, SOON),
                2.0 * away / max(speed, SOON),
            )
        elif rolling < speed:
            cost += acceleration_cost(horizon.weights, (rolling - speed) / wait, wait)
        station, speed, waited = line, min(rolling, speed), waited + wait
    return cost, station, speed, waited


@bare_inner_kernel
def sideways(weights: Weights, acceleration: float, time: float) -> float:
    """Cost of a lateral acceleration that is needed for a time [s]."""
    cost = weights.aside * acceleration * acceleration * time
    if acceleration > weights.lateral:
        cost += IMPOSSIBLE * (acceleration / weights.lateral - 1.0)
    return cost


@bare_inner_kernel
def cost_to_goal(
    horizon: RoadArrays,
    g: int,
    station: float,
    offset: float,
    turned: float,
    speed: float,
    tick: int,
) -> float:
    """Estimate of the cost to be at goal `g` in its time.

    Constant accelerations along the route and across it that lead there in the time that suits.
    """
    goals, weights = horizon.goals, horizon.weights
    least = max(goals.tick[g, 0] - tick, 0) * horizon.limits.tick
    most = (goals.tick[g, 1] - tick) * horizon.limits.tick
    cost, time = 0.0, most
    if goals.extent[g, 0] > -math.inf:
        end = goals.extent[g, 0]
        cost, begin, after, waited = past_lines(horizon, station, speed, tick, end)
        if waited > most:
            return cost + IMPOSSIBLE * (1.0 + waited - most)
        onward, time = along_to_goal(
            horizon, g, begin, after, max(least - waited, 0.0), most - waited
        )
        cost += onward
        if time < 0.0:
            return cost
        time += waited
    else:
        cost = to_speed(weights, goals, g, speed, most)
    if goals.extent[g, 2] > -math.inf:
        aside = 0.0
        reach = offset + speed * math.sin(turned) * time
        if reach < goals.extent[g, 2]:
            aside = goals.extent[g, 2] - reach
        elif reach > goals.extent[g, 3]:
            aside = reach - goals.extent[g, 3]
        if aside > 0.0:
            cost += sideways(weights, 2.0 * aside / max(time * time, 0.01), time)
    askew = max(max(goals.turned[g, 0] - turned, turned - goals.turned[g, 1]), 0.0)
    if askew > 0.0:
        cost += sideways(weights, askew * speed / max(time, 0.1), time)
    return cost


@bare_inner_kernel
def cost_past_obstacles(
    weights: Weights,
    obstacles: StaticObstacles,
    station: float,
    offset: float,
    turned: float,
    speed: float,
    goal: Array,
    most: float,
) -> float:
    """Estimate of the cost to get past static obstacles before a station.

    Each is taken alone: the vehicle is beside it when it gets there, on the nearer side with road,
    and has to be back at the goal's offsets in the time left then. `goal` is a row (4,) of
    `GoalArrays.extent`.
    """
    cost = 0.0
    for b in range(obstacles.extent.shape[0]):
        begin, after = obstacles.extent[b, 0], obstacles.extent[b, 1]
        end = goal[0] if goal[0] > -math.inf else station + speed * most
        if station >= after or begin >= end or speed <= 0.0:
            continue  # passed already, or beyond the goal
        low, high = obstacles.extent[b, 2], obstacles.extent[b, 3]
        if goal[0] > -math.inf:
            back = max(min(goal[2] - low, high - goal[3]), 0.0)
            left_over = max(most - (after - station) / speed, 0.1)
            needed = back / (left_over * left_over)  # half of what it is from straight ahead
            cost += weights.aside * needed * needed * left_over
        time = max(begin - station, 0.0) / speed
        reach = offset + speed * math.sin(turned) * time
        right, left = reach - low, high - reach
        if right <= 0.0 or left <= 0.0:
            continue  # it will be beside it
        aside = math.inf
        if obstacles.passable[b, 0]:
            aside = right
        if obstacles.passable[b, 1]:
            aside = min(aside, left)
        if aside == math.inf:
            continue
        time = max(time, 0.1)
        cost += sideways(weights, 2.0 * aside / (time * time), time)
    return cost


@bare_inner_kernel
def cost_to_go(
    horizon: RoadArrays, station: float, offset: float, turned: float, speed: float, tick: int
) -> float:
    """Estimate of the cost-to-go, to the goal that is cheapest to reach."""
    goals, weights = horizon.goals, horizon.weights
    best = math.inf
    for g in range(goals.tick.shape[0]):
        if tick > goals.tick[g, 1]:
            best = min(best, 2.0 * IMPOSSIBLE)
            continue
        most = (goals.tick[g, 1] - tick) * horizon.limits.tick
        cost = cost_to_goal(horizon, g, station, offset, turned, speed, tick)
        cost += cost_past_obstacles(
            weights, horizon.obstacles, station, offset, turned, speed, goals.extent[g], most
        )
        best = min(best, cost)
    return best


@bare_inner_kernel
def cost_of_tick(
    horizon: RoadArrays, states: Array, controls: Array, k: int, guess: int
) -> tuple[float, int, bool]:
    """Cost (stage and effort) of tick `k` of a motion, the nearest point of the route after it.

    And whether it keeps limits of speed, or brakes to them.
    """
    limits = horizon.limits
    x, y, heading = states[k + 1, 0], states[k + 1, 1], states[k + 1, 2]
    speed, steering = states[k + 1, 3], states[k + 1, 4]
    rate, near, limit = rate_at(horizon, x, y, heading, speed, guess)
    before = states[k, 3] * states[k, 3] * math.tan(states[k, 4]) / limits.wheelbase
    after = speed * speed * math.tan(steering) / limits.wheelbase
    jerk = (after - before) / limits.tick
    rate += limits.weight_along * controls[k, 0] * controls[k, 0]
    rate += limits.weight_across * after * after + limits.weight_jerk * jerk * jerk
    kept = not is_too_fast(horizon.route, limit, states[k, 3], speed, limits.tick)
    return limits.tick * rate, near, kept


@bare_kernel
def price(horizon: RoadArrays, states: Array, controls: Array) -> float:
    """Cost (stage and effort) of a motion with states (n + 1, 5) and controls (n, 2)."""
    total, near = 0.0, nearest_of_all(horizon.route, states[0, 0], states[0, 1])
    for k in range(controls.shape[0]):
        cost, near, _ = cost_of_tick(horizon, states, controls, k, near)
        total += cost
    return total
