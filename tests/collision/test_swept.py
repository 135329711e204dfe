"""What a slice sweeps: nothing is left out, and the excess is what is said."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.collision import Box, Disc
from maneuver_automaton.collision.motion import point_speeds
from maneuver_automaton.collision.swept import (
    MOST_STEPS,
    MOST_TURN,
    chunks,
    course_boxes,
    cut_where_it_pivots,
    grown_body,
    halves,
    slice_excess,
    swept_hulls,
    windows,
)
from maneuver_automaton.groups import SE2
from tests.collision.scenes import ANGLE, CAR, FOOTPRINTS, TWISTS


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
    duration = part * _windows(twist, 2.0).lengths[0]
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


def _windows(twist, duration):
    return windows(np.array([twist[2]]), np.array([duration]))


@given(twist=twists, duration=st.floats(1e-9, 1e3))
def test_windows_cover_the_time_and_no_more(twist, duration):
    duration = min(duration, 2.0 * np.pi / max(abs(twist[2]), 1e-9))
    parts = _windows(twist, duration)
    length = parts.lengths[0]
    assert (parts.lengths == length).all()
    assert abs(twist[2]) * length <= MOST_TURN
    assert parts.begins[0] == 0.0
    assert parts.begins[-1] + length == pytest.approx(duration, rel=1e-15)
    assert (parts.begins + length <= duration * (1 + 1e-15)).all()
    assert (np.diff(parts.begins) <= length).all()
    assert (np.diff(parts.begins) >= 0.0).all()


@given(rates=st.lists(st.tuples(speeds, st.floats(0.0, 10.0)), max_size=5))
def test_windows_of_several_are_those_of_each(rates):
    turns, durations = np.array(rates).reshape(-1, 2).T
    parts = windows(turns, durations)
    for k, (turn, duration) in enumerate(rates):
        alone, own = _windows((0.0, 0.0, turn), duration), parts.of(parts.coast == k)
        assert own.begins.tolist() == alone.begins.tolist()
        assert own.level.tolist() == alone.level.tolist()
    assert (np.diff(parts.coast) >= 0).all()


def test_halves_cover_the_same():
    parts = _windows((1.0, 0.0, 0.5), 3.3)
    half = halves(parts)
    assert half.lengths[::2].tolist() == (0.5 * parts.lengths).tolist()
    assert half.coast[::2].tolist() == half.coast[1::2].tolist() == parts.coast.tolist()
    assert half.begins[::2].tolist() == parts.begins.tolist()
    assert (half.begins[1::2] - parts.begins == half.lengths[::2]).all()


def test_no_time_at_all_takes_no_slice():
    assert windows(np.array([0.0, 1.0]), np.zeros(2)).coast.size == 0


@given(twist=twists)
@pytest.mark.parametrize("name", ["car", "angle", "truck", "point", "disc"])
def test_a_cut_body_is_the_same_body(name, twist):
    body = grown_body(FOOTPRINTS[name], 0.1, 1e-3)
    # On a grid: of pieces that touch along their cuts the plain union of GEOS 3.14 loses one.
    whole, parts = (
        shapely.union_all([shapely.Polygon(corners) for corners in one.pieces], grid_size=1e-9)
        for one in (body, cut_where_it_pivots(body, twist))
    )
    assert whole.buffer(1e-8).covers(parts)
    assert parts.buffer(1e-8).covers(whole)


@pytest.mark.parametrize("twist", [(1.0, 0.0, 0.25), (0.0, 0.0, 1.0), (0.3, 0.8, -1.0)])
def test_a_cut_body_stands_out_by_the_square_of_the_turn(twist):
    body = grown_body((CAR,), 0.0, 1e-3)

    def excess(pieces, turn):
        duration = turn / abs(twist[2])
        poses = SE2.exp(np.multiply.outer(np.linspace(0.0, duration, 400), twist)).pose
        passed = shapely.union_all(
            [shapely.polygons(SE2(poses[:, None]).act(corners)) for corners in body.pieces]
        )
        hulls = slice_hulls(pieces, twist, duration)
        points = [shapely.get_coordinates(shapely.segmentize(_ring(one), 0.02)) for one in hulls]
        return shapely.distance(shapely.points(np.concatenate(points)), passed).max()

    pieces = cut_where_it_pivots(body, twist)
    assert excess(pieces, 0.125) < 0.35 * excess(pieces, 0.25)
    assert excess(pieces, 0.25) < 0.4 * excess(body, 0.25)


def test_sizes_by_hand():
    body = grown_body((Box([4.0, 2.0], center=[1.0, 0.0]),), 0.0, 1e-3)
    assert body.middle.tolist() == [1.0, 0.0]
    assert body.reach == pytest.approx(np.sqrt(5.0))
    coasts = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    speeds = point_speeds(coasts, np.concatenate(body.pieces)).max(axis=1)
    assert speeds.tolist() == pytest.approx([1.0, 2.0 * np.sqrt(10.0)])


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


def test_rectangles_fall_to_the_body():
    """Of a straight step they are exact, of a short turn they stand out by its half turn."""
    body = grown_body((CAR,), 0.0, 1e-3)
    steps = np.array([[0.5, 0.0, 0.0], [0.0, 0.0, 0.02]])
    poses = poses_along(steps)
    ends = np.stack([poses[:-1], poses[1:]])
    straight, turned = course_boxes(body, ends, steps, np.array([0, 1]), np.array([1, 2]))
    (hull,) = swept_hulls(body, poses[:2], steps[:1])
    assert shapely.Polygon(straight).symmetric_difference(shapely.Polygon(hull)).area < 1e-9
    assert shapely.Polygon(turned).area < shapely.Polygon(body.pieces[0]).area + 0.6


@given(steps=courses, begins=st.lists(st.booleans(), min_size=12, max_size=12))
def test_chunks_are_runs_of_one_course_that_turn_little(steps, begins):
    steps, marks = np.array(steps * 5), np.array((begins * 5)[: 5 * len(steps)])
    marks[0] = True
    first, last = chunks(steps, marks)
    assert first[0] == 0
    assert last[-1] == len(steps)
    assert first[1:].tolist() == last[:-1].tolist()
    assert np.isin(np.flatnonzero(marks), first).all()
    for k, end in zip(first, last, strict=True):
        turned = np.abs(steps[k:end, 2]).sum()
        assert turned <= MOST_TURN + 1e-12 or end - k == 1
        assert end - k <= MOST_STEPS
