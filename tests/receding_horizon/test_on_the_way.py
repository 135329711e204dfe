"""Loops past poses on the way: what was passed stays passed, and plans lead through the rest."""

from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.formats.closed_loop_json import (
    load_closed_loop,
    load_steps,
    save_closed_loop,
)

ROBOT = ma.Automaton.of_controls(
    ma.Unicycle(), {"rest": (0, 0), "ahead": (1, 0), "left": (1, 1), "right": (1, -1)}
)
VIA = (
    ma.Via([3, 1], free_heading=True),
    ma.Via([6, -1, -0.4], stay_s=1.5),
    ma.Via(gate=[[8, -1], [8, 2]]),
)
PAST = ma.Problem(ROBOT, [0, 0, 0], [10, 0, 0], via=VIA)


def driven_poses(loop):
    """Times and poses along what was driven, by small steps of the body velocity alone."""
    times, poses = [], []
    for piece in loop.driven:
        pose, clock = np.array(piece.start), piece.start_time
        for trim, lasting in zip(piece.trims, piece.durations.tolist(), strict=True):
            n = max(1, int(np.ceil(lasting / 2e-4)))
            v, _, w = trim.body_velocity
            for _ in range(n):
                times.append(clock)
                poses.append(pose.copy())
                h = lasting / n
                middle = pose[2] + w * h / 2
                pose = pose + h * np.array([v * np.cos(middle), v * np.sin(middle), w])
                clock += h
        times.append(clock)
        poses.append(pose)
    return np.array(times), np.array(poses)


def judged(loop):
    """The loop arrives, and its own drawing passes all in order, and stands where it is to stay."""
    assert loop.reached, loop.reason
    assert not list(loop.violations)
    times, poses = driven_poses(loop)
    since = -np.inf
    for via in loop.problem.via:
        if via.gate is not None:
            across = np.sign(poses[:, 0] - via.gate[0, 0])
            at = times[1:][(np.diff(across) != 0) & (times[1:] > since)]
            assert at.size
            since = at[0]
            continue
        off = np.hypot(*(poses[:, :2] - via.pose[:2]).T)
        if not via.free_heading:
            off = off + np.abs(np.angle(np.exp(1j * (poses[:, 2] - via.pose[2]))))
        near = (off < 1e-3) & (times > since - 1e-3)
        assert near.any()
        stood = np.diff(times, append=times[-1])[(off < 1e-6) & near].sum()
        assert stood >= via.stay_s - 1e-6 or not via.stay_s
        since = times[near][0]
    return loop


@pytest.fixture(scope="module")
def whole():
    return ma.simulate(PAST, step=1.0, time_limit=2.0)


def test_the_value_falls_past_all_that_is_on_the_way(whole):
    loop = judged(whole)
    values = [one.value for one in loop.steps]
    assert values[0] == pytest.approx(loop.cost)
    for one, then in zip(loop.steps, values[1:], strict=False):
        assert then <= one.value - one.applied_cost + 1e-6
    assert [one.number for one in loop.passed] == [1, 2, 3]
    assert loop.passed[1].until - loop.passed[1].time == pytest.approx(1.5)


def test_pushed_before_it_the_pose_is_met_all_the_same_and_a_stay_is_made_up_for():
    push = ma.Disturbance(pushes={1: (0.3, 0.2, 0.5), 7: (0.3, 0.1, -0.2)})
    loop = ma.simulate(PAST, step=1.0, time_limit=2.0, disturbance=push, steps=60)
    judged(loop)
    stay = next(one for one in loop.passed if one.number == 2)
    assert stay.stay_left == 0.0
    assert loop.cost > 13.0


def test_a_stay_that_a_push_interrupts_is_finished():
    robot = ma.Automaton.of_controls(
        ma.Unicycle(), {"rest": (0, 0), "on": (1, 0), "back": (-1, 0), "spin": (0, 1)}
    )
    problem = ma.Problem(robot, [0, 0, 0], [4, 0, 0], via=ma.Via([2, 0, 0], stay_s=2.0))
    push = ma.Disturbance(pushes={2: (0.5, 0.0, 0.0)})
    loop = judged(ma.simulate(problem, step=1.0, time_limit=2.0, disturbance=push))
    met = [[(one.number, round(one.stay_left, 9)) for one in step.passed] for step in loop.steps]
    assert met[1] == [(1, 2.0)] or not met[1]
    assert met[2] == [(1, 1.0)]
    assert loop.passed[0].stay_left == 0.0
    assert loop.cost == pytest.approx(6.5)


def test_going_on_after_a_break_knows_what_was_passed(tmp_path, whole):
    half = ma.simulate(PAST, step=1.0, time_limit=2.0, steps=7)
    save_closed_loop(half, tmp_path / "closed_loop.json")
    steps, poses = load_steps(tmp_path / "closed_loop.json", ROBOT)
    assert steps[-1].passed[-1].stay_left > 0.0  # in the midst of the stay
    again = load_closed_loop(tmp_path / "closed_loop.json", PAST)
    assert [one.number for one in again.passed] == [1, 2]
    then = ma.simulate(replace(PAST, start=poses[-1]), step=1.0, time_limit=2.0, last=steps[-1])
    assert then.reached
    assert then.cost == pytest.approx(whole.cost, rel=1e-6)


def test_a_controller_alone_sees_what_it_passed():
    problem = ma.Problem(ROBOT, [0, 0, 0], [8, 0, 0], via=[ma.Via([2, 0, 0]), ma.Via([5, 0, 0])])
    controller = ma.RecedingHorizon(problem, step=3.0, time_limit=2.0)
    controller.step([0, 0, 0])
    _, log = controller.step([3, 0, 0])
    assert [one.number for one in log.passed] == [1]
    assert log.value == pytest.approx(5.0)
    _, log = controller.step([4.5, 0, 0])  # it did not get as far as its plan says
    assert [one.number for one in log.passed] == [1]
    assert log.value == pytest.approx(3.5)


@pytest.mark.parametrize(
    ("disturbance", "said"),
    [
        (ma.Disturbance(measured_position_m=0.1), "via 1: a vehicle that is measured late or"),
        (ma.Disturbance(twist_scale=(1.1, 1.0, 1.0)), "meets no pose exactly"),
    ],
)
def test_what_meets_no_pose_is_refused(disturbance, said):
    with pytest.raises(ValueError, match=said):
        ma.simulate(PAST, step=1.0, disturbance=disturbance)
