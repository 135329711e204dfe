"""Groups made of others, by hand: translations, products, and SE(2) x R."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.groups import SE2, SE2xR, group_of, product, translations
from tests.compare import assert_same_motion


def test_one_class_for_each_dimension():
    assert translations(2) is translations(2)
    assert translations(2) is not translations(3)
    assert translations(3).coordinates == ("x", "y", "z")
    assert translations(4).coordinates == ("x1", "x2", "x3", "x4")
    with pytest.raises(ValueError, match="translations: n must be at least 1, got 0"):
        translations(0)


def test_one_class_for_each_pair():
    assert product(SE2, SE2) is product(SE2, SE2)
    assert product(SE2, translations(1)) is not product(translations(1), SE2)
    assert product(SE2, SE2).coordinates == ("x_1", "y_1", "heading_1", "x_2", "y_2", "heading_2")


def test_two_robots_do_not_feel_each_other():
    group = product(SE2, SE2)
    moved = group([1.0, 0.0, np.pi / 2, 0.0, 0.0, 0.0]) @ group([2.0, 0.0, 0.0, 5.0, 6.0, 7.0])
    np.testing.assert_allclose(moved.pose, [1.0, 2.0, np.pi / 2, 5.0, 6.0, 7.0], atol=1e-15)


def test_helix_rises_while_it_turns():
    assert_same_motion(
        SE2xR.exp([np.pi, 0.0, np.pi, 3.0]), SE2xR([0.0, 2.0, np.pi, 3.0]), atol=1e-15
    )


def test_planar_motions_are_a_subgroup():
    a, b = SE2([1.0, 2.0, 0.5]), SE2([0.3, -0.2, 1.0])
    lifted = SE2xR([1.0, 2.0, 0.5, 0.0]) @ SE2xR([0.3, -0.2, 1.0, 0.0])
    assert lifted.pose[3] == 0.0
    assert_same_motion(lifted.planar, a @ b, atol=0.0)


def test_group_of_dof():
    assert group_of(3) is SE2
    assert group_of(4) is SE2xR
    with pytest.raises(ValueError, match=r"dof: got 6, need 3 \(x, y, heading\) or 4"):
        group_of(6)
