"""Vehicles that translations alone move, with the pose of the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.analysis import Region, check_vector_field
from maneuver_automaton.groups import SE2, translations
from maneuver_automaton.models import UserModel, as_stated, in_world, vector_field
from maneuver_automaton.models.speeds import greatest_speed

RIVER = UserModel(
    name="boat",
    group=translations(2),
    control_names=("speed", "turn_rate"),
    reduced_names=("push", "heading"),
    velocity=lambda z, u: [(u[0] + z[0]) * np.cos(z[1]) + 0.3, (u[0] + z[0]) * np.sin(z[1]) - 0.1],
    dynamics=lambda z, u: [u[0] - z[0], u[1]],
)
NUMBERS = st.floats(-3.0, 3.0)


@given(heading=NUMBERS, push=NUMBERS, speed=NUMBERS, turn_rate=NUMBERS, far=NUMBERS)
def test_it_moves_as_it_is_stated(heading, push, speed, turn_rate, far):
    boat, control = in_world(RIVER), np.array([speed, turn_rate])
    stated = np.array([far, -far, push, heading])
    seen = np.concatenate([[far, -far, heading], boat.seen(stated[2:])])
    rates, expected = vector_field(boat)(seen, control), vector_field(RIVER)(stated, control)
    np.testing.assert_allclose(rates[:2], expected[:2], atol=1e-12)
    assert rates[2] == expected[3]
    np.testing.assert_allclose(rates[3], expected[2], atol=1e-12)
    slope = [-np.sin(heading) * turn_rate, np.cos(heading) * turn_rate]
    np.testing.assert_allclose(rates[4:], slope, atol=1e-12)


def test_it_is_as_fast_as_it_is_stated():
    """1 m/s at most through the water, and 0.3 and 0.1 m/s with it."""
    limits = {"control_limits": np.array([[0.0, 0.6], [-1, 1]])}
    limits["reduced_limits"] = np.array([[0.0, 0.4], [-np.inf, np.inf]])
    boat = replace(RIVER, **limits)
    assert greatest_speed(in_world(boat)) == pytest.approx(np.hypot(1.3, 1.1))
    lift = replace(boat, group=translations(3), velocity=lambda z, u: [0.0, u[0], 5.0 * u[0]])
    assert greatest_speed(in_world(lift)) == pytest.approx(np.hypot(0.6, 3.0))
    assert greatest_speed(in_world(lift), axes=(3,)) == pytest.approx(3.0)


def test_its_components_are_those_of_its_arrays():
    boat = in_world(RIVER)
    rows, control = boat.seen(np.array([[0.5, 2.0], [0.1, -3.0]])), np.array([0.7, 0.2])
    for z, twist, rates in zip(
        rows,
        boat.body_velocity(rows, control),
        boat.reduced_dynamics(rows, control),
        strict=True,
    ):
        np.testing.assert_allclose(boat.velocity(z, control), twist, atol=1e-15)
        np.testing.assert_allclose(boat.dynamics(z, control), rates, atol=1e-15)


def test_in_space_the_altitude_comes_last():
    drone = UserModel(
        name="crane",
        group=translations(3),
        control_names=("v_x", "v_y", "v_z"),
        velocity=lambda z, u: [u[0], u[1], u[2]],
    )
    twist = in_world(drone).body_velocity(np.zeros(0), np.array([1.0, 2.0, 3.0]))
    assert twist.tolist() == [1.0, 2.0, 0.0, 3.0]


def test_a_vehicle_that_rotations_move_stays_as_it_is():
    skate = UserModel(
        name="skate", group=SE2, control_names=("speed",), velocity=lambda z, u: [u[0], 0, 0]
    )
    assert in_world(skate) is skate
    assert as_stated(in_world(RIVER)) is RIVER


def test_the_heading_is_what_a_current_breaks():
    def boat(x, u):
        return [u[0] * np.cos(x[2]) + 0.3, u[0] * np.sin(x[2]), u[1]]

    report = check_vector_field(boat, region=Region.of(SE2, n_controls=2))
    assert report.broken == ("rotation",)
    assert "depends on the heading" in report.message
    assert "in a steady wind or current" in report.message
    assert check_vector_field(RIVER).holds


@pytest.mark.parametrize("heading", [0.0, np.pi / 2, np.pi, -2.0])
def test_a_heading_is_found_again(heading):
    boat = in_world(RIVER)
    assert boat.heading(boat.seen(np.array([0.3, heading]))) == pytest.approx(heading, abs=1e-15)
