"""Stop and steer: the path itself, in the least time that stops allow, from any place."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton import Plan
from maneuver_automaton.groups import SE2
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal
from maneuver_automaton.refinement.stop_and_steer import extreme_automaton, stop_and_steer
from tests.inertia import CAR, ROBOT, rest_of

MODELS = {"car": CAR, "unicycle": ROBOT}


def paths(model):
    """Words of up to five trims of the kinematic vehicle, with short and long coasts."""
    trims = extreme_automaton(model).trims
    pieces = st.tuples(st.sampled_from(trims), st.floats(1e-6, 8.0))
    return st.lists(pieces, min_size=1, max_size=5)


def path_of(pieces, start=(0.0, 0.0, 0.0)):
    return Plan(start, [trim for trim, _ in pieces], durations=[time for _, time in pieces])


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
@given(data=st.data())
def test_it_ends_where_the_path_ends_and_obeys_the_model(name, data):
    model = MODELS[name]
    path = path_of(data.draw(paths(model)), start=(1.0, -2.0, 0.5))
    rest = rest_of(model)
    plan = stop_and_steer(model, path, first=rest, last=rest)
    goal = Goal(pose=path.end)
    states = (rest.reduced_state, rest.reduced_state)
    audit = audit_plan(plan, goal, model, states=states)
    assert audit.passed, audit.reason
    assert audit.max_dynamics_defect < 1e-9


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
@given(data=st.data())
def test_every_pose_is_one_of_the_path(name, data):
    """What is free for the kinematic vehicle is free for this one."""
    model = MODELS[name]
    path = path_of(data.draw(paths(model)))
    rest = rest_of(model)
    plan = stop_and_steer(model, path, first=rest, last=rest)
    times = np.linspace(0.0, path.duration, 4000)
    driven = path.pose_at(times)
    step = np.abs(np.diff(driven, axis=0)).max()
    for pose in plan.sample().pose[::7]:
        assert np.abs(driven - pose).max(axis=1).min() < 2.0 * step + 1e-9


@pytest.mark.parametrize("name", MODELS)
@given(data=st.data(), by=st.tuples(*[st.floats(-5.0, 5.0)] * 3))
def test_a_moved_path_has_the_moved_plan(name, data, by):
    model, move = MODELS[name], SE2(by)
    path = path_of(data.draw(paths(model)))
    rest = rest_of(model)
    plan = stop_and_steer(model, path, first=rest, last=rest)
    other = stop_and_steer(model, path.moved(move), first=rest, last=rest)
    assert other.word == plan.word
    assert other.durations.tolist() == plan.durations.tolist()
    np.testing.assert_allclose(other.end, (move @ SE2(plan.end)).pose, atol=1e-9)


def test_durations_by_hand():
    """10 m ahead: 2.5 s and 3.125 m up to 2.5 m/s, 1.5 s of coast, 2.5 s of brake."""
    ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    path = Plan([0, 0, 0], [ahead], durations=[10.0])
    plan = stop_and_steer(CAR, path, first=rest_of(CAR), last=rest_of(CAR))
    assert plan.duration == pytest.approx(2.5 + (10.0 - 6.25) / 2.5 + 2.5)
    left = Trim(name="left", body_velocity=[-1.0, 0.0, -math.tan(0.75) / 2.8], control=[-1.0, 0.75])
    path = Plan([0, 0, 0], [left], durations=[1.0])
    plan = stop_and_steer(CAR, path, first=rest_of(CAR), last=rest_of(CAR))
    assert plan.duration == pytest.approx(1.5 + 2.0 + 1.5)  # turn the wheel, 1 m, turn it back


def test_equal_trims_in_a_row_are_one_stroke():
    ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    rest = rest_of(CAR)
    whole = stop_and_steer(CAR, Plan([0, 0, 0], [ahead], durations=[4.0]), first=rest, last=rest)
    halves = Plan([0, 0, 0], [ahead, ahead], durations=[1.0, 3.0])
    assert stop_and_steer(CAR, halves, first=rest, last=rest).duration == whole.duration


def test_nothing_to_do():
    rest = rest_of(CAR)
    plan = stop_and_steer(CAR, Plan([1, 2, 3], [], durations=[]), first=rest, last=rest)
    assert (plan.duration, plan.end.tolist()) == (0.0, [1, 2, 3])


def test_it_must_begin_at_rest():
    moving = Trim(name="go", body_velocity=[1, 0, 0], control=[0, 0], reduced_state=[1, 0])
    path = Plan([0, 0, 0], [], durations=[])
    with pytest.raises(ValueError, match=r"^first trim 'go': it moves, need one that stands"):
        stop_and_steer(CAR, path, first=moving, last=rest_of(CAR))
