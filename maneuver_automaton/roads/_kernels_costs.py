"""Cost of a drive, and an estimate of the cost-to-go.

Stage cost: offset and heading from the route, speed beyond the limit, pace, comfort. Cost-to-go:
constant accelerations along the route and across it that lead to the goal in the time left. It is
an estimate, not a bound: the beam search needs an order of nodes, and promises no optimum.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.groups._kernels import nearest_turn
from maneuver_automaton.roads._kernels_route import nearest_of_all, nearest_point, on_route

if TYPE_CHECKING:
    from maneuver_automaton._arrays import Array
    from maneuver_automaton.roads._kernels_beam import Horizon
    from maneuver_automaton.roads._kernels_goals import GoalArrays

IMPOSSIBLE = 1e4  # cost beyond the car's limits, far above any stage cost
SOON = 1e-3  # [s] and [m] left at least, where a value is divided by what is left


class Weights(NamedTuple):
    """Weights of the stage cost per second, and of the accelerations in the cost-to-go."""

    offset: float  # per m^2 from the route
    turned: float  # per rad^2 from the route's direction
    hurry: float  # per (m/s)^2 beyond the speed limit
    pace: float  # per (m/s)^2 from the pace
    progress: float  # [m/s] the pace, nan where the goal sets it
    # Of the cost-to-go: prices of the accelerations that are still needed, and their limits.
    ahead: float  # per (m/s^2)^2 s, along the route
    aside: float  # per (m/s^2)^2 s, across it
    lateral: float  # [m/s^2] limit across
    braking: float  # [m/s^2] limit of slowing down
    gain: float  # [m/s^2] limit of speeding up


class StaticObstacles(NamedTuple):
    """B static obstacles on the road, as intervals in which the vehicle's middle may not be."""

    extent: np.ndarray  # (B, 4) least and greatest station, least and greatest offset
    passable: np.ndarray  # (B, 2) whether there is road to its right and to its left


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
    horizon: Horizon, x: float, y: float, heading: float, speed: float, guess: int
) -> tuple[float, int]:
    """`stage_rate` of a state, and the point of the route that is nearest, near a guess."""
    ahead = horizon.clearing.car.ahead
    m_x, m_y = x + ahead * math.cos(heading), y + ahead * math.sin(heading)
    near = nearest_point(horizon.route, m_x, m_y, guess)
    _, offset = on_route(horizon.route, m_x, m_y, near)
    turned = nearest_turn(heading - horizon.route.heading[near])
    return stage_rate(horizon.weights, horizon.route.limit[near], offset, turned, speed), near


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
def along_to_goal(
    weights: Weights,
    goals: GoalArrays,
    g: int,
    station: float,
    speed: float,
    least: float,
    most: float,
) -> tuple[float, float]:
    """Cost to be at the stations of goal `g` between two times from now [s], and that time [s].

    The time is negative if it cannot be: then the cost is the answer.
    """
    low, high = goals.extent[g, 0] - station, goals.extent[g, 1] - station
    if high < 0.0:
        return IMPOSSIBLE - high, -1.0  # passed; the further, the worse
    # In time at this speed? Then when it is first there, else at the end that is nearer.
    enter = math.inf if speed <= 0.0 and low > 0.0 else (low / speed if low > 0.0 else 0.0)
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
        needed = 2.0 * (distance - speed * time) / (time * time)
        if needed < 0.0 and speed + needed * time < 0.0:
            needed = -0.5 * speed * speed / max(distance, SOON)  # it has to stop before
        cost += weights.ahead * needed * needed * time
        # The small share keeps a step between the last possible value and the first impossible one.
        if needed > weights.gain:
            cost += IMPOSSIBLE * (needed / weights.gain - 1.0 + 0.01)
        elif needed < -weights.braking:
            cost += IMPOSSIBLE * (-needed / weights.braking - 1.0 + 0.01)
        final = max(speed + needed * time, 0.0)
    return cost + to_speed(weights, goals, g, final, time), time


@bare_inner_kernel
def sideways(weights: Weights, acceleration: float, time: float) -> float:
    """Cost of a lateral acceleration that is needed for a time [s]."""
    cost = weights.aside * acceleration * acceleration * time
    if acceleration > weights.lateral:
        cost += IMPOSSIBLE * (acceleration / weights.lateral - 1.0)
    return cost


@bare_inner_kernel
def cost_to_goal(
    weights: Weights,
    goals: GoalArrays,
    g: int,
    station: float,
    offset: float,
    turned: float,
    speed: float,
    least: float,
    most: float,
) -> float:
    """Estimate of the cost to be at goal `g` between two times from now [s].

    Constant accelerations along the route and across it that lead there in the time that suits.
    """
    cost, time = 0.0, most
    if goals.extent[g, 0] > -math.inf:
        cost, time = along_to_goal(weights, goals, g, station, speed, least, most)
        if time < 0.0:
            return cost
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
    horizon: Horizon, station: float, offset: float, turned: float, speed: float, tick: int
) -> float:
    """Estimate of the cost-to-go, to the goal that is cheapest to reach."""
    goals, weights = horizon.goals, horizon.weights
    best = math.inf
    for g in range(goals.tick.shape[0]):
        if tick > goals.tick[g, 1]:
            best = min(best, 2.0 * IMPOSSIBLE)
            continue
        least = max(goals.tick[g, 0] - tick, 0) * horizon.limits.tick
        most = (goals.tick[g, 1] - tick) * horizon.limits.tick
        cost = cost_to_goal(weights, goals, g, station, offset, turned, speed, least, most)
        cost += cost_past_obstacles(
            weights, horizon.obstacles, station, offset, turned, speed, goals.extent[g], most
        )
        best = min(best, cost)
    return best


@bare_inner_kernel
def cost_of_tick(
    horizon: Horizon, states: Array, controls: Array, k: int, guess: int
) -> tuple[float, int]:
    """Cost (stage and effort) of tick `k` of a motion, and the nearest point of the route after."""
    limits = horizon.limits
    x, y, heading = states[k + 1, 0], states[k + 1, 1], states[k + 1, 2]
    speed, steering = states[k + 1, 3], states[k + 1, 4]
    rate, near = rate_at(horizon, x, y, heading, speed, guess)
    before = states[k, 3] * states[k, 3] * math.tan(states[k, 4]) / limits.wheelbase
    after = speed * speed * math.tan(steering) / limits.wheelbase
    jerk = (after - before) / limits.tick
    rate += limits.weight_along * controls[k, 0] * controls[k, 0]
    rate += limits.weight_across * after * after + limits.weight_jerk * jerk * jerk
    return limits.tick * rate, near


@bare_kernel
def price(horizon: Horizon, states: Array, controls: Array) -> float:
    """Cost (stage and effort) of a motion with states (n + 1, 5) and controls (n, 2)."""
    total, near = 0.0, nearest_of_all(horizon.route, states[0, 0], states[0, 1])
    for k in range(controls.shape[0]):
        cost, near = cost_of_tick(horizon, states, controls, k, near)
        total += cost
    return total
