"""Fail-safe stops: full braking from a state, proven free tick by tick, and rest after it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from maneuver_automaton._compile import bare_inner_kernel
from maneuver_automaton.collision._kernels_moving import free_of_moving
from maneuver_automaton.roads._kernels_free import free_tick
from maneuver_automaton.roads._kernels_motion import one_tick

if TYPE_CHECKING:
    from maneuver_automaton._arrays import Array
    from maneuver_automaton.roads._kernels_beam import Horizon


@bare_inner_kernel
def stays_free(horizon: Horizon, x: float, y: float, heading: float, tick: int) -> bool:
    """Whether nobody comes where the vehicle stands from a tick on until the goals are over."""
    clearing, last = horizon.clearing, tick
    for g in range(horizon.goals.tick.shape[0]):
        last = max(last, horizon.goals.tick[g, 1])
    duration, clock = (last - tick) * clearing.tick, clearing.start + tick * clearing.tick
    moving, body, off = clearing.world.moving, clearing.body, clearing.off_traffic
    lasts, _ = free_of_moving(
        moving, body, x, y, heading, 0.0, 0.0, 0.0, 0.0, duration, off, clearing.margin, clock
    )
    return lasts >= duration


@bare_inner_kernel
def stop_with(
    horizon: Horizon,
    x: float,
    y: float,
    heading: float,
    speed: float,
    steering: float,
    share: float,
    tick: int,
    controls: Array,
    begin: int,
    rests: bool,
) -> int:
    """Try to stop from a state, steering to a share of the sharpest angle; ticks, or -1 if hit.

    If it `rests`, nobody may come where it stands, either.

    The share is of the angle that the speed at each moment admits, and the steering follows at its
    rate; nan holds the angle. Rows of `controls` (n, 2) from `begin` on are written.
    """
    car, limits = horizon.clearing.car, horizon.limits
    k = 0
    while speed > 0.0:
        if begin + k >= controls.shape[0]:
            return -1
        slower = max(speed - car.braking * limits.tick, 0.0)
        square = max(speed * speed, 1.0)
        sharpest = min(math.atan(limits.lateral * limits.wheelbase / square), limits.sharpest)
        rate = (share * sharpest - steering) / limits.tick
        if share != share:  # nan
            rate = 0.0
        rate = min(max(rate, -limits.rate), limits.rate)
        acceleration = (slower - speed) / limits.tick
        n_x, n_y, n_heading, _, n_steering = one_tick(
            car.wheelbase, limits.tick, x, y, heading, speed, steering, acceleration, rate
        )
        if not free_tick(horizon.clearing, x, y, heading, n_x, n_y, n_heading, tick + k):
            return -1
        controls[begin + k, 0], controls[begin + k, 1] = acceleration, rate
        x, y, heading, speed, steering = n_x, n_y, n_heading, slower, n_steering
        k += 1
    if rests and not stays_free(horizon, x, y, heading, tick + k):
        return -1
    return k


@bare_inner_kernel
def first_free_stop(
    horizon: Horizon,
    x: float,
    y: float,
    heading: float,
    speed: float,
    steering: float,
    tick: int,
    shares: Array,
    controls: Array,
    begin: int,
    rests: bool,
) -> int:
    """Ticks of the first of the stops that is free, -1 if none is.

    `shares` (n,) are in the order in which stops are tried, the gentle ones first.
    """
    for k in range(shares.shape[0]):
        n = stop_with(
            horizon, x, y, heading, speed, steering, shares[k], tick, controls, begin, rests
        )
        if n >= 0:
            return n
    return -1
