from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.analysis import FeasibleSet, feasible_set, least_times
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem
from maneuver_automaton.search.limits import closed_bound
from tests.search.cases import NAMED_TABLE_2, robot

TABLE_2 = robot(NAMED_TABLE_2)
DUBINS = Automaton.of_controls(Unicycle(), {"l": (1, 1), "s": (1, 0), "r": (1, -1)})
TURNS = Automaton.of_controls(Unicycle(), {"go": (1.5, 0), "left": (0, 0.5), "right": (0, -0.5)})
POSES = np.random.default_rng(5).uniform([-4, -4, -3], [4, 4, 3], (20, 3))


def problem_of(robot, *, goals=(0.0, 0.0, 0.0), max_trims=3, **horizon):
    limits = Horizon(max_trims=max_trims, **horizon)
    return Problem(robot, [0.0, 1.0, 0.0], goals, cost=Cost(effort=1.0), horizon=limits)


def dubins_length(pose):
    """Shortest path of turns of radius 1 to the origin, by the formulas of Shkel and Lumelsky.

    Source: Shkel, Lumelsky (2001), "Classification of the Dubins set".
    """
    x, y, heading = pose
    d, theta = math.hypot(x, y), math.atan2(-y, -x)
    a, b = (heading - theta) % math.tau, -theta % math.tau
    sa, sb, ca, cb, cab = math.sin(a), math.sin(b), math.cos(a), math.cos(b), math.cos(a - b)
    lengths = []
    if (square := 2 + d * d - 2 * cab + 2 * d * (sa - sb)) >= 0.0:
        turn = math.atan2(cb - ca, d + sa - sb)
        lengths.append((turn - a) % math.tau + math.sqrt(square) + (b - turn) % math.tau)
    if (square := 2 + d * d - 2 * cab + 2 * d * (sb - sa)) >= 0.0:
        turn = math.atan2(ca - cb, d - sa + sb)
        lengths.append((a - turn) % math.tau + math.sqrt(square) + (turn - b) % math.tau)
    if (square := -2 + d * d + 2 * cab + 2 * d * (sa + sb)) >= 0.0:
        p = math.sqrt(square)
        turn = math.atan2(-ca - cb, d + sa + sb) - math.atan2(-2.0, p)
        lengths.append((turn - a) % math.tau + p + (turn - b) % math.tau)
    if (square := -2 + d * d + 2 * cab - 2 * d * (sa + sb)) >= 0.0:
        p = math.sqrt(square)
        turn = math.atan2(ca + cb, d - sa - sb) - math.atan2(2.0, p)
        lengths.append((a - turn) % math.tau + p + (b - turn) % math.tau)
    if abs(cosine := (6 - d * d + 2 * cab + 2 * d * (sa - sb)) / 8) <= 1.0:
        p = (math.tau - math.acos(cosine)) % math.tau
        t = (a - math.atan2(ca - cb, d - sa + sb) + p / 2) % math.tau
        lengths.append(t + p + (a - b - t + p) % math.tau)
    if abs(cosine := (6 - d * d + 2 * cab + 2 * d * (sb - sa)) / 8) <= 1.0:
        p = (math.tau - math.acos(cosine)) % math.tau
        t = (-a + math.atan2(-ca + cb, d + sa - sb) + p / 2) % math.tau
        lengths.append(t + p + (b - a - t + p) % math.tau)
    return min(lengths)


def test_straight_ahead_the_time_is_distance_by_speed():
    robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "slow": (0.5, 0), "fast": (1.5, 0)})
    poses = [[-3.0, 0.0, 0.0], [-0.75, 0.0, math.tau], [0.0, 0.0, 0.0]]
    times = least_times(problem_of(robot), poses)
    assert np.allclose(times, [2.0, 0.5, 0.0], rtol=0.0, atol=1e-9)
    unreached = [[1.0, 0.0, 0.0], [-1.0, 0.5, 0.0], [-1.0, 0.0, 0.1]]
    assert np.isinf(least_times(problem_of(robot), unreached)).all()


def test_turn_move_turn_by_hand():
    """From (-3, -3) facing +y: an eighth of a turn to the right, 3 sqrt(2) m, the same again."""
    times = least_times(problem_of(TURNS), [[-3.0, -3.0, math.pi / 2]])
    assert np.isclose(times[0], math.pi / 2 / 0.5 + 3.0 * math.sqrt(2.0) / 1.5)


def test_with_three_trims_of_a_car_the_times_are_those_of_dubins():
    times = least_times(problem_of(DUBINS), POSES)
    assert np.allclose(times, [dubins_length(pose) for pose in POSES], rtol=1e-9)


@given(by=st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-4.0, 4.0)))
@settings(max_examples=10)
def test_moving_goal_and_poses_together_changes_nothing(by):
    problem, move = problem_of(TABLE_2), SE2(by)
    moved = problem.moved(move)
    there = least_times(moved, (move @ SE2(POSES[:6])).pose)
    assert np.allclose(there, least_times(problem, POSES[:6]), rtol=1e-9)


def test_a_mirrored_library_has_a_mirrored_set():
    """The trims of DUBINS are their own mirror image; spin on the left alone is not."""
    found = feasible_set(
        problem_of(DUBINS),
        5.0,
        window=((-3.0, 3.0), (-3.0, 3.0)),
        headings=[0.7, -0.7],
        resolution=1.0,
    )
    assert np.allclose(found.times[0], found.times[1, ::-1], rtol=1e-9)
    assert 0.0 < found.feasible.mean() < 1.0
    left = least_times(problem_of(TABLE_2), POSES)
    right = least_times(problem_of(TABLE_2), POSES * [1.0, -1.0, -1.0])
    assert not np.allclose(left, right)


def test_no_time_is_below_the_bound_of_way_and_turn():
    problem = problem_of(TABLE_2)
    for pose, time in zip(POSES, least_times(problem, POSES), strict=True):
        here = Problem(TABLE_2, pose, (0.0, 0.0, 0.0), cost=Cost(time=1.0))
        assert time >= closed_bound(here, here.goals[0]) - 1e-9


def test_more_trims_are_never_slower():
    few, more = (least_times(problem_of(TABLE_2, max_trims=n), POSES[:4]) for n in (3, 4))
    assert (more <= few + 1e-9).all()


def test_a_fixed_time_leaves_a_trim_to_the_rest():
    fixed = least_times(problem_of(TABLE_2, max_trims=4, time=8.0), POSES)
    assert np.allclose(fixed, least_times(problem_of(TABLE_2, max_trims=3), POSES))
    with pytest.raises(ValueError) as error:
        least_times(problem_of(TABLE_2, max_trims=1, time=8.0), POSES)
    assert str(error.value) == (
        "least times: a fixed time padded by rest leaves no trim to move with, need max_trims of "
        "at least 2, got 1"
    )


def test_of_several_goals_the_nearest_counts():
    goals = [[0.0, 0.0, 0.0], [1.0, -2.0, 1.0]]
    both = least_times(problem_of(TABLE_2, goals=goals), POSES)
    each = [least_times(problem_of(TABLE_2, goals=goal), POSES) for goal in goals]
    assert np.allclose(both, np.minimum(*each))


def test_any_heading_is_never_slower():
    free = Goal(pose=(0.0, 0.0, 0.0), free_heading=True)
    assert (
        least_times(problem_of(TABLE_2, goals=free), POSES)
        <= least_times(problem_of(TABLE_2), POSES) + 1e-9
    ).all()


def test_without_a_limit_the_search_is_not_exhaustive():
    window = ((-1.0, 0.0), (0.0, 1.0))
    problem = problem_of(TABLE_2, max_trims=None)
    found = feasible_set(problem, 4.0, window=window, headings=[0.0], resolution=1.0)
    assert not found.exhaustive
    poses = np.array([[-1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    assert (found.times[0, 1] <= least_times(problem_of(TABLE_2), poses) + 1e-9).all()


def test_the_grid_is_where_it_says():
    problem, window = problem_of(TABLE_2), ((-2.0, 1.0), (0.0, 1.0))
    found = feasible_set(problem, 3.0, window=window, headings=[0.0, 2.0], resolution=0.8)
    assert np.allclose(found.x, [-2.0, -1.25, -0.5, 0.25, 1.0])
    assert np.allclose(found.y, [0.0, 0.5, 1.0])
    pose = [found.x[1], found.y[2], 2.0]
    assert found.times[1, 2, 1] == least_times(problem, [pose])[0]
    assert found.exhaustive
    assert (found.feasible == (found.times <= 3.0 + 1e-9)).all()


def test_many_processes_find_the_same():
    problem, poses = problem_of(DUBINS), np.tile(POSES[:5], (14, 1))
    assert (least_times(problem, poses, jobs=2) == least_times(problem, poses)).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"within": 0.0}, "feasible set: within must be positive, got 0.0 s"),
        ({"resolution": -1.0}, "feasible set: resolution must be positive, got -1.0 m"),
        ({"headings": []}, "feasible set: got headings of shape (0,), need (k,)"),
        (
            {"window": ((1.0, 0.0), (0.0, 1.0))},
            "feasible set: window must have low < high, got x from 1.0 to 0.0 m",
        ),
    ],
)
def test_wrong_grids_are_named(changes, message):
    usual = {"within": 1.0, "window": ((0, 1), (0, 1)), "headings": [0.0], "resolution": 1.0}
    arguments = {**usual, **changes}
    with pytest.raises(ValueError) as error:
        feasible_set(problem_of(TABLE_2), arguments.pop("within"), **arguments)
    assert str(error.value) == message


def test_wrong_poses_and_problems_are_named():
    with pytest.raises(ValueError) as error:
        least_times(problem_of(TABLE_2), [0.0, 0.0, 0.0])
    assert str(error.value) == "poses: got shape (3,), need (n, 3)"
    with pytest.raises(ValueError) as error:
        least_times(problem_of(TABLE_2), POSES, jobs=0)
    assert str(error.value) == "jobs must be at least 1, got 0"
    bounded = Problem(TABLE_2, [0, 0, 0], [1, 0, 0], bounds=Bounds(x=(-1.0, 2.0)))
    with pytest.raises(ValueError) as error:
        least_times(bounded, POSES)
    assert str(error.value) == ("least times: bounds do not move with the symmetry; leave them out")
    with pytest.raises(ValueError) as error:
        FeasibleSet(
            problem=bounded, within=1.0, x=[0, 1], y=[0, 1], headings=[0], times=[[0.0]],
            exhaustive=True,
        )  # fmt: skip
    assert str(error.value) == "feasible set: got times of shape (1, 1), need (1, 2, 2)"
