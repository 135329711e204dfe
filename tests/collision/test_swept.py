"""What a slice sweeps: nothing is left out, and the excess is what is said."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from maneuver_automaton.collision import Disc
from maneuver_automaton.collision._kernels_swept import slices_near
from maneuver_automaton.collision.swept import (
    course_boxes,
    cut_where_it_pivots,
    grown_body,
    slice_excess,
    swept_hulls,
)
from maneuver_automaton.groups import SE2
from tests.collision.scenes import ANGLE, FOOTPRINTS, TWISTS


def slice_hulls(body, twist, duration):
    """The hulls of one coast, from where its frame begins."""
    step = duration * np.array([twist])
    return swept_hulls(body, np.concatenate([np.zeros((1, 3)), SE2.exp(step).pose]), step)


speeds = st.floats(-5.0, 5.0) | st.floats(-1e-7, 1e-7)
twists = st.tuples(speeds, speeds, speeds)


@given(twist=twists, part=st.floats(0.01, 1.0))
@pytest.mark.parametrize("name", ["car", "angle", "truck", "point"])
def test_every_point_at_every_time_is_inside(name, twist, part):
    body = grown_body(FOOTPRINTS[name], 0.0, 1e-3)
    level = _slices(twist, 2.0)[1]
    duration = part * (0.5 ** float(level[0]) if level.size else 2.0)
    body = cut_where_it_pivots(body, twist)
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


@pytest.mark.parametrize(("footprint", "duration"), [((ANGLE,), 0.25), ((Disc(0.5),), 0.05)])
@pytest.mark.parametrize("twist", TWISTS)
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


def _slices(
    twist, duration, around=(0, 0, 0, 0, 1.0, 0), boxes=((-np.inf, -np.inf, np.inf, np.inf),)
):
    """The slices of one coast."""
    given = np.zeros((1, 3)), np.array([twist]), np.array([duration])
    return slices_near(*given, np.array(around), np.array(boxes))


@given(twist=twists, place=st.tuples(*[st.floats(-4.0, 4.0)] * 2))
@pytest.mark.parametrize("name", ["car", "angle", "truck", "point"])
def test_slices_cover_a_coast_and_those_left_out_meet_no_box(name, twist, place):
    assume(max(map(abs, twist)) > 1e-9)  # it does not stand
    body = grown_body(FOOTPRINTS[name], 0.0, 1e-3)
    box = np.append(place, np.add(place, 0.5))
    around = [*body.middle, *body.half, np.hypot(*body.middle) + body.reach, 1e-7]
    _, level, begins, poses, *_ = _slices(twist, 3.0)
    _, _, near, _, stands, met = _slices(twist, 3.0, around, [box])
    assert met[0] == bool(near.size or stands.size)
    lengths = np.ldexp(1.0, -level)
    assert begins[0] == 0.0
    assert (begins[1:] <= (begins + lengths)[:-1]).all()
    assert begins[-1] + lengths[-1] == pytest.approx(min(3.0, 2.0 * np.pi / max(abs(twist[2]), 1)))
    for begin, length, pose in zip(begins, lengths, poses, strict=True):
        times = begin + np.linspace(0.0, length, 5)
        along = SE2.exp(np.multiply.outer(times, twist))
        assert pose == pytest.approx(along.pose[0], abs=1e-12)
        if begin not in near and not stands.size:
            for corners in body.pieces:
                seen = SE2(along.pose[:, None]).act(corners)
                hulls = shapely.convex_hull(shapely.multipoints(seen))
                assert not shapely.intersects(hulls, shapely.box(*box)).any()


courses = st.lists(
    st.tuples(st.floats(-0.5, 0.5), st.floats(-0.2, 0.2), st.floats(-0.3, 0.3) | st.floats(-3, 3)),
    min_size=1,
    max_size=12,
)


def poses_along(steps):
    poses = [np.array([1.0, -2.0, 0.5])]
    for step in steps:
        poses.append((SE2(poses[-1]) @ SE2.exp(step)).pose)
    return np.array(poses)


@given(steps=courses, data=st.data())
@pytest.mark.parametrize("name", ["car", "angle", "disc", "point"])
def test_a_body_on_a_course_stays_in_its_rectangles(name, steps, data):
    body = grown_body(FOOTPRINTS[name], 0.1, 1e-3)
    steps, n = np.array(steps), len(steps)
    poses = poses_along(steps)
    first = np.array(data.draw(st.lists(st.integers(0, n - 1), min_size=1, max_size=4)))
    last = np.array([data.draw(st.integers(k + 1, n)) for k in first.tolist()])
    rings = course_boxes(body, np.stack([poses[:-1], poses[1:]]), steps, first, last)
    for begin, end, ring in zip(first, last, rings, strict=True):
        box = shapely.Polygon(ring).buffer(1e-9)
        for k in range(begin, end):
            inside = SE2(poses[k]) @ SE2.exp(np.linspace(0.0, 1.0, 9)[:, None] * steps[k])
            for corners in body.pieces:
                seen = SE2(inside.pose[:, None]).act(corners).reshape(-1, 2)
                assert shapely.covers(box, shapely.points(seen)).all()
