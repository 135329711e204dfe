"""What is separated, what is connected, by hand and against samples of the poses."""

import dataclasses
import math

import numpy as np
import pytest
import shapely
from shapely import affinity

from maneuver_automaton import Disc, Goal, Obstacle, OccupancyMap
from maneuver_automaton.bounds import Reachability, connectivity, pose_scene, separation
from maneuver_automaton.collision import Box, Motion
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds, Problem
from tests.bounds.scenes import BODY, CAR, bend, dead_end, gap, slot


def connected(problem, **more):
    scene = pose_scene(problem)
    ends = [
        np.append(scene.world.into(np.array(pose)), np.zeros(3))[None]
        for pose in (problem.start, problem.goals[0].pose)
    ]
    return connectivity(scene, *ends, bounds=problem.bounds, **more)


@pytest.mark.parametrize(
    ("scene", "width", "answer"),
    [
        (gap, 1.88, Reachability.SEPARATED),
        (gap, 1.95, Reachability.CONNECTED),
        (bend, 2.99, Reachability.SEPARATED),
        (bend, 3.02, Reachability.CONNECTED),
        (dead_end, 4.9, Reachability.SEPARATED),
        (dead_end, 5.2, Reachability.CONNECTED),
        (slot, 4.71, Reachability.CONNECTED),
    ],
)
def test_passages_are_decided_within_a_few_centimetres(scene, width, answer):
    found = connected(scene(width), most_boxes=60_000)
    assert found.answer is answer


def test_a_way_through_free_boxes_collides_nowhere():
    problem = bend(3.1)
    path = connected(problem).path
    assert np.allclose(path[0], problem.start, atol=1.6)
    walls = shapely.union_all([shapely.Polygon(one.shape.corners) for one in problem.obstacles])
    body = shapely.Polygon(BODY.corners)
    for x, y, heading in path:
        turned = affinity.rotate(body, heading, origin=(0, 0), use_radians=True)
        assert affinity.translate(turned, x, y).distance(walls) > 0.0


def test_too_little_work_leaves_it_open():
    assert connected(gap(1.88), most_boxes=3_000).answer is Reachability.OPEN


def test_a_moved_scene_has_the_moved_proof():
    walls = [Obstacle(Box([0.4, 30.0], [10.0, y])) for y in (-15.2, 15.2)]
    walls += [Obstacle(Box([30.0, 0.4], [10.0, y])) for y in (-8.0, 8.0)]
    walls += [Obstacle(Box([0.4, 30.0], [-5.0, 0.0]))]
    problem = Problem(CAR, [4, 3, 0], [15, -2, 1.0], obstacles=walls, footprint=BODY)
    by = SE2([300.0, -50.0, 0.7])
    first, second = connected(problem), connected(problem.moved(by))
    assert first.answer is second.answer is Reachability.SEPARATED
    assert first.boxes == second.boxes
    assert np.allclose(second.reached, by.act(first.reached), atol=1e-6)


@pytest.mark.parametrize(
    ("scene", "width", "missing", "place"),
    [(gap, 1.8, 0.1, (10, 0)), (bend, 2.9, 0.105, (14, 2))],
)
def test_the_narrowest_place_says_what_is_missing(scene, width, missing, place):
    narrowest = separation(scene(width)).narrowest
    assert missing <= narrowest.missing <= 1.6 * missing
    assert np.hypot(*(np.array(narrowest.place) - place)) < 1.2


def test_a_proof_in_the_last_moment_names_no_place():
    wall = Box([8.0, 14.0], [10.0, 0.0])  # the first boxes close it already
    proof = separation(dataclasses.replace(gap(1.0), obstacles=[wall]), deadline=-math.inf)
    assert proof.narrowest is None
    assert proof.reason.endswith("however it is driven")


def test_places_that_are_reached_hold_the_start_and_not_the_goal():
    problem = gap(1.7)
    proof = separation(problem)
    squares = shapely.union_all(shapely.polygons(proof.reached))
    assert squares.contains(shapely.Point(problem.start[:2]))
    assert not squares.contains(shapely.Point(problem.goals[0].pose[:2]))
    assert "the passage at (" in proof.reason


def test_a_goal_is_every_pose_within_its_tolerance():
    def with_goal(**more):
        goal = Goal(pose=[15.0, -2.0, 1.0], **more)
        return dataclasses.replace(gap(1.7), goals=(goal,))

    assert separation(with_goal(free_heading=True, tolerance_m=1.0)) is not None
    assert separation(with_goal(tolerance_m=12.0, tolerance_rad=1.1)) is None
    many = dataclasses.replace(gap(1.7), goals=([15, -2, 1.0], [6, 3, 0.0]))
    assert separation(many) is None


def test_what_moves_proves_nothing():
    wall = Obstacle(Box([0.4, 40.0], [10.0, 0.0]))
    problem = dataclasses.replace(gap(1.7), obstacles=(wall,))
    assert connected(problem).answer is Reachability.SEPARATED
    leaves = dataclasses.replace(wall, motion=Motion([0.0, 60.0], [[0, 0, 0], [0, 90, 0]]))
    assert separation(dataclasses.replace(problem, obstacles=(leaves,))) is None


def test_a_point_and_a_disc_have_no_headings():
    wall = OccupancyMap(np.ones((2, 40)), resolution=0.25, origin=[-5.0, 4.0, 0.0])
    bounds = Bounds(x=(-5.0, 5.2), y=(-10.0, 10.0))  # the map leaves 0.2 m at its end
    for body, is_separated in ((Disc(0.1), False), (Disc(0.3), True), ((), False)):
        problem = Problem(
            CAR, [0, 0, 0], [0, 8, 2.0], obstacles=wall, footprint=body, bounds=bounds
        )
        assert not pose_scene(problem).turns
        assert (separation(problem) is not None) is is_separated
    inside = dataclasses.replace(problem, bounds=Bounds(x=(-4.9, 4.9)))
    assert separation(inside) is not None


def test_a_long_corridor_has_as_small_boxes_as_a_short_one():
    """Too narrow to turn round in by 18 cm; the work grows as the corridor does."""

    def closed(length):
        width = math.hypot(2.0, 1.4) - 0.18
        walls = [(-1, -1, length + 1, 0), (-1, width, length + 1, width + 1)]
        walls += [(-1, 0, 0, width), (length, 0, length + 1, width)]
        obstacles = [Box([c - a, d - b], [0.5 * (a + c), 0.5 * (b + d)]) for a, b, c, d in walls]
        ends = [[3.0, 0.5 * width, 0.0], [length - 3.0, 0.5 * width, math.pi]]
        return Problem(CAR, *ends, obstacles=obstacles, footprint=Box([2.0, 1.4]))

    short, long = (connected(closed(length), most_boxes=300_000) for length in (20.0, 100.0))
    assert short.answer is long.answer is Reachability.SEPARATED
    assert long.boxes < 6 * short.boxes
