"""Left and right: found where they are alike, denied where they are not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from maneuver_automaton.groups import SE2
from maneuver_automaton.models import (
    Car,
    SingleTrack,
    Unicycle,
    UserModel,
)
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.primitives.symmetry import mirror_of
from tests.inertia import HELICOPTER
from tests.inertia import HOVERCRAFT as CRAFT

SIGNS = [
    (Unicycle(), [], [1, -1]),
    (Car(wheelbase=2.0), [], [1, -1]),
    (CRAFT, [1, -1, -1], [1, -1]),
    (SingleTrack(), [1, -1, -1, -1], [1, -1]),
    (HELICOPTER, [1, -1, 1, -1, 1, -1], [1, -1, 1, -1]),
]


@pytest.mark.parametrize(
    ("model", "reduced", "control"), SIGNS, ids=lambda x: getattr(x, "name", "")
)
def test_stock_vehicles(model, reduced, control):
    mirror = mirror_of(model)
    assert mirror.reduced.tolist() == reduced
    assert mirror.control.tolist() == np.diag(control).tolist()


def two_tracks(**changes):
    """Two chains, left and right: the mirror exchanges them."""
    return UserModel(
        name="tracks", group=SE2, control_names=("left", "right"), reduced_names=("speed",),
        velocity=lambda z, u: [z[0], 0.0, u[1] - u[0]], dynamics=lambda z, u: [u[0] + u[1] - z[0]],
        **{"control_limits": [[-1.0, 1.0], [-1.0, 1.0]], **changes},
    )  # fmt: skip


def test_two_controls_may_change_places():
    mirror = mirror_of(two_tracks())
    assert mirror.control.tolist() == [[0, 1], [1, 0]]
    assert mirror.reduced.tolist() == [1]


def wheels(**changes):
    """Two wheels with a speed each: the mirror exchanges the speeds, and what drives them."""
    return UserModel(
        name="wheels", group=SE2, control_names=("left", "right"),
        reduced_names=("left_speed", "right_speed"),
        velocity=lambda z, u: [0.5 * (z[0] + z[1]), 0.0, z[1] - z[0]],
        dynamics=lambda z, u: [u[0] - z[0] * abs(z[0]), u[1] - z[1] * abs(z[1])],
        **{"control_limits": [-1.0, 1.0], "reduced_limits": [0.0, 2.0], **changes},
    )  # fmt: skip


def test_components_of_the_reduced_state_may_change_places():
    mirror = mirror_of(wheels())
    assert mirror.control.tolist() == [[0, 1], [1, 0]]
    np.testing.assert_array_equal(mirror.state(np.array([[1.0, 2.0]])), [[2.0, 1.0]])
    model, state, control = wheels(), np.array([0.3, 1.2]), np.array([0.7, -0.4])
    there = mirror.state(state), mirror.control @ control
    signs = np.array([1.0, -1.0, -1.0])
    np.testing.assert_allclose(
        model.body_velocity(*there), signs * model.body_velocity(state, control), atol=1e-15
    )
    np.testing.assert_allclose(
        model.reduced_dynamics(*there),
        mirror.state(model.reduced_dynamics(state, control)),
        atol=1e-15,
    )


def test_two_pairs_of_controls_may_change_places():
    thrusters = UserModel(
        name="thrusters", group=SE2, control_names=("fl", "fr", "rl", "rr"),
        reduced_names=("u", "v", "r"), control_limits=[0.0, 1.0],
        velocity=lambda z, u: [z[0], z[1], z[2]],
        dynamics=lambda z, u: [
            u[0] + u[1] - u[2] - u[3] - z[0], u[0] - u[1] + u[2] - u[3] - z[1],
            0.5 * (u[1] - u[0]) + 0.3 * (u[2] - u[3]) - z[2],
        ],
    )  # fmt: skip
    mirror = mirror_of(thrusters)
    assert mirror.reduced.tolist() == [1, -1, -1]
    exchanged = [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]]
    assert mirror.control.tolist() == exchanged


def test_limits_that_differ_by_rounding_are_alike():
    steering = [-0.1 - 0.2, 0.3]
    assert steering[0] != -steering[1]
    model = UserModel(
        name="skate", group=SE2, control_names=("speed", "steering"),
        velocity=lambda z, u: [u[0], 0.0, u[0] * np.tan(u[1])],
        control_limits=[[0.0, 1.0], steering],
    )  # fmt: skip
    assert mirror_of(model).control.tolist() == [[1, 0], [0, -1]]


@pytest.mark.parametrize(
    "model",
    [
        two_tracks(control_limits=[[-1.0, 1.0], [-1.0, 2.0]]),
        dataclasses.replace(two_tracks(), velocity=lambda z, u: [z[0], 0.01 * z[0], u[1] - u[0]]),
        dataclasses.replace(two_tracks(), dynamics=lambda z, u: [u[0] + 1.1 * u[1] - z[0]]),
        wheels(reduced_limits=[[0.0, 2.0], [0.0, 1.9]]),
    ],
    ids=["limits", "velocity", "dynamics", "wheels"],
)
def test_a_lopsided_vehicle_has_none(model):
    assert mirror_of(model) is None


def test_the_image_of_a_drive_is_the_drive_of_the_image():
    mirror = mirror_of(CRAFT)
    control = np.array([[3.0, 0.1], [-1.0, 0.2], [2.0, -0.1]])
    start = np.array([1.0, 0.3, -0.2])
    course = drive(CRAFT, start, control=control, durations=[0.3, 0.4, 0.5])
    there = drive(
        CRAFT, start * mirror.reduced, control=control @ mirror.control.T, durations=[0.3, 0.4, 0.5]
    )
    maneuver = Maneuver(
        name="a", source="s", target="t", displacement=course.pose[-1],
        duration=float(course.time[-1]), course=course,
    )  # fmt: skip
    image = mirror.maneuver(maneuver, source="s'", target="t'")
    assert (image.source, image.target) == ("s'", "t'")
    assert image.displacement == pytest.approx(there.pose[-1], abs=1e-13)
    assert image.course.pose == pytest.approx(there.pose, abs=1e-13)
    assert image.course.reduced_state == pytest.approx(there.reduced_state, abs=1e-13)
    assert image.course.control == pytest.approx(there.control)


def test_which_trims_are_images():
    mirror = mirror_of(Unicycle())
    left = Trim(name="left", body_velocity=[1, 0, 1], control=[1, 1])
    right = Trim(name="right", body_velocity=[1, 0, -1], control=[1, -1])
    assert mirror.takes(left, right)
    assert not mirror.takes(left, left)
