"""Boxes of poses against shapely: dropped ones collide everywhere, free ones nowhere."""

import dataclasses

import numpy as np
import pytest
import shapely
from shapely import affinity

from maneuver_automaton import Automaton, Car, Goal, Problem
from maneuver_automaton.bounds import PoseScene, pose_scene
from maneuver_automaton.bounds.cells import lasting_obstacles
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import UserModel
from maneuver_automaton.problem import Bounds
from tests.inertia import CAR as SLOW_CAR
from tests.inertia import resting

CAR = Automaton.of_controls(
    Car(wheelbase=2.7, max_steering=0.58), {"ahead": (1, 0), "left": (1, 0.5)}
)
BODIES = {
    "box": [Box([4.7, 1.9], [1.35, 0.0])],
    "discs": [Disc(1.0, [0.0, 0.0]), Disc(1.0, [2.0, 0.2])],
    "cross": [Polygon([[-1, -0.5], [3, -0.5], [3, 0.5], [-1, 0.5]]), Box([1.0, 3.0])],
    "point": [],
}
OBSTACLES = [
    Box([6.0, 1.5], [3.0, 4.0], 0.4),
    Disc(1.4, [-4.0, 2.0]),
    Polygon([[-5, -6], [4, -6], [4, -4], [1, -4.5], [0, -3], [-5, -3.5]]),
    OccupancyMap(
        np.arange(60).reshape(6, 10) % 7 < 3, resolution=0.5, origin=[-8.0, 4.0, 0.3], name="map"
    ),
]


def solid(shape):
    if isinstance(shape, Disc):
        return shapely.Point(shape.center).buffer(shape.radius, quad_segs=64)
    return shapely.Polygon(shape.corners)


def solids_of_map(one):
    x, y, heading = one.origin
    cells = [
        shapely.box(*(one.resolution * np.array([column, row, column + 1, row + 1])))
        for row, column in np.argwhere(one.blocked)
    ]
    turned = affinity.rotate(shapely.union_all(cells), heading, origin=(0, 0), use_radians=True)
    return affinity.translate(turned, x, y)


def problem_with(body, margin=0.0):
    return Problem(
        CAR,
        [0, 0, 0],
        [5, 0, 0],
        obstacles=OBSTACLES,
        footprint=BODIES[body],
        margin=margin,
        bounds=Bounds(x=(-9.0, 7.0), y=None),
    )


def random_boxes(rng, n, size):
    half = size * rng.uniform(0.2, 1.0, (n, 3)) * [1.0, 1.0, 0.25]
    middles = rng.uniform([-10, -8, -np.pi], [9, 8, np.pi], (n, 3))
    return np.concatenate([middles, half], axis=1)


def poses_in(rng, box, n):
    """Random poses of a box, its corners among them."""
    corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 0, 1])).reshape(3, -1).T
    inside = rng.uniform(-1.0, 1.0, (n, 3))
    return box[:3] + np.concatenate([corners, inside]) * box[3:]


@pytest.mark.parametrize(("margin", "frame"), [(0.0, None), (0.3, (3.0, -2.0, 0.7))])
@pytest.mark.parametrize("body", BODIES)
def test_states_hold_for_every_pose_of_a_box(body, margin, frame):
    problem = problem_with(body, margin)
    scene = pose_scene(problem, frame=None if frame is None else np.array(frame))
    rng = np.random.default_rng(7)
    shapes = [one.shape for one in problem.obstacles if isinstance(one, Obstacle)]
    obstacles = shapely.union_all([*map(solid, shapes), solids_of_map(OBSTACLES[-1])])
    parts = shapely.union_all([solid(one) for one in problem.footprint] or [shapely.Point(0, 0)])
    decided = 0
    for size in (0.05, 0.3, 1.2):
        boxes = random_boxes(rng, 40, size)
        boxes[:, :3] = scene.world.into(boxes[:, :3])
        states = scene.states(boxes)
        decided += int((states != 1).sum())
        for box, state in zip(boxes, states, strict=True):
            if state == 1:
                continue
            world = (SE2(scene.world.frame) @ SE2(poses_in(rng, box, 6))).pose
            for x, y, heading in world:
                there = affinity.translate(
                    affinity.rotate(parts, heading, origin=(0, 0), use_radians=True), x, y
                )
                inside = -9.0 <= x <= 7.0
                apart = there.distance(obstacles)
                if state == 2:
                    assert inside
                    assert apart > margin
                else:
                    assert not inside or apart <= margin
    assert decided > 60  # of 120


def test_small_boxes_of_poses_are_decided_but_for_contact():
    scene = pose_scene(problem_with("box"))
    rng = np.random.default_rng(1)
    boxes = random_boxes(rng, 4000, 0.004)
    assert (scene.states(boxes) == 1).mean() < 0.01


def test_a_pose_has_the_depth_at_which_obstacles_that_draw_back_let_it_pass():
    wall = Box([2.0, 20.0], [6.0, 0.0])
    problem = Problem(CAR, [0, 0, 0], [20, 0, 0], obstacles=wall, footprint=Box([4.0, 2.0]))
    scene = pose_scene(problem, frame=np.zeros(3))
    poses = np.array([[3.25, 0.0, 0.0, 0.0, 0.0, 0.0]])  # 0.25 m deep
    assert scene.states(poses).tolist() == [0]
    assert scene.states(poses, give=0.249).tolist() == [0]
    assert scene.states(poses, give=0.251).tolist() == [2]


def test_a_vehicle_with_inertia_turns_whatever_its_trims_are():
    problem = problem_with("box")
    assert pose_scene(problem).turns
    straight = Automaton.of_controls(Car(wheelbase=2.7), {"ahead": (1, 0), "back": (-1, 0)})
    assert not pose_scene(dataclasses.replace(problem, automaton=straight)).turns
    assert pose_scene(dataclasses.replace(problem, automaton=resting(SLOW_CAR))).turns


def test_what_moves_or_can_be_flown_over_stands_in_no_way():
    crossing = Obstacle(Disc(1.0), motion=Motion([0.0, 1.0], [[0, 0, 0], [4, 0, 0]]))
    wall = Obstacle(Box([1.0, 9.0]))
    car = dataclasses.replace(problem_with("box"), obstacles=(crossing, wall))
    assert lasting_obstacles(car) == (wall,)
    glider = UserModel(
        name="glider",
        group=SE2xR,
        control_names=("speed", "turn", "climb"),
        velocity=lambda z, u: [u[0], 0.0, u[1], u[2]],
    )
    flies = Automaton.of_controls(glider, {"ahead": (1, 0, 0), "left": (1, 1, 0), "up": (1, 0, 1)})
    low, high = (Obstacle(Disc(1.0), height=(-5.0, top)) for top in (10.0, 40.0))
    flight = Problem(
        flies,
        [0, 0, 0, 5],
        Goal(pose=[30, 0, 0, 5]),
        obstacles=(low, high),
        bounds=Bounds(z=(0.0, 30.0)),
    )
    assert lasting_obstacles(flight) == (high,)
    assert isinstance(pose_scene(flight), PoseScene)
