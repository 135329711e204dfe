"""Plans: poses and controls at every time, samples, and the law that moves them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.automaton import Plan
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim

AHEAD = Trim(name="ahead", body_velocity=[2.0, 0.0, 0.0], control=[2.0, 0.0])
LEFT = Trim(name="left", body_velocity=[1.0, 0.0, 1.0], control=[1.0, 1.0])
BACK = Trim(name="back", body_velocity=[-1.0, 0.0, -0.5], control=[-1.0, -0.5])
SPIN = Trim(name="spin", body_velocity=[0.0, 0.0, -2.0], control=[0.0, -2.0])
REST = Trim(name="rest", body_velocity=[0.0, 0.0, 0.0], control=[0.0, 0.0])
PLANAR = (AHEAD, LEFT, BACK, SPIN, REST)
CLIMB = Trim(name="climb", body_velocity=[1.0, 0.0, 0.5, 1.0], control=[1.0])
SINK = Trim(name="sink", body_velocity=[2.0, 0.0, -0.5, -0.25], control=[2.0])

PIECES = st.lists(
    st.tuples(st.sampled_from(PLANAR), st.floats(0.0, 10.0) | st.just(0.0)), max_size=5
)
STARTS = arrays(np.float64, 3, elements=st.floats(-100.0, 100.0))
QUARTER = math.pi / 2


def plan_of(pieces, start=(0.0, 0.0, 0.0), **more):
    trims = tuple(trim for trim, _ in pieces)
    return Plan(start, trims, durations=[time for _, time in pieces], **more)


TURN = plan_of([(AHEAD, 1.0), (LEFT, QUARTER), (AHEAD, 0.5)], start_time=10.0)


@pytest.mark.parametrize(
    ("time", "pose"),
    [
        (-5.0, (0.0, 0.0, 0.0)),
        (10.0, (0.0, 0.0, 0.0)),
        (10.25, (0.5, 0.0, 0.0)),
        (11.0, (2.0, 0.0, 0.0)),
        (11.0 + QUARTER / 2, (2.0 + math.sqrt(0.5), 1.0 - math.sqrt(0.5), QUARTER / 2)),
        (11.0 + QUARTER, (3.0, 1.0, QUARTER)),
        (11.25 + QUARTER, (3.0, 1.5, QUARTER)),
        (11.5 + QUARTER, (3.0, 2.0, QUARTER)),
        (1e9, (3.0, 2.0, QUARTER)),
    ],
)
def test_poses_by_hand(time, pose):
    np.testing.assert_allclose(TURN.pose_at(time), pose, atol=1e-14)


def test_words_and_times_by_hand():
    assert TURN.word == ("ahead", "left", "ahead")
    assert TURN.duration == 1.5 + QUARTER
    assert TURN.switching_times.tolist() == [10.0, 11.0, 11.0 + QUARTER, 11.5 + QUARTER]
    np.testing.assert_allclose(TURN.end, [3.0, 2.0, QUARTER], atol=1e-15)
    np.testing.assert_array_equal(TURN.end, TURN.switching_poses[-1])


@pytest.mark.parametrize(
    ("time", "control"),
    [
        (0.0, AHEAD.control),
        (10.999, AHEAD.control),
        (11.0, LEFT.control),
        (11.0 + QUARTER, AHEAD.control),
        (99.0, AHEAD.control),
    ],
)
def test_at_a_switch_the_control_is_that_of_the_trim_that_begins(time, control):
    assert TURN.control_at(time).tolist() == control.tolist()


@given(pieces=PIECES, start=STARTS, start_time=st.floats(-100.0, 100.0))
def test_samples_are_close_and_hold_every_switch(pieces, start, start_time):
    plan = plan_of(pieces, start, start_time=start_time)
    samples = plan.sample()
    steps = np.diff(samples.pose, axis=0)
    assert (np.hypot(steps[:, 0], steps[:, 1]) <= 0.05 * (1 + 1e-9)).all()
    assert (np.abs(steps[:, 2]) <= 0.05 * (1 + 1e-9)).all()
    assert (np.diff(samples.time) >= 0.0).all()
    assert set(plan.switching_times) <= set(samples.time)
    np.testing.assert_allclose(samples.pose[0], plan.start, atol=1e-12)
    assert samples.pose[-1].tolist() == plan.end.tolist()
    np.testing.assert_allclose(samples.pose, plan.pose_at(samples.time), atol=1e-12)
    assert len(samples.time) == len(samples.control) == len(samples.reduced_state)


@given(pieces=PIECES.filter(bool))
def test_between_two_samples_the_control_drives_from_one_to_the_other(pieces):
    plan = plan_of(pieces)
    samples = plan.sample()
    # both planar trims of a unicycle: (v, omega) is its control
    twists = np.insert(samples.control, 1, 0.0, axis=1)
    held = np.diff(samples.time)[:, None] * twists[:-1]
    reached = SE2(samples.pose[:-1]) @ SE2.exp(held)
    np.testing.assert_allclose(reached.pose, samples.pose[1:], atol=1e-11)
    assert samples.control[-1].tolist() == plan.trims[-1].control.tolist()


@given(pieces=PIECES, start=STARTS, by=STARTS)
def test_a_moved_plan_is_moved_at_every_time(pieces, start, by):
    plan, group_element = plan_of(pieces, start, start_time=2.0), SE2(by)
    moved = plan.moved(group_element)
    assert moved.word == plan.word
    assert moved.start_time == plan.start_time
    assert moved.durations.tolist() == plan.durations.tolist()
    times = np.linspace(0.0, plan.duration + 4.0, 30)
    there = group_element @ SE2(plan.pose_at(times))
    np.testing.assert_allclose(moved.pose_at(times), there.pose, atol=1e-9)


def test_a_plan_with_height_moves_too():
    plan = plan_of([(CLIMB, 2.0), (SINK, 4.0)], start=(1.0, 2.0, 0.5, 3.0))
    assert plan.end[3] == 3.0 + 2.0 - 1.0
    by = SE2xR([5.0, -1.0, 2.0, 7.0])
    np.testing.assert_allclose(plan.moved(by).end, (by @ SE2xR(plan.end)).pose, atol=1e-13)
    steps = np.diff(plan.sample().pose, axis=0)[:, [0, 1, 3]]
    assert (np.linalg.norm(steps, axis=1) <= 0.05 * (1 + 1e-9)).all()


@given(pieces=PIECES, start=STARTS)
def test_the_way_back_is_the_plan_of_the_opposite_trims(pieces, start):
    plan = plan_of(pieces, start)
    opposite = [
        Trim(name=trim.name, body_velocity=-trim.body_velocity, control=-trim.control)
        for trim in reversed(plan.trims)
    ]
    back = Plan(plan.end, opposite, durations=plan.durations[::-1])
    np.testing.assert_allclose(back.end, plan.start, atol=1e-10)


@pytest.mark.parametrize(
    ("start", "durations", "message"),
    [
        ([0.0, 0.0], [1.0], "start: got shape (2,), need 3 or 4 components last"),
        ([0.0, 0.0, math.nan], [1.0], "start: got nan, need finite numbers"),
        ([0.0, 0.0, 0.0], [], "plan: got (0,) durations for 1 trims"),
        ([0.0, 0.0, 0.0], [1.0, 2.0], "plan: got (2,) durations for 1 trims"),
        ([0.0, 0.0, 0.0], [[1.0]], "plan: got (1, 1) durations for 1 trims"),
        ([0.0, 0.0, 0.0], [-0.5], "plan: durations must not be negative, got -0.5 s"),
        ([0.0, 0.0, 0.0], [math.inf], "durations: got inf, need finite numbers"),
    ],
)
def test_what_is_wrong_is_said(start, durations, message):
    with pytest.raises(ValueError) as error:
        Plan(start, (AHEAD,), durations=durations)
    assert str(error.value) == message


def braking(duration=2.0):
    """From 1 m/s to rest: 1 m in 2 s, three samples."""
    time = np.linspace(0.0, duration, 3)
    speed = 1.0 - time / duration
    pose = np.zeros((3, 3))
    pose[:, 0] = time - 0.5 * time**2 / duration
    course = Trajectory(
        time=time,
        pose=pose,
        reduced_state=speed[:, None],
        control=np.full((3, 1), -1.0 / duration),
    )
    return Maneuver(
        name="brake",
        source="ahead",
        target="rest",
        displacement=pose[-1],
        duration=duration,
        course=course,
    )


ROLLING = Trim(name="ahead", body_velocity=[1, 0, 0], control=[0], reduced_state=[1.0])
STOPPED = Trim(name="rest", body_velocity=[0, 0, 0], control=[0], reduced_state=[0.0])


def test_a_plan_with_a_maneuver():
    plan = Plan([1, 0, 0], (ROLLING, STOPPED), durations=[2, 1], maneuvers=(braking(),))
    assert plan.word == ("ahead", "brake", "rest")
    assert plan.primitive_durations.tolist() == [2.0, 2.0, 1.0]
    assert plan.switching_times.tolist() == [0.0, 2.0, 4.0, 5.0]
    assert plan.end.tolist() == [4.0, 0.0, 0.0]
    assert plan.pose_at([1.0, 3.0, 4.5])[:, 0].tolist() == [2.0, 3.75, 4.0]
    assert plan.control_at(2.5).tolist() == [-0.5]
    samples = plan.sample()
    assert samples.reduced_state[[0, -1]].ravel().tolist() == [1.0, 0.0]
    assert np.hypot(*np.diff(samples.pose[:, :2], axis=0).T).max() <= 0.05 + 1e-12
    assert set(plan.switching_times.tolist()) <= set(samples.time.tolist())


def test_a_trim_between_maneuvers_may_last_no_time():
    plan = Plan([1, 0, 0], (ROLLING, STOPPED), durations=[0, 0], maneuvers=(braking(),))
    assert (plan.word, plan.duration) == (("brake",), 2.0)
    again = Plan.of_primitives(
        [1, 0, 0], [braking()], durations=[2.0], trims={"ahead": ROLLING, "rest": STOPPED}
    )
    assert again.word == plan.word
    assert again.end.tolist() == plan.end.tolist()


def test_maneuvers_must_fit_the_trims():
    with pytest.raises(ValueError, match=r"^plan: maneuver 'brake' leads from 'ahead' to 'rest', "):
        Plan([0, 0, 0], (STOPPED, ROLLING), durations=[1, 1], maneuvers=(braking(),))
    trims = (ROLLING, STOPPED, STOPPED)
    with pytest.raises(ValueError, match=r"^plan: got 1 maneuvers for 3 trims, need one between"):
        Plan([0, 0, 0], trims, durations=[1, 1, 1], maneuvers=(braking(),))


def test_a_moved_plan_with_maneuvers():
    plan = Plan([1, 0, 0], (ROLLING, STOPPED), durations=[2, 1], maneuvers=(braking(),))
    by = SE2([3.0, 1.0, 2.0])
    moved = plan.moved(by)
    times = np.linspace(0.0, 5.0, 21)
    np.testing.assert_allclose(
        moved.pose_at(times), (by @ SE2(plan.pose_at(times))).pose, atol=1e-14
    )


def test_a_maneuver_without_a_course_cannot_be_sampled():
    bare = Maneuver(name="hop", source="ahead", target="rest", displacement=[1, 0, 0], duration=1)
    plan = Plan([0, 0, 0], (ROLLING, STOPPED), durations=[1, 0], maneuvers=(bare,))
    assert plan.end.tolist() == [2, 0, 0]
    with pytest.raises(ValueError, match=r"^maneuver 'hop': has no course, so it cannot be"):
        plan.sample()


def test_a_plan_begun_elsewhere_keeps_what_is_known_of_its_motions_alone():
    known = plan_of([(AHEAD, 1.0), (LEFT, QUARTER)], start_time=10.0)
    assert known.switching_times[-1] == 11.0 + QUARTER
    assert known.switching_poses[-1, 0] > 2.0
    moved = known.begun_at([5.0, 1.0, 0.3], start_time=2)
    alone = plan_of([(AHEAD, 1.0), (LEFT, QUARTER)], [5.0, 1.0, 0.3], start_time=2.0)
    assert moved.twists is known.twists
    assert moved.switching_times.tolist() == alone.switching_times.tolist()
    assert moved.switching_poses.tolist() == alone.switching_poses.tolist()
    with pytest.raises(ValueError, match="start: got shape"):
        known.begun_at([0.0, 0.0], start_time=0.0)
