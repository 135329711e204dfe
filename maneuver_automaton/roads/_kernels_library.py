"""The maneuvers between the trims of a car, made at the identity pose."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from maneuver_automaton._compile import bare_inner_kernel, inner_kernel, kernel
from maneuver_automaton.roads._kernels_motion import one_tick

if TYPE_CHECKING:
    from maneuver_automaton._arrays import Array, IntArray


class Maneuvers(NamedTuple):
    """E maneuvers from the identity pose, all of the same number of ticks."""

    # Sorted by the trim they leave, so that the edges of a node are one range.
    first: np.ndarray  # (S + 1,) where those of each trim begin; (2,) of a single state
    target: np.ndarray  # (E,) trim that is reached
    control: np.ndarray  # (E, 2) acceleration [m/s^2], steering rate [rad/s]
    # Poses at all ticks: an edge is proven tick by tick, as others are known at the ticks.
    pose: np.ndarray  # (E, ticks, 3) at the end of each tick
    effort: np.ndarray  # (E,) cost of comfort


class Trims(NamedTuple):
    """S trims: pairs of a speed and a steering angle, speed by speed."""

    speed: np.ndarray  # (S,) [m/s]
    steering: np.ndarray  # (S,) [rad]
    first: np.ndarray  # (speeds + 1,) first trim of each speed: slow ones have more angles


class Limits(NamedTuple):
    """Limits of the vehicle and of the library, and the weights of comfort."""

    wheelbase: float
    tick: float  # [s]
    ticks: int  # of every maneuver
    rate: float  # [rad/s] of the steering
    sharpest: float  # [rad] of the steering
    braking: float  # [m/s^2] at most
    lateral: float  # [m/s^2] at most
    friction: float  # [m/s^2] along and across together
    engine: float  # [m/s^2] up to `power_speed`, less beyond it
    power_speed: float  # [m/s]
    left_out: tuple[float, float]  # [m/s] between these, changes of speed are left out
    most_steps: int  # of the speed grid that a maneuver spans
    weight_along: float  # per (m/s^2)^2 s
    weight_across: float  # per (m/s^2)^2 s
    weight_jerk: float  # per (m/s^3)^2 s, across


@bare_inner_kernel
def admitted(
    limits: Limits,
    duration: float,
    speed: float,
    steering: float,
    target_speed: float,
    target_steering: float,
) -> tuple[bool, float, float, float]:
    """Whether a ramp between two states keeps the limits; acceleration, steering rate, effort."""
    acceleration = (target_speed - speed) / duration
    rate = (target_steering - steering) / duration
    slack = 1e-9
    most = limits.engine * limits.power_speed / max(max(speed, target_speed), limits.power_speed)
    if abs(rate) > limits.rate + slack or acceleration > most + slack:
        return False, 0.0, 0.0, 0.0
    if acceleration < -limits.braking - slack:
        return False, 0.0, 0.0, 0.0
    begin = speed * speed * math.tan(steering) / limits.wheelbase
    end = target_speed * target_speed * math.tan(target_steering) / limits.wheelbase
    across = max(abs(begin), abs(end))
    # A ramp may return from beyond the limits, as from any start, but not lead there.
    if abs(end) > limits.lateral + 1e-6:
        return False, 0.0, 0.0, 0.0
    if math.hypot(acceleration, across) > max(limits.friction, abs(begin)) + 1e-6:
        return False, 0.0, 0.0, 0.0
    jerk = (end - begin) / duration
    effort = limits.weight_along * acceleration * acceleration
    effort += limits.weight_across * (begin * begin + begin * end + end * end) / 3.0
    effort += limits.weight_jerk * jerk * jerk
    return True, acceleration, rate, effort * duration


@inner_kernel
def write_course(
    limits: Limits, speed: float, steering: float, acceleration: float, rate: float, out: Array
) -> None:
    """Poses at the ends of the ticks (ticks, 3) of a ramp from the identity."""
    x, y, heading = 0.0, 0.0, 0.0
    for k in range(limits.ticks):
        x, y, heading, speed, steering = one_tick(
            limits.wheelbase, limits.tick, x, y, heading, speed, steering, acceleration, rate
        )
        out[k, 0], out[k, 1], out[k, 2] = x, y, heading


@inner_kernel
def leading_from(
    limits: Limits,
    trims: Trims,
    speed: float,
    steering: float,
    low: int,
    high: int,
    found: IntArray,
    control: Array,
    effort: Array,
) -> int:
    """Trims numbered from `low` to `high` that a ramp from a state reaches; how many."""
    n, duration = 0, limits.tick * limits.ticks
    for target in range(low, high):
        change = abs(trims.speed[target] - speed)
        if limits.left_out[0] < change < limits.left_out[1]:
            continue
        possible, acceleration, rate, price = admitted(
            limits, duration, speed, steering, trims.speed[target], trims.steering[target]
        )
        if possible:
            found[n], control[n, 0], control[n, 1], effort[n] = target, acceleration, rate, price
            n += 1
    return n


@kernel
def maneuvers_from(limits: Limits, trims: Trims, speed: float, steering: float) -> Maneuvers:
    """All maneuvers from one state, which need not be a trim."""
    most = trims.speed.shape[0]
    found = np.empty(most, dtype=np.int64)
    control, effort = np.empty((most, 2)), np.empty(most)
    n = leading_from(limits, trims, speed, steering, 0, most, found, control, effort)
    pose = np.empty((n, limits.ticks, 3))
    for e in range(n):
        write_course(limits, speed, steering, control[e, 0], control[e, 1], pose[e])
    first = np.array([0, n])
    return Maneuvers(first, found[:n].copy(), control[:n].copy(), pose, effort[:n].copy())


@kernel
def maneuvers_between(limits: Limits, trims: Trims, most: int) -> Maneuvers:
    """All maneuvers between trims, at most `most` of them."""
    count = trims.speed.shape[0]
    found = np.empty(most, dtype=np.int64)
    control, effort = np.empty((most, 2)), np.empty(most)
    pose = np.empty((most, limits.ticks, 3))
    first = np.zeros(count + 1, dtype=np.int64)
    n, step = 0, 0
    speeds = trims.first.shape[0] - 1
    for source in range(count):
        while source >= trims.first[step + 1]:
            step += 1
        low = trims.first[max(0, step - limits.most_steps)]
        high = trims.first[min(speeds, step + limits.most_steps + 1)]
        speed, steering = trims.speed[source], trims.steering[source]
        if n + high - low > most:
            break
        added = leading_from(
            limits, trims, speed, steering, low, high, found[n:], control[n:], effort[n:]
        )
        for e in range(n, n + added):
            write_course(limits, speed, steering, control[e, 0], control[e, 1], pose[e])
        n += added
        first[source + 1] = n
    return Maneuvers(
        first, found[:n].copy(), control[:n].copy(), pose[:n].copy(), effort[:n].copy()
    )
