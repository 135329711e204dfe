"""GeoJSON, read back by shapely."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.geometry import shape

import maneuver_automaton as ma
from maneuver_automaton.groups import SE2
from tests.exports.cases import VALUES, assert_close, drive_on_lanes, ends, slalom, trailer
from tests.plotting.cases import parking_plan
from tests.plotting.fleets import crossing
from tests.roads.files import LANES, car, parked, problem


def written(value, folder):
    path = folder / "plan.geojson"
    ma.save_geojson(value, path)
    return json.loads(path.read_text())


def features(document, kind):
    return [
        (shape(one["geometry"]), one["properties"])
        for one in document["features"]
        if one["properties"]["kind"] == kind
    ]


@pytest.mark.parametrize("name", list(VALUES))
def test_every_feature_is_valid_and_the_path_leads_from_start_to_end(name, tmp_path):
    value = VALUES[name]()
    document = written(value, tmp_path)
    assert document["type"] == "FeatureCollection"
    for one in document["features"]:
        assert one["type"] == "Feature"
        geometry = shape(one["geometry"])
        straight_up = geometry.has_z and np.ptp(np.array(geometry.coords)[:, :2], axis=0).max() == 0
        assert geometry.is_valid or straight_up  # which shapely takes for a point
    ((path, facts),) = features(document, "path")
    first, last = ends(value)
    kept = [0, 1, 3][: first.size - 1]
    assert_close(np.array(path.coords)[[0, -1]], [first[kept], last[kept]])
    assert facts["length_m"] >= np.linalg.norm(last[kept] - first[kept]) - 1e-9
    (start,) = features(document, "start")
    assert_close(start[0].coords[0], first[kept])


def test_what_is_around_a_plan_is_there(tmp_path):
    result = slalom()
    document = written(result, tmp_path)
    ((swept, _),) = features(document, "swept")
    bodies = features(document, "body")
    assert len(bodies) == len(result.plan.trims) + 1
    assert all(swept.buffer(1e-6).contains(body) for body, _ in bodies)
    obstacles = features(document, "obstacle")
    areas = [one.area for one, facts in obstacles if "time_s" not in facts]
    assert_close(areas[0], 1.2**2 * 0.75)  # a polygon with a hole of half its size
    assert_close(areas[1], np.pi * 0.09, atol=0.002)
    assert_close(areas[2:], [0.4, 4 * 0.2**2])
    moving = {facts["time_s"]: one.centroid for one, facts in obstacles if "time_s" in facts}
    x, y = result.plan.start[:2]
    crossing = SE2([x - 2.0, y + 1.5, 0.0]).act(np.array([0.1, 0.0]))
    assert_close(moving[0.0].coords[0], crossing)
    assert len(moving) > 3
    ((goal, facts),) = features(document, "goal")
    assert_close(goal.coords[0], result.plan.end[:2])
    assert facts["heading_rad"] == result.problem.goals[0].pose[2]


def test_the_trailer_is_swept_too(tmp_path):
    document = written(trailer(), tmp_path)
    parts = {facts["part"] for _, facts in features(document, "body")}
    assert parts == {"vehicle", "trailer"}
    ((swept, _),) = features(document, "swept")
    for body, _ in features(document, "body"):
        assert swept.buffer(1e-6).contains(body)


def test_a_road_has_lanelets_goals_and_those_who_are_there(tmp_path):
    gone = car(8, x=100.0, y=6.0, speed=6.0, steps=4)
    drive = drive_on_lanes(
        tmp_path, *LANES, car(7, x=35.0, y=2.0, speed=6.0, steps=40), gone,
        parked(9, x=190.0, y=2.0), problem(),
    )  # fmt: skip
    document = written(drive, tmp_path)
    assert document["name"] == "TST_Lanes-1_1_T-1"
    lanes = features(document, "lanelet")
    assert [facts["id"] for _, facts in lanes] == [1, 2]
    assert_close([one.area for one, _ in lanes], [800.0, 800.0])
    ((swept, _),) = features(document, "swept")
    assert shapely.union_all([one for one, _ in lanes]).buffer(1e-6).contains(swept)
    times = [f["time_s"] for _, f in features(document, "obstacle") if f["name"] == "car 8"]
    assert times == [0.0]  # it leaves after 0.4 s
    ((goal, facts),) = features(document, "goal")
    assert_close([goal.area, *facts["time_s"]], [800.0, 2.0, 4.0])


def test_no_limit_is_null(tmp_path):
    drive = drive_on_lanes(tmp_path)
    scene = drive.planner.scene
    goal = replace(scene.goals[0], time=(2.0, np.inf))
    planner = replace(drive.planner, scene=replace(scene, goals=(goal,)))
    ((_, facts),) = features(written(replace(drive, planner=planner), tmp_path), "goal")
    assert facts["time_s"] == [2.0, None]


def test_what_several_do_is_told_apart(tmp_path):
    result = crossing()
    document = written(result, tmp_path)
    paths = {facts["vehicle"]: path for path, facts in features(document, "path")}
    assert {name: one.coords[-1] for name, one in paths.items()} == {
        name: tuple(plan.end[:2]) for name, plan in result.plans.items()
    }
    assert [facts["vehicle"] for _, facts in features(document, "start")] == list(result.results)
    once = [facts["name"] for _, facts in features(document, "obstacle") if "time_s" not in facts]
    assert once == [""]  # the wall, which all three have around them


def test_a_moved_plan_has_moved_features(tmp_path):
    by, plan = SE2([3.0, -2.0, 0.7]), parking_plan()
    here, there = (written(one, tmp_path) for one in (plan, plan.moved(by)))
    for one, other in zip(here["features"], there["features"], strict=True):
        moved = shapely.transform(shape(one["geometry"]), by.act)
        assert moved.equals_exact(shape(other["geometry"]), 1e-9)


def test_coordinates_are_said_to_be_metres(tmp_path):
    document = written(parking_plan(), tmp_path)
    assert document["units"] == "m"
    assert 'UNIT["metre",1]' in document["crs"]["properties"]["name"]
    pyogrio = pytest.importorskip("pyogrio")
    frame = pyogrio.read_dataframe(tmp_path / "plan.geojson")
    assert frame.crs.is_engineering
    assert frame.crs.axis_info[0].unit_name == "metre"


def test_outer_rings_run_to_the_left(tmp_path):
    document = written(replace(slalom()), tmp_path)
    for geometry, _ in features(document, "obstacle"):
        for part in shapely.get_parts(geometry):
            assert part.exterior.is_ccw
            assert not any(ring.is_ccw for ring in part.interiors)
