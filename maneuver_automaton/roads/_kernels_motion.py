"""The motion of a second-order car under constant controls, tick by tick."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from maneuver_automaton._compile import bare_inner_kernel, kernel

if TYPE_CHECKING:
    from maneuver_automaton._arrays import Array

STEPS = 2  # of the quadrature in one tick: 1e-6 m off the equations after 0.5 s at 12 m/s


@bare_inner_kernel
def one_tick(
    wheelbase: float,
    tick: float,
    x: float,
    y: float,
    heading: float,
    speed: float,
    steering: float,
    acceleration: float,
    rate: float,
) -> tuple[float, ...]:
    """State (x, y, heading, speed, steering) a tick later, under constant controls.

    The heading is a quadrature of the turn rate and the position one of the heading, both by
    Simpson's rule and its half; the model is that of `SecondOrderCar`.
    """
    h = tick / STEPS
    for _ in range(STEPS):
        v_m, d_m = speed + 0.5 * h * acceleration, steering + 0.5 * h * rate
        v_e, d_e = speed + h * acceleration, steering + h * rate
        w_0 = speed * math.tan(steering) / wheelbase
        w_m = v_m * math.tan(d_m) / wheelbase
        w_e = v_e * math.tan(d_e) / wheelbase
        turn = h * (w_0 + 4.0 * w_m + w_e) / 6.0
        half = h * (5.0 * w_0 + 8.0 * w_m - w_e) / 24.0  # to the middle of the step
        middle, end = heading + half, heading + turn
        x += (
            h
            * (speed * math.cos(heading) + 4.0 * v_m * math.cos(middle) + v_e * math.cos(end))
            / 6.0
        )
        y += (
            h
            * (speed * math.sin(heading) + 4.0 * v_m * math.sin(middle) + v_e * math.sin(end))
            / 6.0
        )
        heading, speed, steering = end, v_e, d_e
    return x, y, heading, speed, steering


@bare_inner_kernel
def drive_tick(wheelbase: float, tick: float, states: Array, controls: Array, k: int) -> None:
    """Fill in the state after tick `k` (row k + 1), from the state and the controls of row k."""
    x, y, heading, speed, steering = one_tick(
        wheelbase,
        tick,
        states[k, 0],
        states[k, 1],
        states[k, 2],
        states[k, 3],
        states[k, 4],
        controls[k, 0],
        controls[k, 1],
    )
    states[k + 1, 0], states[k + 1, 1], states[k + 1, 2] = x, y, heading
    states[k + 1, 3], states[k + 1, 4] = speed, steering


@kernel
def driven(wheelbase: float, tick: float, state: Array, controls: Array) -> Array:
    """States (n + 1, 5) at the ticks under controls (n, 2), from a state (5,)."""
    states = np.empty((controls.shape[0] + 1, 5))
    states[0] = state
    for k in range(controls.shape[0]):
        drive_tick(wheelbase, tick, states, controls, k)
    return states
