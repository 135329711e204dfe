"""What is driven on roads, as plans: where they lead, their words, and files that read back."""

from __future__ import annotations

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.formats.documents import write_document
from maneuver_automaton.formats.road_json import road_plan_to_dict
from maneuver_automaton.models import rollout
from maneuver_automaton.roads import RoadVehicle, plan_road
from maneuver_automaton.roads.plans import plan_of_controls
from tests.roads.files import scene_of

MODEL = RoadVehicle().model


def test_a_plan_leads_where_the_equations_do():
    controls = np.array([[2.0, 0.1], [2.0, 0.1], [0.0, 0.0], [0.0, 0.0], [-8.0, -0.4]])
    state = np.array([3.0, -2.0, 0.7, 9.0, 0.05])
    plan = plan_of_controls(MODEL, state, controls, tick=0.1, start_time=4.0)
    assert plan.switching_times == pytest.approx([4.0, 4.2, 4.4, 4.5])
    end = state
    for control in controls:
        end = rollout(MODEL, end, control=control, times=[0.0, 0.1], rtol=1e-11, atol=1e-11)[-1]
    np.testing.assert_allclose([*plan.end, *plan.trims[-1].reduced_state], end, atol=1e-8)


def test_what_changes_nothing_is_a_trim():
    at_rest = plan_of_controls(MODEL, np.zeros(5), np.zeros((3, 2)), tick=0.1)
    assert (at_rest.word, at_rest.maneuvers) == (("speed 0, steering 0",), ())
    assert at_rest.duration == pytest.approx(0.3)
    nothing = plan_of_controls(MODEL, np.ones(5), np.zeros((0, 2)), tick=0.1)
    assert (nothing.duration, nothing.end.tolist()) == (0.0, [1.0, 1.0, 1.0])


def test_a_plan_on_roads_reads_back_from_its_file(tmp_path):
    result = plan_road(scene_of(tmp_path))
    file = tmp_path / "plan.json"
    write_document(road_plan_to_dict(result), file)
    read = ma.load_plan(file, model=result.planner.vehicle.model)
    assert read.word == result.plan.word
    times = np.linspace(0.0, read.duration, 50)
    np.testing.assert_allclose(read.pose_at(times), result.plan.pose_at(times), atol=1e-9)
    controls = [one.course.control[0].tolist() for one in read.maneuvers if one is not None]
    entries = [one for one in road_plan_to_dict(result)["primitives"] if one["kind"] == "maneuver"]
    assert [one["control"] for one in entries] == controls


def test_the_stop_begins_where_the_plan_ends(tmp_path):
    result = plan_road(scene_of(tmp_path))
    np.testing.assert_allclose(result.stop.start, result.plan.end, atol=1e-6)
    assert result.stop.start_time == pytest.approx(result.plan.duration)
    assert result.stop.trims[-1].reduced_state[0] == pytest.approx(0.0, abs=1e-9)
