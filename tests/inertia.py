"""Vehicles with inertia that several tests drive, and small automata of theirs."""

from __future__ import annotations

import functools
import itertools

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.models import (
    CarWithTrailer,
    Helicopter,
    Hovercraft,
    Model,
    SecondOrderCar,
    SecondOrderUnicycle,
)
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import drive_all

STATES = ((0.0, 0.0), (1.0, 0.0), (0.8, 0.8), (0.8, -0.8), (-0.6, 0.0))
CAR = SecondOrderCar(
    wheelbase=2.8,
    max_steering=0.75,
    max_speed=2.5,
    max_acceleration=1.0,
    max_steering_rate=0.5,
)
ROBOT = SecondOrderUnicycle(
    max_speed=0.5, max_turn_rate=0.5, max_acceleration=0.25, max_angular_acceleration=0.25
)
TRAILER = CarWithTrailer(wheelbase=0.25, hitch_length=0.5, max_steering=1.0, max_speed=0.5)
HOVERCRAFT = Hovercraft(
    mass=2.0, inertia=0.1, drag=1.0, lateral_drag=3.0, turn_drag=0.1, max_force=4.0, max_torque=0.2
)
HELICOPTER = Helicopter(
    max_speed=10.0,
    max_lateral_speed=3.0,
    max_climb=3.0,
    max_turn_rate=1.0,
    max_tilt=0.6,
    max_tilt_rate=1.5,
    max_climb_acceleration=3.0,
    max_angular_acceleration=2.0,
    drag=0.1,
)


def rest_of(model) -> Trim:
    """The trim that stands still with nothing turned."""
    return Trim(
        name="rest",
        body_velocity=np.zeros(model.group.dof),
        control=np.zeros(len(model.control_names)),
        reduced_state=np.zeros(len(model.reduced_names)),
    )


def resting(model) -> Automaton:
    """An automaton of nothing but rest: enough to stop and steer."""
    return Automaton(model, (rest_of(model),))


@functools.cache
def unicycle_automaton(states: tuple[tuple[float, float], ...] = STATES) -> Automaton:
    """Trims [speed, turn rate] of the second-order unicycle, and a maneuver between every two."""
    model = SecondOrderUnicycle(
        max_speed=1.0, max_turn_rate=1.0, max_acceleration=1.0, max_angular_acceleration=2.0
    )
    return _joined(model, states, lambda z: [z[0], 0.0, z[1]])


@functools.cache
def car_automaton(speeds=(2.0, 1.0, -1.0), steering=(-0.6, 0.0, 0.6)) -> Automaton:
    """Trims [speed, steering] of the second-order car, rest among them."""
    states = ((0.0, 0.0), *itertools.product(speeds, steering))
    return _joined(CAR, states, lambda z: [z[0], 0.0, z[0] * np.tan(z[1]) / 2.8])


def _joined(model: Model, states, twist) -> Automaton:
    """Trims of reduced states, and the fastest ramp of every component between every two."""
    names = ["rest" if not any(z) else f"{z[0]:g}, {z[1]:g}" for z in states]
    trims = tuple(
        Trim(name=name, body_velocity=twist(z), control=[0.0, 0.0], reduced_state=z)
        for name, z in zip(names, states, strict=True)
    )
    pairs = list(itertools.permutations(trims, 2))
    rates = np.asarray(model.control_limits)[:, 1]
    control, durations = [], []
    for a, b in pairs:
        change = b.reduced_state - a.reduced_state
        times = np.abs(change) / rates
        first, last = times.min(), times.max()
        both = np.sign(change) * rates
        control.append([both, np.where(times > first, both, 0.0)])
        durations.append([first, last - first])
    courses = drive_all(
        model,
        [a.reduced_state for a, _ in pairs],
        control=np.array(control),
        durations=np.array(durations),
    )
    maneuvers = tuple(
        Maneuver(
            name=f"{a.name} to {b.name}",
            source=a.name,
            target=b.name,
            displacement=course.pose[-1],
            duration=float(course.time[-1]),
            course=course,
        )
        for (a, b), course in zip(pairs, courses, strict=True)
    )
    return Automaton(model, trims, maneuvers)
