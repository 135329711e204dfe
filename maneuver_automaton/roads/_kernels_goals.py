"""Goals of a drive as kernels see them: whether a state meets one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel

if TYPE_CHECKING:
    from maneuver_automaton._arrays import Array
    from maneuver_automaton.roads._kernels_beam import Horizon


class GoalArrays(NamedTuple):
    """G goals in world coordinates, and where they are along the route."""

    # Rings of all places one after another, as goals have any number of places of any size.
    corner: np.ndarray  # (R, 2)
    ring: np.ndarray  # (P + 1,) first corner of each ring
    place: np.ndarray  # (G + 1,) first ring of each goal
    anywhere: np.ndarray  # (G,) whether a goal is no place
    heading: np.ndarray  # (G, 2) least heading, width of the interval
    speed: np.ndarray  # (G, 2) least and greatest
    tick: np.ndarray  # (G, 2) first and last
    every: int  # ticks: only at multiples of these, where the scene's clock ticks, a goal counts
    # For the cost-to-go, which knows no rings: the intervals that hold the places of each goal.
    extent: np.ndarray  # (G, 4) least and greatest station, least and greatest offset; or infinite
    turned: np.ndarray  # (G, 2) least and greatest heading, seen from the route's direction there


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
def goal_at(horizon: Horizon, x: float, y: float, heading: float, speed: float, tick: int) -> int:
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
def first_goal(horizon: Horizon, states: Array, tick: int) -> int:
    """First of the states (n, 5) at ticks from `tick` on that meets a goal, -1 if none does."""
    for k in range(states.shape[0]):
        if goal_at(horizon, states[k, 0], states[k, 1], states[k, 2], states[k, 3], tick + k) >= 0:
            return k
    return -1
