from __future__ import annotations

import numpy as np

from maneuver_automaton.collision import Box, Disc, Polygon
from maneuver_automaton.plotting.track import footprint_polygons, placed

SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]


def test_shapes_have_their_own_outlines():
    shapes = (Box([4.0, 2.0], [1.0, 0.0]), Disc(0.5, [1.0, 2.0]), Polygon(SQUARE))
    box, disc, polygon = footprint_polygons(shapes)
    assert box.min(axis=0).tolist() == [-1.0, -1.0]
    np.testing.assert_allclose(np.linalg.norm(disc - [1.0, 2.0], axis=1), 0.5)
    np.testing.assert_array_equal(polygon, SQUARE)
    assert footprint_polygons(()) == []


def test_outlines_are_placed_by_the_pose():
    (outline,) = placed([np.array([[1.0, 0.0], [0.0, 2.0]])], np.array([[5.0, 0.0, np.pi / 2]]))
    np.testing.assert_allclose(outline, [[5.0, 1.0], [3.0, 0.0]], atol=1e-15)
