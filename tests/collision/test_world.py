"""A world is the same wherever it lies, and says where things are."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton._compile import kernel
from maneuver_automaton.collision import Box, Disc, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.collision._kernels_moving import obstacle_pose
from maneuver_automaton.collision.world import own_frame, world_of
from maneuver_automaton.groups import SE2
from tests.collision import scenes
from tests.quickly import draws
from tests.reference_collision import distances_of, moved, world_around

BODY = (Box([1.0, 0.5]),)


@kernel
def pose_of(moving, m, time):
    """`obstacle_pose`, which only kernels call."""
    return obstacle_pose(moving, m, time)


def shape_on_a_raster(seed):
    """A box, a polygon or a map with coordinates of a few binary digits."""
    rng = np.random.default_rng(seed)
    place = rng.integers(-80, 80, 2) / 16.0
    kind = rng.integers(4)
    if kind == 0:
        return Obstacle(Box(rng.integers(1, 40, 2) / 16.0, place))
    if kind == 1:
        return Obstacle(Disc(float(rng.integers(1, 30)) / 16.0, place))
    if kind == 2:
        return Obstacle(
            Polygon(place + rng.integers(1, 9) * np.array([[0, 0], [1, 0], [1, 0.5], [0, 0.5]]))
        )
    cells = rng.random((5, 7)) < 0.3
    cells[0, 0] = True
    return OccupancyMap(cells, resolution=0.25, origin=[*place, 0.0])


def arrays_of(world):
    parts = world.arrays
    moving = parts.moving
    return [parts.solids.edges, parts.solids.plates, distances_of(parts.field), parts.buckets.items,
            moving.time, moving.pose, moving.speed, world.box]  # fmt: skip


@given(seeds=st.lists(st.integers(0, 10**6), min_size=1, max_size=5), far=st.integers(0, 30))
@settings(max_examples=draws(40))
def test_a_shifted_world_is_the_same_to_the_last_bit(seeds, far):
    obstacles = tuple(shape_on_a_raster(seed) for seed in seeds)
    by = SE2([float(2**far), -float(2**far), 0.0])
    start = np.array([0.5, 0.25, 0.0])
    here = world_of(obstacles, BODY, own_frame(obstacles, start))
    there = world_of(
        moved(obstacles, by), BODY, own_frame(moved(obstacles, by), (by @ SE2(start)).pose)
    )
    for one, other in zip(arrays_of(here), arrays_of(there), strict=True):
        assert np.array_equal(one, other)


def test_moving_obstacles_are_where_they_are_said_to_be():
    rng = np.random.default_rng(1)
    for _ in range(10):
        obstacle = scenes.random_moving_obstacle(rng)
        wall = Obstacle(Box([1.0, 1.0], rng.uniform(-5, 5, 2), rng.uniform(-3, 3)))
        world = world_around(BODY, [wall, obstacle])
        times = rng.uniform(-2.0, 9.0, 20)
        seen = world.into(obstacle.motion.at(times))
        got = np.array([pose_of(world.arrays.moving, 0, t) for t in times])
        off = got - seen
        off[:, 2] = np.remainder(off[:, 2] + math.pi, 2 * math.pi) - math.pi
        assert np.abs(off).max() < 5e-9
        assert world.last_event == obstacle.motion.time[-1]


def test_no_point_of_a_moving_obstacle_is_faster():
    rng = np.random.default_rng(2)
    for _ in range(10):
        obstacle = scenes.random_moving_obstacle(rng)
        world = world_around(BODY, [obstacle])
        corners = (
            np.array([[obstacle.shape.radius, 0.0]]) if isinstance(obstacle.shape, Disc)
            else obstacle.shape.corners
        )  # fmt: skip
        times = np.linspace(obstacle.motion.time[0], obstacle.motion.time[-1], 400)
        if len(obstacle.motion.time) < 2:
            assert world.arrays.moving.speed.tolist() == [0.0]
            continue
        places = SE2(obstacle.motion.at(times)[:, None]).act(corners)
        speed = np.hypot(*np.diff(places, axis=0).transpose(2, 0, 1)) / np.diff(times)[:, None]
        assert speed.max() <= world.arrays.moving.speed[0] * (1.0 + 1e-9)


def test_the_box_holds_everything_all_the_time():
    rng = np.random.default_rng(3)
    for _ in range(10):
        obstacles = scenes.random_scene(rng, moving=1)
        world = world_around(BODY, obstacles)
        times = np.linspace(-2.0, 12.0, 50)
        for obstacle in obstacles:
            if not isinstance(obstacle, Obstacle):
                continue
            for time in times:
                shape = obstacle.at(time)
                ends = shape.center[None] if isinstance(shape, Disc) else shape.corners
                seen = world.into(np.column_stack([ends, np.zeros(len(ends))]))[:, :2]
                assert (seen >= world.box[:2] - 1e-8).all()
                assert (seen <= world.box[2:] + 1e-8).all()


def test_half_a_turn_left_or_right_is_the_same_pose():
    world = world_around(BODY, [Obstacle(Box([1.0, 1.0]))])
    turns = np.array([math.pi, -math.pi, math.pi - 1e-15, math.pi + 1e-15, 3.0 * math.pi])
    poses = world.into(np.column_stack([np.ones((5, 2)), turns]))
    assert np.ptp(np.sin(poses[:, 2])) < 1e-12


def test_a_heading_a_full_turn_away_is_the_same_pose():
    world = world_around(BODY, [Obstacle(Box([1.0, 1.0]))])
    turns = 2.0 * math.pi * np.arange(-3, 4)
    poses = world.into(np.column_stack([np.ones((7, 2)), 0.3 + turns]))
    assert np.ptp(np.sin(poses[:, 2])) < 1e-12


def test_a_small_robot_that_keeps_far_away_needs_no_large_field():
    # 2 cm wide, 2 m to be kept: cells of 2.5 mm, and 2 m of them all around
    world = world_around((Disc(0.01),), [Obstacle(Box([1.0, 1.0]))], keep=2.0)
    assert world.arrays.field.distance.size <= 500_000
