"""Field and buckets against distances found one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from maneuver_automaton._compile import kernel
from maneuver_automaton.collision import Box, Disc, Obstacle, OccupancyMap
from maneuver_automaton.collision._kernels_field import known_distance, write_map
from maneuver_automaton.collision.arrays import Field, Place
from maneuver_automaton.collision.convex import NO_PIECES, solids_of
from maneuver_automaton.collision.surroundings import runs_of
from maneuver_automaton.groups import SE2
from tests.collision import scenes
from tests.reference_collision import distances_of, shapely_world, still, world_around


def centres(field):
    rows, columns = field.distance.shape
    x = field.origin_x + (np.arange(columns) + 0.5) * field.cell
    y = field.origin_y + (np.arange(rows) + 0.5) * field.cell
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def out_of(world, places):
    """Poses of the problem (n, 3) at places (n, 2) of the world's own frame."""
    return (SE2(world.frame) @ SE2(np.column_stack([places, np.zeros(len(places))]))).pose


def random_worlds(seed, footprint, n, *, keep=0.0):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        obstacles = scenes.random_scene(rng, moving=1)
        if still(obstacles):
            yield obstacles, world_around(footprint, obstacles, keep=keep)


def assert_distances(values, exact, depth, *, most):
    """Capped distances outside; inside they are negative, and no deeper than it is."""
    outside = exact > 1e-8
    assert values[outside] == pytest.approx(np.minimum(exact, most)[outside], abs=5e-9)
    assert (values[~outside] <= 1e-8).all()
    assert (-values[~outside] <= depth[~outside] + 1e-8).all()


def solid_union(obstacles):
    """All static obstacles as one geometry, discs as polygons around them."""
    solids = []
    for obstacle in still(obstacles):
        if isinstance(obstacle, OccupancyMap):
            solids += runs_of(obstacle)
        elif isinstance(obstacle.shape, Disc):
            around = obstacle.shape.radius / math.cos(math.pi / 256)
            solids.append(shapely.Point(obstacle.shape.center).buffer(around, quad_segs=64))
        else:
            holes = getattr(obstacle.shape, "holes", ())
            solids.append(shapely.make_valid(shapely.Polygon(obstacle.shape.corners, holes)))
    return shapely.union_all(solids, grid_size=1e-9)


@pytest.mark.parametrize(("name", "keep"), [("car", 0.0), ("disc", 0.4), ("point", 0.0)])
def test_the_field_is_the_distance(name, keep):
    rng = np.random.default_rng(1)
    for obstacles, world in random_worlds(2, scenes.FOOTPRINTS[name], 8, keep=keep):
        field = world.arrays.field
        values, places = distances_of(field).ravel(), centres(field)
        some = rng.permutation(len(values))[:800]
        poses = out_of(world, places[some])
        exact = shapely_world((), still(obstacles)).clearance(poses)
        depth = shapely.distance(solid_union(obstacles).boundary, shapely.points(poses[:, :2]))
        assert_distances(values[some], exact, depth, most=field.outside)


def test_deep_inside_it_is_as_deep_as_it_is():
    for obstacles in ([Obstacle(Box([8.0, 6.0], [1.0, 2.0], 0.4))], [Obstacle(Disc(3.0))]):
        world = world_around((Disc(0.6),), obstacles)
        places = centres(world.arrays.field)
        depth = shapely.distance(
            solid_union(obstacles).boundary, shapely.points(out_of(world, places)[:, :2])
        )
        values = distances_of(world.arrays.field).ravel()
        assert -values.min() > 2.8
        assert -values[values < 0.0] == pytest.approx(depth[values < 0.0], abs=1e-3)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.4])
def test_a_map_is_as_far_as_its_cells(yaw):
    rng = np.random.default_rng(5)
    for share in (0.02, 0.2, 0.8, 1.0):
        cells = OccupancyMap(rng.random((9, 14)) < share, resolution=0.3, origin=[1.0, -2.0, yaw])
        if not cells.blocked.any():
            continue
        distance = np.full((40, 50), 2.5)
        field, place = (
            Field(distance, -3.0, -5.0, 0.2, 2.5, solids_of(NO_PIECES)),
            Place(1.0, -2.0, math.cos(yaw), math.sin(yaw)),
        )
        write_map(field, cells.blocked, 0.3, place)
        x, y = -3.0 + 0.2 * (np.arange(50) + 0.5), -5.0 + 0.2 * (np.arange(40) + 0.5)
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        exact = shapely_world((), [cells]).clearance(np.column_stack([places, 0 * places[:, 0]]))
        inner = SE2(cells.origin).inverse().act(places)  # where cells fit together exactly
        union = solid_union([OccupancyMap(cells.blocked, resolution=0.3)])
        depth = shapely.distance(union.boundary, shapely.points(inner))
        assert_distances(distance.ravel(), exact, depth, most=2.5)
        inside = distance.ravel() < -1e-9
        assert -distance.ravel()[inside] == pytest.approx(depth[inside], abs=1e-6)


def test_a_world_of_one_needle_or_of_far_corners_has_a_small_field():
    lone = [Obstacle(Box([5.0, 1e-7]))]
    far = [Obstacle(Disc(0.1)), Obstacle(Disc(0.1, [1e6, 1e6])), Obstacle(Disc(0.1, [1e6, 0.0]))]
    for obstacles in (lone, far):
        for footprint in ((), (Disc(0.05),), (Box([4.0, 2.0]),)):
            world = world_around(footprint, obstacles)
            assert world.arrays.field.distance.size < 300_000
            assert world.arrays.buckets.start.size < 300_000


@kernel
def known_in(field, cells, out):
    """`known_distance`, which only kernels call, in cells (n, 2)."""
    for k in range(cells.shape[0]):
        out[k] = known_distance(field, cells[k, 0], cells[k, 1])


@pytest.mark.parametrize("name", ["car", "disc"])
def test_a_cell_is_as_far_whichever_is_asked_for_first(name):
    rng = np.random.default_rng(7)
    for _, world in random_worlds(8, scenes.FOOTPRINTS[name], 6):
        field = world.arrays.field
        rows, columns = field.distance.shape
        cells = np.stack([rng.integers(0, rows, 40), rng.integers(0, columns, 40)], axis=1)
        anew = field._replace(distance=np.zeros_like(field.distance))
        if not len(field.solids.plates):  # a map: all is written at once
            continue
        some, others = np.zeros(40), np.zeros(40)
        known_in(anew, cells, some)
        assert not anew.distance.all()
        known_in(anew._replace(distance=np.zeros_like(field.distance)), cells[::-1].copy(), others)
        assert some.tolist() == others[::-1].tolist()
        assert some.tolist() == distances_of(anew)[*cells.T].tolist()
