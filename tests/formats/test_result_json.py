"""A plan.json drawn again in the world of its scenario."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.plan_json import load_result, plan_to_dict, save_plan

SCENARIOS = Path(__file__).parents[2] / "scenarios"
PARKING = ma.load_scenario(SCENARIOS / "parking.yaml").problem


def test_a_result_is_read_back(tmp_path):
    result = ma.plan(PARKING, time_limit=2.0, alternatives=2)
    save_plan(result, tmp_path / "plan.json", name="Parking")
    again = load_result(tmp_path / "plan.json", PARKING)
    ours, theirs = plan_to_dict(again), plan_to_dict(result)
    for key in ("status", "cost", "bound", "gap", "improvements", "alternatives"):
        assert ours[key] == theirs[key], key
    np.testing.assert_allclose(again.plan.end, result.plan.end, atol=1e-9)
    assert [one.plan.word for one in again.alternatives] == [
        one.plan.word for one in result.alternatives
    ]


def test_without_a_plan_it_says_why(tmp_path):
    robot = ma.Automaton.of_controls(ma.Unicycle(), {"spin": (0.0, 1.0)})
    problem = ma.Problem(robot, [0, 0, 0], [1, 0, 0])
    save_plan(ma.plan(problem), tmp_path / "plan.json")
    again = load_result(tmp_path / "plan.json", problem)
    assert (again.plan, again.status.value) == (None, "unreachable")
    assert again.reason


def test_another_scenario_is_told(tmp_path):
    save_plan(ma.plan(PARKING, time_limit=1.0), tmp_path / "plan.json")
    other = ma.load_scenario(SCENARIOS / "car_slot.yaml").problem
    with pytest.raises(InvalidScenario, match="planned with another library"):
        load_result(tmp_path / "plan.json", other)
