"""The verdict on a drive, by hand: contacts while somebody is there, the edge, the equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.collision import Box, Motion, Obstacle
from maneuver_automaton.roads import (
    GoalRegion,
    Lanelet,
    RoadScene,
    RoadStart,
    RoadVehicle,
    judged,
)
from maneuver_automaton.roads.plans import plan_of_controls

VEHICLE = RoadVehicle()
STATE = np.array([0.0, 0.0, 0.0, 10.0, 0.0])
PLAN = plan_of_controls(VEHICLE.model, STATE, np.zeros((40, 2)), tick=0.1)  # 40 m straight on


def scene(*traffic, width=4.0, more=()):
    lane = Lanelet(1, [[-50, width / 2], [90, width / 2]], [[-50, -width / 2], [90, -width / 2]])
    return RoadScene(
        name="by hand",
        lanelets=(lane, *more),
        start=RoadStart(middle=VEHICLE.middle_of(STATE[:3]), speed=10.0),
        goals=(GoalRegion(time=(1.0, 4.0)),),
        traffic=traffic,
    )


def waiting(begin, end, *, x=30.0):
    there = Motion([begin, end], [[x, 0.0, 0.0]] * 2)
    return Obstacle(Box([4.0, 1.8]), motion=there, name="waiting")


def test_distances_are_those_on_paper():
    verdict = judged(scene(Obstacle(Box([2.0, 2.0], [20.0, 3.0]), name="post")), VEHICLE, PLAN)
    assert verdict.clean
    assert verdict.clearance_m == pytest.approx(2.0 - 0.5 * VEHICLE.width)
    assert verdict.edge_m == pytest.approx(2.0 - 0.5 * VEHICLE.width)


@pytest.mark.parametrize(("begin", "end", "hit"), [(0.0, 9.0, True), (0.0, 1.0, False)])
def test_road_users_count_while_they_are_there(begin, end, hit):
    said = Obstacle(Box([4.0, 1.8], [30.0, 0.0]), present_s=(begin, end), name="waiting")
    for there in (waiting(begin, end), said):
        verdict = judged(scene(there), VEHICLE, PLAN)
        assert verdict.hit == (("waiting",) if hit else ())
        assert verdict.collisions == int(hit)
        front = VEHICLE.ahead + 0.5 * VEHICLE.length
        assert verdict.clearance_m == pytest.approx(0.0 if hit else 28.0 - 10.0 - front)


def test_somebody_who_comes_after_the_end_is_not_met():
    assert judged(scene(waiting(4.5, 9.0)), VEHICLE, PLAN).clearance_m == np.inf


def test_a_hole_in_the_road_is_left_out():
    parts = [
        Lanelet(2, [[-50, 6], [90, 6]], [[-50, 2], [90, 2]]),
        Lanelet(3, [[-50, -2], [90, -2]], [[-50, -6], [90, -6]]),
    ]
    whole = scene(more=parts)
    assert judged(whole, VEHICLE, PLAN).edge_m == pytest.approx(6.0 - 0.5 * VEHICLE.width)
    ends = [Lanelet(k, [[a, 2], [b, 2]], [[a, -2], [b, -2]]) for k, (a, b) in
            enumerate(((-50, 20), (21, 90)))]  # fmt: skip
    broken = replace(whole, lanelets=(*ends, *parts))
    assert judged(broken, VEHICLE, PLAN).off_road


def test_what_the_car_cannot_do_is_not_clean():
    wild = plan_of_controls(VEHICLE.model, STATE, np.array([[12.0, 0.0]] * 5), tick=0.1)
    verdict = judged(scene(), VEHICLE, wild)
    assert not verdict.clean
    assert verdict.audit.reason.startswith("acceleration is 4 beyond its limits")
