"""Solution files of CommonRoad, judged by the official checker where it is installed."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.recording import recording_of
from maneuver_automaton.roads import RoadBenchmark, RoadVehicle, drive_scene, road_planner
from tests.exports.cases import assert_close, drive_on_lanes
from tests.plotting.cases import parking_plan
from tests.quickly import quick_are
from tests.roads.files import LANES, car, problem, scene_of

DATA = Path(__file__).parents[2] / "../shared/data/commonroad/scenarios"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="needs ../shared/data")
quiet = pytest.mark.filterwarnings("ignore")  # of the libraries that judge


def states_of(path):
    root = ElementTree.parse(path).getroot()
    (trajectory,) = root
    rows = [
        [float(state.find(tag).text) for tag in ("time", "x", "y", "orientation", "velocity",
                                                 "steeringAngle")]
        for state in trajectory
    ]  # fmt: skip
    return root.attrib, trajectory, np.array(rows)


@quiet
def test_states_are_those_of_the_middle_at_the_steps_of_the_scenario(tmp_path):
    pytest.importorskip("commonroad.common.solution")
    step = 0.1
    recorded = car(7, x=60.0, y=2.0, speed=8.0, steps=40, step=step)
    drive = drive_on_lanes(tmp_path, *LANES, recorded, problem(321), step=step)
    named = RoadBenchmark(scenario="ZAM_Lanes-1_1_T-1", version="2020a", problem=321)
    scene = drive.planner.scene
    assert scene.benchmark == replace(named, scenario="TST_Lanes-1_1_T-1", version="2018b")
    planner = replace(drive.planner, scene=replace(scene, benchmark=named))
    ma.save_commonroad_solution(
        replace(drive, planner=planner), tmp_path / "solution.xml", cost_function="WX1"
    )
    attributes, trajectory, rows = states_of(tmp_path / "solution.xml")
    assert attributes["benchmark_id"] == "KS2:WX1:ZAM_Lanes-1_1_T-1:2020a"
    assert (trajectory.tag, trajectory.get("planningProblem")) == ("ksTrajectory", "321")
    assert_close(rows[:, 0], np.arange(len(rows)))
    times = step * rows[:, 0]
    middle = RoadVehicle().middle_of(drive.driven.pose_at(times))
    assert_close(rows[:, 1:4], middle, atol=1e-9)
    assert_close(
        rows[:, 4:], recording_of(drive).movers[0].rows(step=step).reduced_state[: len(rows)]
    )
    assert times[-1] > drive.driven.duration - step


def test_other_vehicles_other_plans_and_other_costs_are_refused(tmp_path):
    with pytest.raises(ValueError) as error:
        ma.save_commonroad_solution(parking_plan(), tmp_path / "solution.xml")
    assert str(error.value) == (
        "CommonRoad solution: got no drive on a CommonRoad scenario, need a plan or drive of its "
        "XML file"
    )
    scene = scene_of(tmp_path)
    pytest.importorskip("commonroad.common.solution")
    long = drive_scene(road_planner(scene, RoadVehicle(length=5.5)), steps=2)
    with pytest.raises(ValueError) as wrong:
        ma.save_commonroad_solution(long, tmp_path / "solution.xml")
    assert str(wrong.value) == (
        "CommonRoad solution: the vehicle has a wheelbase of 2.5789 m and a body of 5.5 m x 1.61 "
        "m, its middle 1.42273 m before the rear axle; need that of FORD_ESCORT, BMW_320i, "
        "VW_VANAGON, TRUCK"
    )
    drive = drive_scene(road_planner(scene), steps=2)
    with pytest.raises(ValueError, match=r"cost_function: got 'ABC', need one of JB1, SA1, WX1"):
        ma.save_commonroad_solution(drive, tmp_path / "solution.xml", cost_function="ABC")
    with pytest.raises(ValueError) as unnamed:
        ma.save_commonroad_solution(drive, tmp_path / "solution.xml")
    assert str(unnamed.value).startswith(
        "CommonRoad solution: the scenario is named 'TST_Lanes-1_1_T-1', need a benchmark's name "
        "such as DEU_Ffb-1_6_T-1: "
    )
    late = replace(drive, driven=replace(drive.driven, start_time=0.05))
    with pytest.raises(ValueError) as off:
        ma.save_commonroad_solution(late, tmp_path / "solution.xml")
    assert str(off.value) == (
        "CommonRoad solution: the drive starts at 0.05 s, need a multiple of the scenario's time "
        "step of 0.1 s"
    )
    assert not (tmp_path / "solution.xml").exists()


def test_the_extra_is_named_where_it_is_missing(monkeypatch, tmp_path):
    drive = drive_scene(road_planner(scene_of(tmp_path)), steps=1)
    monkeypatch.setitem(sys.modules, "commonroad.common", None)
    with pytest.raises(ImportError) as error:
        ma.save_commonroad_solution(drive, tmp_path / "solution.xml")
    assert str(error.value) == (
        "CommonRoad solution: commonroad-io is not installed; need pip install "
        "'maneuver-automaton[commonroad]'"
    )


@needs_data
@quiet
@pytest.mark.parametrize(
    "name",
    [
        *quick_are((), ["DEU_Ffb-1_6_T-1", "USA_US101-1_1_S-1"], exhaustive=True),
        "ZAM_Urban-3_1",
    ],
)
def test_the_official_checker_accepts_what_was_driven(name, tmp_path):
    pytest.importorskip("commonroad_dc")
    judges = pytest.importorskip(
        "commonroad_dc.feasibility.solution_checker",
        reason="the checker needs commonroad-io<2026",
        exc_type=ImportError,
    )
    from commonroad.common.file_reader import CommonRoadFileReader
    from commonroad.common.solution import CommonRoadSolutionReader

    file = DATA / f"{name}.xml"
    road = ma.load_scenario(file)
    drive = ma.drive_road(road.scene, road.vehicle)
    plan = ma.plan_road(road.scene, road.vehicle)
    for value in (drive, plan):
        ma.save_commonroad_solution(value, tmp_path / "solution.xml")
        scenario, problems = CommonRoadFileReader(str(file)).open()
        solution = CommonRoadSolutionReader.open(str(tmp_path / "solution.xml"))
        valid, results = judges.valid_solution(scenario, problems, solution)
        assert valid  # goal, start, collision, road boundary, feasibility
        ((feasible, inputs, _),) = results.values()
        assert feasible
        assert len(inputs.state_list) == len(states_of(tmp_path / "solution.xml")[2]) - 1
