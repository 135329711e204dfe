"""The factory of product groups."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.groups import SE2, product, translations


def test_one_class_for_each_pair():
    assert product(SE2, SE2) is product(SE2, SE2)
    assert product(SE2, translations(1)) is not product(translations(1), SE2)


def test_two_robots_do_not_feel_each_other():
    group = product(SE2, SE2)
    moved = group([1.0, 0.0, np.pi / 2, 0.0, 0.0, 0.0]) @ group([2.0, 0.0, 0.0, 5.0, 6.0, 7.0])
    np.testing.assert_allclose(moved.pose, [1.0, 2.0, np.pi / 2, 5.0, 6.0, 7.0], atol=1e-15)


def test_names_of_both_robots_differ():
    assert product(SE2, SE2).coordinates == ("x_1", "y_1", "heading_1", "x_2", "y_2", "heading_2")
