"""closed_loop.json of several vehicles: what it holds, and the loop back from it."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.fleet import FleetProblem, plan_fleet, simulate_fleet, verify_driven
from maneuver_automaton.formats.closed_loop_json import driven_document
from maneuver_automaton.formats.documents import read_document, write_document
from maneuver_automaton.formats.fleet_json import (
    fleet_loop_to_dict,
    load_fleet_loop,
)
from maneuver_automaton.formats.plan_json import plan_of_document
from maneuver_automaton.receding_horizon import Disturbance
from tests.fleet.robots import crossing

SCENARIOS = Path(__file__).parents[2] / "scenarios"
KEYS = [
    "schema", "version", "kind", "name", "status", "reason", "notes", "reached", "cost",
    "duration_s", "step_s", "sum_s", "last_s", "clearance_m", "closest", "collisions",
    "broken_guarantees", "counts", "vehicles", "steps",
]  # fmt: skip
LOOPS = {
    "a push": {"disturbance": {"a": Disturbance(pushes={3: (0.5, 0.2, 0.1)})}},
    "breaks down, joins": {"breaks_s": {"a": 2.0}, "joins_s": {"b": 1.0}},
}


def first_of(fleet):
    """Plans to begin with, which nothing improves until a time is over."""
    return plan_fleet(fleet, time_limit=60.0, max_rounds=0)


@pytest.fixture(scope="module", params=LOOPS)
def log(request):
    fleet = crossing(tolerance=0.05)
    return simulate_fleet(fleet, step=0.5, steps=30, first=first_of(fleet), **LOOPS[request.param])


def document_of(log):
    return fleet_loop_to_dict(log, verify_driven(log), name="any")


def same(one, other):
    assert json.dumps(one) == json.dumps(other)


def test_there_and_back(log, tmp_path):
    path = tmp_path / "closed_loop.json"
    write_document(fleet_loop_to_dict(log, verify_driven(log), name="any"), path)
    again = load_fleet_loop(path, log.problem)
    same(document_of(again), document_of(log))
    assert again.status == log.status
    assert again.arrived_s == log.arrived_s
    assert again.broken_down == log.broken_down
    for name in log.problem.names:
        for one, other in zip(log.driven[name], again.driven[name], strict=True):
            np.testing.assert_array_equal(one.start, other.start)
            np.testing.assert_array_equal(one.end, other.end)
            np.testing.assert_array_equal(one.durations, other.durations)
    assert verify_driven(again).distance_m == verify_driven(log).distance_m


def test_what_stands_in_it(log):
    found = document_of(log)
    assert list(found) == KEYS
    assert (found["kind"], found["status"], found["reached"]) == ("fleet", log.status, log.reached)
    assert len(found["steps"]) == len(log.steps) + 1
    assert found["cost"] == pytest.approx(found["steps"][-1]["accumulated_cost"], rel=1e-12)
    costs = [one["cost"] for one in found["vehicles"].values()]
    assert found["cost"] == pytest.approx(math.fsum(costs), rel=1e-12)
    swaps = sum(len(step["swaps"]) for step in found["steps"])
    assert swaps == found["counts"]["swaps"]
    for name, one in found["vehicles"].items():
        assert one["arrived_s"] == log.arrived_s.get(name)
        spent = [step["accumulated_cost"] for step in one["steps"]]
        assert spent == sorted(spent)
        assert one["steps"][-1]["plan"] is None


def test_a_vehicle_is_written_as_one_alone(log):
    """Each entry is a closed_loop.json that is drawn as one vehicle's is."""
    for one in document_of(log)["vehicles"].values():
        if len(one["steps"]) > 1:
            plan = plan_of_document(driven_document(one))
            np.testing.assert_allclose(plan.end, one["steps"][-1]["pose"], atol=1e-9)


def test_who_leaves_ends_where_it_left(tmp_path):
    fleet = crossing(tolerance=0.05)
    fleet = FleetProblem(fleet.problems, names=fleet.names, leaves=(True, False))
    log = simulate_fleet(fleet, step=0.5, first=first_of(fleet))
    found = document_of(log)["vehicles"]["a"]
    assert found["reached"]
    assert found["steps"][-1]["time_s"] >= found["arrived_s"]
    path = tmp_path / "closed_loop.json"
    write_document(fleet_loop_to_dict(log, verify_driven(log)), path)
    assert verify_driven(load_fleet_loop(path, fleet)).passed


def test_interrupted_and_sources(tmp_path):
    fleet = crossing(tolerance=0.05)
    log = simulate_fleet(fleet, step=0.5, steps=2, first=first_of(fleet))
    path = tmp_path / "out" / "closed_loop.json"
    path.parent.mkdir()
    source = {"file": tmp_path / "x.yaml", "with": None, "case": None}
    document = fleet_loop_to_dict(log, verify_driven(log))
    write_document(document, path, source=source, interrupted=True)
    document = read_document(path, "fleet-loop")
    assert document["interrupted"] is True
    assert document["source"] == {"file": "../x.yaml", "with": None, "case": None}
    assert (document["status"], document["reached"]) == ("steps_spent", False)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d["vehicles"].pop("a"), "vehicles: got b, need a, b"),
        (
            lambda d: d["vehicles"]["a"].update(automaton_hash="0"),
            "vehicles.a.automaton_hash: this loop was driven with another library",
        ),
        (
            lambda d: d["vehicles"]["a"]["steps"][0].pop("plan"),
            "vehicles.a.steps[0].plan: is missing, need a list",
        ),
        (
            lambda d: d["vehicles"]["a"]["steps"][0].update(held=None),
            "vehicles.a: steps: holds no plan at 0 s",
        ),
        (
            lambda d: d["vehicles"]["a"]["steps"][1].update(time_s=9.0),
            "vehicles.a: step 1 is at 9 s, need 0.5 s",
        ),
        (lambda d: d["steps"][1].update(number=5), "steps: number: got 5, need 1"),
        (
            lambda d: d["vehicles"]["a"]["steps"][0].update(vehicle_pose=[0.0]),
            "vehicles.a: steps: pose: got shape (1,), need 3 components last",
        ),
        (
            lambda d: d["steps"][0].update(swaps=[{}]),
            "steps[0].swaps[0].vehicles: is missing, need a list",
        ),
        (lambda d: d.pop("closest"), "closest: is missing, need a list"),
        (lambda d: d.update(step_s=-1.0), "step_s: got -1.0, need a positive number"),
        (
            lambda d: d["clearance_m"].update(between={}),
            "clearance_m.between: got {}, need a finite number",
        ),
    ],
)  # fmt: skip
def test_a_damaged_file_is_told(tmp_path, change, message):
    fleet = crossing(tolerance=0.05)
    log = simulate_fleet(fleet, step=0.5, steps=2, first=first_of(fleet))
    path = tmp_path / "closed_loop.json"
    document = json.loads(json.dumps(document_of(log)))
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(InvalidScenario) as error:
        load_fleet_loop(path, log.problem)
    assert str(error.value) == f"{path}: {message}"


def test_files_of_one_vehicle_are_none(tmp_path):
    (tmp_path / "x.json").write_text('{"schema": 1, "reached": true, "steps": [], "step_s": 1}')
    with pytest.raises(InvalidScenario, match=r"is no closed_loop\.json of several"):
        load_fleet_loop(tmp_path / "x.json", crossing())
