"""The clearance that kernels see is that of shapely near contact, and never more."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.collision import Box, Disc, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.collision._kernels_clearance import NEAR, SHARP
from maneuver_automaton.collision.advancement import clearances
from maneuver_automaton.groups import SE2
from tests.collision import scenes
from tests.quickly import draws
from tests.reference_collision import moved, shapely_world, world_around

ROUNDED = 1e-8  # [m] coordinates are rounded to 1e-9


def compare(footprint, obstacles, poses, times=0.0):
    """Check the clearances at poses; returns them with the exact ones."""
    world = world_around(footprint, obstacles)
    times = np.broadcast_to(np.asarray(times, dtype=float), len(poses))
    got = clearances(world, world.into(poses), times=times)
    exact = np.maximum(shapely_world(footprint, obstacles).clearance(poses, times), 0.0)
    assert (got <= exact + ROUNDED).all(), (got - exact).max()
    assert (got[exact > ROUNDED] > 0.0).all(), "contact where there is none"
    assert (got[exact <= 0.0] <= ROUNDED).all(), "no contact where there is one"
    near = SHARP * NEAR * world.body.reach
    close = (exact > 0.0) & (exact < near)
    assert np.abs(got - exact)[close].max(initial=0.0) < ROUNDED
    return got, exact


def poses_around(rng, n, *, reach=7.0):
    return np.array([scenes.random_pose(rng, reach=reach) for _ in range(n)])


@pytest.mark.parametrize("name", scenes.FOOTPRINTS)
def test_clearances_among_random_solids(name):
    rng = np.random.default_rng([1, *name.encode()])
    touching = 0
    for _ in range(12):
        obstacles = scenes.random_scene(rng)
        _, exact = compare(scenes.FOOTPRINTS[name], obstacles, poses_around(rng, 250))
        touching += int((exact <= 0.0).sum())
    assert touching > 50


@pytest.mark.parametrize("name", ["car", "disc", "truck", "point"])
def test_clearances_to_moving_obstacles(name):
    rng = np.random.default_rng([2, *name.encode()])
    for _ in range(10):
        obstacles = scenes.random_scene(rng, moving=2)
        poses = poses_around(rng, 150)
        compare(scenes.FOOTPRINTS[name], obstacles, poses, rng.uniform(-2.0, 9.0, len(poses)))


def needles(rng):
    return tuple(
        Obstacle(Box([rng.uniform(0.5, 6.0), 10.0 ** rng.uniform(-7.0, -3.0)],
                     rng.uniform(-6.0, 6.0, 2), rng.uniform(0.0, math.pi)))
        for _ in range(6)
    )  # fmt: skip


@pytest.mark.parametrize("name", ["car", "frame", "disc", "point"])
def test_clearances_to_slivers(name):
    rng = np.random.default_rng([3, *name.encode()])
    for _ in range(5):
        compare(scenes.FOOTPRINTS[name], needles(rng), poses_around(rng, 200))


@pytest.mark.parametrize("name", ["car", "disc", "point"])
def test_clearances_to_maps_with_yaw(name):
    rng = np.random.default_rng([4, *name.encode()])
    for _ in range(6):
        maps = [scenes.random_map(rng) for _ in range(2)]
        compare(scenes.FOOTPRINTS[name], maps, poses_around(rng, 200))


def test_clearances_in_contact_to_the_last_digits():
    # pushed together along the path between the nearest points, until just before contact
    rng = np.random.default_rng(5)
    box, body = Box([2.0, 1.0]), (Box([4.7, 1.9], [1.4, 0.0]),)
    world, slow = world_around(body, [Obstacle(box)]), shapely_world(body, [Obstacle(box)])
    for _ in range(60):
        far, near = np.array([*(7.0 * rng.standard_normal(2)), rng.uniform(-4, 4)]), None
        path = -far * [1.0, 1.0, 0.0]
        low, high = 0.0, 1.0
        if slow.clearance(far[None])[0] <= 0.0:
            continue
        for _ in range(50):
            middle = 0.5 * (low + high)
            free = slow.clearance((far + middle * path)[None])[0] > 1e-5
            low, high = (middle, high) if free else (low, middle)
        near = (far + low * path)[None]
        assert clearances(world, world.into(near)) == pytest.approx(slow.clearance(near), abs=2e-9)


@given(
    size=st.tuples(st.floats(0.1, 3.0), st.floats(0.1, 3.0)),
    turn=st.floats(-7.0, 7.0),
    apart=st.floats(1e-6, 0.05),
)
@settings(max_examples=draws(60))
def test_by_hand_two_boxes_face_to_face(size, turn, apart):
    obstacle = Obstacle(Box(size, [0.5 * size[0] + 1.0 + apart, 0.0]))
    by = SE2([3.0, -2.0, turn])
    world = world_around((Box([2.0, 1.0]),), [obstacle.moved(by)])
    assert clearances(world, world.into(by.pose[None])) == pytest.approx(apart, abs=3e-9)


@pytest.mark.parametrize("far", [0.0, 1e6, 1e9])
def test_nothing_is_lost_far_away(far):
    rng = np.random.default_rng(6)
    places = rng.integers(-40, 40, (8, 2)) / 8.0
    obstacles = tuple(Obstacle(Box([0.5, 1.0], place)) for place in places)
    poses = np.column_stack([rng.integers(-40, 40, (60, 2)) / 8.0, np.zeros(60)])
    here = world_around((Box([1.0, 0.5]),), obstacles)
    by = SE2([far, -far, 0.0])
    there = world_around((Box([1.0, 0.5]),), moved(obstacles, by))
    shifted = (by @ SE2(poses)).pose
    got = clearances(here, here.into(poses))
    assert np.array_equal(got, clearances(there, there.into(shifted)))


@pytest.mark.parametrize("far", [1e6, 1e9])
def test_nothing_of_a_map_is_lost_far_away(far):
    rng = np.random.default_rng(7)
    cells = OccupancyMap(rng.random((9, 9)) < 0.2, resolution=0.3, origin=[0.25, 0.5, 0.3])
    wall = Obstacle(Box([0.3, 0.7], [3.0, 3.5], 0.1))
    poses = np.column_stack([rng.integers(-16, 32, (80, 2)) / 8.0, rng.uniform(-3.0, 3.0, 80)])
    by = SE2([far, -far, 0.0])
    for obstacles in ([cells], [wall, cells], [cells, wall]):
        here = world_around((Disc(0.1),), obstacles)
        there = world_around((Disc(0.1),), moved(obstacles, by))
        got = clearances(here, here.into(poses))
        shifted = clearances(there, there.into((by @ SE2(poses)).pose))
        assert shifted == pytest.approx(got, abs=2e-9)


def test_inside_of_a_hole_and_inside_of_a_solid():
    ring = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    court = [Obstacle(Polygon(30 * ring, [3 * ring]))]
    got, exact = compare((Box([1.0, 1.0]),), court, np.array([[0.0, 0.0, 0.0], [2.45, 0.0, 0.0],
                                                              [2.55, 0.0, 0.0], [20.0, 0.0, 1.0],
                                                              [40.0, 0.0, 0.0]]))  # fmt: skip
    assert got[1] == pytest.approx(0.05)
    assert (exact[2:4] <= 0.0).all()


def test_diagonal_neighbours_in_a_map():
    cells = OccupancyMap([[1, 0], [0, 1]], resolution=1.0, origin=[0.0, 0.0, 0.4])
    through = (SE2(cells.origin) @ SE2([[1.2, 0.8, 0.0], [1.0, 1.0, 0.0], [1.5, 0.5, 0.0]])).pose
    got, _ = compare((), [cells], through)
    assert got[1] <= ROUNDED
    assert got[2] > 0.4


def test_a_clearance_to_a_flat_tail_is_not_cut_off():
    # a ring with a spike: shapely makes it a square and a line
    tail = [Obstacle(Polygon([[0, 0], [2, 0], [2, 2], [0, 2], [0, 0], [-3, 0]]))]
    world = world_around((), tail)
    got = clearances(world, world.into(np.array([[-2.0, 0.05, 0.0], [-3.1, 0.0, 0.0]])))
    assert got == pytest.approx([0.05, 0.1])
