"""Proof that a motion on the road is free, tick by tick.

Land beside the road and static obstacles on it are a `World`, and the proof along a tick that of
the collision room, `free_time`, for the constant twist between its ends. The car leaves that twist
by at most an eighth of its acceleration times the square of the tick (9 m/s^2 and 0.1 s: 11 mm),
which is less than the distance that is kept. Moving obstacles: see `_kernels_traffic`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.collision._kernels_advancement import free_time
from maneuver_automaton.collision.body import Body
from maneuver_automaton.collision.world import WorldArrays
from maneuver_automaton.roads._kernels_traffic import TrafficArrays, clear_of_traffic


class CarArrays(NamedTuple):
    """The car as a rectangle; the pose is that of the rear axle's middle."""

    half_length: float  # [m]
    half_width: float  # [m]
    ahead: float  # [m] from the rear axle to the middle of the body
    reach: float  # [m] half the diagonal
    wheelbase: float  # [m]
    braking: float  # [m/s^2] of a fail-safe stop


class Clearing(NamedTuple):
    """All obstacles, the distances kept from them, and the body that moves."""

    car: CarArrays
    body: Body  # the same rectangle, for `static`
    static: WorldArrays  # land beside the road, and static obstacles on it
    keep: float  # [m] kept from them all the way
    margin: float  # [m] besides, where the motion is looked at: its edge is simplified by as much
    traffic: TrafficArrays
    tick: float  # [s]


@bare_inner_kernel
def clear_of_static(clearing, x_0, y_0, h_0, x_1, y_1, h_1):
    """Whether the body meets no static obstacle along the constant twist between two poses."""
    car, tick = clearing.car, clearing.tick
    c, s = math.cos(h_0), math.sin(h_0)
    d_x, d_y = c * (x_1 - x_0) + s * (y_1 - y_0), c * (y_1 - y_0) - s * (x_1 - x_0)
    turn = h_1 - h_0
    # Logarithm of the motion. Source: Solà, Deray, Atchuthan (2018), Eq. (157), by half angles.
    half = 0.5 * turn
    shrink = 1.0 if half == 0.0 else half / math.tan(half)
    v_x, v_y = (shrink * d_x + half * d_y) / tick, (shrink * d_y - half * d_x) / tick
    turn_rate = turn / tick
    # No point of the rectangle is faster: its corners are, and of these the outer one in front.
    front = max(car.half_length + car.ahead, car.half_length - car.ahead)
    fastest = math.hypot(
        abs(v_x) + abs(turn_rate) * car.half_width, abs(v_y) + abs(turn_rate) * front
    )
    lasts, _ = free_time(
        clearing.static,
        clearing.body,
        x_0,
        y_0,
        h_0,
        v_x,
        v_y,
        turn_rate,
        fastest,
        tick,
        clearing.keep,
        clearing.margin,
        0.0,
    )
    return lasts >= tick  # the proof: `free_time` returns the duration itself if it gets there


@bare_inner_kernel
def free_tick(clearing, x_0, y_0, h_0, x_1, y_1, h_1, tick):
    """Whether the motion between two poses of the rear axle, from `tick` to the next, is free."""
    # Static obstacles first: their proof costs the same however much moves on the road.
    if not clear_of_static(clearing, x_0, y_0, h_0, x_1, y_1, h_1):
        return False
    car = clearing.car
    m_0x, m_0y = x_0 + car.ahead * math.cos(h_0), y_0 + car.ahead * math.sin(h_0)
    m_1x, m_1y = x_1 + car.ahead * math.cos(h_1), y_1 + car.ahead * math.sin(h_1)
    return clear_of_traffic(car, clearing.traffic, m_0x, m_0y, h_0, m_1x, m_1y, h_1, tick)


@bare_kernel
def free_ticks(clearing, states, tick):
    """How many ticks of a motion with states (n + 1, 5) at ticks from `tick` on are free."""
    for k in range(states.shape[0] - 1):
        if not free_tick(
            clearing,
            states[k, 0],
            states[k, 1],
            states[k, 2],
            states[k + 1, 0],
            states[k + 1, 1],
            states[k + 1, 2],
            tick + k,
        ):
            return k
    return states.shape[0] - 1
