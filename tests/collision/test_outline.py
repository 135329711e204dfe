"""Outlines: careless polygons become valid ones, and nothing solid is lost."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from maneuver_automaton.audit.outlines import body_outline
from maneuver_automaton.collision import Box, Polygon
from maneuver_automaton.collision.outline import outlines, outlines_of, rings_of, united


def area(corners, holes=()):
    return sum(part.area for part in outlines(Polygon(corners, holes)))


SQUARE = [[0, 0], [2, 0], [2, 2], [0, 2]]


def test_a_valid_polygon_stays_as_it_is():
    hole = [[0.5, 0.5], [1.5, 0.5], [1.5, 1.5], [0.5, 1.5]]
    (part,) = outlines(Polygon(SQUARE, [hole]))
    assert part.equals_exact(shapely.Polygon(SQUARE, [hole]))
    (part,) = outlines(Box([2.0, 1.0], center=[3.0, 0.0], heading=0.1))
    assert part.area == pytest.approx(2.0)


def test_areas_by_hand():
    assert area([[0, 0], [2, 2], [2, 0], [0, 2]]) == 2.0  # a bow tie
    assert area(SQUARE * 2) == 4.0  # twice around
    assert area([[0, 0], [2, 0], [7, 0], [2, 0], [2, 2], [0, 2]]) == 4.0  # a spike
    # a ring that runs around its middle twice
    pentagram = [[np.cos(4 * np.pi * k / 5), np.sin(4 * np.pi * k / 5)] for k in range(5)]
    assert area(pentagram) > 1.12  # the middle is solid too
    # two squares that touch in a corner
    assert area([[0, 0], [1, 0], [1, 1], [2, 1], [2, 2], [1, 2], [1, 1], [0, 1]]) == 2.0


def test_holes_by_hand():
    beyond = [[1, 0.5], [3, 0.5], [3, 1.5], [1, 1.5]]
    assert area(SQUARE, [beyond]) == pytest.approx(3.0)
    apart = [[5, 5], [6, 5], [6, 6]]
    assert area(SQUARE, [apart]) == pytest.approx(4.0)
    crossing = [[0.5, 0.5], [1.5, 1.5], [1.5, 0.5], [0.5, 1.5]]
    assert area(SQUARE, [crossing]) == pytest.approx(3.5)


def test_corners_are_not_repeated():
    rings = rings_of(shapely.Polygon([[0, 0], [0, 0], [1, 0], [1, 1], [1, 1], [0, 0]]))
    assert [len(ring) for ring in rings] == [3]


@pytest.mark.parametrize(
    "corners",
    [[[1, 1], [1, 1], [1, 1]], [[0, 0], [1, 1], [2, 2]], [[0, 0], [3, 0], [1, 0], [2, 0]]],
)
def test_without_area_it_is_no_polygon(corners):
    with pytest.raises(ValueError) as error:
        outlines(Polygon(corners))
    assert str(error.value) == (
        f"polygon: got {len(corners)} corners around no area, near "
        f"({corners[0][0]}, {corners[0][1]}); need corners that are not all on one line"
    )


def test_no_area_is_lost_at_random():
    rng = np.random.default_rng(7)
    for _ in range(300):
        corners = rng.uniform(-1.0, 1.0, (rng.integers(3, 12), 2))
        parts = outlines(Polygon(corners))
        assert all(part.is_valid for part in parts)
        even_odd = shapely.make_valid(shapely.Polygon(corners))
        assert even_odd.difference(shapely.union_all(parts)).area < 1e-12


def test_a_piece_that_a_union_loses_is_found_again(monkeypatch):
    """Uniting many parts at once was seen to lose one of them."""
    knot = Polygon([[0, 0], [2, 2], [2, 0], [0, 2]])
    squares = [shapely.box(k, 0, k + 1.5, 1) for k in range(4)]
    right = shapely.union_all
    monkeypatch.setattr(shapely, "union_all", lambda parts: right(list(parts)[1:]))
    assert united(squares).area == pytest.approx(4.5)
    assert sum(part.area for part in outlines(knot)) == pytest.approx(2.0)
    assert united([squares[0], squares[3]]).area == pytest.approx(3.0)
    rings = body_outline((knot,)).edges
    assert rings.holds(np.array([0.3 + 1.0j, 1.7 + 1.0j])).tolist() == [[True, True]]


@pytest.mark.parametrize(
    ("corners", "plain"),
    [
        ([[0, 0], [2, 0], [0, 1]], True),
        ([[0, 0], [0, 1], [2, 1], [2, 0]], True),  # clockwise
        ([[0, 0], [2, 0], [0, 1], [2, 1]], False),  # it crosses itself
        ([[0, 0], [2, 0], [0.5, 0.5], [0, 2]], False),  # concave: nothing is said
        ([[0, 0], [2, 0], [4, 0]], False),  # no area
        ([[0, 0], [1, 0], [2, 1], [1, 2], [0, 1]], False),  # five corners: nothing is said
    ],
)
def test_what_surely_surrounds_its_area_once(corners, plain):
    polygon = Polygon(corners)
    assert polygon.is_plain == plain
    assert not plain or len(outlines_of([polygon])[0]) == 1
