"""Convex pieces are the shape: nothing solid is lost, nothing added, and each is convex."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.collision import Box, Disc, Obstacle, Polygon
from maneuver_automaton.collision.advancement import clearances
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.collision.outline import outlines
from maneuver_automaton.groups import SE2
from tests.collision import scenes
from tests.quickly import draws
from tests.reference_collision import shapely_world, world_around


def assert_pieces_are(shape, *, atol=1e-9):
    """Convex, counter-clockwise, apart from each other, and together the shape."""
    exact = shapely.union_all(outlines(shape))
    pieces = convex_pieces(shape)
    polygons = []
    for ring, rounding in pieces:
        assert rounding == 0.0
        if len(ring) < 3:
            continue
        polygon = shapely.Polygon(ring)
        assert polygon.is_valid
        assert polygon.exterior.is_ccw
        assert polygon.convex_hull.area == pytest.approx(polygon.area, abs=atol)
        polygons.append(polygon)
    areas = sum(polygon.area for polygon in polygons)
    union = shapely.union_all(polygons)
    assert areas == pytest.approx(exact.area, abs=atol)
    assert union.symmetric_difference(exact).area < atol
    return pieces


@given(
    n=st.integers(3, 12),
    seed=st.integers(0, 10**6),
    clockwise=st.booleans(),
    hole=st.booleans(),
)
@settings(max_examples=draws(80))
def test_stars_with_and_without_holes(n, seed, clockwise, hole):
    rng = np.random.default_rng(seed)
    angles = 2.0 * math.pi * (np.arange(n) + rng.uniform(0.0, 0.8, n)) / n
    ring = rng.uniform(0.3, 2.0, (n, 1)) * np.stack([np.cos(angles), np.sin(angles)], 1)
    ring = ring[::-1] if clockwise else ring
    assert_pieces_are(Polygon(ring, [0.5 * ring] if hole else ()))


@given(seed=st.integers(0, 10**6), n=st.integers(4, 9))
@settings(max_examples=draws(60))
def test_rings_that_cross_themselves(seed, n):
    ring = np.random.default_rng(seed).uniform(-2.0, 2.0, (n, 2))
    assert_pieces_are(Polygon(ring))


def test_by_hand():
    assert len(convex_pieces(Box([4.0, 2.0], heading=0.7))) == 1
    ((ring, radius),) = convex_pieces(Disc(0.5, [1.0, 2.0]))
    assert (ring.tolist(), radius) == ([[1.0, 2.0]], 0.5)
    ((ring, _),) = convex_pieces(Polygon([[0, 1], [1, 1], [1, 0], [0, 0]]))  # clockwise
    assert shapely.Polygon(ring).exterior.is_ccw
    assert len(assert_pieces_are(scenes.ANGLE)) == 2
    assert len(assert_pieces_are(scenes.FRAME)) <= 5
    bow = Polygon([[0, 0], [2, 2], [2, 0], [0, 2]])
    assert len(assert_pieces_are(bow)) == 2


def test_what_a_ring_runs_around_twice_is_solid():
    pentagram = [[np.cos(4 * np.pi * k / 5), np.sin(4 * np.pi * k / 5)] for k in range(5)]
    square = [[0, 0], [2, 0], [2, 2], [0, 2]]
    for ring, inside in ((pentagram, [0.0, 0.0, 0.0]), (square * 2, [1.0, 1.0, 0.0])):
        assert_pieces_are(Polygon(ring))
        world = world_around((Disc(0.01),), [Obstacle(Polygon(ring))])
        assert clearances(world, world.into([inside]))[0] <= 0.0


def test_corners_on_a_line_and_repeated_corners():
    square = [[0, 0], [1, 0], [1, 0], [2, 0], [2, 2], [0, 2], [0, 2], [0, 1], [0, 0]]
    assert len(assert_pieces_are(Polygon(square))) == 1


def test_a_spiral_keeps_its_gap():
    turns = np.linspace(0.0, 6.0 * math.pi, 90)
    ray = np.stack([np.cos(turns), np.sin(turns)], 1)
    wall = Polygon(
        np.concatenate([ray * (1 + turns[:, None]), (ray * (1.3 + turns[:, None]))[::-1]])
    )
    assert_pieces_are(wall, atol=1e-7)


@pytest.mark.parametrize("off", [1e-16, 1e-12, 3e-10])
def test_corners_that_all_but_coincide(off):
    ring = [[0, 0], [1, 0], [1, 1], [0, 1], [off, 0.3 * off]]
    found = world_clearances([Obstacle(Polygon(ring))])
    assert found == pytest.approx(
        world_clearances([Obstacle(Box([1.0, 1.0], [0.5, 0.5]))]), abs=1e-8
    )


def test_a_needle_thinner_than_what_coordinates_are_rounded_to():
    found = world_clearances([Obstacle(Box([3.0, 1e-10]))])
    assert found == pytest.approx(world_clearances([Obstacle(Box([3.0, 1e-7]))]), abs=1e-6)


@pytest.mark.parametrize("size", [5e-9, 2e-8, 1e-7])
def test_a_corner_cut_off_by_nanometres(size):
    rng = np.random.default_rng(7)
    for _ in range(20):
        a, b = size * rng.uniform(0.3, 1.0, 2)
        ring = np.array([[a, 0], [3, 0], [3, 3], [0, 3], [0, b]])
        by = SE2([*rng.uniform(-5, 5, 2), rng.uniform(-4, 4)])
        whole = [Obstacle(Box([3.0, 3.0], [1.5, 1.5]).moved(by))]
        assert_below(world_clearances([Obstacle(Polygon(ring).moved(by))]), whole, atol=3e-8)


@pytest.mark.parametrize(
    "size",
    [
        2e-9,
        1e-7,
    ],
)  # fmt: skip
def test_tiny_edges_on_an_arc_hide_nothing(size):
    # twelve pairs of corners, the two of a pair a few nanometres apart
    rng = np.random.default_rng(8)
    for _ in range(20):
        angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, 12))
        angles = np.sort(np.concatenate([angles, angles + size * rng.uniform(0.5, 1.0, 12)]))
        ring = 2.0 * np.stack([np.cos(angles), np.sin(angles)], 1)
        block = Polygon(ring).moved(SE2([*rng.uniform(-5, 5, 2), rng.uniform(-4, 4)]))
        assert_below(world_clearances([Obstacle(block)]), [Obstacle(block)], atol=3e-8)


PLACES = np.array([scenes.random_pose(np.random.default_rng(k)) for k in range(60)])


def world_clearances(obstacles):
    world = world_around((Box([1.0, 0.5]),), obstacles)
    return clearances(world, world.into(PLACES))


def assert_below(found, obstacles, *, atol):
    exact = shapely_world((Box([1.0, 0.5]),), obstacles).clearance(PLACES)
    assert (found <= np.maximum(exact, 0.0) + atol).all()
