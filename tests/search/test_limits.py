"""What is said without searching: a goal is out of reach only if no plan can lead there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton import Automaton, Cost, Horizon, PlanStatus, plan
from maneuver_automaton.collision import Box
from maneuver_automaton.groups import SE2xR
from maneuver_automaton.models import Unicycle, UserModel
from maneuver_automaton.problem import Goal, Problem, SearchSettings
from maneuver_automaton.search.limits import (
    closed_bounds,
    sole_shortest,
    three_are_enough,
    why_impossible,
)
from tests.search.cases import compiled_only

pytestmark = compiled_only

CURVES = {
    "straight": [1.0, 0.0, 0.0, 0.0],
    "sideways": [0.3, -0.8, 0.0, 0.0],
    "climb": [1.0, 0.0, 0.0, 0.2],
    "circle": [1.0, 0.0, 0.5, 0.0],
    "crab's circle": [0.5, 0.5, -1.0, 0.0],
    "spin": [0.0, 0.0, 2.0, 0.0],
    "helix": [1.0, 0.0, -0.5, 0.3],
    "spin upwards": [0.0, 0.0, 1.0, 0.3],
}
CLOSED = ("circle", "crab's circle", "spin")
ANYTHING = UserModel(
    name="anything",
    group=SE2xR,
    control_names=("v_x", "v_y", "turn_rate", "v_z"),
    velocity=lambda z, u: u,
)


def library(*twists):
    """Trims of these body velocities, which are their controls."""
    return Automaton.of_controls(ANYTHING, {f"trim {k}": twist for k, twist in enumerate(twists)})


def reason(twists, goal, *, start=(0.0, 0.0, 0.0, 0.0), free_heading=False):
    goals = (Goal(pose=goal, free_heading=free_heading),)
    return why_impossible(Problem(library(*twists), start, goals))


def after(twist, time, *, start=(0.0, 0.0, 0.0, 0.0)):
    """Pose after a trim."""
    return (SE2xR(start) @ SE2xR.exp(time * np.array(twist))).pose


@given(
    name=st.sampled_from(list(CURVES)),
    time=st.floats(-20.0, 20.0),
    turns=st.integers(-2, 2),
    start=st.tuples(*[st.floats(-30.0, 30.0)] * 4),
    scale=st.floats(0.2, 3.0),
)
def test_a_goal_on_the_curve_is_never_out_of_reach(name, time, turns, start, scale):
    twist = np.array(CURVES[name])
    goal = after(twist, time, start=start).copy()
    goal[2] += 2.0 * math.pi * turns
    assert reason([twist, -scale * twist], goal, start=start) == ""
    ahead_only = reason([twist, scale * twist], goal, start=start)
    if time >= 0.0 or name in CLOSED:
        assert ahead_only == ""
    elif time < -1e-3:
        assert ahead_only


@given(
    name=st.sampled_from(list(CURVES)),
    time=st.floats(-20.0, 20.0),
    start=st.tuples(*[st.floats(-30.0, 30.0)] * 4),
    axis=st.integers(0, 3),
    off=st.sampled_from([0.3, 1e-3]),
)
def test_a_goal_beside_the_curve_is_out_of_reach(name, time, start, axis, off):
    twist = np.array(CURVES[name])
    beside = np.zeros(4)
    beside[axis] = off
    if np.linalg.matrix_rank([twist, beside]) == 1:
        return  # it is further along the curve
    goal = (SE2xR(after(twist, time, start=start)) @ SE2xR(beside)).pose
    assert reason([twist, -twist], goal, start=start)


def test_a_goal_straight_ahead_behind_a_wall_is_not_called_off_the_curve():
    straights = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "back": (-1.0, 0.0)})
    wall = Box([1.0, 8.0], [3.0, 0.0])
    problem = Problem(straights, [0, 0, 0], [6, 0, 0], obstacles=wall,
                      footprint=Box([0.5, 0.5]),
                      search=SearchSettings(method="lattice"))  # fmt: skip
    result = plan(problem, time_limit=0.5)
    assert result.status in (PlanStatus.NO_PLAN, PlanStatus.OUT_OF_BUDGET)


AHEAD, LEFT, RIGHT = (1, 0, 0, 0), (2, 0, 1, 0), (1, 0, -0.5, 0)


@pytest.mark.parametrize(
    ("twists", "goal"),
    [
        ([(0, 0, 1, 0), (0, 0, -1, 0)], Goal([1, 0, 0.3, 0], tolerance_m=0.1)),
        ([AHEAD, (0, 1, 0, 0)], Goal([1, 1, 1e-10, 0])),
    ],
)
def test_what_does_not_drive_or_does_not_turn_has_no_least_time_for_it(twists, goal):
    problem = Problem(library(*twists), np.zeros(4), goal, horizon=Horizon(max_time=9.0))
    assert why_impossible(problem) == ""


LENGTH = Cost(length=1.0)


@pytest.mark.parametrize(
    ("twists", "cost", "horizon", "enough"),
    [
        ([AHEAD, LEFT, RIGHT, (1, 0, 0.2, 0)], LENGTH, Horizon(), True),
        ([AHEAD, LEFT, RIGHT], Cost(time=1.0), Horizon(), False),  # which turns faster to one side
        ([AHEAD, LEFT, RIGHT, (-1, 0, 0, 0)], LENGTH, Horizon(), False),
        ([AHEAD, LEFT, RIGHT, (1, 0.1, 0, 0)], LENGTH, Horizon(), False),
        ([AHEAD, LEFT, RIGHT, (1, 0, 0.6, 0)], LENGTH, Horizon(), False),
        ([AHEAD, LEFT, RIGHT], LENGTH, Horizon(max_time=30.0), False),
        ([AHEAD, LEFT, RIGHT], Cost(length=1.0, switch=0.1), Horizon(), False),
        ([LEFT, RIGHT], LENGTH, Horizon(), False),
    ],
)
def test_words_of_three_trims_are_enough_of_a_vehicle_that_drives_forward_alone(
    twists, cost, horizon, enough
):
    robot = library(*twists)
    problem = Problem(robot, [0, 0, 0, 0], [3, 1, 2, 0], cost=cost, horizon=horizon)
    assert three_are_enough(problem) == enough
    result = plan(problem)
    assert (result.bound.kind == "exhaustive") == enough


CAR = [(v, 0, 0.5 * side, 0) for v in (1, -1) for side in (1, 0, -1)]


@pytest.mark.parametrize(
    ("twists", "cost", "horizon", "goal", "sole"),
    [
        (CAR, LENGTH, Horizon(), (3, 1, 2), True),
        (CAR, Cost(time=1.0), Horizon(), (-5, 9, 1), True),
        ([*CAR, (1, 0, 0.2, 0), (0.5, 0, 0, 0)], Cost(time=1.0), Horizon(), (9, 1, -2), True),
        (CAR, LENGTH, Horizon(), (1, 9, 0.1), True),  # of five trims
        (CAR, LENGTH, Horizon(max_trims=3), (-9, 3, 3), False),
        (CAR, LENGTH, Horizon(), (3, 0, 0), False),  # its own image
        (CAR, LENGTH, Horizon(), (0.1, 0.2, 2), False),  # which no path turns in vain to
        (CAR, LENGTH, Horizon(max_time=99.0), (3, 1, 2), False),
        (CAR, Cost(length=1.0, switch=0.1), Horizon(), (3, 1, 2), False),
        ([*CAR, (2, 0, 0, 0)], LENGTH, Horizon(), (3, 1, 2), False),  # at two speeds
        (CAR[1:], LENGTH, Horizon(), (3, 1, 2), False),
        ([*CAR, (0, 0, 1, 0)], LENGTH, Horizon(), (3, 1, 2), False),
    ],
)
def test_the_only_shortest_path_of_a_car_is_what_a_search_of_words_finds(
    twists, cost, horizon, goal, sole
):
    robot = library(*twists)
    problem = Problem(robot, [0, 0, 0, 0], [*goal, 0], cost=cost, horizon=horizon)
    word = sole_shortest(problem, problem.goals[0])
    assert (word is not None) == sole
    searched = plan(replace(problem, search=SearchSettings(method="insertion")))
    assert max(closed_bounds(problem, problem.goals[0]).values()) <= searched.cost + 1e-9
    if word is not None:
        assert [robot.trim_names[k] for k in word.trims] == list(searched.plan.word)
        assert word.cost == pytest.approx(searched.cost, rel=1e-11)
        assert word.durations == pytest.approx(searched.plan.primitive_durations, abs=1e-6)
        result = plan(problem)
        assert (result.bound.kind, result.cost) == ("exhaustive", pytest.approx(word.cost))
