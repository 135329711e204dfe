"""SE(2) by hand."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.groups import SE2
from tests.compare import assert_same_motion


def test_quarter_circle_to_the_left():
    assert_same_motion(SE2.exp([np.pi / 2, 0.0, np.pi / 2]), SE2([1.0, 1.0, np.pi / 2]), atol=1e-15)


def test_straight_drive_is_exact():
    assert SE2.exp([3.0, -2.0, 0.0]).pose.tolist() == [3.0, -2.0, 0.0]


def test_full_circle_keeps_its_turn():
    assert_same_motion(SE2.exp([5.0, 0.0, 2 * np.pi]), SE2([0.0, 0.0, 2 * np.pi]), atol=1e-14)


def test_drive_then_turn_is_not_turn_then_drive():
    drive, turn = SE2([1.0, 0.0, 0.0]), SE2([0.0, 0.0, np.pi / 2])
    assert_same_motion(drive @ turn, SE2([1.0, 0.0, np.pi / 2]), atol=1e-15)
    assert_same_motion(turn @ drive, SE2([0.0, 1.0, np.pi / 2]), atol=1e-15)


def test_headings_add_up_and_are_not_wrapped():
    three_quarters = SE2([0.0, 0.0, 1.5 * np.pi])
    assert (three_quarters @ three_quarters).pose[2] == 3 * np.pi


def test_headings_can_be_compared_modulo_a_turn():
    a, b = SE2([1.0, 2.0, 0.1]), SE2([1.0, 2.0, 0.1 + 4 * np.pi])
    assert_same_motion(a, b, modulo_turn=True)
    with pytest.raises(AssertionError, match=r"differ by 12\.6"):
        assert_same_motion(a, b)


def test_inverse_by_hand():
    assert_same_motion(
        SE2([1.0, 2.0, np.pi / 2]).inverse(), SE2([-2.0, 1.0, -np.pi / 2]), atol=1e-15
    )


def test_adjoint_by_hand():
    expected = [[0.0, -1.0, 3.0], [1.0, 0.0, -2.0], [0.0, 0.0, 1.0]]
    np.testing.assert_allclose(SE2([2.0, 3.0, np.pi / 2]).adjoint(), expected, atol=1e-15)


def test_matrix_composes_as_poses_do():
    a, b = SE2([1.0, 2.0, 0.7]), SE2([-0.5, 0.3, 2.0])
    np.testing.assert_allclose((a @ b).matrix(), a.matrix() @ b.matrix(), atol=1e-15)
    point = a.matrix() @ [3.0, 4.0, 1.0]
    np.testing.assert_allclose(point[:2], a.act([3.0, 4.0]), atol=1e-15)


@pytest.mark.parametrize("w", [1e-8, 1e-5, 1e-3])
def test_small_turns_keep_all_their_digits(w):
    # (1 - cos w) / w = w/2 - w^3/24 + ..., which that form does not give at w = 1e-8
    aside = SE2.exp([1.0, 0.0, w]).pose[1]
    assert aside == pytest.approx(w / 2 - w**3 / 24 + w**5 / 720, rel=1e-15)


def test_log_of_more_than_half_a_turn():
    twist = [1.0, 0.2, 1.7 * np.pi]
    np.testing.assert_allclose(SE2.exp(twist).log(), twist, atol=1e-14)


def test_log_of_whole_turns_on_the_spot_is_a_spin():
    assert SE2([0.0, 0.0, -4 * np.pi]).log().tolist() == [0.0, 0.0, -4 * np.pi]
    np.testing.assert_array_equal(SE2([1e-17, 0.0, 2 * np.pi]).log(), [0.0, 0.0, 2 * np.pi])


def test_log_of_whole_turns_elsewhere_does_not_exist():
    with pytest.raises(ValueError, match=r"pose \(0, 2, 12.5664\) is 2 m away after 2 full turns"):
        SE2([[1.0, 0.0, 1.0], [0.0, 2.0, 4 * np.pi]]).log()
    with pytest.raises(ValueError, match="after 1 full turn,"):
        SE2([1.0, 0.0, -2 * np.pi]).log()
    loose = SE2([1.0, 0.0, 2 * np.pi]).log(position_tolerance=1.5)
    assert loose.tolist() == [0.0, 0.0, 2 * np.pi]


def test_log_just_beside_a_whole_turn_exists():
    a = SE2([1e-3, 0.0, 2 * np.pi + 1e-6])
    assert_same_motion(SE2.exp(a.log()), a, atol=1e-9)


def test_empty_batches_pass_through():
    none = SE2(np.zeros((0, 3)))
    assert (none @ none.inverse()).pose.shape == (0, 3)
    assert none.log().shape == (0, 3)
    assert none.adjoint().shape == (0, 3, 3)
