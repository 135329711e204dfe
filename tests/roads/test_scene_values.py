"""Values of roads: goals, lanelets, routes, the vehicle; by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maneuver_automaton.collision import Box, Disc
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads import (
    GoalRegion,
    Lanelet,
    RoadScene,
    RoadStart,
    RoadVehicle,
    drivable_area,
)
from maneuver_automaton.roads.route import lanelets_of_goal, route_of
from tests.roads.files import scene_of


def straight(number, y, *, start=0.0, end=100.0, **more):
    return Lanelet(number, [[start, y + 2], [end, y + 2]], [[start, y - 2], [end, y - 2]], **more)


def scene(lanelets, *, middle=(5.0, 0.0, 0.0), goal=None):
    return RoadScene(
        name="by hand",
        lanelets=tuple(lanelets),
        start=RoadStart(middle=np.array(middle), speed=10.0),
        goals=(goal or GoalRegion(time=(1.0, 2.0)),),
    )


def test_a_goal_is_reached_on_its_ends():
    goal = GoalRegion(places=(Disc(1.0, [10.0, 0.0]),), speed=(2.0, 3.0), time=(1.0, 1.0))
    assert goal.contains([10.9, 0.0, 2.0], speed=3.0, time=1.0)
    assert not goal.contains([11.1, 0.0, 2.0], speed=3.0, time=1.0)
    assert not goal.contains([10.0, 0.0, 2.0], speed=3.1, time=1.0)


def test_a_goal_of_no_place_is_refused():
    with pytest.raises(ValueError) as caught:
        GoalRegion(places=())
    assert str(caught.value) == (
        "goal region: got no place, need at least one, or None for anywhere"
    )


@pytest.mark.parametrize("gap", [0.002, 0.05, 0.3])
def test_there_is_road_between_stated_neighbours_only(gap):
    apart = drivable_area([straight(1, 0.0), straight(2, 4.0 + gap)])
    assert apart.geom_type == "MultiPolygon"
    assert_allclose(apart.area, 800.0, atol=1e-3)
    back = Lanelet(2, [[100, 2 + gap], [0, 2 + gap]], [[100, 6 + gap], [0, 6 + gap]])
    for beside, other in (([2], straight(2, 4.0 + gap)), ([], back)):
        against = [] if beside else [2]
        joined = drivable_area([straight(1, 0.0, beside=beside, against=against), other])
        assert joined.geom_type == "Polygon"
        assert_allclose(joined.area, 100.0 * (8.0 + gap), atol=1e-3)


@pytest.mark.parametrize(
    ("middle", "side", "whole"), [(1e-4, 0.0, True), (0.0, 1e-4, False), (0.1, 0.0, False)]
)
def test_there_is_road_where_only_corners_amid_two_rows_miss_each_other(middle, side, whole):
    lanes = [
        Lanelet(1, [[0, 2], [9, 2]], [[0, 0], [9, 0]], successors=[3], against=[2]),
        Lanelet(2, [[9, 2], [0, 2]], [[9, 4], [0, 4]], against=[1]),
        Lanelet(3, [[9 + middle, 2], [20, 2]], [[9 + side, 0], [20, 0]], against=[4]),
        Lanelet(4, [[20, 2], [9 + middle, 2]], [[20, 4], [9 + side, 4]], [2], against=[3]),
    ]
    assert (drivable_area(lanes).buffer(-0.5).geom_type == "Polygon") == whole


def test_rounding_leaves_no_gap():
    area = drivable_area([straight(1, 0.0), straight(2, 4.0 + 1e-7)])
    assert area.geom_type == "Polygon"


def test_a_scene_needs_a_time_step():
    with pytest.raises(ValueError, match=r"step must be positive, got 0\.0 s"):
        replace(scene([straight(1, 0.0)]), step=0.0)


def test_a_lanelet_needs_two_points_on_each_side():
    with pytest.raises(ValueError) as caught:
        Lanelet(3, [[0, 1]], [[0, 0], [1, 0]])
    assert str(caught.value) == (
        "lanelet 3: the left bound has shape (1, 2), need (n, 2) with n >= 2"
    )


def test_the_route_is_that_of_the_lane_that_is_changed_to():
    lanes = [straight(1, 0.0, beside=[2]), straight(2, 4.0, beside=[1], successors=[3])]
    lanes.append(straight(3, 4.0, start=100.0, end=200.0))
    goal = GoalRegion(places=(Box([10.0, 3.0], [150.0, 4.0]),), time=(0.0, 9.0))
    route = route_of(scene(lanes, goal=goal))
    assert route.lanelets == (2, 3)
    assert_allclose(route.points[:, 1], 4.0)
    assert lanelets_of_goal(lanes, goal) == [3]
    (low, high, right, left) = route.extents[0]
    assert_allclose([high - low, left, right], [10.0, 1.5, -1.5])


def test_speed_limits_are_those_of_the_lanelets():
    lanes = [
        straight(1, 0.0, end=50.0, successors=[2], speed_limit=10.0),
        straight(2, 0.0, start=50.0, speed_limit=20.0),
    ]
    goal = GoalRegion(places=(Box([10.0, 3.0], [90.0, 0.0]),), time=(0.0, 9.0))
    route = route_of(scene(lanes, goal=goal))
    lane, beside = route.limit[:, 24], route.limit[:, 30]
    at = {round(x): limit for x, limit in zip(route.points[:, 0], lane, strict=True)}
    assert (at[20], at[80]) == (10.0, 20.0)
    assert_allclose(beside[70:100], lane[70:100])  # off all lanelets: that of the route
    lanes.append(straight(3, 4.0, speed_limit=5.0))
    slower = route_of(scene(lanes, goal=goal)).limit
    assert (slower[:, 24] == lane).all()
    assert (slower[60:160, 30] == 5.0).all()


def test_middle_and_rear_axle_are_each_others_inverse():
    vehicle = RoadVehicle()
    pose = np.array([3.0, -2.0, 0.7])
    assert_allclose(vehicle.middle_of(vehicle.rear_of(pose)), pose, atol=1e-12)
    assert_allclose(vehicle.footprint.center, [vehicle.ahead, 0.0])


def test_steering_keeps_the_lateral_limit():
    vehicle = RoadVehicle()
    speeds = np.array([0.0, 5.0, 20.0])
    across = speeds**2 * np.tan(vehicle.sharpest(speeds)) / vehicle.model.wheelbase
    assert (across <= vehicle.lateral + 1e-9).all()
    assert_allclose(across[2], vehicle.lateral)


def test_a_moved_scene_is_the_same_from_where_it_starts(tmp_path):
    plain = scene_of(tmp_path)
    by = SE2(np.array([120.0, -340.0, 2.1]))
    vehicle = RoadVehicle()

    def seen(one):
        frame = SE2(vehicle.rear_of(one.start.middle))
        return one.moved(frame.inverse(), digits=9)

    here, there = seen(plain), seen(plain.moved(by))
    for one, other in zip(here.lanelets, there.lanelets, strict=True):
        assert one.left.tolist() == other.left.tolist()
    for one, other in zip(here.traffic, there.traffic, strict=True):
        assert one.motion.pose.tolist() == other.motion.pose.tolist()
    assert here.goals[0].heading == there.goals[0].heading
