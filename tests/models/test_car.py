"""The kinematic car by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from maneuver_automaton.models import Car, rollout


def test_rear_axle_drives_the_circle_of_the_steering_angle():
    # wheelbase 2 m, steering 45 degrees: a circle of radius 2 m around (0, 2)
    car = Car(wheelbase=2.0)
    half = rollout(car, np.zeros(3), control=[1.0, math.pi / 4], times=[0.0, 2.0 * math.pi])
    np.testing.assert_allclose(half[-1], [0.0, 4.0, math.pi], atol=1e-7)


def test_turning_radius():
    assert Car(wheelbase=2.0, max_steering=math.pi / 4).turning_radius == pytest.approx(2.0)
    assert Car(wheelbase=2.0).turning_radius == 0.0


def test_limits():
    car = Car(wheelbase=2.0, max_steering=0.6, max_speed=3.0)
    assert car.control_limits.tolist() == [[-3.0, 3.0], [-0.6, 0.6]]
    assert Car(wheelbase=2.0).control_limits[1].tolist() == [-math.pi / 2, math.pi / 2]


@pytest.mark.parametrize("wheelbase", [0.0, -1.0, math.nan, math.inf, 5e-324])
def test_wheelbase_must_be_a_length(wheelbase):
    message = "car: wheelbase must be (positive|finite|at least 1e-100), got"
    with pytest.raises(ValueError, match=message):
        Car(wheelbase=wheelbase)


def test_wheels_cannot_be_turned_across():
    with pytest.raises(ValueError, match=r"car: max_steering must be less than pi / 2, got 1\.6"):
        Car(wheelbase=2.0, max_steering=1.6)
    with pytest.raises(ValueError, match=r"car: steering must be less than pi / 2, got 1\.8 rad"):
        Car(wheelbase=2.0).body_velocity(np.zeros(0), np.array([[1.0, 0.2], [1.0, -1.8]]))
