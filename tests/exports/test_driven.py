"""Rows of what is to be exported, whatever it is."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.exports import driven_of
from tests.exports.cases import VALUES, assert_close, drive_on_lanes, ends
from tests.plotting.cases import parking_plan
from tests.plotting.loops import pushed_loop


@pytest.mark.parametrize("name", list(VALUES))
@pytest.mark.parametrize("step", [None, 0.3])
def test_rows_lead_from_the_first_pose_to_the_last(name, step):
    value = VALUES[name]()
    driven = driven_of(value)
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
    ours, theirs = driven_of(value).rows(step=0.25), plan.as_arrays(step=0.25, model=model)
    for name in ("time", "pose", "twist", "reduced_state", "control", "index"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert ours.primitive.tolist() == theirs.primitive.tolist()


def test_rows_of_a_loop_are_where_it_was_at_every_step():
    loop = pushed_loop()
    rows = driven_of(loop).rows(step=0.5)
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
        rows = driven_of(value).rows(step=0.1)
        known = list(rows.columns())
        assert (header[: len(known) - 1], header[-1]) == (known[:-1], "primitive")
        numbers = np.array([[float(cell) for cell in line[:-1]] for line in lines])
        np.testing.assert_array_equal(numbers[:, 0], rows.time)
    assert "state_steering" in header  # of the road


def test_what_is_no_plan_is_told():
    problem = VALUES["among obstacles"]().problem
    empty = ma.PlanResult(problem=problem, status=ma.PlanStatus.NO_PLAN, reason="none at all")
    with pytest.raises(ValueError) as error:
        driven_of(empty)
    assert str(error.value) == "the result has no plan to write: none at all"
    with pytest.raises(TypeError) as wrong:
        driven_of(3)
    assert str(wrong.value) == (
        "export: got int, need a Plan, PlanResult, ClosedLoop, RoadPlanResult or RoadDrive"
    )


def test_a_plan_that_is_there_already_has_one_row():
    there = ma.Plan([1.0, 2.0, 0.5], (), durations=[])
    rows = driven_of(there).rows(step=0.1)
    assert rows.pose.tolist() == [[1.0, 2.0, 0.5]]
    assert rows.primitive.tolist() == [""]
    assert driven_of(parking_plan()).model is None
