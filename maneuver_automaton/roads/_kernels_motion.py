"""Motions of a second-order car: a tick, the maneuvers between trims, the proof, fail-safe stops.

Land beside the road, static and moving obstacles on it are a `World`, and the proof along
a tick is that of `free_time` in the collision room, for the constant twist between its ends, but
with distances of their own to static and to moving obstacles. The car leaves that twist by at most
an eighth of its acceleration times the square of the tick (9 m/s^2 and 0.1 s: 11 mm), which is less
than either distance.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import (
    bare_inner_kernel,
    bare_kernel,
    bare_shared_kernel,
    inner_kernel,
    kernel,
)
from maneuver_automaton.collision._kernels_advancement import free_of_static
from maneuver_automaton.collision._kernels_moving import free_of_moving
from maneuver_automaton.collision.arrays import Coast
from maneuver_automaton.roads.arrays import (
    Clearing,
    Limits,
    Maneuvers,
    RoadArrays,
    RoadTrims,
    State,
)

STEPS = 2  # of the quadrature in one tick: 1e-6 m off the equations after 0.5 s at 12 m/s
ROUNDING = 1e-9  # [m/s^2, rad/s] that a ramp may be beyond its limits
ACROSS = 1e-6  # [m/s^2] the same across, where the limits are those of the trims themselves


@bare_inner_kernel
def one_tick(
    wheelbase: float, tick: float, state: State, acceleration: float, rate: float
) -> State:
    """State (x, y, heading, speed, steering) a tick later, under constant controls.

    The heading is a quadrature of the turn rate and the position one of the heading, both by
    Simpson's rule and its half; the model is that of `SecondOrderCar`.
    """
    x, y, heading, speed, steering = state
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
        along = speed * math.cos(heading) + 4.0 * v_m * math.cos(middle) + v_e * math.cos(end)
        aside = speed * math.sin(heading) + 4.0 * v_m * math.sin(middle) + v_e * math.sin(end)
        x, y = x + h * along / 6.0, y + h * aside / 6.0
        heading, speed, steering = end, v_e, d_e
    return x, y, heading, speed, steering


@bare_inner_kernel
def state_at(states: Array, k: int) -> State:
    """Row `k` of states (n, 5)."""
    return states[k, 0], states[k, 1], states[k, 2], states[k, 3], states[k, 4]


@bare_inner_kernel
def drive_tick(wheelbase: float, tick: float, states: Array, controls: Array, k: int) -> None:
    """Fill in the state after tick `k` (row k + 1), from the state and the controls of row k."""
    after = one_tick(wheelbase, tick, state_at(states, k), controls[k, 0], controls[k, 1])
    for i in range(5):
        states[k + 1, i] = after[i]


@kernel
def driven(wheelbase: float, tick: float, state: Array, controls: Array) -> Array:
    """States (n + 1, 5) at the ticks under controls (n, 2), from a state (5,)."""
    states = np.empty((controls.shape[0] + 1, 5))
    states[0] = state
    for k in range(controls.shape[0]):
        drive_tick(wheelbase, tick, states, controls, k)
    return states


@bare_inner_kernel
def admitted(
    limits: Limits, duration: float, before: tuple[float, float], after: tuple[float, float]
) -> tuple[bool, float, float, float]:
    """Whether a ramp between speeds and steering angles keeps the limits, and what it takes.

    The rest of the answer: acceleration, steering rate, effort.
    """
    acceleration, rate = (after[0] - before[0]) / duration, (after[1] - before[1]) / duration
    most = limits.engine * limits.power_speed / max(max(before[0], after[0]), limits.power_speed)
    if abs(rate) > limits.rate + ROUNDING or acceleration > most + ROUNDING:
        return False, 0.0, 0.0, 0.0
    if acceleration < -limits.braking - ROUNDING:
        return False, 0.0, 0.0, 0.0
    begin = before[0] * before[0] * math.tan(before[1]) / limits.wheelbase
    end = after[0] * after[0] * math.tan(after[1]) / limits.wheelbase
    across = max(abs(begin), abs(end))
    # A ramp may return from beyond the limits, as from any start, but not lead there.
    if abs(end) > limits.lateral + ACROSS:
        return False, 0.0, 0.0, 0.0
    if math.hypot(acceleration, across) > max(limits.friction, abs(begin)) + ACROSS:
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
    state = (0.0, 0.0, 0.0, speed, steering)
    for k in range(limits.ticks):
        state = one_tick(limits.wheelbase, limits.tick, state, acceleration, rate)
        out[k, 0], out[k, 1], out[k, 2] = state[0], state[1], state[2]


@inner_kernel
def leading_from(
    limits: Limits,
    trims: RoadTrims,
    begin: tuple[float, float],
    low: int,
    high: int,
    found: IntArray,
    control: Array,
    effort: Array,
) -> int:
    """Trims numbered from `low` to `high` that a ramp from a speed and an angle reaches; how many.

    `found`, `control` and `effort` are written.
    """
    n, duration = 0, limits.tick * limits.ticks
    for target in range(low, high):
        change = abs(trims.speed[target] - begin[0])
        if limits.left_out[0] < change < limits.left_out[1]:
            continue
        end = (trims.speed[target], trims.steering[target])
        possible, acceleration, rate, price = admitted(limits, duration, begin, end)
        if possible:
            found[n], control[n, 0], control[n, 1], effort[n] = target, acceleration, rate, price
            n += 1
    return n


@kernel
def maneuvers_from(limits: Limits, trims: RoadTrims, speed: float, steering: float) -> Maneuvers:
    """All maneuvers from one state, which need not be a trim."""
    most = trims.speed.shape[0]
    found = np.empty(most, dtype=np.int64)
    control, effort = np.empty((most, 2)), np.empty(most)
    n = leading_from(limits, trims, (speed, steering), 0, most, found, control, effort)
    pose = np.empty((n, limits.ticks, 3))
    for e in range(n):
        write_course(limits, speed, steering, control[e, 0], control[e, 1], pose[e])
    first = np.array([0, n])
    return Maneuvers(first, found[:n].copy(), control[:n].copy(), pose, effort[:n].copy())


@kernel
def maneuvers_between(limits: Limits, trims: RoadTrims, most: int) -> Maneuvers:
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
            limits, trims, (speed, steering), low, high, found[n:], control[n:], effort[n:]
        )
        for e in range(n, n + added):
            write_course(limits, speed, steering, control[e, 0], control[e, 1], pose[e])
        n += added
        first[source + 1] = n
    return Maneuvers(
        first, found[:n].copy(), control[:n].copy(), pose[:n].copy(), effort[:n].copy()
    )


@bare_shared_kernel
def free_tick(
    clearing: Clearing,
    before: tuple[float, float, float],
    after: tuple[float, float, float],
    tick: int,
) -> bool:
    """Whether the constant twist between two poses of the car, from `tick` to the next, is free."""
    x, y, heading = before
    car, body, duration, margin = clearing.car, clearing.body, clearing.tick, clearing.margin
    c, s = math.cos(heading), math.sin(heading)
    d_x, d_y = c * (after[0] - x) + s * (after[1] - y), c * (after[1] - y) - s * (after[0] - x)
    turn = after[2] - heading
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
    clock = clearing.start + tick * duration
    motion = Coast(x, y, heading, v_x, v_y, w, fastest, duration, clock)
    lasts, _ = free_of_static(clearing.world, body, motion, off, margin)
    if lasts < duration:  # proven is what lasts for the duration itself
        return False
    lasts, _, _ = free_of_moving(clearing.world.moving, body, motion, traffic, margin)
    return lasts >= duration


@bare_inner_kernel
def free_from(clearing: Clearing, states: Array, begin: int, tick: int) -> int:
    """The first tick from row `begin` on of states (n + 1, 5) that is not free; n if all are.

    The first row is at `tick`.
    """
    for k in range(begin, states.shape[0] - 1):
        before, after = state_at(states, k), state_at(states, k + 1)
        if not free_tick(clearing, before[:3], after[:3], tick + k):
            return k
    return states.shape[0] - 1


@bare_kernel
def free_ticks(clearing: Clearing, states: Array, tick: int) -> int:
    """How many ticks of a motion with states (n + 1, 5) at ticks from `tick` on are free."""
    return free_from(clearing, states, 0, tick)


@bare_inner_kernel
def stays_free(horizon: RoadArrays, x: float, y: float, heading: float, tick: int) -> bool:
    """Whether nobody comes where the vehicle stands from a tick on until the goals are over."""
    clearing, last = horizon.clearing, tick
    for g in range(horizon.goals.tick.shape[0]):
        last = max(last, horizon.goals.tick[g, 1])
    duration, clock = (last - tick) * clearing.tick, clearing.start + tick * clearing.tick
    moving, body, off = clearing.world.moving, clearing.body, clearing.off_traffic
    stay = Coast(x, y, heading, 0.0, 0.0, 0.0, 0.0, duration, clock)
    lasts, _, _ = free_of_moving(moving, body, stay, off, clearing.margin)
    return lasts >= duration


@bare_inner_kernel
def stop_with(
    horizon: RoadArrays,
    state: State,
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
    while state[3] > 0.0:
        if begin + k >= controls.shape[0]:
            return -1
        speed, steering = state[3], state[4]
        slower = max(speed - car.braking * limits.tick, 0.0)
        square = max(speed * speed, 1.0)
        sharpest = min(math.atan(limits.lateral * limits.wheelbase / square), limits.sharpest)
        rate = (share * sharpest - steering) / limits.tick
        if share != share:  # nan
            rate = 0.0
        rate = min(max(rate, -limits.rate), limits.rate)
        acceleration = (slower - speed) / limits.tick
        x, y, heading, _, steering = one_tick(car.wheelbase, limits.tick, state, acceleration, rate)
        if not free_tick(horizon.clearing, state[:3], (x, y, heading), tick + k):
            return -1
        controls[begin + k, 0], controls[begin + k, 1] = acceleration, rate
        state = (x, y, heading, slower, steering)
        k += 1
    if rests and not stays_free(horizon, state[0], state[1], state[2], tick + k):
        return -1
    return k


@bare_inner_kernel
def first_free_stop(
    horizon: RoadArrays,
    state: State,
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
        n = stop_with(horizon, state, shares[k], tick, controls, begin, rests)
        if n >= 0:
            return n
    return -1
