"""Regions and skins: areas as they are, round corners outside, and by little."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from maneuver_automaton.collision import Box, Disc, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.collision.solids import (
    body_pieces,
    body_skin,
    circumscribed,
    obstacle_regions,
    obstacle_skin,
)
from tests.collision.scenes import ANGLE, CAR, FRAME, random_shape


def union_of(triangles):
    return shapely.union_all(shapely.polygons(triangles))


@pytest.mark.parametrize("radius", [1e-3, 0.3, 5.0, 1e4, 1e13])
@pytest.mark.parametrize("excess", [1e-2, 1e-5])
def test_a_disc_is_inside_its_polygon(radius, excess):
    ring = shapely.Polygon(circumscribed(np.array([1.0, 2.0]), radius, excess))
    center = shapely.Point(1.0, 2.0)
    assert center.distance(ring.exterior) >= radius * (1.0 - 1e-12)
    assert center.hausdorff_distance(ring.exterior) <= radius + max(
        excess * (1.0 + 1e-6), 2e-9 * radius
    )


def test_regions_of_polygons_have_their_area():
    rng = np.random.default_rng(2)
    for _ in range(200):
        shape = random_shape(rng)
        if isinstance(shape, Disc):
            continue
        whole = shapely.Polygon(shape.corners, getattr(shape, "holes", ()))
        (region,) = obstacle_regions([Obstacle(shape)], excess=1e-3)
        assert shapely.area(shapely.polygons(region.cover)).sum() == pytest.approx(whole.area)
        if whole.area > 1e-3:
            assert union_of(region.cover).symmetric_difference(whole).area < 1e-9


def test_a_map_is_the_area_of_its_blocked_cells():
    rng = np.random.default_rng(4)
    for density in (0.0, 0.1, 0.5, 0.9, 1.0):
        cells = rng.random((17, 23)) < density
        one = OccupancyMap(cells, resolution=0.5, origin=[3.0, -2.0, 0.7])
        (region,) = obstacle_regions([one], excess=1e-3)
        covered = shapely.area(shapely.polygons(region.cover)).sum()
        assert covered == pytest.approx(0.25 * cells.sum())
        assert union_of(region.cover).area == pytest.approx(covered)


def test_every_part_has_two_posts_inside_it():
    holes = [Obstacle(FRAME), Obstacle(ANGLE), Obstacle(Disc(0.3)), Obstacle(Box([1.0, 2.0]))]
    for obstacle in (*holes, OccupancyMap([[1, 0, 1], [1, 0, 0]], resolution=1.0)):
        (region,) = obstacle_regions([obstacle], excess=1e-3)
        solid = union_of(region.cover)
        posts = shapely.linestrings(region.posts)
        assert (shapely.length(posts) > 0.0).all()
        for part in shapely.get_parts(solid):
            assert shapely.intersects(part, posts).sum() >= 2
        assert shapely.distance(posts, solid).max() < 1e-12


@pytest.mark.parametrize("margin", [0.0, 0.2, 3.0])
@pytest.mark.parametrize("shape", [CAR, ANGLE, FRAME, Disc(0.4, center=[1.0, 0.0])])
def test_pieces_cover_the_grown_footprint_and_little_more(shape, margin):
    excess = 1e-3
    pieces = shapely.union_all(
        [shapely.Polygon(piece) for piece in body_pieces((shape,), margin=margin, excess=excess)]
    )
    if isinstance(shape, Disc):
        core, radius = shapely.Point(shape.center), shape.radius + margin
    else:
        core, radius = shapely.Polygon(shape.corners, shape.holes), margin
    inner = core.buffer(radius, quad_segs=256)
    outer = core.buffer(radius + excess, quad_segs=256).buffer(1e-4)
    assert inner.difference(pieces).area < 1e-9
    assert outer.covers(pieces)


def test_a_convex_footprint_is_one_piece():
    assert len(body_pieces((CAR,), margin=0.0, excess=1e-3)) == 1
    assert len(body_pieces((CAR,), margin=0.3, excess=1e-3)) == 1
    square = Polygon([[0, 0], [1, 0], [2, 0], [2, 2], [0, 2], [0, 1]])
    assert len(body_pieces((square,), margin=0.0, excess=1e-3)) == 1
    assert len(body_pieces((ANGLE,), margin=0.0, excess=1e-3)) == 2


def test_a_point_is_a_tiny_square():
    (piece,) = body_pieces((), margin=0.0, excess=1e-3)
    assert shapely.Polygon(piece).contains(shapely.Point(0.0, 0.0))
    assert np.abs(piece).max() <= 1e-9


def test_skins_by_hand():
    body = body_skin([Box([2.0, 2.0]).corners, np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])])
    assert sorted(set(body.vertices[:, 2])) == [0.0, 1.0]
    assert len(body.triangles) == (8 + 2) + (6 + 1)
    heights = body.vertices[body.triangles][..., 2]
    assert (heights == 1.0).all(axis=1).sum() == 2 + 1  # the lid
    assert not (heights == 0.0).all(axis=1).any()  # no bottom
    boxes = obstacle_regions([Obstacle(Box([1.0, 1.0]))] * 3, excess=1.0)
    skin, owners = obstacle_skin(boxes)
    heights = skin.vertices[skin.triangles][..., 2]
    assert heights[:6].tolist() == [[0.5, 0.5, 0.5]] * 6
    assert heights[6:].tolist() == [[0.5, 0.5, 1.5]] * 6
    assert owners.tolist() == [0, 0, 1, 1, 2, 2] * 2
