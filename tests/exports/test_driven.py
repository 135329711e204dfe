"""Rows of what is to be exported, whatever it is, and tables of them."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.recording import recording_of, recording_to_write
from tests.exports.cases import VALUES, assert_close, drive_on_lanes, ends
from tests.plotting.cases import parking_plan
from tests.plotting.fleets import crossing
from tests.plotting.loops import pushed_loop


def driver(value):
    """The one that drives."""
    (mover,) = recording_to_write(value).movers
    return mover


@pytest.mark.parametrize("name", list(VALUES))
@pytest.mark.parametrize("step", [None, 0.3])
def test_rows_lead_from_the_first_pose_to_the_last(name, step):
    value = VALUES[name]()
    driven = driver(value)
    rows = driven.rows(step=step)
    first, last = ends(value)
    assert_close(rows.pose[0], first)
    assert_close(rows.pose[-1], last)
    assert (np.diff(rows.time) > 0.0).all()
    assert_close(rows.time[[0, -1]], [driven.start_time, driven.start_time + driven.duration])
    if step is not None:
        assert_close(rows.time[:-1], driven.start_time + step * np.arange(len(rows.time) - 1))


@pytest.mark.parametrize("name", ["plan", "flight", "trailer", "inertia"])
def test_rows_of_a_plan_are_its_own(name):
    value = VALUES[name]()
    plan = value if isinstance(value, ma.Plan) else value.plan
    model = None if isinstance(value, ma.Plan) else value.problem.automaton.model
    ours, theirs = driver(value).rows(step=0.25), plan.as_arrays(step=0.25, model=model)
    for name in ("time", "pose", "twist", "reduced_state", "control", "index"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert ours.primitive.tolist() == theirs.primitive.tolist()


def test_rows_of_a_loop_are_where_it_was_at_every_step():
    loop = pushed_loop()
    rows = driver(loop).rows(step=0.5)
    assert_close(rows.time, loop.times)
    assert_close(rows.pose, loop.poses)  # after each push
    names = [plan.word[0] for plan in loop.driven]
    assert rows.primitive.tolist()[:-1] == names


def test_every_kind_is_a_table(tmp_path):
    drive = drive_on_lanes(tmp_path)
    for name, value in {**{name: make() for name, make in VALUES.items()}, "road": drive}.items():
        ma.save_csv(value, tmp_path / f"{name}.csv", step=0.1)
        with (tmp_path / f"{name}.csv").open(newline="") as stream:
            header, *lines = csv.reader(stream)
        rows = driver(value).rows(step=0.1)
        known = list(rows.columns())
        assert (header[: len(known) - 1], header[-1]) == (known[:-1], "primitive")
        numbers = np.array([[float(cell) for cell in line[:-1]] for line in lines])
        np.testing.assert_array_equal(numbers[:, 0], rows.time)
    assert "state_steering" in header  # of the road


def test_the_lines_of_a_fleet_begin_with_the_name(tmp_path):
    result = crossing()  # the third of them has no plan
    ma.save_csv(result, tmp_path / "fleet.csv", step=0.5)
    with (tmp_path / "fleet.csv").open(newline="") as stream:
        header, *lines = csv.reader(stream)
    assert header[:4] == ["vehicle", "time_s", "x_m", "y_m"]
    for name, plan in result.plans.items():
        of_it = np.array([line[1:4] for line in lines if line[0] == name], dtype=np.float64)
        rows = plan.as_arrays(step=0.5)
        assert_close(of_it[:, 0], rows.time)
        assert_close(of_it[:, 1:], rows.pose[:, :2])
    assert {line[0] for line in lines} == {"there", "back"}


def test_a_column_that_a_vehicle_does_not_have_is_empty(tmp_path):
    car, robot = VALUES["inertia"](), VALUES["among obstacles"]()
    movers = [replace(recording_of(one).movers[0], name=n) for n, one in
              (("car", car), ("robot", robot))]  # fmt: skip
    ma.save_csv(replace(recording_of(car), movers=tuple(movers)), tmp_path / "two.csv", step=1.0)
    with (tmp_path / "two.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert all(row["state_steering"] for row in rows if row["vehicle"] == "car")
    assert not any(row["state_steering"] for row in rows if row["vehicle"] == "robot")
    assert all(row["control_speed"] for row in rows if row["vehicle"] == "robot")
    assert all(row["primitive"] for row in rows)


def test_what_is_no_plan_is_told():
    problem = VALUES["among obstacles"]().problem
    empty = ma.PlanResult(problem=problem, status=ma.PlanStatus.NO_PLAN, reason="none at all")
    with pytest.raises(ValueError) as error:
        recording_to_write(empty)
    assert str(error.value) == "the result has no plan to write: none at all"
    with pytest.raises(TypeError) as wrong:
        recording_to_write(3)
    assert str(wrong.value).startswith("recording: got int, need a Plan, PlanResult")


def test_a_plan_that_is_there_already_has_one_row():
    there = ma.Plan([1.0, 2.0, 0.5], (), durations=[])
    rows = driver(there).rows(step=0.1)
    assert rows.pose.tolist() == [[1.0, 2.0, 0.5]]
    assert rows.primitive.tolist() == [""]
    assert driver(parking_plan()).model is None
