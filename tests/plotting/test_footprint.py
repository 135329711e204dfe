from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.collision import Box, Disc, Polygon
from maneuver_automaton.plotting.footprint import footprint_polygons, placed

SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]


@pytest.mark.parametrize(
    "footprint",
    [SQUARE, np.array(SQUARE), {"polygon_m": SQUARE}, [SQUARE], [{"polygon_m": SQUARE}]],
)
def test_a_polygon_may_be_stated_in_many_ways(footprint):
    (outline,) = footprint_polygons(footprint)
    np.testing.assert_array_equal(outline, SQUARE)


def test_shapes_have_their_own_outlines():
    shapes = (Box([4.0, 2.0], [1.0, 0.0]), Disc(0.5, [1.0, 2.0]), Polygon(SQUARE))
    box, disc, polygon = footprint_polygons(shapes)
    assert box.min(axis=0).tolist() == [-1.0, -1.0]
    np.testing.assert_allclose(np.linalg.norm(disc - [1.0, 2.0], axis=1), 0.5)
    np.testing.assert_array_equal(polygon, SQUARE)
    assert footprint_polygons(()) == []


def test_no_footprint_has_no_outline():
    assert footprint_polygons(None) == []


def test_a_list_gives_one_outline_each():
    assert len(footprint_polygons([{"disc_m": 1.0}, [SQUARE, {"rectangle_m": [2, 1]}]])) == 3


def test_a_disc_has_its_radius_all_around():
    (outline,) = footprint_polygons({"disc_m": 0.3})
    np.testing.assert_allclose(np.linalg.norm(outline, axis=1), 0.3)


def test_a_rectangle_is_centred_on_the_pose_unless_a_reference_is_given():
    (outline,) = footprint_polygons({"rectangle_m": [4.0, 2.0]})
    assert outline.min(axis=0).tolist() == [-2.0, -1.0]
    assert outline.max(axis=0).tolist() == [2.0, 1.0]
    # the pose of a car sits on its rear axle, behind the centre: the body reaches further ahead
    (outline,) = footprint_polygons({"rectangle_m": [4.0, 2.0], "reference_m": [-1.0, 0.0]})
    assert outline.min(axis=0).tolist() == [-1.0, -1.0]
    assert outline.max(axis=0).tolist() == [3.0, 1.0]


def test_outlines_are_placed_by_the_pose():
    (outline,) = placed([np.array([[1.0, 0.0], [0.0, 2.0]])], np.array([[5.0, 0.0, np.pi / 2]]))
    np.testing.assert_allclose(outline, [[5.0, 1.0], [3.0, 0.0]], atol=1e-15)


@pytest.mark.parametrize(
    ("footprint", "message"),
    [
        ({"rectangle": [1, 2]}, "got the keys 'rectangle', need rectangle_m"),
        ({"rectangle_m": [1.0, -2.0]}, r"rectangle_m must be positive, got \[1.0, -2.0\] m"),
        ({"disc_m": 0.0}, "disc_m must be a positive radius, got 0.0 m"),
        ([[0.0, 0.0], [1.0, 1.0]], r"polygon has shape \(2, 2\)"),
        ("box", "got 'box', need a shape, corners, a mapping, or several"),
        (np.array([[0.0, 0.0], [np.nan, 1.0], [1.0, 1.0]]), "need finite numbers"),
    ],
)
def test_wrong_footprints_are_named(footprint, message):
    with pytest.raises(ValueError, match=message):
        footprint_polygons(footprint)
