"""Trims: what coasting is, by law and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.primitives import Trim
from tests.compare import assert_same_motion

GROUPS = [SE2, SE2xR]
EVERYDAY = st.floats(-3.0, 3.0) | st.floats(-1e-7, 1e-7)
SECONDS = st.floats(0.0, 5.0)


def trim(**changes):
    values = {"name": "turn", "body_velocity": [1.0, 0.0, 0.5], "control": [1.0, 0.5]}
    return Trim(**(values | changes))


@pytest.mark.parametrize("group", GROUPS)
@given(data=st.data())
def test_coasting_twice_is_coasting_for_the_sum(group, data):
    vectors = arrays(np.float64, group.dof, elements=EVERYDAY)
    one = trim(body_velocity=data.draw(vectors))
    start, s, t = group(data.draw(vectors)), data.draw(SECONDS), data.draw(SECONDS)
    assert_same_motion(one.coast(one.coast(start, s), t), one.coast(start, s + t))


@pytest.mark.parametrize("group", GROUPS)
@given(data=st.data())
def test_a_moved_start_has_the_moved_motion(group, data):
    vectors = arrays(np.float64, group.dof, elements=EVERYDAY)
    one = trim(body_velocity=data.draw(vectors))
    start, by, t = group(data.draw(vectors)), group(data.draw(vectors)), data.draw(SECONDS)
    assert_same_motion(one.coast(by @ start, t), by @ one.coast(start, t))


def test_durations_may_be_a_batch():
    one, start = trim(), SE2([1.0, 2.0, 0.3])
    times = np.array([[0.0, 1.0], [2.0, 7.5]])
    batch = one.coast(start, times)
    assert batch.pose.shape == (2, 2, 3)
    for index in np.ndindex(times.shape):
        np.testing.assert_array_equal(batch.pose[index], one.coast(start, times[index]).pose)
    np.testing.assert_array_equal(batch.pose[0, 0], start.pose)


def test_several_turns_are_counted():
    circle = trim(body_velocity=[2.0, 0.0, 1.0])
    end = circle.coast(SE2([0.0, 0.0, 0.0]), 6 * np.pi).pose
    np.testing.assert_allclose(end, [0.0, 0.0, 6 * np.pi], atol=1e-14)


@pytest.mark.parametrize(
    ("velocity", "rest"),
    [([0, 0, 0], True), ([0, 0, -0.0], True), ([0, 0, 0, 0], True), ([0, 0, 1e-300], False),
     ([0, 0, 0, 1], False), ([0, 1, 0], False)],
)  # fmt: skip
def test_rest_stands_still(velocity, rest):
    assert trim(body_velocity=velocity).is_rest is rest


def test_arrays_are_read_only_copies():
    velocity = np.array([1.0, 0.0, 0.0])
    one = trim(body_velocity=velocity)
    velocity[0] = 5.0
    assert one.body_velocity[0] == 1.0
    for array in (one.body_velocity, one.control):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 2.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"body_velocity": [1.0]},
         "body_velocity: got shape (1,), need 2 or 3 or 4 components last"),
        ({"body_velocity": [1.0, 0.0, math.nan]}, "body_velocity: got nan, need finite numbers"),
        ({"control": [math.inf]}, "control: got inf, need finite numbers"),
        ({"control": "fast"}, "control: got 'fast', need numbers"),
        ({"reduced_state": [math.nan]}, "reduced_state: got nan, need finite numbers"),
        ({"name": ""}, "trim: got the name '', need at least one visible character"),
        ({"name": " \t"}, "trim: got the name ' \\t', need at least one visible character"),
        ({"max_duration": 0.0}, "trim 'turn': max_duration must be positive, got 0.0 s"),
        ({"max_duration": -2.0}, "trim 'turn': max_duration must be positive, got -2.0 s"),
        ({"max_duration": math.nan}, "trim 'turn': max_duration must be positive, got nan s"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(changes, message):
    with pytest.raises(ValueError) as error:
        trim(**changes)
    assert str(error.value) == message
