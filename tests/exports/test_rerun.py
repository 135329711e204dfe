"""Recordings for the viewer of rerun, read back by its SDK."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.recording import recording_of
from tests.exports.cases import VALUES, assert_close, drive_on_lanes
from tests.plotting.cases import parking_plan
from tests.roads.files import LANES, car, problem

quiet = pytest.mark.filterwarnings("ignore")  # of the SDK


def columns_of(path):
    """Columns of a recording by entity and component, those in time with their times [s]."""
    chunk = pytest.importorskip("rerun.chunk", reason="needs rerun-sdk that reads recordings")
    found = {}
    for one in chunk.RrdReader(path).stream():
        batch = one.to_record_batch().to_pydict()
        times = batch.pop("plan", None)
        for name, values in batch.items():
            found[one.entity_path, name.split(":")[-1]] = (times, values)
    return found


def seconds(times):
    return [one.total_seconds() for one in times]


@quiet
@pytest.mark.parametrize("name", list(VALUES))
def test_the_body_is_where_the_plan_is(name, tmp_path):
    value = VALUES[name]()
    pytest.importorskip("rerun")
    ma.save_rerun(value, tmp_path / "plan.rrd", step=0.25)
    assert [one.name for one in tmp_path.iterdir()] == ["plan.rrd"]
    found = columns_of(tmp_path / "plan.rrd")
    rows = recording_of(value).movers[0].rows(step=0.25)
    times, places = found["/world/vehicle", "translation"]
    assert_close(seconds(times), rows.time, atol=1e-6)
    altitude = rows.pose[:, 3] if rows.pose.shape[1] > 3 else np.zeros(len(rows.time))
    assert_close(np.array(places)[:, 0], np.column_stack([rows.pose[:, :2], altitude]), atol=1e-5)
    _, turns = found["/world/vehicle", "quaternion"]
    half = np.array(turns)[:, 0, 2:]
    assert_close(half, np.stack([np.sin(rows.pose[:, 2] / 2), np.cos(rows.pose[:, 2] / 2)], -1),
                 atol=1e-6)  # fmt: skip
    curve = next(iter(rows.columns().items()))
    assert curve[0] == "time_s"
    times, speeds = found["/curves/v_x_m_s", "scalars"]
    assert_close(np.ravel(speeds), rows.columns()["v_x_m_s"])


@quiet
def test_what_is_around_and_what_is_carried_is_there(tmp_path):
    pytest.importorskip("rerun")
    ma.save_rerun(VALUES["among obstacles"](), tmp_path / "slalom.rrd")
    entities = {entity for entity, _ in columns_of(tmp_path / "slalom.rrd")}
    assert len({one for one in entities if one.startswith("/world/obstacles/")}) >= 5
    assert {"/world/path", "/world/swept", "/world/goals/0", "/primitive"} <= entities
    ma.save_rerun(VALUES["trailer"](), tmp_path / "trailer.rrd")
    assert "/world/trailer/body" in {one for one, _ in columns_of(tmp_path / "trailer.rrd")}


@quiet
def test_who_leaves_the_road_is_cleared(tmp_path):
    pytest.importorskip("rerun")
    parts = (*LANES, car(8, x=100.0, y=6.0, speed=6.0, steps=4), problem())
    ma.save_rerun(drive_on_lanes(tmp_path, *parts), tmp_path / "drive.rrd")
    found = columns_of(tmp_path / "drive.rrd")
    at = next(one for one, _ in found if one.endswith("/body") and "car" in one)
    times, _ = found[at, "is_recursive"]
    assert_close(seconds(times), [0.4], atol=1e-6)
    assert ("/world/lanelets", "strips") in found


def test_the_extra_is_named_where_it_is_missing(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ImportError) as error:
        ma.save_rerun(parking_plan(), tmp_path / "plan.rrd")
    assert str(error.value) == (
        "rerun: rerun-sdk is not installed; need pip install 'maneuver-automaton[rerun]'"
    )
    assert list(tmp_path.iterdir()) == []
