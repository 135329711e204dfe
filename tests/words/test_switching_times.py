"""Best coasting times of a fixed word: against SLSQP, by optimality conditions, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.words import (
    SwitchingTimes,
    TimesStatus,
    solve_switching_times,
)
from maneuver_automaton.words._kernels_solve import correct
from maneuver_automaton.words._kernels_times import TimesProblem, residual
from tests import reference
from tests.quickly import quick_are

AHEAD, BACK, LEFT, RIGHT = [1.0, 0, 0], [-1.0, 0, 0], [1.0, 0, 1.0], [1.0, 0, -1.0]
SPIN, SPIN_BACK = [0.0, 0, 1.0], [0.0, 0, -1.0]


def random_words(n_words, *, total, seed):
    """Words of three to seven trims whose goal is reached by known, positive times."""
    rng = np.random.default_rng(seed)
    for _ in range(n_words):
        n = int(rng.integers(4 if total else 3, 8))
        speeds = rng.choice([-1.0, -0.5, 0.0, 0.5, 1.0, 1.5], n)
        turns = rng.choice([-1.0, 0.0, 0.0, 0.5, 1.0], n)
        twists = np.column_stack([speeds, np.zeros(n), turns])
        times = rng.uniform(0.1, 2.0, n)
        rates = 1.0 + rng.uniform(0.0, 1.0, n)
        goal = reference.word_end(twists, times)
        whole = float(times.sum()) if total else None
        yield reference.Word(twists, rates, goal, total=whole), times


def solve(word, **options):
    return solve_switching_times(word.twists, word.rates, word.goal, total=word.total, **options)


def assert_optimal(word: reference.Word, solved: SwitchingTimes) -> None:
    """The conditions of Karush, Kuhn and Tucker, from the returned multipliers."""
    off, matrix = word.conditions(solved.durations)
    assert np.abs(off).max() < 1e-9
    assert solved.durations.min() >= 0.0
    assert solved.cost == pytest.approx(word.cost(solved.durations), abs=1e-12)
    reduced = word.rates + matrix.T @ solved.multipliers
    used = solved.durations > 0.0
    assert np.abs(reduced[used]).max(initial=0.0) < 1e-6
    if np.linalg.matrix_rank(matrix[:, used], tol=1e-6) == len(matrix):
        assert reduced.min(initial=0.0) > -1e-6  # the multipliers are unique: no trim pays


@pytest.mark.parametrize("total", quick_are([True], [False, True]), ids=["free", "fixed"])
def test_agrees_with_slsqp(total):
    costlier = 0
    for word, planted in random_words(60, total=total, seed=7):
        solved = solve(word, guesses=[planted])
        assert solved.status is TimesStatus.OPTIMAL
        assert_optimal(word, solved)
        improved = word.slsqp(np.array(solved.durations))
        assert improved is None or word.cost(improved) > solved.cost - 1e-6
        warm = word.slsqp(planted)
        costlier += warm is not None and solved.cost > word.cost(warm) + 1e-6
    assert costlier <= 6  # both are local: now and then one ends in a costlier valley


@pytest.mark.parametrize("total", quick_are([False], [False, True]), ids=["free", "fixed"])
def test_a_cold_start_finds_the_goal(total):
    for word, _ in random_words(60, total=total, seed=8):
        solved = solve(word)
        assert solved.status is not TimesStatus.FAILED
        assert np.abs(word.conditions(solved.durations)[0]).max() < 1e-9


@pytest.mark.parametrize("turns", [-2, -1, 1, 3])
def test_a_goal_moved_by_whole_turns_has_the_same_times(turns):
    for word, planted in random_words(10, total=False, seed=9):
        moved = word.goal + np.array([0.0, 0.0, 2.0 * np.pi * turns])
        here = solve(word, guesses=[planted])
        there = solve_switching_times(word.twists, word.rates, moved, guesses=[planted])
        assert there.durations == pytest.approx(here.durations, abs=1e-7)


def test_climbing_words_meet_the_altitude():
    rng = np.random.default_rng(3)
    for _ in range(20):
        twists = np.column_stack([rng.uniform(-1, 1, (5, 4))])
        twists[0, 2] = twists[3, 2] = 0.0
        times = rng.uniform(0.1, 1.5, 5)
        goal = reference.word_end(twists, times)
        word = reference.Word(twists, 1.0 + rng.uniform(0.0, 1.0, 5), goal)
        solved = solve(word, guesses=[times])
        assert solved.status is TimesStatus.OPTIMAL
        end = reference.word_end(twists, solved.durations)
        assert reference.off_goal(end, goal) == pytest.approx(np.zeros(4), abs=1e-9)
        assert solved.multipliers.shape == (4,)
        assert_optimal(word, solved)


def test_gaps_are_kept_even_beside_a_trim_of_no_time():
    twists, displacements = [AHEAD, SPIN, AHEAD], np.zeros((3, 4))
    displacements[0] = 0.5, 0.25, 0.0, 0.0
    goal = reference.word_end(twists, [1.0, 0.0, 2.0], displacements[:, :3])
    solved = solve_switching_times(twists, [1, 1, 1], goal, displacements=displacements[:, :3])
    assert solved.status is TimesStatus.OPTIMAL
    end = reference.word_end(twists, solved.durations, displacements[:, :3])
    assert reference.off_goal(end, goal) == pytest.approx(np.zeros(3), abs=1e-9)
    assert solved.durations[1] < 1e-6
    assert solved.durations.sum() == pytest.approx(3.0, abs=1e-6)


def test_gaps_of_random_words_are_met():
    rng = np.random.default_rng(5)
    for _ in range(20):
        twists = rng.uniform(-1, 1, (4, 3))
        displacements = np.pad(rng.uniform(-1, 1, (4, 3)), [(0, 0), (0, 1)])
        times = rng.uniform(0.2, 1.5, 4)
        goal = reference.word_end(twists, times, displacements[:, :3])
        solved = solve_switching_times(
            twists, np.ones(4), goal, displacements=displacements[:, :3], guesses=[times]
        )
        assert solved.status is not TimesStatus.FAILED
        end = reference.word_end(twists, solved.durations, displacements[:, :3])
        assert np.abs(reference.off_goal(end, goal)).max() < 1e-9
        assert solved.durations.min() >= 0.0
        assert solved.cost < times.sum() + 1e-6


# Words whose twists do not span.


def test_two_speeds_share_a_fixed_time():
    # Table 1 of the paper: 1.62 m in one second, between the controls 1.6 and 1.7
    solved = solve_switching_times([[1.6, 0, 0], [1.7, 0, 0]], [2.56, 2.89], [1.62, 0, 0], total=1)
    assert solved.status is TimesStatus.OPTIMAL
    assert solved.durations == pytest.approx([0.8, 0.2], abs=1e-9)
    assert solved.cost == pytest.approx(2.626, abs=1e-9)


def test_of_many_speeds_the_two_neighbours_are_used():
    speeds = np.arange(0.0, 2.05, 0.1)
    twists = np.column_stack([speeds, np.zeros((speeds.size, 2))])
    solved = solve_switching_times(twists, speeds**2, [1.62, 0, 0], total=1.0)
    assert solved.status is TimesStatus.OPTIMAL
    used = np.flatnonzero(solved.durations)
    assert speeds[used] == pytest.approx([1.6, 1.7])
    assert solved.durations[used] == pytest.approx([0.8, 0.2], abs=1e-9)


def test_what_the_word_cannot_reach_fails():
    aside = solve_switching_times([AHEAD, BACK], [1, 1], [0.0, 1.0, 0.0])
    assert aside.status is TimesStatus.FAILED
    assert aside.cost == np.inf
    assert solve_switching_times([AHEAD], [1], [-1.0, 0, 0]).status is TimesStatus.FAILED
    late = solve_switching_times([AHEAD], [1.0], [1.0, 0, 0], total=2.0)
    assert late.status is TimesStatus.FAILED


# Goals that one set of times alone reaches.


@pytest.mark.xfail(strict=True, reason="refined for the goal alone after optimality was judged")
def test_beside_a_cusp_of_the_feasible_times_optimal_means_optimal():
    twists = np.array([[-0.5, 0, 0], [-1.0, 0, -1.0], [0.5, 0, 0], [-1.0, 0, 0.5]])
    goal = reference.plain_end(twists, [0.3, 0.0, 0.0, 0.5])
    word = reference.Word(twists, np.array([1.4, 1.4, 1.3, 1.8]), goal)
    solved = solve(word)
    assert solved.status is TimesStatus.FEASIBLE or solved.cost < 1.32 + 1e-6
    if solved.status is TimesStatus.OPTIMAL:
        assert_optimal(word, solved)


def ends_off(twists, times, goal):
    columns, gap = np.zeros((len(times), 3)), np.zeros(3)
    problem = TimesProblem(
        twists, np.ones(len(times)), np.zeros((0, len(times))), goal, np.zeros(0)
    )
    return residual(problem, times, columns, gap), problem, gap, columns


def test_a_step_along_curved_conditions_is_corrected():
    twists = np.array([[1.0, 0, 1.0, 0], [1.0, 0, 0, 0], [1.0, 0, -1.0, 0], [0.5, 0, 0.5, 0]])
    times = np.array([0.7, 1.3, 0.4, 0.9])
    goal = np.append(reference.plain_end(twists[:, :3], times), 0.0)
    for off in (1e-1, 1e-2, 1e-3):
        near = times + off * np.array([1.0, -0.5, 0.3, 0.2])
        before, problem, gap, columns = ends_off(twists, near, goal)
        assert correct(problem, near, gap, columns)
        after, _, there, _ = ends_off(twists, near, goal)
        assert after < before * before
        assert there == pytest.approx(gap, abs=1e-15)
        assert near.min() > 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"twists": [1.0, 0, 0]}, r"twists: got shape \(3,\), need \(n, 3\) or \(n, 4\)"),
        ({"twists": [[1.0, 0]]}, r"twists: got shape \(1, 2\), need 3 or 4 components last"),
        ({"rates": [1, 1]}, r"rates: got shape \(2,\), need \(1,\), one per trim"),
        ({"rates": [np.inf]}, "rates: got inf, need finite numbers"),
        ({"goal": [1.0, 0]}, r"goal: got shape \(2,\), need 3 or 4 components last"),
        ({"guesses": [[1, 2]]}, r"guesses: got shape \(2,\), need \(1,\)"),
        ({"guesses": [[np.nan]]}, "guesses: got nan, need finite numbers"),
        ({"total": np.nan}, "total: got nan, need finite numbers"),
        ({"displacements": [[0, 0, 0]] * 2}, "displacements: got 2, need 0, one between each two"),
        ({"displacements": [1, 0, 0, 0]}, r"displacements: got shape \(4,\), need \(0, 3\)"),
    ],
)
def test_wrong_input(change, message):
    arguments = {"twists": [AHEAD], "rates": [1.0], "goal": [1.0, 0, 0]} | change
    with pytest.raises(ValueError, match=message):
        solve_switching_times(
            arguments.pop("twists"), arguments.pop("rates"), arguments.pop("goal"), **arguments
        )
