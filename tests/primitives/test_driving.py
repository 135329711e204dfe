"""Driving under piecewise constant controls, against an ODE solver and the laws of groups."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.groups import SE2
from maneuver_automaton.models import (
    SingleTrack,
    Unicycle,
    UserModel,
    rollout,
)
from maneuver_automaton.primitives import drive, drive_all
from tests.inertia import CAR
from tests.models.test_laws import every_model, states_of, within


def solved(model, z, controls, durations):
    """States at every change of control, by DOP853."""
    states = [np.concatenate([np.zeros(model.group.dof), z])]
    for control, duration in zip(controls, durations, strict=True):
        states.append(
            rollout(
                model, states[-1], control=control, times=[0.0, duration], rtol=1e-12, atol=1e-12
            )[-1]
        )
    return np.array(states)


def ride_of(model, seed, n=6):
    """Reduced state, controls and durations that stay near the limits' middle."""
    rng = np.random.default_rng(seed)
    dof, n_z, n_u = model.group.dof, len(model.reduced_names), len(model.control_names)
    z = states_of(model, 0.5 * rng.uniform(-1, 1, dof + n_z))[dof:]
    controls = within(model.control_limits, rng.uniform(-1, 1, (n, n_u)))
    return z, controls, rng.uniform(0.05, 0.15, n)


@every_model
@pytest.mark.parametrize("seed", range(2))
def test_every_sample_is_where_the_solver_is(model, seed):
    z, controls, durations = ride_of(model, seed)
    course = drive(model, z, control=controls, durations=durations)
    expected = solved(model, z, controls, durations)
    at_switch = np.searchsorted(course.time, np.cumsum(durations) - 1e-9)
    got = np.concatenate([course.pose, course.reduced_state], axis=1)
    np.testing.assert_allclose(got[[0, *at_switch]], expected, rtol=1e-11, atol=1e-11)
    k = course.time.size // 2  # also between the changes
    begin = int(np.searchsorted(np.cumsum(durations), course.time[k], side="right"))
    since = course.time[k] - np.concatenate([[0.0], np.cumsum(durations)])[begin]
    if since > 1e-9:
        there = rollout(
            model,
            expected[begin],
            control=controls[begin],
            times=[0, since],
            rtol=1e-12,
            atol=1e-12,
        )[-1]
        np.testing.assert_allclose(got[k], there, rtol=1e-11, atol=1e-11)


@every_model
def test_samples_are_close_and_carry_their_controls(model):
    z, controls, durations = ride_of(model, 7)
    course = drive(
        model, z, control=controls, durations=durations, max_step_m=0.02, max_step_rad=0.01
    )
    step = np.diff(course.pose, axis=0)
    places = [k for k in range(model.group.dof) if k != 2]
    assert np.linalg.norm(step[:, places], axis=1).max() <= 0.02
    assert np.abs(step[:, 2]).max() <= 0.01
    assert (np.diff(course.time) > 0.0).all()
    changes = np.concatenate([[0.0], np.cumsum(durations)])
    inside = course.time[:-1] + 1e-9
    np.testing.assert_array_equal(
        course.control[:-1], controls[np.searchsorted(changes, inside, side="right") - 1]
    )
    np.testing.assert_array_equal(course.control[-1], controls[-1])


@pytest.mark.slow
@every_model
@settings(max_examples=5)
@given(cut=st.floats(0.1, 0.9))
def test_driving_on_is_driving_in_one_go(model, cut):
    z, controls, durations = ride_of(model, 3)
    whole = drive(model, z, control=controls, durations=durations)
    split = durations.copy()
    split[2] *= cut
    first = drive(model, z, control=controls[:3], durations=split[:3])
    rest = np.concatenate([[durations[2] - split[2]], durations[3:]])
    second = drive(model, first.reduced_state[-1], control=controls[2:], durations=rest)
    end = (model.group(first.pose[-1]) @ model.group(second.pose[-1])).pose
    np.testing.assert_allclose(end, whole.pose[-1], rtol=1e-12, atol=1e-12)


def test_rides_together_are_rides_alone():
    rng = np.random.default_rng(2)
    z = rng.uniform(-0.4, 0.4, (5, 2))
    controls, durations = rng.uniform(-0.3, 0.3, (5, 4, 2)), rng.uniform(0.1, 0.6, (5, 4))
    durations[1, 2:] = 0.0
    durations[3] = 0.0
    for k, course in enumerate(drive_all(CAR, z, control=controls, durations=durations)):
        alone = drive(CAR, z[k], control=controls[k], durations=durations[k])
        np.testing.assert_allclose(course.pose[-1], alone.pose[-1], atol=1e-14)
        np.testing.assert_allclose(course.time, alone.time, atol=1e-14)
        np.testing.assert_allclose(course.pose, alone.pose, atol=1e-13)
    still = drive(CAR, z[3], control=controls[3], durations=durations[3])
    assert still.time.tolist() == [0.0]
    assert still.control.shape == (1, 2)


def test_samples_are_equal_times_apart_while_a_control_holds():
    stiff = SingleTrack(min_speed=0.5)  # needs many elements where it is slow
    for z in ([1.0, 0.0, 0.0, 0.1], [30.0, 0.0, 0.0, 0.01]):
        course = drive(
            stiff,
            z,
            control=[[1.0, 0.1], [0.0, 0.0]],
            durations=[0.5, 0.7],
            max_step_m=9e9,
            max_step_rad=9e9,
        )
        assert course.time.tolist() == [0.0, 0.5, 1.2]
    course = drive(CAR, [0.0, 0.0], control=[[1.0, 0.0], [0.0, 0.5]], durations=[2.0, 1.0])
    slow, fast = course.time[course.time <= 2.0], course.time[course.time >= 2.0]
    np.testing.assert_allclose(np.diff(slow), 2.0 / (slow.size - 1), atol=1e-14)
    np.testing.assert_allclose(np.diff(fast), 1.0 / (fast.size - 1), atol=1e-14)


def test_headings_count_full_turns():
    spin = drive(Unicycle(), [], control=[[0.5, 1.0]], durations=[20.0])
    assert spin.pose[-1, 2] == pytest.approx(20.0, abs=1e-12)
    circle = SE2.exp([10.0, 0.0, 20.0]).pose
    np.testing.assert_allclose(spin.pose[-1], circle, atol=1e-13)


def test_steering_at_rest_goes_nowhere():
    course = drive(CAR, [0.0, -0.5], control=[[0.0, 0.5]], durations=[2.0])
    assert not course.pose.any()
    np.testing.assert_allclose(course.reduced_state[-1], [0.0, 0.5], atol=1e-15)


@pytest.mark.parametrize("speed", [8.0, 40.0])
def test_fast_relaxation_is_followed(speed):
    car = SingleTrack(min_speed=0.5)
    z, controls, durations = (
        np.array([speed, 0.0, 0.0, 0.05]),
        [[1.0, 0.1], [-0.2, -0.3]],
        [0.4, 0.7],
    )
    course = drive(car, z, control=controls, durations=durations)
    got = np.concatenate([course.pose[-1], course.reduced_state[-1]])
    np.testing.assert_allclose(got, solved(car, z, controls, durations)[-1], rtol=1e-10, atol=1e-10)


def test_functions_of_single_rows_serve():
    def velocity(z, u):
        return [max(z[0], 0.0), 0.0, u[1]]  # max: not for arrays

    cart = UserModel(
        name="cart",
        group=SE2,
        control_names=("push", "turn"),
        reduced_names=("speed",),
        velocity=velocity,
        dynamics=lambda z, u: [u[0] - z[0]],
    )
    course = drive(cart, [0.5], control=[[1.0, 0.3]], durations=[2.0])
    expected = solved(cart, [0.5], [[1.0, 0.3]], [2.0])[-1]
    np.testing.assert_allclose(course.pose[-1], expected[:3], atol=1e-10)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"durations": [-1.0]}, "drive: got -1 s, need durations of at least 0 s"),
        ({"durations": []}, "drive: got reduced states"),
        ({"control": np.zeros((0, 2)), "durations": []}, "drive: got no control, need durations"),
        ({"reduced_state": [1.0]}, "reduced state: got shape (1, 1), need 2 components last"),
        ({"control": [[np.nan, 0.0]]}, "control: got nan, need finite numbers"),
        ({"max_step_m": 0.0}, "drive: max_step_m must be positive, got 0.0"),
        (
            {"control": [[0.0, 1.0]], "durations": [4.0]},
            "second_order_car: the motion under control [0.0, 1.0] cannot be followed for 4 s",
        ),
    ],
)
def test_what_is_wrong_is_said(changes, message):
    values = {"reduced_state": [1.0, 0.0], "control": [[0.0, 0.0]], "durations": [1.0]} | changes
    with pytest.raises(ValueError) as error:
        drive(CAR, values.pop("reduced_state"), **values)
    assert str(error.value).startswith(message)
