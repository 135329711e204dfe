"""What a slice sweeps: nothing is left out, and the excess is what is said."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.collision import Box, Disc
from maneuver_automaton.collision.swept import (
    MOST_TURN,
    fastest,
    grown_body,
    halves,
    slice_excess,
    slice_hulls,
    windows,
)
from maneuver_automaton.groups import SE2
from tests.collision.scenes import ANGLE, CAR, FOOTPRINTS, TWISTS

speeds = st.floats(-5.0, 5.0) | st.floats(-1e-7, 1e-7)
twists = st.tuples(speeds, speeds, speeds)


@given(twist=twists, part=st.floats(0.01, 1.0))
@pytest.mark.parametrize("name", ["car", "angle", "truck", "point"])
def test_every_point_at_every_time_is_inside(name, twist, part):
    body = grown_body(FOOTPRINTS[name], 0.0, 1e-3)
    duration = part * windows(twist, 2.0).length
    poses = SE2.exp(np.multiply.outer(np.linspace(0.0, duration, 9), twist))
    for corners, hull in zip(body.pieces, slice_hulls(body, twist, duration), strict=True):
        seen = SE2(poses.pose[:, None]).act(corners).reshape(-1, 2)
        ends = np.concatenate([hull[1:], hull[:1]])
        along = ends - hull
        area = hull[:, 0] @ ends[:, 1] - hull[:, 1] @ ends[:, 0]
        aside = np.sign(area) * (
            along[:, 0] * (seen[:, None, 1] - hull[:, 1])
            - along[:, 1] * (seen[:, None, 0] - hull[:, 0])
        )
        assert aside.min() >= -1e-9 * np.hypot(*along.T).max()


@pytest.mark.parametrize("footprint", [(CAR,), (ANGLE,), (Disc(0.5),)])
@pytest.mark.parametrize("twist", TWISTS)
@pytest.mark.parametrize("duration", [0.25, 0.05])
def test_no_point_is_further_off_than_the_excess(footprint, twist, duration):
    body = grown_body(footprint, 0.1, 1e-3)
    poses = SE2.exp(np.multiply.outer(np.linspace(0.0, duration, 400), twist)).pose
    passed = shapely.union_all(
        [shapely.polygons(SE2(poses[:, None]).act(corners)) for corners in body.pieces]
    )
    for hull in slice_hulls(body, twist, duration):
        # distances are largest at a corner or on an edge
        points = shapely.points(shapely.get_coordinates(shapely.segmentize(_ring(hull), 0.02)))
        worst = shapely.distance(points, passed).max()
        assert worst <= slice_excess(body, twist, duration) + 1e-4


def _ring(hull):
    return shapely.LinearRing(hull)


def test_straight_motions_are_exact():
    body = grown_body((CAR,), 0.0, 1e-3)
    assert slice_excess(body, (3.0, 1.0, 0.0), 100.0) == 0.0
    (hull,) = slice_hulls(body, (1.0, 0.0, 0.0), 10.0)
    assert shapely.Polygon(hull).equals(shapely.box(-0.95, -0.95, 13.75, 0.95))


def test_the_excess_falls_with_the_length():
    body = grown_body((CAR,), 0.0, 1e-3)
    excesses = [slice_excess(body, (1.0, 0.0, 0.25), 2.0**-k) for k in range(12)]
    assert all(b < 0.51 * a for a, b in itertools.pairwise(excesses))
    assert excesses[0] < 0.5


@given(twist=twists, duration=st.floats(1e-9, 1e3))
def test_windows_cover_the_time_and_no_more(twist, duration):
    parts = windows(twist, min(duration, 2.0 * np.pi / max(abs(twist[2]), 1e-9)))
    duration = min(duration, 2.0 * np.pi / max(abs(twist[2]), 1e-9))
    assert abs(twist[2]) * parts.length <= MOST_TURN
    assert parts.begins[0] == 0.0
    assert parts.begins[-1] + parts.length == pytest.approx(duration, rel=1e-15)
    assert (parts.begins + parts.length <= duration * (1 + 1e-15)).all()
    assert (np.diff(parts.begins) <= parts.length).all()
    assert (np.diff(parts.begins) >= 0.0).all()


def test_halves_cover_the_same():
    parts = windows((1.0, 0.0, 0.5), 3.3)
    half = halves(parts)
    assert half.length == 0.5 * parts.length
    assert half.begins[::2].tolist() == parts.begins.tolist()
    assert (half.begins[1::2] - parts.begins).tolist() == [half.length] * len(parts.begins)


def test_sizes_by_hand():
    body = grown_body((Box([4.0, 2.0], center=[1.0, 0.0]),), 0.0, 1e-3)
    assert body.middle.tolist() == [1.0, 0.0]
    assert body.reach == pytest.approx(np.sqrt(5.0))
    assert fastest(body, (1.0, 0.0, 0.0)) == 1.0
    assert fastest(body, (0.0, 0.0, 2.0)) == pytest.approx(2.0 * np.sqrt(10.0))
