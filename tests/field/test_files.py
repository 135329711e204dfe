"""`cover` on the command line: fields in YAML and GeoJSON, what it writes, what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely.geometry import shape

import maneuver_automaton as ma
from maneuver_automaton.cli.app import run
from maneuver_automaton.exports.earth import degrees_of, metres_of
from maneuver_automaton.field.files import load_field
from tests.field.cases import OBLONG

MEADOW = Path(__file__).parents[2] / "scenarios" / "fields" / "meadow.yaml"
TRACTOR = """schema: 1
name: Oblong
vehicle: {model: car, wheelbase_m: 2.0, max_steering_rad: 0.6,
          footprint: {rectangle_m: [3.5, 1.8], reference_m: [-1.0, 0.0]}}
automaton:
  trims:
    - {name: ahead, control: [2.0, 0.0]}
    - {name: left, control: [2.0, 0.6]}
    - {name: right, control: [2.0, -0.6]}
search: {improve: false, time_limit_s: 10}
"""
FIELD = TRACTOR + f"field: {{polygon_m: {OBLONG}, width_m: 3.0, headland_m: 12.0}}\n"


def written(folder, text, name="field.yaml"):
    path = folder / name
    path.write_text(text)
    return path


def test_a_field_is_planned_written_and_drawn(tmp_path, capsys):
    path = written(tmp_path, FIELD)
    assert run(["cover", str(path), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "swaths:         4, 64 m" in said
    assert "worked:         100 % inside the headland of 12 m" in said
    document = json.loads((tmp_path / "out" / "plan.json").read_text())
    assert (document["status"], document["audit"]["passed"]) == ("found", True)
    assert document["name"] == "Oblong"
    assert (tmp_path / "out" / "field.png").stat().st_size > 10000
    features = json.loads((tmp_path / "out" / "field.geojson").read_text())["features"]
    kinds = [one["properties"]["kind"] for one in features]
    assert kinds == ["field", "inner", *["swath"] * 4, *["turn"] * 3]
    turns = [shape(one["geometry"]) for one in features if one["properties"]["kind"] == "turn"]
    assert sum(one.length for one in turns) == pytest.approx(39.3, rel=0.01)
    assert ma.load_plan(tmp_path / "out" / "plan.json").duration == document["duration_s"]


def test_geojson_in_degrees_comes_back_in_degrees(tmp_path, capsys):
    origin = (52.1, 13.4)
    beside = written(tmp_path, TRACTOR, "tractor.yaml")
    ring = degrees_of([*OBLONG, OBLONG[0]], origin=origin).tolist()
    area = {"type": "Feature", "properties": {"width_m": 3.0},
            "geometry": {"type": "Polygon", "coordinates": [ring]}}  # fmt: skip
    path = written(tmp_path, json.dumps(area), "meadow.geojson")
    field = load_field(path, beside=beside)
    middle = np.mean(ring[:4], axis=0)
    np.testing.assert_allclose(field.origin, middle[::-1], atol=1e-6)
    assert field.problem.whole.area == pytest.approx(40.0 * 34.0, rel=1e-6)
    asked = ["cover", str(path), "--with", str(beside), "--headland", "12", "--quiet", "--no-plot"]
    assert run([*asked, "--origin", "52.1,13.4", "--out", str(tmp_path / "out")]) == 0
    found = json.loads((tmp_path / "out" / "field.geojson").read_text())
    assert found["units"] == "degree"
    whole = shapely.transform(
        shape(found["features"][0]["geometry"]), lambda p: metres_of(p, origin=origin)
    )
    assert whole.symmetric_difference(shapely.Polygon(OBLONG)).area < 1e-3


def test_the_meadow_reads():
    field = load_field(MEADOW)
    assert field.name == "Meadow with a pond"
    assert (field.problem.width, len(field.problem.shape.holes)) == (6.0, 1)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TRACTOR, "field.yaml:1: field: polygon_m is missing, need the corners of the field"),
        (FIELD.replace("width_m: 3.0", "width_m: 0.0"),
         "field.yaml:11: field.width_m: got 0.0, need a positive number"),
        (FIELD.replace("width_m: 3.0, ", ""),
         "field.yaml: width_m: missing, need the working width, or --width"),
        (FIELD.replace("[40, 0], [40, 34]", "[40, 34], [40, 0]"),
         "crosses or touches itself at (20, 17), need a simple polygon"),
        (FIELD.replace("headland_m: 12.0", "headland_m: 20.0"),
         "field: nothing is left of it inside a headland of 20 m: the largest circle in it has a "
         "radius of 17 m"),
        (FIELD + "start: {pose: [0, 0, 0]}\n", "start: is for plan; a field has none"),
        (FIELD + "via: [{pose: [9, 9, 0]}]\n", "via: is for plan; a field has none"),
        (FIELD.replace("headland_m", "headlands_m"), "headlands_m"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_in_one_line(text, said, tmp_path, capsys):
    path = written(tmp_path, text)
    assert run(["cover", str(path), "--out", str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert "internal error" not in err


@pytest.mark.slow
def test_a_field_without_room_has_no_plan(tmp_path, capsys):
    path = written(tmp_path, FIELD.replace("headland_m: 12.0", "headland_m: 2.0"))
    asked = ["cover", str(path), "--out", str(tmp_path / "out"), "--no-plot"]
    assert run([*asked, "--time-limit", "0.1"]) == 1
    assert "no_plan: no turn was found from the end of a swath at (" in capsys.readouterr().err
    assert json.loads((tmp_path / "out" / "plan.json").read_text())["status"] == "no_plan"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{}", "is no GeoJSON with a polygon: 'type'"),
        ('{"type": "FeatureCollection", "features": []}', "has 0 polygons, need one, the field"),
    ],
)
def test_geojson_without_a_field_is_told(content, said, tmp_path, capsys):
    beside = written(tmp_path, TRACTOR, "tractor.yaml")
    path = written(tmp_path, content, "meadow.geojson")
    assert run(["cover", str(path), "--with", str(beside)]) == 2
    assert said in capsys.readouterr().err
    assert run(["cover", str(path)]) == 2
    assert "states no vehicle, need --with" in capsys.readouterr().err
