"""Where to count from."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.collision.checker import GRID, origin_near

coordinates = st.floats(-1e10, 1e10)


@given(x=coordinates, y=coordinates)
def test_an_origin_is_near_and_shared(x, y):
    origin = origin_near([x, y, 0.3])
    assert abs(x - origin[0]) <= GRID / 2
    assert abs(y - origin[1]) <= GRID / 2
    assert origin_near(origin) == origin


def test_everyday_places_count_from_zero():
    assert origin_near([-30_000.0, 12.0]) == (0.0, 0.0)
    assert str(origin_near([-1.0, -1.0])) == "(0.0, 0.0)"
