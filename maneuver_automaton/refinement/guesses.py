"""Guesses for polishing: the geometry of a kinematic plan, driven at a pace that inertia allows.

A guess may jump where the plan jumps from arc to arc: the solver closes the defects. It must get
right the sequence of gears and, roughly, the duration of each stroke.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.models import CarWithTrailer, SecondOrderCar, SecondOrderUnicycle
from maneuver_automaton.models.speeds import lateral_limit
from maneuver_automaton.optimal_control import Guess
from maneuver_automaton.optimal_control.polishing import intervals_for
from maneuver_automaton.primitives import Trajectory
from maneuver_automaton.refinement.gear_sequences import car_library, unicycle_library

SHARE = 0.9  # of the limits that a guess uses
SAMPLES = 24  # at least, of every trim that is driven
FINE = 0.02  # [rad, share of the plan] between samples


@dataclass(frozen=True, slots=True, kw_only=True)
class PathLimits:
    """Limits of a motion along a path; infinite where there is no limit."""

    speed: float  # [m/s]
    reverse_speed: float  # [m/s]
    acceleration: float  # [m/s^2]
    turn_rate: float = math.inf  # [rad/s]
    angular_acceleration: float = math.inf  # [rad/s^2]
    wheelbase: float = 0.0  # [m] 0: nothing is steered
    steering_rate: float = math.inf  # [rad/s]
    lateral: float = math.inf  # [m/s^2] speed times turn rate


class Timed(NamedTuple):
    """A kinematic plan driven from stop to stop: samples in time, and the stroke of each."""

    time: Array  # (m,) [s]
    pose: Array  # (m, 3)
    twist: Array  # (m, 3) along the path
    steering: Array  # (m,) [rad] as the path asks for it, with jumps
    stroke: IntArray  # (m,) number of the stroke from stop to stop

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.time[-1])


def timed(plan: Plan, pace: PathLimits) -> Timed:
    """A plan of steady motions in the plane, driven within limits of speed and acceleration.

    It stops where the sign of the speed changes, and between driving and turning on the spot. Where
    a wheel has to be turned further than the strokes around a stop give time for, it waits.
    """
    twists = np.array([trim.body_velocity[:3] for trim in plan.trims]).reshape(-1, 3)
    moves = twists.any(axis=1) & (plan.durations > 0.0)
    if not moves.any():
        raise ValueError("guess: the plan does not move, so there is nothing to time")
    twists, durations = twists[moves], plan.durations[moves]
    begins = (np.cumsum(plan.durations) - plan.durations)[moves]
    gears = np.sign(twists[:, 0])
    stroke_of = np.concatenate([[0], np.cumsum(np.diff(gears) != 0)])
    counts = np.maximum(SAMPLES, np.ceil(durations / durations.sum() / FINE)).astype(np.int64)
    owner = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    share = (np.arange(len(owner)) - first[owner]) / counts[owner]
    width = durations[owner] / counts[owner]
    ratio, growth = _limits(twists, pace)
    squared = _squared_ratio(ratio[owner], growth[owner], width, stroke_of[owner])
    mean = 0.5 * (np.sqrt(squared[:-1]) + np.sqrt(squared[1:]))
    passed = width / mean
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.arctan(pace.wheelbase * twists[:, 2] / twists[:, 0])
    steering = np.where(twists[:, 0] != 0.0, angle, 0.0)
    strokes = np.bincount(stroke_of[owner], weights=passed).astype(np.float64)
    waits = _waits(steering, stroke_of, strokes, pace.steering_rate)
    return _assembled(
        plan, begins[owner] + share * durations[owner], passed, squared, twists[owner],
        steering[owner], stroke_of[owner], waits,
    )  # fmt: skip


def _limits(twists: Array, pace: PathLimits) -> tuple[Array, Array]:
    """How much faster than planned each trim may be driven, and how fast this may grow [1/s]."""
    speed, turn = np.abs(twists[:, 0]), np.abs(twists[:, 2])
    most = np.where(twists[:, 0] < 0.0, pace.reverse_speed, pace.speed)
    with np.errstate(divide="ignore"):
        ratio = np.minimum(most / speed, pace.turn_rate / turn)
        ratio = np.minimum(ratio, np.sqrt(pace.lateral / (speed * turn)))
        growth = np.minimum(pace.acceleration / speed, pace.angular_acceleration / turn)
    return SHARE * ratio, SHARE * growth


def _squared_ratio(ratio: Array, growth: Array, width: Array, stroke: IntArray) -> Array:
    """Squares (m + 1,) of the fastest pace along the path, zero at its stops."""
    stops = np.concatenate([[True], np.diff(stroke) != 0, [True]])
    bound = np.minimum(np.append(ratio, np.inf), np.append(np.inf, ratio)) ** 2
    squared = np.where(stops, 0.0, bound)
    gain = 2.0 * growth * width
    for k in range(len(width)):
        squared[k + 1] = min(squared[k + 1], squared[k] + gain[k])
    for k in range(len(width) - 1, -1, -1):
        squared[k] = min(squared[k], squared[k + 1] + gain[k])
    return squared


def _waits(steering: Array, stroke_of: IntArray, strokes: Array, rate: float) -> Array:
    """Time (n + 1,) [s] at the begin, at each stop and at the end for the wheel to come round."""
    last = np.concatenate([[0.0], steering[np.flatnonzero(np.diff(np.append(stroke_of, -1)))]])
    first = steering[np.flatnonzero(np.diff(np.concatenate([[-1], stroke_of])))]
    turned = np.abs(np.append(first, 0.0) - last)
    before = np.concatenate([[0.0], 0.5 * strokes])
    spare = before + np.append(0.5 * strokes, 0.0)
    return np.asarray(np.maximum(0.0, turned / rate - spare))


def _assembled(
    plan: Plan,
    places: Array,
    passed: Array,
    squared: Array,
    twists: Array,
    steering: Array,
    stroke: IntArray,
    waits: Array,
) -> Timed:
    """Samples at the begin of every cell, doubled at stops, and at the end."""
    new = np.concatenate([[True], np.diff(stroke) != 0])
    time = np.concatenate([[0.0], np.cumsum(passed)])
    time[:-1] += np.cumsum(waits[:-1])[stroke]
    time[-1] += waits[:-1].sum()
    pace = np.sqrt(squared)[:-1]
    number = stroke.astype(np.float64)
    table = np.column_stack([time[:-1], places, pace, number, steering, pace[:, None] * twists])
    at = np.flatnonzero(new)
    stops = table[at].copy()  # where each stroke begins, before it has waited
    stops[:, 0] -= waits[:-1][stroke[at]]
    stops[1:, 4] = steering[at[1:] - 1]
    stops[0, 4] = 0.0
    table = np.insert(table, at, stops, axis=0)
    end = table[-1].copy()
    end[[0, 1, 2, 5, 6, 7]] = [time[-1], plan.durations.sum(), 0.0, 0.0, 0.0, 0.0]
    last = end.copy()
    last[0] += waits[-1] + 1e-6
    last[4] = 0.0
    table = np.vstack([table, end, last])
    clock = table[:, 0] + 1e-9 * np.arange(len(table))
    return Timed(
        time=clock - clock[0],
        pose=plan.pose_at(plan.start_time + table[:, 1]),
        twist=table[:, 5:8],
        steering=table[:, 4],
        stroke=table[:, 3].astype(np.int64),
    )


def _hitched(
    model: CarWithTrailer, control: Array, step: float, hitches: tuple[float, float]
) -> Array:
    """Angles (n + 1,) at the hitch [rad], which may jump where the gear changes."""
    low, high = model.reduced_limits[0].tolist()
    angle = np.zeros(len(control) + 1)
    angle[0], angle[-1] = hitches
    pushed = control[:, 0] < 0.0

    def after(k: int, time: float) -> float:
        hitch = float(angle[k] if time > 0.0 else angle[k + 1])
        (rate,) = model.dynamics((hitch,), control[k])
        return float(min(max(hitch + time * rate, low), high))

    for k in np.flatnonzero(~pushed).tolist():
        angle[k + 1] = after(k, step)
    for k in np.flatnonzero(pushed)[::-1].tolist():
        angle[k] = after(k, -step)
    return angle


def course_guess(course: Trajectory) -> Guess:
    """Guess from a motion that any model can make: an automaton's plan."""
    lasting = float(course.time[-1] - course.time[0])
    return guess_at(course, np.linspace(0.0, lasting, intervals_for(lasting) + 1))


def guess_at(course: Trajectory, at: Array) -> Guess:
    """Guess from a motion, with nodes at times (n,) [s] since it began."""
    known, rows = course.time - course.time[0], np.hstack([course.pose, course.reduced_state])
    return Guess.of_motion(at, known=known, state=rows, control=course.control)


def _nodes(run: Timed) -> Array:
    """Times (n + 1,) [s] of the nodes of a guess."""
    return np.linspace(0.0, run.duration, intervals_for(run.duration) + 1)


def _second_order(run: Timed, wanted: Array, rate: float, limits: Array) -> Guess:
    """Poses, speed and a second reduced state at equal steps; controls are their differences.

    The second one follows what is `wanted` along the run at a limited rate, from zero to zero.
    """
    at = _nodes(run)
    second = _followed(np.interp(at, run.time, wanted), rate, at[1])
    second[[0, -1]] = 0.0
    reduced = np.column_stack([np.interp(at, run.time, run.twist[:, 0]), second])
    control = np.clip(np.diff(reduced, axis=0) / at[1], *limits.T)
    return Guess(state=np.hstack([_at(run, at), reduced]), control=control, duration=run.duration)


def _at(run: Timed, at: Array) -> Array:
    return np.stack([np.interp(at, run.time, column) for column in run.pose.T], axis=1)


def _followed(wanted: Array, rate: float, step: float) -> Array:
    """A signal of limited rate that follows another one, half of it ahead of its jumps."""
    after, before = wanted.copy(), wanted.copy()
    most = rate * step
    for k in range(1, len(wanted)):
        after[k] = after[k - 1] + min(max(wanted[k] - after[k - 1], -most), most)
    for k in range(len(wanted) - 2, -1, -1):
        before[k] = before[k + 1] + min(max(wanted[k] - before[k + 1], -most), most)
    return 0.5 * (after + before)


LESS = 0.8  # of the greatest curvature that lasts, with which they turn too
WIDEST = 0.2  # the same where a lateral acceleration allows no more at full speed
ALONG = 0.5 * math.pi  # [rad] at the hitch, beyond which a trailer is pulled no more


class PathGuesses(NamedTuple):
    """Guesses along plans of kinematic vehicles."""

    libraries: Sequence[Automaton]  # of vehicles that turn as tightly as can be, and less
    pace: PathLimits  # along their paths
    guess: Callable[[Plan, Array, Array], Guess]  # of a plan, first and last reduced state (n_z,)


@functools.singledispatch
def path_guesses(model: object) -> PathGuesses | None:
    """How guesses are made along kinematic plans; None for a vehicle that is led by no path."""
    return None


def _libraries_of_car(
    model: SecondOrderCar | CarWithTrailer, pace: PathLimits, share: float = 1.0
) -> list[Automaton]:
    """Libraries that turn as tightly as the car may, by a share, and less.

    Less is what a lateral acceleration allows at full speed.
    """
    less = pace.lateral / pace.speed**2 * model.wheelbase / math.tan(model.max_steering)
    return [
        car_library(
            wheelbase=model.wheelbase,
            max_steering=model.max_steering,
            share=share * turn,
            reverses=pace.reverse_speed > 0.0,
        )
        for turn in (1.0, min(max(less, WIDEST), LESS))
    ]


@path_guesses.register
def _of_car(model: SecondOrderCar) -> PathGuesses:
    low, high = model.reduced_limits[0]
    pace = PathLimits(
        speed=high,
        reverse_speed=-low,
        acceleration=model.max_acceleration,
        wheelbase=model.wheelbase,
        steering_rate=model.max_steering_rate,
        lateral=lateral_limit(model),
    )

    def guess(plan: Plan, first: Array, last: Array) -> Guess:
        run = timed(plan, pace)
        return _second_order(run, run.steering, model.max_steering_rate, model.control_limits)

    return PathGuesses(_libraries_of_car(model, pace), pace, guess)


@path_guesses.register
def _of_unicycle(model: SecondOrderUnicycle) -> PathGuesses:
    low, high = model.reduced_limits[0]
    most = model.max_angular_acceleration
    pace = PathLimits(
        speed=high,
        reverse_speed=-low,
        acceleration=model.max_acceleration,
        turn_rate=model.max_turn_rate,
        angular_acceleration=most,
    )

    def guess(plan: Plan, first: Array, last: Array) -> Guess:
        run = timed(plan, pace)
        return _second_order(run, run.twist[:, 2], most, model.control_limits)

    libraries = [
        unicycle_library(
            max_speed=model.max_speed,
            max_turn_rate=model.max_turn_rate,
            share=turn,
            reverses=pace.reverse_speed > 0.0,
        )
        for turn in (1.0, LESS)
    ]
    return PathGuesses(libraries, pace, guess)


@path_guesses.register
def _of_trailer(model: CarWithTrailer) -> PathGuesses:
    """The car alone, which turns no tighter than its trailer can follow for long.

    Source: the hitch stands still where ``tan(steering) / wheelbase = sin(hitch) / hitch_length``.
    """
    hitch = min(float(model.reduced_limits[0, 1]), ALONG)
    followed = math.sin(hitch) / model.hitch_length * model.wheelbase
    low, high = model.control_limits[0]
    pace = PathLimits(
        speed=high,
        reverse_speed=-low,
        acceleration=math.inf,
        wheelbase=model.wheelbase,
        lateral=lateral_limit(model),
    )

    def guess(plan: Plan, first: Array, last: Array) -> Guess:
        run = timed(plan, pace)
        at = _nodes(run)
        middle = 0.5 * (at[1:] + at[:-1])
        driven = [np.interp(middle, run.time, column) for column in (run.twist[:, 0], run.steering)]
        control = np.clip(np.column_stack(driven), *model.control_limits.T)
        hitch = _hitched(model, control, at[1], (float(first[0]), float(last[0])))
        return Guess(
            state=np.column_stack([_at(run, at), hitch]), control=control, duration=run.duration
        )

    share = min(followed / math.tan(model.max_steering), 1.0)
    return PathGuesses(_libraries_of_car(model, pace, share), pace, guess)
