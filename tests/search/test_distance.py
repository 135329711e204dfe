"""Distances that know the obstacles: those of plain Dijkstra, whatever is asked for first."""

from __future__ import annotations

import math

import numpy as np
import pytest

from maneuver_automaton.collision import Box, Disc, Obstacle, Polygon
from maneuver_automaton.collision.world import world_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.search._kernels_distance import NARROW, distances
from maneuver_automaton.search.distance_grid import distance_grid
from tests.collision import scenes
from tests.reference_collision import shapely_world, still, world_around
from tests.reference_lattice import cells_open, centre_clearances, grid_distances

CAR, DISC = scenes.FOOTPRINTS["car"], (Disc(0.6),)
RING = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def grid_and_world(footprint, obstacles, seeds, aim, *, pad=3.0):
    world = world_around(footprint, obstacles)
    seeds, aim = world.into(np.atleast_2d(seeds)), world.into(np.asarray(aim))
    ends = np.vstack([seeds, aim])[:, :2]
    low = np.minimum(world.box[:2], ends.min(axis=0)) - pad
    high = np.maximum(world.box[2:], ends.max(axis=0)) + pad
    box = np.concatenate([low, high])
    return distance_grid(world, box, window_along(box), seeds, aim), world, seeds


def window_along(box, turn=0.0):
    """A box (4,) seen from a frame that is turned as a window (9,)."""
    return np.array([*box, 0.0, 0.0, math.cos(turn), math.sin(turn), 0.0])


def centres(grid):
    x = grid.layout.origin_x + (np.arange(grid.layout.columns) + 0.5) * grid.layout.cell
    y = grid.layout.origin_y + (np.arange(grid.layout.rows) + 0.5) * grid.layout.cell
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def cells_of(grid, places):
    at = np.floor(
        (places[:, :2] - [grid.layout.origin_x, grid.layout.origin_y]) / grid.layout.cell
    ).astype(int)
    return [(int(j), int(i)) for i, j in at]


@pytest.mark.parametrize("seed", range(6))
def test_asked_in_any_order_it_is_dijkstra(seed):
    rng = np.random.default_rng(seed)
    obstacles = (*still(scenes.random_scene(rng)), Obstacle(Box([4.0, 3.0], [1.0, 1.0], 0.4)))
    ends = np.array([scenes.random_pose(rng) for _ in range(3)])
    footprint = CAR if seed % 2 else DISC
    grid, world, seeds = grid_and_world(footprint, obstacles, ends[:2], ends[2])
    field = world.arrays.field
    clear = centre_clearances(grid, field)
    price = np.where(clear < world.body.inscribed, NARROW, 1.0)
    open_, begins = cells_open(grid, field), cells_of(grid, seeds)
    expected = grid_distances(open_, price, grid.layout.cell, begins).ravel()
    assert np.isinf(expected).any()
    some = rng.permutation(len(expected))
    for batch in np.array_split(some, 5):
        got = distances(grid, field, centres(grid)[batch])
        assert np.array_equal(np.isinf(got), np.isinf(expected[batch]))
        finite = np.isfinite(got)
        assert got[finite] == pytest.approx(expected[batch][finite], abs=1e-9)
    assert grid.state[1] <= len(expected)
    anew, _, _ = grid_and_world(footprint, obstacles, ends[:2], ends[2])
    places = centres(grid)
    in_order = distances(anew, field, places)
    assert in_order.tolist() == distances(grid, field, places).tolist()  # to the last bit


@pytest.mark.parametrize("name", ["car", "disc", "truck"])
def test_no_free_pose_is_in_a_blocked_cell(name):
    rng = np.random.default_rng([9, *name.encode()])
    blocked = 0
    for _ in range(6):
        obstacles = (*still(scenes.random_scene(rng)), Obstacle(Box([5.0, 4.0], [1.0, 1.0], 0.4)))
        footprint = (Disc(0.6),) if name == "disc" else scenes.FOOTPRINTS[name]
        grid, world, _ = grid_and_world(footprint, obstacles, np.zeros(3), np.ones(3))
        closed = np.argwhere(~cells_open(grid, world.arrays.field))
        blocked += len(closed)
        if not len(closed):
            continue
        some = closed[rng.integers(len(closed), size=300)]
        inside = rng.uniform(0.0, 1.0, (300, 2))
        inside[:80] = rng.integers(0, 2, (80, 2))  # corners of cells
        origin = np.array([grid.layout.origin_x, grid.layout.origin_y])
        places = origin + grid.layout.cell * (some[:, ::-1] + inside)
        turns = rng.uniform(-math.pi, math.pi, 300)
        poses = (SE2(world.frame) @ SE2(np.column_stack([places, turns]))).pose
        assert shapely_world(footprint, obstacles).clearance(poses).max() <= 1e-9
    assert blocked > 100


def test_a_closed_ring_lets_nothing_out_and_an_open_one_does():
    court = Obstacle(Polygon(9.0 * RING, [8.0 * RING]))
    goal, start = np.zeros(3), np.array([15.0, 0.0, 0.0])
    grid, world, _ = grid_and_world(CAR, [court], goal, start)
    outside = np.ascontiguousarray(world.into(start[None])[:, :2])
    assert np.isinf(distances(grid, world.arrays.field, outside)).all()
    assert grid.state[2] == 0  # the rim was not reached
    opened = [Obstacle(Box([1.0, 18.0], [-8.5, 0.0])), Obstacle(Box([18.0, 1.0], [0.0, 8.5])),
              Obstacle(Box([18.0, 1.0], [0.0, -8.5]))]  # fmt: skip
    grid, world, _ = grid_and_world(CAR, opened, goal, start)
    outside = np.ascontiguousarray(world.into(start[None])[:, :2])
    assert distances(grid, world.arrays.field, outside)[0] < 16.0


def test_no_path_leads_around_outside_of_a_turned_window():
    # The window is 20 m x 20 m, turned by 0.6 rad; a wall across it leaves 4 m at its left end.
    # Around the right end, in a corner of the box around the window, it would be nearer.
    turn = 0.6
    frame = SE2([0.0, 0.0, -turn])  # in which the window lies along the axes, seen from the world
    wall = Obstacle(Box([17.0, 1.0], frame.act([2.5, 0.0]), -turn))
    ends = frame.act([[9.0, -4.0], [9.0, 4.0]])
    world = world_of((wall,), (Disc(0.6),), (0.0, 0.0, 0.0))
    goal, start = np.column_stack([ends, np.zeros(2)])
    half = 10.0 * (math.cos(turn) + math.sin(turn))
    box = np.array([-half, -half, half, half])
    window = window_along([-10.0, -10.0, 10.0, 10.0], turn)
    for inside, least, most in ((window, 30.0, 40.0), (window_along(box), 8.0, 16.0)):
        grid = distance_grid(world, box, inside, goal[None], start)
        (length,) = distances(grid, world.arrays.field, start[None, :2].copy())
        assert least < length < most


# --- walls thinner than a cell ---

THIN = [
    Obstacle(Box([60.0, 0.05], [50.0, 50.0])),
    Obstacle(Box([0.05, 60.0], [20.0, 20.0])),
    Obstacle(Box([0.05, 60.0], [80.0, 20.0])),
]


@pytest.mark.parametrize("radius", [0.0, 0.05, 0.22, 0.3])
def test_a_small_body_is_not_led_through_a_thin_wall(radius):
    footprint = (Disc(radius),) if radius else ()
    start, goal = np.array([50.0, 45.0, 0.0]), np.array([50.0, 52.0, 0.0])
    grid, world, _ = grid_and_world(footprint, THIN, goal, start)
    places = world.into(np.array([start, [50.0, 51.0, 0.0]]))[:, :2]
    far, near = distances(grid, world.arrays.field, np.ascontiguousarray(places))
    assert far > 100.0  # round the wall; straight through it are 7 m
    assert near == pytest.approx(1.0, abs=2.0 * grid.layout.cell)
