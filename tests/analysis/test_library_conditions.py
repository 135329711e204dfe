"""Which libraries reach every pose, and by which word."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.analysis import check_library, turn_move_turn
from maneuver_automaton.groups import SE2
from tests.compare import assert_same_motion

REST, AHEAD, LEFT, RIGHT, ARC = (
    [0.0, 0.0, 0.0],
    [1.5, 0.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -2.0],
    [1.0, 0.0, 1.0],
)
POSES = arrays(np.float64, 3, elements=st.floats(-10.0, 10.0))


def end_of(word, twists, start):
    end = SE2(start)
    for trim, duration in word:
        end = end @ SE2.exp(duration * np.array(twists[trim]))
    return end


def test_all_conditions_hold():
    report = check_library([ARC, REST, AHEAD, LEFT, RIGHT], max_trims=3)
    assert report.holds
    assert (report.rests, report.straights, report.spins) == ((1,), (2,), (3, 4))
    assert report.missing == ()
    assert str(report) == "library reaches every pose by turn, move, turn"


@pytest.mark.parametrize(
    ("twists", "max_trims", "message"),
    [
        ([AHEAD, LEFT], None, r"no rest, with body velocity \(0, 0, 0\)"),
        ([REST, LEFT, ARC], None, r"no forward straight, with body velocity \(v > 0, 0, 0\)"),
        ([REST, LEFT, [-1.0, 0.0, 0.0]], None, "no forward straight"),
        ([REST, LEFT, [1.0, 0.5, 0.0]], None, "no forward straight"),
        ([REST, AHEAD, ARC], None, "no spin"),
        ([REST, AHEAD, LEFT], 2, "words of at most 2 trims, need 3"),
        (np.zeros((0, 3)), 1, "at most 1 trims.*no rest.*no forward straight.*no spin"),
    ],
)
def test_what_is_missing_is_named(twists, max_trims, message):
    report = check_library(twists, max_trims=max_trims)
    assert not report.holds
    with pytest.raises(ValueError, match=message):
        raise ValueError(report.message)


@pytest.mark.parametrize("spins", [[LEFT], [RIGHT], [LEFT, RIGHT]])
@given(start=POSES, goal=POSES)
def test_turn_move_turn_ends_at_the_goal(spins, start, goal):
    twists = [REST, AHEAD, *spins]
    word = turn_move_turn(start, goal, body_velocities=twists)
    assert len(word) <= 3
    assert all(duration > 0.0 for _, duration in word)
    assert_same_motion(end_of(word, twists, start), SE2(goal), atol=1e-9, modulo_turn=True)


def test_the_quicker_spin_is_taken():
    # a quarter turn to the left takes longer than three quarters at four times the rate
    twists = [AHEAD, [0.0, 0.0, 0.5], [0.0, 0.0, -2.0]]
    word = turn_move_turn(np.zeros(3), [0.0, 0.0, np.pi / 2], body_velocities=twists)
    assert word == [(2, pytest.approx(0.75 * np.pi))]


def test_the_fastest_straight_is_taken():
    word = turn_move_turn(
        np.zeros(3), [6.0, 0.0, 0.0], body_velocities=[[1.0, 0.0, 0.0], [3.0, 0.0, 0.0], LEFT]
    )
    assert word == [(1, 2.0)]


def test_no_spin_through_a_full_turn_for_a_rounding_error():
    word = turn_move_turn([0.0, 0.0, 1e-16], [3.0, 0.0, 2 * np.pi], body_velocities=[AHEAD, LEFT])
    assert word == [(0, 2.0)]


def test_no_motion_where_the_start_is_the_goal():
    assert turn_move_turn([1, 2, 3], [1, 2, 3], body_velocities=[AHEAD, LEFT]) == []


def test_an_unfit_library_is_refused():
    with pytest.raises(ValueError, match=r"turn_move_turn: library does not reach .* no spin"):
        turn_move_turn(np.zeros(3), np.ones(3), body_velocities=[REST, AHEAD])
    with pytest.raises(ValueError, match=r"body_velocities: got shape \(3,\), need \(m, 3\)"):
        check_library([1.0, 0.0, 0.0])
