"""Proof that a motion on the road is free, tick by tick.

Land beside the road, static and moving obstacles on it are a `World`, and the proof along
a tick is that of `free_time` in the collision room, for the constant twist between its ends, but
with distances of their own to static and to moving obstacles. The car leaves that twist by at most
an eighth of its acceleration times the square of the tick (9 m/s^2 and 0.1 s: 11 mm), which is less
than either distance.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.collision._kernels_advancement import free_of_static
from maneuver_automaton.collision._kernels_moving import free_of_moving
from maneuver_automaton.collision.arrays import WorldArrays
from maneuver_automaton.collision.body import Body

if TYPE_CHECKING:
    from maneuver_automaton._arrays import Array


class CarArrays(NamedTuple):
    """The car as a rectangle; the pose is that of the rear axle's middle."""

    half_length: float  # [m]
    half_width: float  # [m]
    ahead: float  # [m] from the rear axle to the middle of the body
    wheelbase: float  # [m]
    braking: float  # [m/s^2] of a fail-safe stop


class Clearing(NamedTuple):
    """All obstacles, the distances kept from them, and the body that moves."""

    car: CarArrays
    body: Body  # the same rectangle, for `world`
    world: WorldArrays  # land beside the road, static and moving obstacles on it
    off_static: float  # [m] kept all the way from land and static obstacles
    off_traffic: float  # [m] from moving obstacles, each there as long as it was recorded
    margin: float  # [m] besides, where the motion is looked at: the edge is simplified by as much
    start: float  # [s] time of the world at tick 0
    tick: float  # [s]


@bare_inner_kernel
def free_tick(
    clearing: Clearing,
    x_0: float,
    y_0: float,
    h_0: float,
    x_1: float,
    y_1: float,
    h_1: float,
    tick: int,
) -> bool:
    """Whether the constant twist between two poses of the car, from `tick` to the next, is free."""
    car, body, duration, margin = clearing.car, clearing.body, clearing.tick, clearing.margin
    c, s = math.cos(h_0), math.sin(h_0)
    d_x, d_y = c * (x_1 - x_0) + s * (y_1 - y_0), c * (y_1 - y_0) - s * (x_1 - x_0)
    turn = h_1 - h_0
    # Logarithm of the motion. Source: Solà, Deray, Atchuthan (2018), Eq. (157), by half angles.
    half = 0.5 * turn
    shrink = 1.0 if half == 0.0 else half / math.tan(half)
    v_x, v_y = (shrink * d_x + half * d_y) / duration, (shrink * d_y - half * d_x) / duration
    w = turn / duration
    # No point of the rectangle is faster: its corners are, and of these the outer one in front.
    front = max(car.half_length + car.ahead, car.half_length - car.ahead)
    fastest = math.hypot(abs(v_x) + abs(w) * car.half_width, abs(v_y) + abs(w) * front)
    off, traffic = clearing.off_static, clearing.off_traffic
    # Static obstacles first: their proof costs the same however much moves on the road.
    lasts, _ = free_of_static(
        clearing.world, body, x_0, y_0, h_0, v_x, v_y, w, fastest, duration, off, margin
    )
    if lasts < duration:  # proven is what lasts for the duration itself
        return False
    moving, clock = clearing.world.moving, clearing.start + tick * duration
    lasts, _ = free_of_moving(
        moving, body, x_0, y_0, h_0, v_x, v_y, w, fastest, duration, traffic, margin, clock
    )
    return lasts >= duration


@bare_kernel
def free_ticks(clearing: Clearing, states: Array, tick: int) -> int:
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
