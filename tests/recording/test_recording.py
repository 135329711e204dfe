"""Recordings: one value of every kind of result."""

import numpy as np
import pytest

from maneuver_automaton.collision import Box
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning import plan
from maneuver_automaton.problem import Problem
from maneuver_automaton.recording import Fact, Mover, recording_of
from maneuver_automaton.roads import (
    GoalRegion,
    Lanelet,
    RoadScene,
    RoadStart,
    drive_road,
    plan_road,
    plan_roads,
)
from tests.plotting.cases import ROBOT, plan_of
from tests.plotting.fleets import crossing
from tests.plotting.loops import parking_loop, pushed_loop

LANE = Lanelet(1, [[0, 2], [200, 2]], [[0, -2], [200, -2]])


def lane_scene(x=5.0):
    return RoadScene(
        name="lane",
        lanelets=(LANE,),
        goals=(GoalRegion(places=(Box([20, 4], [x + 30.0, 0]),), time=(2.0, 4.0)),),
        start=RoadStart(middle=[x, 0, 0], speed=10.0),
    )


def test_pieces_and_rows_of_a_plan():
    whole = plan_of(["straight", "clockwise"], [2.0, 1.0])
    one = recording_of(whole).movers[0]
    times = np.linspace(-1.0, 4.0, 11)
    assert np.array_equal(one.pose_at(times), whole.pose_at(times))
    assert np.array_equal(one.rows(step=0.5).pose, whole.as_arrays(step=0.5).pose)


def test_an_answer_has_its_world_its_bodies_and_its_goal():
    around = {"obstacles": [Box([0.2, 0.2], [1.0, 1.0])], "footprint": Box([0.4, 0.2])}
    problem = Problem(ROBOT, [0, 0, 0], [2, 0, 0], **around)
    result = plan(problem)
    recording = recording_of(result)
    one = recording.movers[0]
    assert (recording.status, one.cost, one.goal_index) == ("found", result.cost, 0)
    assert recording.world.obstacles == problem.obstacles
    assert one.bodies[""] == tuple(problem.footprint)
    assert recording_of(recording) is recording


def test_who_has_no_plan_stands():
    recording = recording_of(crossing())
    there, back, stuck = recording.movers
    assert not stuck.has_plan
    assert stuck.duration == 0.0
    assert stuck.reason == "walls enclose the start"
    assert back.there[1] == back.end_time
    assert there.there == (-np.inf, np.inf)
    assert recording.begin == min(one.start_time for one in recording.movers)


@pytest.mark.parametrize("loop", [parking_loop, pushed_loop])
def test_a_loop_goes_where_it_was_measured(loop):
    recording = recording_of(loop())
    one = recording.movers[0]
    for time, pose in zip(loop().times[:-1], loop().poses[:-1], strict=True):
        assert one.pose_at(time) == pytest.approx(pose, abs=1e-9)
    assert one.end == pytest.approx(loop().poses[-1])
    assert [time for time, _ in one.held] == loop().times[:-1].tolist()
    replanned = [event for event in recording.events if event.kind == "replanned"]
    assert len(replanned) == sum(step.replanned for step in loop().steps)


def test_roads():
    answer = plan_road(lane_scene())
    drive, several = drive_road(lane_scene()), plan_roads({"a": lane_scene(), "b": lane_scene(25)})
    for result, kind in ((answer, "road_plan"), (drive, "road_drive"), (several, "road_fleet")):
        recording = recording_of(result)
        assert recording.kind == kind
        assert recording.world.fleeting
        assert len(recording.world.lanes) == 1
        assert all(one.reached for one in recording.movers)
    one = recording_of(several).movers[1]
    assert one.start == pytest.approx(SE2([25 - 1.42273, 0, 0]).pose)
    assert one.there == (one.start_time, one.end_time)


def test_other_values_are_refused():
    with pytest.raises(TypeError, match="recording: got int, need a Plan, PlanResult"):
        recording_of(3)
    with pytest.raises(ValueError, match="at least one"):
        Mover(pieces=())
    assert Fact(label="cost", value=1.23456789, digits=6).text == "1.23457"
