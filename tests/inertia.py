"""Vehicles with inertia that several tests drive."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.models import CarWithTrailer, SecondOrderCar, SecondOrderUnicycle
from maneuver_automaton.primitives import Trim

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
