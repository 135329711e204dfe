"""Quickest maneuvers between trims, and strokes: exact in time and place."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.errors import NotATrim
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import (
    SecondOrderCar,
    SecondOrderUnicycle,
    SingleTrack,
    UserModel,
    rollout,
)
from maneuver_automaton.primitives import (
    Trim,
    bang_bang,
    connect_bang_bang,
    from_rest,
    trims_of,
)
from maneuver_automaton.primitives.closed_form import differing, has_limited_rates
from tests.inertia import CAR

ROBOT = SecondOrderUnicycle(
    max_speed=0.5, max_turn_rate=0.6, max_acceleration=0.25, max_angular_acceleration=0.3
)
CASES = [(CAR, "steering"), (ROBOT, "turn_rate")]
SHARES = st.floats(-1.0, 1.0)


def trim_at(model, *state):
    names = model.reduced_names
    (trim,) = trims_of(model, {n: [v] for n, v in zip(names, state, strict=True)}).trims
    return trim


def trims_drawn(model, data, count):
    most = model.reduced_limits[:, 1]
    states = [most * data.draw(st.tuples(SHARES, SHARES)) for _ in range(count)]
    return [trim_at(model, *state) for state in states]


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize(("model", "_"), CASES)
def test_displacements_are_those_of_the_solver(model, _, late):
    trims = [
        trim_at(model, *state)
        for state in model.reduced_limits[:, 1] * [[-1.0, 0.4], [0, 0], [0.6, -1.0], [1, 1]]
    ]
    for maneuver in connect_bang_bang(model, trims, late=late):
        course = maneuver.course
        state = np.zeros(5)
        state[3:] = course.reduced_state[0]
        changes = np.flatnonzero(np.abs(np.diff(course.control, axis=0)).any(axis=1)) + 1
        stops = [0, *changes.tolist(), course.time.size - 1]
        for begin, end in pairwise(stops):
            times = course.time[[begin, end]]
            state = rollout(
                model, state, control=course.control[begin], times=times, rtol=1e-12, atol=1e-13
            )[-1]
        np.testing.assert_allclose(maneuver.displacement, state[:3], rtol=0, atol=1e-12)
        np.testing.assert_allclose(course.reduced_state[-1], state[3:], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("model", "_"), CASES)
@settings(max_examples=25)
@given(data=st.data())
def test_the_slowest_component_sets_the_time_and_limits_hold(model, _, data):
    source, target = trims_drawn(model, data, 2)
    change = np.abs(target.reduced_state - source.reduced_state)
    if change.max() < 1e-6:
        return
    expected = (change / model.control_limits[:, 1]).max()
    for late in (False, True):
        maneuver = bang_bang(model, source, target, late=late)
        course = maneuver.course
        assert maneuver.duration == pytest.approx(expected, rel=1e-12)
        assert (np.abs(course.control) <= model.control_limits[:, 1] * (1 + 1e-12)).all()
        low, high = model.reduced_limits.T
        assert (course.reduced_state >= low - 1e-12).all()
        assert (course.reduced_state <= high + 1e-12).all()
        np.testing.assert_allclose(course.reduced_state[0], source.reduced_state, atol=1e-14)
        np.testing.assert_allclose(course.reduced_state[-1], target.reduced_state, atol=1e-12)


@pytest.mark.parametrize(("model", "_"), CASES)
@settings(max_examples=25)
@given(data=st.data(), late=st.booleans())
def test_a_mirrored_maneuver_has_the_mirrored_displacement(model, _, data, late):
    source, target = trims_drawn(model, data, 2)
    if np.abs(target.reduced_state - source.reduced_state).max() < 1e-6:
        return
    mirrored = [trim_at(model, *(t.reduced_state * [1.0, -1.0])) for t in (source, target)]
    here = bang_bang(model, source, target, late=late)
    there = bang_bang(model, *mirrored, late=late)
    np.testing.assert_allclose(there.displacement, here.displacement * [1, -1, -1], atol=1e-13)


@pytest.mark.parametrize(("model", "_"), CASES)
@settings(max_examples=25)
@given(data=st.data(), late=st.booleans())
def test_a_maneuver_in_reversed_time_leads_back(model, _, data, late):
    # run backwards, what was early is late; speed changes its sign, and so does a turn rate
    source, target = trims_drawn(model, data, 2)
    if np.abs(target.reduced_state - source.reduced_state).max() < 1e-6:
        return
    sign = [-1.0, 1.0] if model is CAR else [-1.0, -1.0]
    reversed_ = [trim_at(model, *(t.reduced_state * sign)) for t in (target, source)]
    here = bang_bang(model, source, target, late=late)
    back = bang_bang(model, *reversed_, late=not late)
    there_and_back = SE2(here.displacement) @ SE2(back.displacement)
    np.testing.assert_allclose(there_and_back.pose, 0.0, atol=1e-12)


def test_speeding_up_by_hand():
    maneuver = bang_bang(CAR, trim_at(CAR, 0.5, 0.0), trim_at(CAR, 2.5, 0.0))
    assert maneuver.name == "speed 0.5, steering 0 to speed 2.5, steering 0"
    assert maneuver.duration == 2.0
    np.testing.assert_allclose(maneuver.displacement, [3.0, 0.0, 0.0], atol=1e-14)
    wheel = bang_bang(ROBOT, trim_at(ROBOT, 0.5, 0.0), trim_at(ROBOT, 0.5, 0.6))
    assert wheel.displacement[2] == pytest.approx(0.3 * 2.0**2 / 2)


def test_a_change_of_direction_passes_through_rest():
    maneuver = bang_bang(CAR, trim_at(CAR, 1.0, 0.3), trim_at(CAR, -1.0, 0.3))
    np.testing.assert_allclose(maneuver.displacement, 0.0, atol=1e-14)
    assert maneuver.duration == 2.0
    assert np.abs(maneuver.course.pose).max() > 0.4


def test_early_and_late_differ_only_where_one_component_waits():
    trims = [trim_at(CAR, *state) for state in ([0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [1.0, 0.25])]
    early, late = (connect_bang_bang(CAR, trims, late=late) for late in (False, True))
    assert (len(early), len(late)) == (12, 12)
    assert all(maneuver.name.endswith(", late") for maneuver in late)
    ends = {(m.source, m.target) for m in differing(early, late)}
    rest, slow = "speed 0, steering 0", "speed 1, steering 0.25"
    assert ends == {(rest, slow), (slow, rest)}  # with 0.5 both take a second


def test_neighbours_are_one_level_away_at_most():
    trims = trims_of(CAR, {"speed": [0.0, 1.0, 2.0], "steering": [-0.5, 0.1, 0.5]}).trims
    maneuvers = connect_bang_bang(CAR, trims, pairs="neighbours")
    assert len(maneuvers) == 40
    assert not any(
        m.source.startswith("speed 0") and m.target.startswith("speed 2") for m in maneuvers
    )


def test_trims_of_equal_reduced_state_need_no_maneuver():
    one, two = trim_at(CAR, 0.0, 0.2), trim_at(CAR, 0.0, 0.2)
    assert connect_bang_bang(CAR, [one, two]) == ()
    with pytest.raises(ValueError, match="have the same reduced state, so the vehicle switches"):
        bang_bang(CAR, one, two)


def test_any_vehicle_whose_control_is_the_rate():
    sled = UserModel(
        name="sled",
        group=SE2,
        control_names=("a", "b", "c"),
        reduced_names=("ahead", "aside", "turn"),
        velocity=lambda z, u: [z[0], z[1], z[2]],
        dynamics=lambda z, u: [u[0], u[1], u[2]],
        control_limits=[[-2.0, 1.0], [-1.0, 1.0], [-0.5, 0.5]],
    )
    assert has_limited_rates(sled)
    source, target = trim_at(sled, 1.0, 0.0, 0.0), trim_at(sled, 0.0, 0.3, 0.4)
    maneuver = bang_bang(sled, source, target)
    assert maneuver.duration == pytest.approx(0.8)
    changes = np.abs(np.diff(maneuver.course.control, axis=0)).any(axis=1)
    assert maneuver.course.time[1:][changes].round(12).tolist() == [0.3, 0.5]


def test_other_vehicles_are_refused():
    car = SingleTrack()
    trims = trims_of(car, {"speed": [10.0, 20.0], "turn_rate": [0.0]}).trims
    with pytest.raises(ValueError, match="single_track is none of the vehicles whose control is"):
        connect_bang_bang(car, trims)
    odd = Trim(name="odd", body_velocity=[1, 0, 0], control=[0.5, 0.0], reduced_state=[1.0, 0.0])
    with pytest.raises(NotATrim, match="trim 'odd': got reduced state"):
        bang_bang(CAR, odd, trim_at(CAR, 0.0, 0.0))
    with pytest.raises(ValueError, match="pairs: got 'near', need all or neighbours"):
        connect_bang_bang(CAR, [trim_at(CAR, 0.0, 0.0)], pairs="near")


@pytest.mark.parametrize("length", [-7.0, -0.3, 0.05, 1.0, 6.25, 6.3, 40.0])
@pytest.mark.parametrize("steering", [0.0, -0.6])
def test_strokes_have_their_length_and_least_time(length, steering):
    rest = trim_at(CAR, 0.0, steering)
    a, v = 1.0, 2.5
    short = abs(length) <= v * v / a
    expected = 2.0 * math.sqrt(abs(length) / a) if short else abs(length) / v + v / a
    (whole,) = from_rest(CAR, [rest], [length], "speed")
    assert whole.duration == pytest.approx(expected, rel=1e-12)
    turned = length * math.tan(steering) / CAR.wheelbase
    arc = SE2.exp([length, 0.0, turned]).pose  # the same circle, whatever the speed
    np.testing.assert_allclose(whole.displacement, arc, atol=1e-12)
    assert (whole.source, whole.target) == (rest.name, rest.name)
    np.testing.assert_allclose(whole.course.reduced_state[-1], [0.0, steering], atol=1e-12)


@settings(max_examples=30)
@given(angle=st.floats(0.01, 9.0), left=st.booleans())
def test_turns_on_the_spot(angle, left):
    angle = angle if left else -angle
    rest = trim_at(ROBOT, 0.0, 0.0)
    (whole,) = from_rest(ROBOT, [rest], [angle], "turn_rate")
    np.testing.assert_allclose(whole.displacement, [0.0, 0.0, angle], atol=1e-12)
    assert np.abs(whole.course.reduced_state[:, 1]).max() <= ROBOT.max_turn_rate + 1e-12


class HardBraking(SecondOrderUnicycle):
    control_limits = np.array([[-2.0, 1.0], [-1.0, 1.0]])


def test_braking_may_be_harder_than_speeding_up():
    robot = HardBraking(
        max_speed=10.0, max_turn_rate=1.0, max_acceleration=2.0, max_angular_acceleration=1.0
    )
    (whole,) = from_rest(robot, [trim_at(robot, 0.0, 0.0)], [3.0], "speed")
    assert whole.duration == 3.0
    np.testing.assert_allclose(whole.course.reduced_state[:, 0].max(), 2.0)
    np.testing.assert_allclose(whole.displacement, [3.0, 0.0, 0.0], atol=1e-12)


def test_wheels_turn_at_rest():
    maneuver = bang_bang(CAR, trim_at(CAR, 0.0, -0.25), trim_at(CAR, 0.0, 0.75))
    assert maneuver.duration == 2.0
    assert not maneuver.displacement.any()


def test_reverse_must_be_allowed():
    forward = SecondOrderCar(
        wheelbase=2.8,
        max_steering=0.75,
        max_speed=2.5,
        max_acceleration=1.0,
        max_steering_rate=0.5,
        min_speed=0.0,
    )
    with pytest.raises(
        ValueError, match=r"stroke: got -1\.0, but the speed of the second_order_car"
    ):
        from_rest(forward, [trim_at(forward, 0.0, 0.0)], [-1.0], "speed")
    with pytest.raises(ValueError, match="second_order_car has no turn_rate, need one"):
        from_rest(CAR, [trim_at(CAR, 0.0, 0.0)], [1.0], "turn_rate")
    with pytest.raises(NotATrim, match=r"trim 'speed 1, steering 0': moves with .*, need a rest"):
        from_rest(CAR, [trim_at(CAR, 1.0, 0.0)], [1.0], "speed")
