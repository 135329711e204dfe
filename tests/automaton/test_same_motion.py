"""One motion is one motion at any time of the clock and anywhere in the world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.same_motion import (
    CONVERGED,
    POLISHED,
    UNFINISHED,
    Likeness,
    is_new,
    same_motion,
)
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle
from maneuver_automaton.planning import plan
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim
from maneuver_automaton.problem import Horizon, Problem

LATER = (0.0, 3.0, 1e3)  # [s] start times: before, about and long after the plans' durations
AHEAD = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
LEFT = Trim(name="left", body_velocity=[1.0, 0.0, 1.0], control=[1.0, 1.0])
RIGHT = Trim(name="right", body_velocity=[1.0, 0.0, -1.0], control=[1.0, -1.0])
SPIN = Trim(name="spin", body_velocity=[0.0, 0.0, 1.0], control=[0.0, 1.0])
REST = Trim(name="rest", body_velocity=[0.0, 0.0, 0.0], control=[0.0, 0.0])
BACK_SPIN = Trim(name="back spin", body_velocity=[0.0, 0.0, -1.0], control=[0.0, -1.0])


def begun_at(time, *trims, durations):
    return Plan([0.0, 0.0, 0.0], trims, durations=durations, start_time=time)


@pytest.mark.parametrize("time", LATER)
def test_a_start_time_changes_nothing(time):
    straight = begun_at(time, AHEAD, durations=[2.0])
    spelled = begun_at(time, AHEAD, LEFT, AHEAD, durations=[1.0, 4e-7, 1.0])
    turning = begun_at(time, AHEAD, LEFT, durations=[1.0, 1.0])
    shorter = begun_at(time, AHEAD, durations=[1.9])
    assert same_motion(straight, spelled)
    assert not same_motion(straight, turning)
    assert not same_motion(straight, shorter)
    assert is_new(turning, [straight, spelled, shorter])


@pytest.mark.parametrize("time", LATER)
def test_alternatives_that_start_later_are_the_same(time):
    controls = {"ahead": (1.0, 0.0), "left": (1.0, 1.0), "right": (1.0, -1.0)}
    car = Automaton.of_controls(Unicycle(), controls)
    problem = Problem(car, [0, 0, 0], [3, 1, 0], horizon=Horizon(max_trims=3), start_time=time)
    result = plan(problem, time_limit=60.0, alternatives=3)
    words = [result.plan.word, *(one.plan.word for one in result.alternatives)]
    at_once = plan(replace(problem, start_time=0.0), time_limit=60.0, alternatives=3)
    assert words == [at_once.plan.word, *(one.plan.word for one in at_once.alternatives)]
    assert len(words) == 4


@pytest.mark.parametrize("likeness", [CONVERGED, POLISHED, UNFINISHED])
@pytest.mark.parametrize("time", LATER)
def test_two_plans_moved_alike_are_as_like_as_before(likeness, time):
    by = SE2([1e3, -2e3, 2.0])
    one = begun_at(time, AHEAD, LEFT, durations=[1.0, 1.0])
    alike = begun_at(time, AHEAD, LEFT, durations=[1.0 + 1e-6, 1.0 - 1e-6])
    other = begun_at(time, AHEAD, RIGHT, durations=[1.0, 1.0])
    assert same_motion(one, alike, likeness)
    assert same_motion(one.moved(by), alike.moved(by), likeness)
    assert not same_motion(one, other, likeness)
    assert not same_motion(one.moved(by), other.moved(by), likeness)
    assert not same_motion(one, one.moved(by), likeness)


def test_rest_at_the_end_is_no_other_motion_but_rest_before_it_is():
    once = begun_at(5.0, AHEAD, durations=[2.0])
    assert same_motion(once, begun_at(5.0, AHEAD, REST, durations=[2.0, 3.0]))
    assert not same_motion(once, begun_at(5.0, REST, AHEAD, durations=[3.0, 2.0]))


def test_whole_turns_either_way_are_two_motions():
    turns = [begun_at(7.0, trim, durations=[2 * np.pi]) for trim in (SPIN, BACK_SPIN)]
    assert not same_motion(*turns)  # both ends and the middle have the same heading


def test_maneuvers_are_compared_between_their_ends():
    def weaving(side):
        time = np.linspace(0.0, 4.0, 41)
        pose = np.stack(
            [time, side * np.sin(np.pi * time / 2.0) ** 2 * np.sign(2.0 - time), 0.0 * time], axis=1
        )
        course = Trajectory(
            time=time, pose=pose, reduced_state=np.zeros((41, 0)), control=np.zeros((41, 2))
        )
        between = Maneuver(
            name="weave", source="rest", target="rest", displacement=[4, 0, 0], duration=4.0,
            course=course,
        )  # fmt: skip
        return Plan([0, 0, 0], (REST, REST), durations=[0.0, 0.0], maneuvers=(between,))

    assert same_motion(weaving(1.0), weaving(1.0), POLISHED)
    assert not same_motion(weaving(1.0), weaving(-1.0), POLISHED)  # alike at ends and halfway


def test_tolerances_follow_the_length_of_the_path():
    tiny = [begun_at(1.0, AHEAD, durations=[t]) for t in (1e-4, 2e-4)]
    assert not same_motion(*tiny)
    long = [begun_at(1.0, AHEAD, durations=[t]) for t in (100.0, 100.5)]
    assert not same_motion(*long)
    assert same_motion(*long, POLISHED)


def test_a_likeness_is_not_negative():
    with pytest.raises(ValueError, match="likeness: heading must be at least 0, got -1"):
        Likeness(per_metre=0.1, heading=-1.0)
