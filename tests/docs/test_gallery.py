"""The gallery has a picture and a plan of every scenario, and each plan is of its scenario."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import pytest

from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.planning import plan
from maneuver_automaton.scenario import load_scenario

ROOT = Path(__file__).parents[2]
SCENARIOS = sorted((ROOT / "scenarios").glob("*.yaml"))
FLEETS = sorted((ROOT / "scenarios").glob("fleets/*.yaml"))


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda path: path.stem)
def test_every_scenario_has_a_picture_and_a_plan(scenario):
    assert (ROOT / "docs" / "pictures" / "gallery" / f"{scenario.stem}.png").is_file()
    kept = ROOT / "docs" / "plans" / f"{scenario.stem}.json.gz"
    document = json.loads(gzip.decompress(kept.read_bytes()))
    there = load_scenario(scenario)
    assert document["name"] == there.name
    assert document["automaton_hash"] == automaton_hash(there.problem.automaton)
    assert document["status"] in ("found", "reached", "steps_spent")


@pytest.mark.parametrize("scenario", FLEETS, ids=lambda path: path.stem)
def test_every_scenario_of_several_vehicles_has_a_picture_and_a_plan(scenario):
    assert (ROOT / "docs" / "pictures" / "gallery" / f"{scenario.stem}.png").is_file()
    kept = ROOT / "docs" / "plans" / f"{scenario.stem}.json.gz"
    document = json.loads(gzip.decompress(kept.read_bytes()))
    fleet = load_scenario(scenario).fleet
    assert document["name"] == load_scenario(scenario).name
    assert document["status"] in ("found", "reached", "steps_spent")
    for name, problem in zip(fleet.names, fleet.problems, strict=True):
        stated = document["vehicles"][name]["automaton_hash"]
        assert stated == automaton_hash(problem.automaton)


@pytest.mark.parametrize("name", ["example10_shifted", "parking", "parking_min_time"])
def test_where_no_clock_decides_the_kept_plan_is_that_of_the_scenario(name):
    kept = ROOT / "docs" / "plans" / f"{name}.json.gz"
    stated = json.loads(gzip.decompress(kept.read_bytes()))
    result = plan(load_scenario(ROOT / "scenarios" / f"{name}.yaml").problem)
    assert stated["cost"] == pytest.approx(result.cost, rel=1e-9)
    assert [one["name"] for one in stated["primitives"]] == list(result.plan.word)
