"""Result files of every kind: stated once, recognised, read back, and told in JSON Schema."""

from __future__ import annotations

import json

import numpy as np
import pytest

from maneuver_automaton.cli import run
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.fleet import plan_fleet, simulate_fleet, verify_driven
from maneuver_automaton.formats.closed_loop_json import (
    load_statistics,
    save_closed_loop,
    statistics_to_dict,
)
from maneuver_automaton.formats.documents import (
    KINDS,
    kind_of,
    read_document,
    schema_of,
    write_document,
)
from maneuver_automaton.formats.fleet_json import fleet_loop_to_dict, save_fleet
from maneuver_automaton.formats.plan_json import save_plan
from maneuver_automaton.formats.road_json import (
    road_drive_to_dict,
    road_fleet_drive_to_dict,
    road_fleet_to_dict,
    road_plan_to_dict,
)
from maneuver_automaton.planning import plan
from maneuver_automaton.receding_horizon import simulate, simulate_many
from maneuver_automaton.roads import drive_road, drive_roads, plan_road, plan_roads
from tests.fleet.robots import crossing
from tests.receding_horizon.loops import straight
from tests.roads.files import scene_of


def many_loops():
    return simulate_many(straight(), starts=[[-2.0, 0.0, 0.0], [0.0, 1.0, 0.0]], step=1.0)


def write_fleet_loop(folder, file):
    log = simulate_fleet(crossing(tolerance=0.05), step=0.5, steps=4, first_time_limit=1.0)
    write_document(fleet_loop_to_dict(log, verify_driven(log)), file)


def write_road_fleet(folder, file):
    result = plan_roads({"100": scene_of(folder)})
    write_document(road_fleet_to_dict(result, status="found", reason=""), file)


WRITERS = {
    "plan": lambda folder, file: save_plan(plan(straight()), file),
    "loop": lambda folder, file: save_closed_loop(simulate(straight(), step=1.0), file),
    "statistics": lambda folder, file: write_document(statistics_to_dict(many_loops()), file),
    "fleet": lambda folder, file: save_fleet(plan_fleet(crossing(), time_limit=0.5), file),
    "fleet-loop": write_fleet_loop,
    "road-plan": lambda folder, file: write_document(
        road_plan_to_dict(plan_road(scene_of(folder))), file
    ),
    "drive": lambda folder, file: write_document(
        road_drive_to_dict(drive_road(scene_of(folder))), file
    ),
    "road-fleet": write_road_fleet,
    "road-fleet-drive": lambda folder, file: write_document(
        road_fleet_drive_to_dict(drive_roads({"100": scene_of(folder)})), file
    ),
}


def test_every_kind_is_written_here():
    assert list(WRITERS) == list(KINDS)


@pytest.mark.parametrize("kind", WRITERS)
def test_what_is_written_is_recognised_and_states_no_other_key(kind, tmp_path):
    file = tmp_path / "result.json"
    WRITERS[kind](tmp_path, file)
    document = read_document(file, kind)
    assert kind_of(document) == kind
    schema = schema_of(kind)
    assert document.keys() <= schema["properties"].keys()
    assert set(schema["required"]) <= document.keys()
    check_keys(document, schema, schema["$defs"])


def check_keys(value, schema, parts):
    """Objects at every depth hold no key that their part of the schema does not name."""
    options = [parts[one["$ref"][8:]] if "$ref" in one else one for one in alternatives(schema)]
    if isinstance(value, dict):
        named = [one for one in options if "properties" in one]
        fitting = [one for one in named if value.keys() <= one["properties"].keys()]
        assert fitting or not named, value.keys()
        for key, inner in value.items() if fitting else ():
            check_keys(inner, fitting[0]["properties"][key], parts)
    elif isinstance(value, list):
        for one in options:
            for inner in value if one.get("items") else ():
                check_keys(inner, one["items"], parts)


def alternatives(schema):
    return schema.get("oneOf") or schema.get("anyOf") or [schema]


def test_the_schema_is_printed(capsys):
    for kind in KINDS:
        assert run(["schema", "--document", kind]) == 0
        assert json.loads(capsys.readouterr().out) == schema_of(kind)
    assert run(["schema", "--document", "map"]) == 2
    assert capsys.readouterr().err.startswith("--document: got 'map', need plan, loop, ")


def test_statistics_are_read_back(tmp_path):
    statistics = many_loops()
    write_document(statistics_to_dict(statistics), tmp_path / "a.json")
    again = load_statistics(tmp_path / "a.json")
    write_document(statistics_to_dict(again), tmp_path / "b.json")
    assert (tmp_path / "b.json").read_bytes() == (tmp_path / "a.json").read_bytes()
    for one, other in zip(statistics.outcomes, again.outcomes, strict=True):
        np.testing.assert_array_equal(one.start, other.start)
        assert (one.violations, one.disturbed) == (other.violations, other.disturbed)


@pytest.mark.parametrize(
    ("kind", "change", "message"),
    [
        ("plan", lambda d: d["primitives"][0].pop("name"),
         "primitives[0].name: is missing, need a text"),
        ("plan", lambda d: d.update(cost="low"), "cost: got 'low', need a finite number"),
        ("loop", lambda d: d.update(steps=[]), "steps: got [], need at least one entry"),
        ("loop", lambda d: d["steps"][0].update(number=-1),
         "steps[0].number: got -1, need greater than or equal to 0"),
        ("statistics", lambda d: d["loops"][1].pop("cost"),
         "loops[1].cost: is missing, need a finite number"),
        ("fleet", lambda d: d["vehicles"].update(a=3), "vehicles.a: got 3, need an object"),
    ],
)  # fmt: skip
def test_a_damaged_file_is_told(kind, change, message, tmp_path):
    file = tmp_path / "result.json"
    WRITERS[kind](tmp_path, file)
    document = json.loads(file.read_text())
    change(document)
    file.write_text(json.dumps(document))
    with pytest.raises(InvalidScenario) as error:
        read_document(file, kind)
    assert str(error.value) == f"{file}: {message}"


def test_a_file_of_another_kind_is_told(tmp_path):
    WRITERS["loop"](tmp_path, tmp_path / "x.json")
    with pytest.raises(InvalidScenario, match=r"x\.json: is no closed_loop\.json of several"):
        read_document(tmp_path / "x.json", "fleet-loop")
