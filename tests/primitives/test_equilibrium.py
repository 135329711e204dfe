"""Trims found from the model: steady to the solver, and what cannot be reached is named."""

from __future__ import annotations

import math

import numpy as np
import pytest

from maneuver_automaton.groups import SE2
from maneuver_automaton.models import (
    SingleTrack,
    Unicycle,
    UserModel,
    rollout,
)
from maneuver_automaton.primitives import trims_of
from tests.inertia import CAR, HELICOPTER, HOVERCRAFT, ROBOT
from tests.inertia import TRAILER as TRUCK

TURNS = np.linspace(-0.4, 0.4, 5)
GRIDS = {
    "unicycle": (Unicycle(max_speed=2.0), {"speed": [-1, 0, 2], "turn_rate": TURNS}, 15),
    "second-order unicycle": (
        ROBOT,
        {"speed": [-0.5, 0.0, 0.5], "turn_rate": [-0.5, 0.0, 0.5]},
        9,
    ),
    "second-order car": (CAR, {"speed": [-2.5, 0, 2.5], "steering": [-0.75, 0.0, 0.75]}, 9),
    "second-order car, turn rates": (CAR, {"speed": [-2.5, 2.5], "turn_rate": TURNS}, 10),
    "car with trailer": (TRUCK, {"speed": [-0.5, 0.0, 0.5], "steering": [-0.4, 0.0, 0.4]}, 9),
    "single track": (SingleTrack(), {"speed": [5, 10, 20, 30], "turn_rate": TURNS}, 20),
    "single track, steering": (SingleTrack(), {"speed": [5, 20], "steering": [-0.1, 0, 0.1]}, 6),
    "hovercraft": (HOVERCRAFT, {"speed": [-1, 0, 1, 2], "turn_rate": TURNS}, 20),
    "helicopter": (
        HELICOPTER,
        {"speed": [0.0, 5.0, 10.0], "turn_rate": TURNS, "climb": [-2.0, 0.0, 2.0]},
        45,
    ),
}


@pytest.mark.parametrize("case", GRIDS)
def test_trims_are_steady_to_the_solver(case):
    model, grid, count = GRIDS[case]
    found = trims_of(model, grid)
    assert (len(found.trims), found.missing) == (count, ())
    for trim in found.trims:
        rates = model.reduced_dynamics(trim.reduced_state, trim.control)
        assert np.abs(rates).max(initial=0.0) < 1e-12
    for trim in found.trims[:: max(1, count // 4)]:
        start = np.concatenate([np.zeros(model.group.dof), trim.reduced_state])
        times = np.array([0.0, 2.0])  # the end is the solver's, what lies between is interpolated
        states = rollout(model, start, control=trim.control, times=times, rtol=1e-10, atol=1e-10)
        coasted = trim.coast(model.group.identity(), times).pose
        np.testing.assert_allclose(states[:, : model.group.dof], coasted, rtol=0, atol=1e-8)
        np.testing.assert_allclose(
            states[:, model.group.dof :], np.tile(trim.reduced_state, (2, 1)), rtol=0, atol=1e-8
        )


def test_names_and_twists_tell_what_was_asked_for():
    found = trims_of(HELICOPTER, {"speed": [2.5], "turn_rate": [-0.4], "climb": [1.0]})
    assert found.trims[0].name == "speed 2.5, turn_rate -0.4, climb 1"
    assert found.trims[0].body_velocity.tolist() == [2.5, 0.0, -0.4, 1.0]
    assert found.trims[0].reduced_state[5] == pytest.approx(math.atan(-0.4 * 2.5 / 9.81))


def test_rests_stand_still_exactly():
    for model in (CAR, TRUCK, HOVERCRAFT, HELICOPTER):
        (rest,) = trims_of(model, {"speed": [0.0], "turn_rate": [0.0]}).trims
        assert rest.is_rest
        assert not rest.control.any()
        assert not rest.reduced_state.any()


def test_trailer_follows_on_its_own_circle():
    (trim,) = trims_of(TRUCK, {"speed": [0.5], "turn_rate": [0.5]}).trims
    # the car on a circle of radius 1 m: the trailer's axle on one of sqrt(1 - 0.25) m
    assert math.sin(trim.reduced_state[0]) == pytest.approx(0.5)
    assert trim.control[1] == pytest.approx(math.atan(0.25))


@pytest.mark.parametrize(
    ("model", "point", "reason"),
    [
        (
            CAR,
            {"speed": 2.5, "turn_rate": 1.0},
            "steering would be 0.8419, 0.09194 beyond its limit 0.7500",
        ),
        (
            CAR,
            {"speed": 3.0, "steering": 0.0},
            "speed would be 3.0000, 0.5 beyond its limit 2.5000",
        ),
        (
            CAR,
            {"speed": 3.0, "steering": -1.0},
            "speed would be 3.0000, 0.5 beyond its limit 2.5000; "
            "steering would be -1.0000, 0.25 beyond its limit -0.7500",
        ),
        (
            CAR,
            {"speed": 0.0, "turn_rate": 0.5},
            "no steady motion: turn_rate stays off by 0.5",
        ),
        (
            SingleTrack(),
            {"speed": 3.0, "turn_rate": 0.1},
            "speed would be 3.0000, 2 beyond its limit 5.0000",
        ),
        (
            HOVERCRAFT,
            {"speed": 3.0, "turn_rate": 1.0},
            "force would be 7.0000, 3 beyond its limit 4.0000",
        ),
        (
            TRUCK,
            {"speed": 0.5, "steering": 1.0},
            "no steady motion: the rate of hitch stays off by 2.115",
        ),
    ],
)
def test_what_is_out_of_reach_is_named(model, point, reason):
    found = trims_of(model, {name: [value] for name, value in point.items()})
    assert found.trims == ()
    assert [missing.reason for missing in found.missing] == [reason]


def test_grip_is_a_limit_of_its_own():
    grid = {"speed": [20.0], "turn_rate": [0.2, 0.4]}
    found = trims_of(SingleTrack(), grid, max_lateral_acceleration=5.0)
    assert [trim.name for trim in found.trims] == ["speed 20, turn_rate 0.2"]
    (missing,) = found.missing
    assert missing.name == "speed 20, turn_rate 0.4"
    assert missing.reason.startswith("the lateral acceleration would be 8")


def test_a_users_model_has_trims_too():
    boat = UserModel(
        name="boat",
        group=SE2,
        control_names=("push", "rudder"),
        reduced_names=("speed", "turn_rate"),
        velocity=lambda z, u: [z[0], 0.0, z[1]],
        dynamics=lambda z, u: [u[0] - z[0] * abs(z[0]), z[0] * u[1] - z[1]],
        control_limits=[[-4.0, 4.0], [-0.5, 0.5]],
    )
    found = trims_of(boat, {"speed": [1.0, 2.0, 3.0], "turn_rate": [0.0, 0.8]})
    assert [trim.control.tolist() for trim in found.trims] == [[1.0, 0.0], [4.0, 0.0], [4.0, 0.4]]
    assert "rudder would be 0.8000, 0.3 beyond its limit 0.5000" in found.missing[0].reason
    assert "push would be 9.0000, 5 beyond its limit 4.0000" in found.missing[1].reason


def test_a_mirrored_point_has_the_mirrored_trim():
    for model, aside in ((SingleTrack(), (1, 2, 3)), (HOVERCRAFT, (1, 2))):
        left, right = trims_of(
            model,
            {"speed": [10.0 if model.name == "single_track" else 1.0], "turn_rate": [0.3, -0.3]},
        ).trims
        mirrored = np.array(left.reduced_state)
        mirrored[list(aside)] *= -1.0
        np.testing.assert_allclose(right.reduced_state, mirrored, atol=1e-13)


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        (
            {},
            "grid: got no axis, need some of speed, steering, acceleration, steering_rate, "
            "lateral_speed, turn_rate",
        ),
        ({"speed": []}, "grid: got no value of speed, need at least one"),
        (
            {"climb": [0.0]},
            "grid: the second_order_car has no 'climb', need speed, steering, "
            "acceleration, steering_rate, lateral_speed, turn_rate",
        ),
        ({"speed": [math.nan]}, "grid: speed: got nan, need finite numbers"),
    ],
)
def test_wrong_grids_are_named(grid, message):
    with pytest.raises(ValueError) as error:
        trims_of(CAR, grid)
    assert str(error.value) == message
