"""What is said of a body bounds the body."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.collision import Box, Disc, Polygon
from maneuver_automaton.collision.body import MOST_DISCS, body_of, fastest_points
from tests.collision import scenes

SLIM = Polygon([[0, 0], [6, 0.01], [6, 0.03], [0, 0.02]])
BODIES = {**scenes.FOOTPRINTS, "slim": (SLIM,), "needle": (Box([5.0, 1e-5], [1.0, 0.3], 0.4),)}


def outline_of(footprint) -> shapely.Geometry:
    """The body, discs as polygons inside them."""
    parts = [
        shapely.Point(s.center).buffer(s.radius, quad_segs=32) if isinstance(s, Disc)
        else shapely.make_valid(shapely.Polygon(s.corners, getattr(s, "holes", ())))
        for s in footprint
    ]  # fmt: skip
    return shapely.union_all(parts or [shapely.Point(0.0, 0.0)])


def points_of(footprint, n=400):
    shape = outline_of(footprint)
    if shape.geom_type == "Point":
        return np.zeros((1, 2))
    rng = np.random.default_rng(0)
    edge = [line.interpolate(rng.uniform(0.0, line.length, n)) for line in
            shapely.get_parts(shape.boundary)]  # fmt: skip
    low, high = np.array(shape.bounds).reshape(2, 2)
    inner = shapely.points(rng.uniform(low, high, (n, 2)))
    inner = inner[shapely.contains(shape, inner)]
    return np.concatenate([shapely.get_coordinates(np.concatenate([*edge, inner])),
                           shapely.get_coordinates(shape)])  # fmt: skip


@pytest.mark.parametrize("name", BODIES)
def test_discs_and_reach_cover_the_body(name):
    body, points = body_of(BODIES[name]), points_of(BODIES[name])
    away = np.hypot(*(points[:, None] - body.discs[None, :, :2]).transpose(2, 0, 1))
    assert (away - body.discs[:, 2]).min(axis=1).max() < 1e-9
    middle = [body.middle_x, body.middle_y]
    assert np.hypot(*(points - middle).T).max() < body.reach + 1e-9
    pieces = len(body.first) - 1
    assert pieces <= len(body.discs) <= MOST_DISCS * pieces


@pytest.mark.parametrize("name", BODIES)
def test_the_inscribed_disc_is_inside(name):
    footprint = BODIES[name]
    body, shape = body_of(footprint), outline_of(footprint)
    pose = shapely.Point(0.0, 0.0)
    assert (body.inscribed >= 0.0) is (shape.distance(pose) <= 1e-9)
    disc = pose.buffer(max(body.inscribed, 0.0) * (1.0 - 1e-9), quad_segs=8)
    assert disc.difference(shape).area <= 0.02 * disc.area  # discs are many-sided here
    assert body.half_width >= 0.0


def test_by_hand():
    car = body_of((Box([4.7, 1.9], [1.4, 0.0]),))
    assert car.inscribed == pytest.approx(0.95)
    assert car.half_width == pytest.approx(0.95)
    assert car.reach == pytest.approx(0.5 * math.hypot(4.7, 1.9))
    assert (car.middle_x, car.middle_y) == pytest.approx((1.4, 0.0))
    point = body_of(())
    assert (point.reach, point.inscribed, point.half_width) == (0.0, 0.0, 0.0)
    assert point.discs.tolist() == [[0.0, 0.0, 0.0]]
    beside = body_of((Box([2.0, 1.0], [5.0, 0.0]),))  # the pose is not in the body
    assert beside.inscribed == -math.inf
    assert body_of((Disc(2.0, [0.5, 0.0]), Box([9.0, 1.0]))).inscribed == pytest.approx(1.5)
    assert body_of((scenes.FRAME,)).inscribed == -math.inf
    assert body_of((Box([2.0, 1.0], [1.0, 0.0]),)).inscribed == 0.0  # it is on the rim
    assert body_of((Box([0.9, 0.6]), Disc(0.02))).half_width == pytest.approx(0.3)


@pytest.mark.parametrize("name", BODIES)
@given(twist=st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_no_point_is_faster_and_one_is_as_fast(name, twist):
    v_x, v_y, turn = twist
    points = points_of(BODIES[name], 60)
    speeds = np.hypot(v_x - turn * points[:, 1], v_y + turn * points[:, 0])
    (fastest,) = fastest_points(body_of(BODIES[name]), np.array([twist]))
    assert speeds.max() <= fastest + 1e-9
    assert fastest <= speeds.max() * 1.01 + 0.01 * abs(turn) + 1e-9
