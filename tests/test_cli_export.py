"""`export` on the command line, from files of every kind."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton.cli.app import run
from tests.roads.files import LANES, car, commonroad, problem

SCENARIOS = Path(__file__).parents[1] / "scenarios"
DATA = Path(__file__).parents[1] / "../shared/data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="needs ../shared/data")
PARKING = SCENARIOS / "parking.yaml"
LOOP = SCENARIOS / "parking_loop.yaml"


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    assert run(["plan", str(PARKING), "--out", str(folder), "--quiet", "--no-plot"]) == 0
    return folder / "plan.json"


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    folder = tmp_path_factory.mktemp("loop")
    assert run(["mpc", str(LOOP), "--out", str(folder), "--quiet", "--no-plot"]) == 0
    return folder / "closed_loop.json"


@pytest.fixture(scope="module")
def road(tmp_path_factory):
    folder = tmp_path_factory.mktemp("road")
    text = commonroad(*LANES, car(7, x=60.0, y=2.0, speed=8.0, steps=40), problem())
    (folder / "road.xml").write_text(text.replace("TST_", "ZAM_"))
    for command in ("plan", "mpc"):
        asked = [command, str(folder / "road.xml"), "--out", str(folder), "--quiet", "--no-plot"]
        assert run(asked) == 0
    return folder


def features(path, kind):
    found = json.loads(path.read_text())["features"]
    return [one["geometry"] for one in found if one["properties"]["kind"] == kind]


def lines(path):
    header, *rows = path.read_text().splitlines()
    return header.split(","), rows


INERTIA = """\
schema: 1
vehicle: {model: second_order_unicycle, max_speed_m_s: 0.5, max_turn_rate_rad_s: 0.5,
  max_acceleration_m_s2: 0.25, max_angular_acceleration_rad_s2: 0.25}
automaton: {preset: second_order_unicycle}
start: {pose: [0, 0, 0]}
goal: {pose: [1, 1, 0]}
search: {polish: false, max_expansions: 300}
"""


def test_between_its_samples_a_plan_with_its_scenario_moves_at_its_speed(tmp_path):
    scenario = tmp_path / "inertia.yaml"
    scenario.write_text(INERTIA)
    assert run(["plan", str(scenario), "--out", str(tmp_path), "--quiet", "--no-plot"]) == 0
    asked = ["--to", "csv", "--rate", "200", "--with", str(scenario)]
    assert run(["export", str(tmp_path / "plan.json"), *asked]) == 0
    with (tmp_path / "plan.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    x, y, length = np.array(
        [[row["x_m"], row["y_m"], row["arc_length_m"]] for row in rows], dtype=np.float64
    ).T
    driven = np.append(0.0, np.cumsum(np.hypot(np.diff(x), np.diff(y))))
    np.testing.assert_allclose(driven, length, atol=1e-5)


def test_a_plan_is_written_beside_its_file(plan):
    assert run(["export", str(plan), "--to", "csv", "--step", "0.5"]) == 0
    header, rows = lines(plan.with_suffix(".csv"))
    named = ["control_speed", "control_turn_rate", "arc_length_m", "curvature_1_m", "primitive"]
    assert (header[-5:], len(rows)) == (named, 17)  # of 8 s
    assert run(["export", str(plan), "--to", "csv", "--rate", "4"]) == 0
    assert len(lines(plan.with_suffix(".csv"))[1]) == 33
    assert run(["export", str(plan), "--to", "csv", "--with", str(PARKING)]) == 0
    named.insert(4, "lateral_acceleration_m_s2")
    assert lines(plan.with_suffix(".csv"))[0][-6:] == named
    assert run(["export", str(plan), "--to", "geojson"]) == 0
    (path,) = features(plan.with_suffix(".geojson"), "path")
    np.testing.assert_allclose(path["coordinates"][0], [0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(path["coordinates"][-1], [0.0, 0.0], atol=1e-9)


def test_controls_that_a_file_does_not_name_are_counted(plan, tmp_path):
    document = json.loads(plan.read_text())
    (tmp_path / "plan.json").write_text(json.dumps(document | {"vehicle": None}))
    assert run(["export", str(tmp_path / "plan.json"), "--to", "csv"]) == 0
    assert lines(tmp_path / "plan.csv")[0][-5:-3] == ["control_0", "control_1"]


@pytest.mark.parametrize("vehicle", [{"control": ["one"]}, {"control": "speed"}, []])
def test_a_vehicle_that_is_none_is_told_in_one_line(plan, tmp_path, vehicle, capsys):
    document = json.loads(plan.read_text())
    (tmp_path / "plan.json").write_text(json.dumps(document | {"vehicle": vehicle}))
    assert run(["export", str(tmp_path / "plan.json"), "--to", "csv"]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"{tmp_path / 'plan.json'}: vehicle")
    assert err.count("\n") == 1


def test_a_loop_is_written_with_its_scenario(loop, tmp_path, capsys):
    out = tmp_path / "sub" / "loop.geojson"
    asked = ["export", str(loop), "--to", "geojson", "--out", str(out)]
    assert run(asked) == 2
    assert capsys.readouterr().err == (
        f"{loop}: is a closed loop, need --with and the scenario it was driven in\n"
    )
    assert run([*asked, "--with", str(LOOP)]) == 0
    (path,) = features(out, "path")
    np.testing.assert_allclose(path["coordinates"][-1], [0.0, 0.0], atol=1e-9)
    assert features(out, "goal")


def test_a_bag_is_a_folder_beside_the_file(loop):
    pytest.importorskip("rosbags")
    assert run(["export", str(loop), "--to", "ros2", "--with", str(LOOP)]) == 0
    folder = loop.with_name("closed_loop_ros2")
    assert {one.name for one in folder.iterdir()} == {"closed_loop_ros2.db3", "metadata.yaml"}


@pytest.mark.filterwarnings("ignore")
def test_a_drive_that_missed_its_goal_is_told(road, tmp_path, capsys):
    pytest.importorskip("commonroad.common.solution")
    path = tmp_path / "closed_loop.json"
    document = json.loads((road / "closed_loop.json").read_text())
    path.write_text(json.dumps(document | {"reached": False}))
    asked = ["export", str(path), "--to", "commonroad", "--with", str(road / "road.xml")]
    assert run(asked) == 0
    assert capsys.readouterr().err == (
        f"{path}: it is no clean drive to a goal: the official checker refuses "
        f"{tmp_path / 'closed_loop_commonroad.xml'}\n"
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--to", "shapefile"],
         "--to: got 'shapefile', need one of commonroad, csv, geojson, rerun, ros2"),
        (["--to", "geojson", "--step", "0.1"],
         "--step: geojson has no rows in time; leave it out"),
        (["--to", "csv", "--step", "0"], "step must be positive, got 0.0 s"),
        (["--to", "csv", "--out", "plan.txt"], "--out: plan.txt: need an ending of .csv for csv"),
        (["--to", "csv", "--with", "nowhere.yaml"], "nowhere.yaml: "),
        (["--to", "csv", "--with", str(SCENARIOS / "car_slot.yaml")],
         "automaton_hash: this was planned with another library"),
        (["--to", "commonroad"],
         "got no drive on a CommonRoad scenario, need a plan or drive of its XML file"),
    ],
)  # fmt: skip
def test_wrong_options_are_told_in_one_line(plan, options, said, capsys, folder):
    assert run(["export", str(plan), *options]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_the_scenario_of_another_start_is_refused(plan, tmp_path, capsys):
    text = PARKING.read_text()
    assert "[0.0, 1.0, 0.0]" in text
    other = tmp_path / "other.yaml"
    other.write_text(text.replace("[0.0, 1.0, 0.0]", "[0.5, 1.0, 0.0]"))
    assert run(["export", str(plan), "--to", "csv", "--with", str(other)]) == 2
    assert capsys.readouterr().err == (
        f"{plan}: starts at [0.0, 1.0, 0.0], but the scenario of --with at [0.5, 1.0, 0.0]; need "
        "the scenario that was planned\n"
    )


def test_a_road_is_not_the_scenario_of_a_loop(loop, road, capsys):
    asked = ["export", str(loop), "--to", "csv", "--with", str(road / "road.xml")]
    assert run(asked) == 2
    assert capsys.readouterr().err == (
        f"{loop}: is a closed loop, but the scenario of --with is a road; need its own\n"
    )


@pytest.mark.parametrize("kind", ["csv", "geojson", "rerun", "ros2"])
def test_a_place_that_cannot_be_written_is_told(plan, kind, tmp_path, capsys):
    pytest.importorskip({"rerun": "rerun", "ros2": "rosbags"}.get(kind, "csv"))
    (tmp_path / "file").write_text("")
    ending = {"rerun": ".rrd", "ros2": ""}.get(kind, f".{kind}")
    out = tmp_path / "file" / f"plan{ending}"
    assert run(["export", str(plan), "--to", kind, "--out", str(out)]) == 2
    err = capsys.readouterr().err
    assert err.startswith(str(tmp_path / "file"))
    assert err.count("\n") == 1
    assert "internal error" not in err


@pytest.mark.parametrize("change", [{"steps": []}, {"steps": None}, {"step_s": "x"}])
def test_a_damaged_drive_is_told_in_one_line(road, change, tmp_path, capsys):
    path = tmp_path / "closed_loop.json"
    document = json.loads((road / "closed_loop.json").read_text())
    path.write_text(json.dumps(document | change))
    assert run(["export", str(path), "--to", "csv", "--with", str(road / "road.xml")]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"{path}: ")
    assert err.count("\n") == 1
    assert "internal error" not in err


@needs_data
@pytest.mark.parametrize(
    ("library", "vehicle"),
    [
        ("nav2-lattice/ackermann_5cm_r0.5m.json", "resolution_m: 0.05, turning_radius_m: 0.5"),
        ("nav2-lattice/diff_5cm_r1m.json", "resolution_m: 0.05, turning_radius_m: 1.0"),
        ("sbpl/mprim/unicycle_noturninplace.mprim", "resolution_m: 0.025"),
    ],
)
def test_libraries_of_nav2_and_sbpl_are_planned_with_and_go_back_to_ros(library, vehicle, tmp_path):
    scenario = tmp_path / "wall.yaml"
    scenario.write_text(
        "schema: 1\n"
        f"vehicle: {{model: lattice_body, {vehicle}, footprint: {{rectangle_m: [0.3, 0.2]}}}}\n"
        f"automaton: {{file: {(DATA / library).resolve()}}}\n"
        "start: {pose: [0, 0, 0]}\n"
        "goal: {pose: [2, 1, 0]}\n"
        "obstacles: [{box_m: {center: [1, 0], size: [0.2, 1.5]}}]\n"
        "search: {max_expansions: 40000, time_limit_s: 60}\n"
    )
    asked = ["plan", str(scenario), "--out", str(tmp_path), "--quiet", "--no-plot"]
    assert run(asked) == 0
    found = json.loads((tmp_path / "plan.json").read_text())
    assert found["audit"]["passed"]
    assert found["audit"]["terminal_position_m"] < 1e-9
    pytest.importorskip("rosbags")
    export = ["export", str(tmp_path / "plan.json"), "--with", str(scenario), "--to", "ros2"]
    assert run(export) == 0
    from rosbags.highlevel import AnyReader

    with AnyReader([tmp_path / "plan_ros2"]) as bag:
        (path,) = [
            bag.deserialize(raw, one.msgtype) for one, _, raw in bag.messages()
            if one.topic == "/path"
        ]  # fmt: skip
    last = path.poses[-1].pose.position
    np.testing.assert_allclose([last.x, last.y], [2.0, 1.0], atol=1e-9)
