"""Whether the effort of a plan is uniform, and from where on a limit can matter."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.models import Unicycle
from maneuver_automaton.refinement.retiming import effort_report, effort_threshold

MATRIX = np.array([[4.0, -1.5], [-1.5, 1.0]])
ROBOT = Automaton.of_controls(
    Unicycle(),
    {"straight": (1.5, 0.0), "anticlockwise": (-0.25, 1.0), "spin": (0.0, 1.0), "rest": (0, 0)},
)


def plan_of(word, durations):
    return Plan(np.zeros(3), tuple(ROBOT[name] for name in word), durations=durations)


def test_the_report_by_hand():
    report = effort_report(plan_of(["straight", "spin", "rest"], [2.0, 1.0, 1.0]))
    np.testing.assert_allclose(report.efforts, [2.25, 1.0, 0.0])
    assert report.cost == 5.5
    assert report.mean == 5.5 / 4.0
    assert report.spread == 2.25 / report.mean
    assert not report.uniform
    assert report.uniform_cost == (3.0 + 1.0) ** 2 / 4.0
    assert report.saving == 1.5


def test_the_report_weighs_with_the_matrix():
    plan = plan_of(["straight", "anticlockwise"], [1.0, 1.0])
    report = effort_report(plan, MATRIX)
    np.testing.assert_allclose(report.efforts, [9.0, 4.0 / 16.0 + 1.0 + 0.75])
    with pytest.raises(ValueError, match="positive definite"):
        effort_report(plan, -MATRIX)


def test_one_trim_and_no_trim_are_uniform():
    assert effort_report(plan_of(["spin"], [2.0])).uniform
    empty = effort_report(plan_of([], []))
    assert empty.uniform
    assert empty.cost == empty.uniform_cost == 0.0
    short = effort_report(plan_of(["spin", "straight"], [2.0, 0.0]))
    assert short.uniform


def test_the_threshold_is_the_largest_ellipse_in_the_box():
    limits = np.array([[-2.0, 1.0], [-3.0, 3.0]])
    r_star = effort_threshold(limits, MATRIX)
    angles = np.linspace(0.0, 2.0 * np.pi, 100_001)
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    rim *= np.sqrt(r_star / np.einsum("ni,ij,nj->n", rim, MATRIX, rim))[:, None]
    assert (rim >= limits[:, 0] - 1e-9).all()
    assert (rim <= limits[:, 1] + 1e-9).all()
    assert np.min(np.abs(rim[:, :, None] - limits)) < 1e-6
    assert effort_threshold([[-np.inf, np.inf]]) == np.inf
