"""Vehicles in scenario files: lattice primitives, platforms without a steering, heights."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton.automaton.library import save_library
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.libraries import read_primitives
from maneuver_automaton.models import Helicopter, Omnidirectional
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.scenario import load_scenario, scenario_of_text, to_yaml
from maneuver_automaton.scenario.writing import json_schema
from tests.formats.test_lattice_files import MPRIM, nav2

SCENARIOS = Path(__file__).parents[2] / "scenarios"
LATTICE = """\
schema: 1
vehicle: {model: lattice_body, resolution_m: 0.5, footprint: {disc_m: 0.1}}
automaton: {file: NAME}
start: {pose: [0, 0, 0]}
goal: {pose: [2.0, 0.0, 0.0]}
margin_m: 0.01
obstacles: [{disc_m: {center: [1, 1], radius: 0.3}}]
search: {time_limit_s: 20.0, max_expansions: 2000}
"""
CART = """\
schema: 1
vehicle: {model: unicycle}
automaton: {trims: [{name: rest, control: [0, 0]}, {name: ahead, control: [1, 0]}]}
start: {pose: [0, 0, 0]}
goal: {pose: [2.0, 0.0, 0.0]}
"""


@pytest.mark.parametrize("name", ["a.mprim", "a.nav2.json", "a.json"])
def test_files_of_lattice_primitives_are_planned_with(tmp_path, name):
    text = LATTICE.replace("NAME", name)
    (tmp_path / "a.mprim").write_text(MPRIM)
    if name == "a.nav2.json":
        (tmp_path / name).write_text(nav2())
        text = text.replace("resolution_m: 0.5", "resolution_m: 0.5, turning_radius_m: 0.5")
    save_library(read_primitives(tmp_path / "a.mprim").automaton, tmp_path / "a.json")
    (tmp_path / "a.yaml").write_text(text)
    scenario = load_scenario(tmp_path / "a.yaml")
    result = plan(scenario.problem, time_limit=20.0)
    assert result.status is PlanStatus.FOUND, result.reason
    assert result.plan.word == ("0 from heading 0",) * 4
    np.testing.assert_allclose(result.plan.end, [2.0, 0.0, 0.0], atol=1e-9)
    (tmp_path / "b.yaml").write_text(to_yaml(scenario, folder=tmp_path))
    again = load_scenario(tmp_path / "b.yaml").problem
    assert again.automaton.model == scenario.problem.automaton.model
    assert again.automaton.trim_names == scenario.problem.automaton.trim_names


def test_a_lattice_of_another_resolution_is_refused(tmp_path):
    (tmp_path / "a.mprim").write_text(MPRIM)
    (tmp_path / "a.yaml").write_text(LATTICE.replace("NAME", "a.mprim").replace("m: 0.5", "m: 0.1"))
    with pytest.raises(InvalidScenario, match=r"a\.yaml:3: automaton\.file: got a library for"):
        load_scenario(tmp_path / "a.yaml")


@pytest.mark.exhaustive
@pytest.mark.slow
def test_an_omnidirectional_platform_goes_aside_where_it_cannot_turn():
    scenario = load_scenario(SCENARIOS / "omnidirectional.yaml")
    problem = scenario.problem
    assert problem.automaton.model == Omnidirectional(
        max_speed=1.0, max_lateral_speed=1.0, max_turn_rate=1.0
    )
    again = scenario_of_text(to_yaml(scenario), name="again").problem
    assert again.automaton.model == problem.automaton.model
    np.testing.assert_array_equal(again.automaton.controls, problem.automaton.controls)
    result = plan(problem, time_limit=10.0)
    assert result.status is PlanStatus.FOUND, result.reason
    aside = {"left", "right", "ahead left", "ahead right", "back left", "back right"}
    inside = [
        name
        for name, pose in zip(result.plan.word, result.plan.switching_poses, strict=False)
        if 1.97 < pose[0] < 3.0 and pose[1] < 1.0
    ]
    assert aside & set(inside)


HELICOPTER = (SCENARIOS / "helicopter_city.yaml").read_text()


def test_the_height_of_a_body_is_stated_and_written():
    text = HELICOPTER.replace(
        "  footprint: {disc_m: 2.5}\n",
        "  footprint: {disc_m: 2.5}\n  footprint_height_m: [-1.5, 3]\n",
    )
    scenario = scenario_of_text(text, name="tall")
    assert isinstance(scenario.problem.automaton.model, Helicopter)
    assert scenario.problem.body_height == (-1.5, 3.0)
    assert scenario_of_text(HELICOPTER, name="flat").problem.body_height == (0.0, 0.0)
    again = scenario_of_text(to_yaml(scenario), name="again")
    assert again.problem.body_height == (-1.5, 3.0)
    assert "footprint_height_m" in json.dumps(json_schema())


def test_the_height_counts():
    """A start that is free by 1 m above it is blocked where the body reaches 1.5 m upwards."""
    roof = "obstacles:\n  - {box_m: {center: [0, 0], size: [9, 9]}, height_m: [7.5, 8.0]}\n"
    head, _ = HELICOPTER.split("obstacles:\n")
    plain = head + roof
    tall = plain.replace("{disc_m: 2.5}", "{disc_m: 2.5}\n  footprint_height_m: [-0.5, 1.5]")
    problem = scenario_of_text(tall, name="tall").problem
    assert plan(problem, time_limit=1.0).status is PlanStatus.START_BLOCKED
    from maneuver_automaton.planning.blocked import blocked_ends

    assert blocked_ends(scenario_of_text(plain, name="flat").problem) is None


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ("[3, 1]", "got [3, 1], need an interval [low, high] with low < high"),
        ("[1]", "got [1], need an interval [low, high], two numbers"),
        ("2", "got 2, need an interval [low, high], two numbers"),
    ],
)
def test_a_height_that_is_none(stated, said):
    text = HELICOPTER.replace("{disc_m: 2.5}", f"{{disc_m: 2.5}}\n  footprint_height_m: {stated}")
    with pytest.raises(InvalidScenario) as error:
        scenario_of_text(text, name="x")
    assert str(error.value).endswith(f"vehicle.footprint_height_m: {said}")


def test_what_moves_in_the_plane_may_have_a_height_above_the_ground():
    cart = CART.replace("{model: unicycle}", "{model: unicycle, footprint_height_m: [0, 1.5]}")
    scenario = scenario_of_text(cart, name="cart")
    assert scenario.problem.body_height == (0.0, 1.5)
    again = scenario_of_text(to_yaml(scenario), name="again")
    assert again.problem.body_height == (0.0, 1.5)
    assert scenario_of_text(CART, name="any").problem.body_height == (0.0, 0.0)
