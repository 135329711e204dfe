"""GeoJSON, read back by shapely."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.geometry import shape

import maneuver_automaton as ma
from maneuver_automaton.collision import Disc, Motion, Obstacle
from maneuver_automaton.exports.surroundings import solids_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.recording import recording_of
from tests.exports.cases import VALUES, assert_close, drive_on_lanes, ends, slalom, trailer
from tests.plotting.cases import parking_plan


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


def test_the_trailer_is_swept_too(tmp_path):
    document = written(trailer(), tmp_path)
    parts = {facts["part"] for _, facts in features(document, "body")}
    assert parts == {"vehicle", "trailer"}
    ((swept, _),) = features(document, "swept")
    for body, _ in features(document, "body"):
        assert swept.buffer(1e-6).contains(body)


@pytest.mark.parametrize("motion", [None, Motion([0.0, 9.0], [[0, 0, 0], [9, 0, 0]])])
@pytest.mark.parametrize(
    ("present", "times"),
    [((-np.inf, 2.0), [0, 2]), ((5.0, 9.0), [6, 8]), ((2.5, 3.5), [2.5]), ((9.0, np.inf), [])],
)
def test_what_comes_and_goes_is_shown_while_it_is_there(motion, present, times):
    recording = recording_of(parking_plan())
    door = Obstacle(Disc(0.3), motion=motion, present_s=present)
    world = replace(recording.world, obstacles=(door,))
    assert [time for *_, time in solids_of(replace(recording, world=world))] == times


def test_no_limit_is_null(tmp_path):
    drive = drive_on_lanes(tmp_path)
    scene = drive.planner.scene
    goal = replace(scene.goals[0], time=(2.0, np.inf))
    planner = replace(drive.planner, scene=replace(scene, goals=(goal,)))
    ((_, facts),) = features(written(replace(drive, planner=planner), tmp_path), "goal")
    assert facts["time_s"] == [2.0, None]


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
