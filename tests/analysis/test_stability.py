from __future__ import annotations

import math

import numpy as np
import pytest

from maneuver_automaton.analysis.growth import (
    GrowthBound,
    growth_bound,
    ring_poses,
)
from maneuver_automaton.analysis.stability import certified_horizon, check_closed_loop
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.errors import InvalidAutomaton
from maneuver_automaton.models import Unicycle
from maneuver_automaton.receding_horizon.unconstrained import search_horizon, simulate_unconstrained
from tests.receding_horizon.unconstrained_cases import (
    MIXED,
    QUADRATIC,
    even,
    octaves,
    problem_of,
)
from tests.reference_unconstrained import index_by_program

TIMES = np.arange(1, 17) / 2.0


def bound(times, bounds):
    worst = np.ones((len(times), 3))
    return GrowthBound(times=times, bounds=bounds, worst=worst, samples=1)


@pytest.mark.parametrize("step", [0.4, 1.0])
def test_the_index_is_what_its_linear_program_nears_as_intervals_get_short(step):
    gaps = []
    for h in (0.1, 0.05, 0.025):
        times = h * np.arange(1, round(4.0 / h) + 1)
        growth = 2.0 * (1.0 - np.exp(-times))
        index = certified_horizon(bound(times, growth), step=step).indices[-1]
        program = index_by_program(np.maximum(growth / h, 1.0), round(step / h))
        gaps.append(program - index)
    assert 0.0 < gaps[2] < 0.6 * gaps[1] < 0.36 * gaps[0]


def test_resting_alone_gives_an_index_of_zero_in_continuous_time():
    times = np.arange(1, 40001) / 1e4
    assert certified_horizon(bound(times, times), step=0.5).indices[-1] == pytest.approx(
        0.0, abs=1e-3
    )


def test_the_index_by_hand():
    root = math.exp(-1.0)
    expected = 1.0 - root * root / (1.0 - root) ** 2
    index = certified_horizon(bound([2.0], [1.0]), step=1.0).indices[-1]
    assert index == pytest.approx(expected)
    index = certified_horizon(bound([1.0, 4.0], [1.0, 1.0]), step=2.0).indices[-1]
    assert index == pytest.approx(1.0 - 1.0 / (math.exp(2.0) - 1.0) ** 2)


def test_the_ring_has_its_level():
    poses = ring_poses(MIXED, levels=[1e-3, 0.2], parts=3)
    rates = MIXED.pose_rates(poses)
    assert len(np.unique(poses, axis=0)) == len(poses) == 76
    np.testing.assert_allclose(rates[:38], 1e-3)
    np.testing.assert_allclose(rates[38:], 0.2)


def test_the_growth_bound_is_above_the_values_of_fine_horizons():
    # words may switch at any time, so a fine grid of switching times approaches the bound from
    # whatever side: the best sequence is better than any single word, up to its rounding
    poses = ring_poses(MIXED, levels=[0.3], parts=2)
    bound = growth_bound(octaves(3), MIXED, poses=poses, times=TIMES)
    for intervals in (4, 8, 16):
        problem = problem_of(octaves(3), MIXED, intervals=intervals, interval=0.25)
        values = [search_horizon(problem, pose).value for pose in poses]
        reached = np.max(values / MIXED.pose_rates(poses))
        assert reached <= 1.02 * bound.bounds[intervals // 2 - 1]


def test_growth_rises_and_stays_below_resting():
    poses = ring_poses(MIXED, levels=[0.3], parts=2)
    bound = growth_bound(octaves(3), MIXED, poses=poses, times=TIMES)
    assert (np.diff(bound.bounds) >= 0.0).all()
    assert (bound.bounds <= TIMES * (1.0 + 1e-12)).all()
    assert bound.samples == len(poses)
    assert repr(bound) == f"GrowthBound(B(8 s) = {bound.bounds[-1]:.6g} s, sampled at 18 poses)"


@pytest.mark.slow
def test_growth_is_the_same_at_every_scale_where_speeds_scale_too():
    last = [
        growth_bound(
            octaves(8), MIXED, poses=ring_poses(MIXED, levels=[level], parts=2), times=[1.0, 9.0]
        ).bounds
        for level in (2e-3, 2e-3 / 16.0, 2e-3 / 256.0)
    ]
    np.testing.assert_allclose(last[1], last[0], rtol=0.03)
    np.testing.assert_allclose(last[2], last[1], rtol=0.03)


def test_near_the_goal_squares_leave_resting_as_the_best_word():
    poses, times = [[0.0, 0.05, 0.0]], np.arange(1, 121) / 20.0
    mixed = growth_bound(octaves(5), MIXED, poses=poses, times=times)
    square = growth_bound(octaves(5), QUADRATIC, poses=poses, times=times)
    np.testing.assert_allclose(square.bounds, times)
    assert mixed.bounds[-1] < 4.0
    assert certified_horizon(mixed, step=0.5).horizon is not None
    assert certified_horizon(square, step=0.5).horizon is None


def test_a_closed_loop_keeps_the_promise_of_its_index():
    library, start = octaves(3), np.array([0.0, 0.8, 0.0])
    loop = simulate_unconstrained(problem_of(library, MIXED, intervals=10), start, steps=5)
    poses = np.concatenate([ring_poses(MIXED, levels=[0.01, 0.1, 0.64], parts=2), loop.poses[:-1]])
    growth = growth_bound(library, MIXED, poses=poses, times=np.arange(1, 101) / 20.0)
    index = certified_horizon(growth, step=0.5).index_at(5.0)
    check = check_closed_loop(loop.values, loop.stage_costs, index=index)
    assert index > 0.3
    assert check.holds
    assert check.steps == 5
    assert check.cost <= check.limit


def test_a_broken_promise_is_seen():
    check = check_closed_loop([3.0, 2.9, 1.0], [1.0, 1.0], index=0.5)
    assert not check.holds
    assert check.least_decrease == pytest.approx(0.1)
    assert check_closed_loop([3.0, 2.9], [1.0], index=-1.0).limit == math.inf


def test_an_index_is_read_at_the_longest_horizon_below():
    growth = GrowthBound(times=[1, 2, 3], bounds=[1.0, 1.5, 1.6], worst=np.ones((3, 3)), samples=1)
    certificate = certified_horizon(growth, step=1.0)
    assert certificate.horizon == 3.0
    assert certificate.index_at(2.5) == certificate.indices[0] > certificate.index_at(1.5)


ROWS = np.ones((2, 3))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: bound([2.0, 1.0], [1.0, 1.0]),
            "times: need one axis of rising positive times, with one growth each",
        ),
        (
            lambda: bound([1.0, 2.0], [1.0, 0.5]),
            "growth: got [1.0, 0.5], need positive numbers that rise",
        ),
        (
            lambda: ring_poses(MIXED, levels=[0.0]),
            "levels: got [0.0] in 4 parts, need positive numbers",
        ),
        (
            lambda: growth_bound(even(3), MIXED, poses=ROWS, times=[2.0, 1.0]),
            "times: got [2.0, 1.0], need one axis of rising positive times",
        ),
        (
            lambda: growth_bound(even(3), MIXED, poses=np.zeros((1, 3)), times=[1.0]),
            "least: got 0.0, need positive costs: leave out the goal",
        ),
        (
            lambda: check_closed_loop([1.0], [1.0], index=1.0),
            "values: got shape (1,) for costs of shape (1,), need one more",
        ),
        (
            lambda: check_closed_loop([1.0, 0.0], [0.0], index=1.0),
            "stage_costs: got 0.0, need positive costs",
        ),
    ],
)
def test_wrong_input_is_named(make, message):
    with pytest.raises(ValueError) as caught:
        make()
    assert str(caught.value) == message


def test_a_growth_bound_has_the_times_its_certificate_needs():
    growth = GrowthBound(times=[0.5, 1.0], bounds=[0.5, 1.0], worst=ROWS, samples=1)
    with pytest.raises(ValueError) as caught:
        certified_horizon(growth, step=1.0)
    assert str(caught.value) == (
        "step: got 1.0 s, need a positive time below the last one of the growth bound, 1 s"
    )


def test_a_library_that_cannot_turn_back_has_no_growth_bound():
    robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (0, 1), "right": (0, -1)})
    with pytest.raises(InvalidAutomaton) as caught:
        growth_bound(robot, MIXED, poses=ROWS, times=[1.0])
    assert str(caught.value) == ("growth bound: the library lacks a rest, straights ahead and back")
