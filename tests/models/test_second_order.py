"""Vehicles with inertia by hand: numbers that one can check on paper."""

from __future__ import annotations

import math

import numpy as np
import pytest

from maneuver_automaton.groups import SE2
from maneuver_automaton.models import (
    CarWithTrailer,
    Helicopter,
    Hovercraft,
    SecondOrderCar,
    SecondOrderUnicycle,
    SingleTrack,
    rollout,
)

UNICYCLE = {
    "max_speed": 0.5,
    "max_turn_rate": 0.6,
    "max_acceleration": 0.25,
    "max_angular_acceleration": 0.3,
}
CAR = {
    "wheelbase": 2.0,
    "max_steering": math.pi / 4,
    "max_speed": 2.5,
    "max_acceleration": 1.0,
    "max_steering_rate": 0.5,
}
TRAILER = {"wheelbase": 0.25, "hitch_length": 0.5, "max_steering": 1.0, "max_speed": 0.5}
HOVERCRAFT = {
    "mass": 2.0,
    "inertia": 0.1,
    "drag": 1.0,
    "lateral_drag": 3.0,
    "turn_drag": 0.1,
    "max_force": 4.0,
    "max_torque": 0.2,
}
HELICOPTER = {
    "max_speed": 10.0,
    "max_lateral_speed": 3.0,
    "max_climb": 3.0,
    "max_turn_rate": 1.0,
    "max_tilt": 0.6,
    "max_tilt_rate": 1.5,
    "max_climb_acceleration": 3.0,
    "max_angular_acceleration": 2.0,
}


def test_braking_distance_is_half_of_speed_squared_over_acceleration():
    robot = SecondOrderUnicycle(**UNICYCLE)
    end = rollout(robot, [0, 0, 0, 0.5, 0.0], control=[-0.25, 0.0], times=[0.0, 2.0])[-1]
    np.testing.assert_allclose(end, [0.5, 0.0, 0.0, 0.0, 0.0], atol=1e-9)


def test_car_drives_the_circle_of_its_steering_angle():
    car = SecondOrderCar(**CAR)
    assert car.turning_radius == pytest.approx(2.0)
    start = [0, 0, 0, 1.0, math.pi / 4]
    half = rollout(car, start, control=[0.0, 0.0], times=[0.0, 2.0 * math.pi])[-1]
    np.testing.assert_allclose(half[:3], [0.0, 4.0, math.pi], atol=1e-7)


def test_trailer_straightens_ahead_and_jackknifes_in_reverse():
    truck = CarWithTrailer(**TRAILER)
    ahead = rollout(truck, [0, 0, 0, 0.1], control=[0.5, 0.0], times=[0.0, 3.0])[-1]
    assert ahead[3] == pytest.approx(2.0 * math.atan(math.tan(0.05) * math.exp(-3.0)))
    back = rollout(truck, [0, 0, 0, 0.1], control=[-0.5, 0.0], times=[0.0, 3.0])[-1]
    assert back[3] == pytest.approx(2.0 * math.atan(math.tan(0.05) * math.exp(3.0)))


def test_trailer_axle_is_pulled_by_the_hitch_and_rolls_without_slip():
    truck = CarWithTrailer(**TRAILER)
    assert truck.part_names == ("trailer",)
    states = rollout(
        truck, [1, 2, 0.5, 0.7], control=[0.5, 0.4], times=np.linspace(0, 1, 2001), rtol=1e-12
    )
    axle = (SE2(states[:, :3]) @ SE2(truck.part_poses(states[:, 3:])[:, 0])).pose
    hitch = states[:, :2] - axle[:, :2]
    np.testing.assert_allclose(np.linalg.norm(hitch, axis=1), 0.5, atol=1e-12)
    np.testing.assert_allclose(np.arctan2(hitch[:, 1], hitch[:, 0]), axle[:, 2], atol=1e-12)
    step = np.diff(axle[:, :2], axis=0)
    middle = (axle[1:, 2] + axle[:-1, 2]) / 2.0
    sideways = -np.sin(middle) * step[:, 0] + np.cos(middle) * step[:, 1]
    assert np.abs(sideways).max() < 1e-9


def test_single_track_steady_turn_by_the_understeer_equation():
    # r = v steering / (L + K v^2) with K = m (lr / Cf - lf / Cr) / L and C = mu C_S F_z: as both
    # axles have the same C_S, Cf / Cr = lr / lf and K is zero: this car steers neutrally.
    car = SingleTrack()
    speed, steering = 20.0, 0.01
    turn = speed * steering / car.wheelbase
    stiffness = car.friction * car.cornering * 9.81 / car.wheelbase  # over the distance to an axle
    slip_rear = speed * turn / (car.wheelbase * stiffness)
    aside = car.rear * turn - slip_rear * speed
    rates = car.dynamics([speed, aside, turn, steering], [0.0, 0.0])
    np.testing.assert_allclose(rates, 0.0, atol=1e-12)


def test_single_track_parameters_are_those_published():
    car = SingleTrack()
    assert (car.mass, car.inertia, car.front, car.rear) == (
        1093.2952,
        1791.5995,
        1.1561957,
        1.422717,
    )
    assert car.wheelbase == pytest.approx(2.5789127)
    assert car.reduced_limits[0].tolist() == [5.0, 50.8]
    assert car.control_limits.tolist() == [[-11.5, 11.5], [-0.4, 0.4]]


def test_hovercraft_drifts_out_of_the_curve():
    craft = Hovercraft(**HOVERCRAFT)
    # in a steady left turn: lateral speed -m r v / d_y, so to the right, out of the curve
    aside = -2.0 * 0.5 * 1.2 / 3.0
    force = 1.0 * 1.2 - 2.0 * 0.5 * aside
    rates = craft.dynamics([1.2, aside, 0.5], [force, 0.05])
    np.testing.assert_allclose(rates, 0.0, atol=1e-15)


def test_helicopter_banks_like_a_pendulum_and_climbs():
    craft = Helicopter(**HELICOPTER, drag=0.2)
    tilt, lateral_tilt = math.atan(0.2 * 5.0 / 9.81), math.atan(0.8 * 5.0 / 9.81)
    z = [5.0, 0.0, 2.0, 0.8, tilt, lateral_tilt]
    np.testing.assert_allclose(craft.dynamics(z, [0.0] * 4), 0.0, atol=1e-14)
    assert craft.velocity(z, [0.0] * 4) == (5.0, 0.0, 0.8, 2.0)
    start = np.concatenate([np.zeros(4), z])
    turned = rollout(craft, start, control=[0.0] * 4, times=[0.0, math.pi / 0.8], rtol=1e-11)[-1]
    np.testing.assert_allclose(turned[:4], [0.0, 12.5, math.pi, 2.0 * math.pi / 0.8], atol=1e-7)


@pytest.mark.parametrize(
    ("model", "reduced", "control"),
    [
        (SecondOrderUnicycle(**UNICYCLE), [[-0.5, 0.5], [-0.6, 0.6]], [[-0.25, 0.25], [-0.3, 0.3]]),
        (
            SecondOrderUnicycle(**UNICYCLE, min_speed=0.0),
            [[0.0, 0.5], [-0.6, 0.6]],
            [[-0.25, 0.25], [-0.3, 0.3]],
        ),
        (
            SecondOrderCar(**CAR, min_speed=-1.0),
            [[-1.0, 2.5], [-math.pi / 4, math.pi / 4]],
            [[-1.0, 1.0], [-0.5, 0.5]],
        ),
        (
            CarWithTrailer(**TRAILER, max_hitch=0.8, min_speed=-0.1),
            [[-0.8, 0.8]],
            [[-0.1, 0.5], [-1.0, 1.0]],
        ),
        (
            Hovercraft(**HOVERCRAFT, min_force=-1.0, max_speed=3.0),
            [[-3.0, 3.0], [-math.inf, math.inf], [-math.inf, math.inf]],
            [[-1.0, 4.0], [-0.2, 0.2]],
        ),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_limits(model, reduced, control):
    assert model.reduced_limits.tolist() == reduced
    assert model.control_limits.tolist() == control


@pytest.mark.parametrize(
    ("make", "changes", "message"),
    [
        (SecondOrderUnicycle, UNICYCLE | {"max_speed": 0.0}, "max_speed must be positive, got 0.0"),
        (
            SecondOrderUnicycle,
            UNICYCLE | {"min_speed": 0.5},
            "min_speed must be less than max_speed 0.5 m/s, got 0.5 m/s",
        ),
        (
            SecondOrderCar,
            CAR | {"max_steering": 1.6},
            "max_steering must be less than pi / 2, got 1.6 rad",
        ),
        (CarWithTrailer, TRAILER | {"max_hitch": -1.0}, "max_hitch must be positive, got -1.0"),
        (SingleTrack, {"min_speed": 0.0}, "min_speed must be positive, got 0.0"),
        (SingleTrack, {"mass": math.nan}, "mass must be positive, got nan"),
        (
            Hovercraft,
            HOVERCRAFT | {"min_force": 5.0},
            "min_force must be less than max_force 4.0 N, got 5.0 N",
        ),
        (
            Helicopter,
            HELICOPTER | {"max_climb_acceleration": 10.0},
            "max_climb_acceleration must be less than gravity 9.81 m/s^2, got 10.0 m/s^2",
        ),
        (Helicopter, HELICOPTER | {"drag": -1.0}, "drag must not be negative, got -1.0 1/s"),
        (
            Helicopter,
            HELICOPTER | {"max_tilt": 1.6},
            "max_tilt must be less than pi / 2, got 1.6 rad",
        ),
    ],
)
def test_wrong_parameters_are_named(make, changes, message):
    with pytest.raises(ValueError) as error:
        make(**changes)
    assert str(error.value) == f"{make.name}: {message}"
