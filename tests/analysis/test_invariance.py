"""Which costs, constraints and boundary conditions the group leaves alone."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.analysis import (
    Region,
    check_boundary_condition,
    check_constraint,
    check_stage_cost,
)
from maneuver_automaton.groups import SE2, SE2xR

PLANE = Region.of(SE2, n_controls=2)
TRANSLATIONS = ("translation in x", "translation in y")
R = np.diag([1.0, 0.25])

INVARIANT_COSTS = {
    "effort": lambda x, u: u @ R @ u,
    "fuel": lambda x, u: np.linalg.norm(u, ord=1),
    "time": lambda x, u: 1.0,
    "path length": lambda x, u: abs(u[0]),
    "weighted sum": lambda x, u: 2.0 * u @ R @ u + 0.5 * np.linalg.norm(u) + 3.0,
}


@pytest.mark.parametrize("cost", INVARIANT_COSTS.values(), ids=INVARIANT_COSTS)
def test_the_costs_named_in_the_paper_are_invariant(cost):
    report = check_stage_cost(cost, region=PLANE)
    assert report.holds
    assert report.worst_violation == 0.0
    assert str(report).startswith("stage cost is invariant under rotation and translation (worst")


def test_a_quadratic_cost_of_the_state_is_not():
    report = check_stage_cost(lambda x, u: x @ np.diag([1.0, 5.0, 0.1]) @ x, region=PLANE)
    assert set(report.broken) == {*TRANSLATIONS, "rotation"}
    assert report.intact == ()
    assert "stage cost is not invariant under rotation and translation: value changes by" in (
        report.message
    )
    assert "depends on the place: shift its references" in report.message


def test_a_quadratic_cost_of_the_reduced_state_is():
    region = Region.of(SE2, n_controls=2, reduced_names=["speed"])
    assert check_stage_cost(lambda x, u: (x[3] - 1.0) ** 2 + u @ u, region=region).holds


def test_a_cost_of_the_heading_breaks_rotation_only():
    report = check_stage_cost(lambda x, u: 1.0 - np.cos(x[2]), region=PLANE)
    assert (report.broken, report.intact) == (("rotation",), TRANSLATIONS)
    assert "depends on a direction of the world" in report.message


def test_a_cost_of_the_height_breaks_climb_only():
    region = Region.of(SE2xR, n_controls=3)
    report = check_stage_cost(lambda x, u: x[3] ** 2, region=region)
    assert report.broken == ("climb",)


def test_control_constraints_are_invariant_and_walls_are_not():
    report = check_constraint(lambda x, u: [u[0] - 1.0, -u[0], x[1] - 3.0], region=PLANE)
    assert report.components == ("constraint 3",)
    assert set(report.broken) == {"translation in y", "rotation"}
    assert report.intact == ("translation in x",)
    assert "constraint 3 changes by " in report.message
    assert check_constraint(lambda x, u: np.abs(u) - 1.0, region=PLANE).holds


def test_a_fixed_start_is_not_invariant():
    report = check_boundary_condition(lambda first, last: first - [1.0, 0.0, 0.0], region=PLANE)
    assert not report.holds
    assert report.state.shape == (2, 3)
    assert ", then (" in report.message
    assert "u = " not in report.message


def test_a_distance_between_the_ends_is_invariant():
    report = check_boundary_condition(
        lambda first, last: [np.hypot(*(last - first)[:2]) - 3.0, last[2] - first[2]], region=PLANE
    )
    assert report.holds


def test_a_constraint_without_rows_holds():
    assert check_constraint(lambda x, u: np.zeros(0), region=PLANE).holds


def test_values_must_be_numbers():
    with pytest.raises(ValueError, match="stage cost: got nan, need finite numbers"):
        check_stage_cost(lambda x, u: np.nan, region=PLANE)
