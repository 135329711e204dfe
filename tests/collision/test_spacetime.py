"""Moving obstacles: nothing is missed between two times, and what is met is near."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.collision import Motion
from maneuver_automaton.collision.spacetime import (
    CoastingBody,
    MovingBodies,
    MovingBody,
    apart_at_least,
    may_meet,
    meet,
)
from maneuver_automaton.groups import SE2

speeds = st.floats(-3.0, 3.0) | st.just(0.0)
places = st.floats(-5.0, 5.0)


def offset_disc(pose, aside):
    """Where a disc off the frame's origin is."""
    turn = pose[..., 2]
    return pose[..., :2] + aside * np.stack([-np.sin(turn), np.cos(turn)], axis=-1)


def clearance(here, there):
    """Distance of two discs of radius 0.3, one a metre beside the origin of its frame."""
    apart = offset_disc(np.asarray(there), 1.0) - np.asarray(here)[..., :2]
    return np.maximum(np.hypot(apart[..., 0], apart[..., 1]) - 0.6, 0.0)


def possible(rover, other, duration):
    """Whether a rover may meet another within a time."""
    ((near,),) = may_meet(
        MovingBodies.of([other]),
        np.array([rover.center(rover.at(0.5 * duration))]).view(np.float64).reshape(1, 2),
        times=np.array([0.5 * duration]),
        halves=np.array([0.5 * duration]),
        speeds=np.array([abs(rover.velocity)]),
        reach=rover.reach,
    )
    return bool(near)


@given(
    start=st.tuples(places, places, st.floats(-7, 7)),
    twist=st.tuples(speeds, speeds, speeds),
    time=st.floats(0.0, 9.0),
)
def test_a_coast_is_that_of_the_group(start, twist, time):
    body = CoastingBody(start, twist, 0j, 1.0)
    assert body.at(time) == pytest.approx(
        (SE2(start) @ SE2.exp(time * np.array(twist))).pose, abs=1e-12
    )


@given(
    start=st.tuples(places, places, st.floats(-7, 7)),
    twist=st.tuples(speeds, speeds, speeds),
    knots=st.lists(st.tuples(places, places, st.floats(-9, 9)), min_size=1, max_size=4),
    begin=st.floats(-2.0, 2.0),
    duration=st.floats(0.0, 4.0),
)
def test_against_dense_times(start, twist, knots, begin, duration):
    motion = Motion(begin + np.arange(len(knots)) * 0.8, knots)
    rover, other = CoastingBody(start, twist, 0j, 0.3), MovingBody.of(motion, 1.3)
    times = np.linspace(0.0, duration, 400)
    clearances = clearance(np.array([rover.at(time) for time in times]), motion.at(times))
    found = meet(
        rover, other, duration=duration, distance=lambda a, b: float(clearance(a, b)), contact=1e-3
    )
    rate = math.hypot(*twist[:2]) + other.speed + other.turn_rate * 1.3
    if found:
        assert clearances.min() <= 1e-3 + rate * duration / 399 / 2 + 1e-12
        assert possible(rover, other, duration)
    else:
        assert clearances.min() > 0.0


def test_stretches_by_hand():
    body = MovingBody.of(Motion([1.0, 3.0, 4.0], [[0, 0, 0], [4, 2, 1], [4, 2, 7]]), 1.0)
    assert body.stretch(0.0) == ((0, 0, 0), 0j, 0.0, 1.0, 0.0)
    assert body.stretch(1.0) == ((0, 0, 0), 2 + 1j, 0.5, 3.0, 0.0)
    assert body.stretch(3.5) == ((4, 2, 4), 0j, 6.0, 4.0, 0.0)
    assert body.stretch(4.0) == ((4, 2, 7), 0j, 0.0, math.inf, 0.0)
    for time in (0.0, 1.0, 2.2, 3.0, 3.9, 4.0, 9.0):
        assert body.stretch(time).pose == pytest.approx(body.motion.at(time), abs=1e-15)
    assert body.speed == pytest.approx(math.sqrt(5.0))
    assert body.turn_rate == 6.0
    assert body.motion.at([-9.0, 9.0]).tolist() == [[0.0, 0.0, 0.0], [4.0, 2.0, 7.0]]


def test_a_convoy_takes_few_steps():
    asked = []

    def distance(here, there):
        asked.append(1)
        return abs(here[0] - there[0]) - 1.0

    rover = CoastingBody((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), 0j, 0.5)
    times = np.arange(100.0)
    road = Motion(times, np.column_stack([1.01 + 10.0 * times, 0 * times, 0 * times]))
    ahead = MovingBody.of(road, 0.5)
    assert not meet(rover, ahead, duration=99.0, distance=distance, contact=1e-3)
    assert len(asked) <= 100  # one for each stretch of the road


def test_what_never_moves_is_asked_once():
    asked = []

    def distance(here, there):
        asked.append(1)
        return 0.5

    still = CoastingBody((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0j, 1.0)
    parked = MovingBody.of(Motion([0.0], [[2.0, 0.0, 0.0]]), 1.0)
    assert not meet(still, parked, duration=1e9, distance=distance, contact=1e-3)
    assert len(asked) == 1


def test_far_and_slow_cannot_meet():
    rover = CoastingBody((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0j, 1.0)
    parked = MovingBody.of(Motion([0.0], [[20.0, 0.0, 0.0]]), 1.0)
    for duration, close in ((10.0, False), (19.0, True)):
        assert possible(rover, parked, duration) is close


@given(
    start=st.tuples(places, places, st.floats(-7, 7)),
    knots=st.lists(st.tuples(places, places, st.floats(-9, 9)), min_size=1, max_size=4),
    duration=st.floats(0.0, 4.0),
)
def test_a_disc_beside_its_frame_is_met_where_a_frame_of_its_own_would_be(start, knots, duration):
    """The same body, seen from a frame 5 m beside it: its disc is small, its reach is not."""
    times = np.arange(len(knots)) * 0.8
    far = Motion(times, knots)
    rover = CoastingBody(start, (1.0, 0.0, 0.3), 0j, 0.3)
    other = MovingBody.of(far, 6.3, middle=5.0 + 0j, radius=1.3)
    dense = np.linspace(0.0, duration, 200)
    (centers,) = MovingBodies.of([other]).centers(np.array([0]), dense)
    apart = np.abs([rover.center(rover.at(time)) for time in dense] - centers)
    found = meet(
        rover,
        other,
        duration=duration,
        distance=lambda a, b: max(0.0, abs(rover.center(a) - other.center(b)) - 1.6),
        contact=1e-3,
    )
    if not found:
        assert min(apart) > 1.6
    elif not possible(rover, other, duration):
        raise AssertionError("what meets may meet")


boxes = st.tuples(st.floats(0.1, 3.0), st.floats(0.1, 3.0))
poses = st.tuples(places, places, st.floats(-7, 7))


@given(here=poses, there=poses, own=boxes, its=boxes, aside=st.tuples(places, places))
def test_what_is_around_bodies_is_never_further_apart(here, there, own, its, aside):
    """Rectangles: the bound is never more than their distance, and little less than it."""
    middle = complex(*aside)
    body = CoastingBody(here, (0.0, 0.0, 0.0), middle, math.hypot(*own), own)
    other = MovingBody.of(Motion([0.0], [there]), 9.0, radius=math.hypot(*its), half=its)

    def rectangle(pose, half, center):
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        corners = corners + np.array([center.real, center.imag])
        return shapely.Polygon(SE2(pose).act(corners))

    one, two = rectangle(here, own, middle), rectangle(there, its, 0j)
    found = apart_at_least(body, other, here, there)
    for bound in found:
        assert 0.0 < bound.distance <= one.distance(two) + 1e-9
        ahead = [
            shapely.get_coordinates(shape) @ [bound.direction.real, bound.direction.imag]
            for shape in (one, two)
        ]
        assert bound.distance <= ahead[1].min() - ahead[0].max() + 1e-9
    if one.distance(two) > 1e-9:
        assert max(bound.distance for bound in found) >= 0.25 * one.distance(two)


@given(
    start=poses,
    twist=st.tuples(speeds, speeds, speeds),
    knots=st.lists(poses, min_size=1, max_size=4),
    own=boxes,
    its=boxes,
    aside=st.tuples(places, places),
    duration=st.floats(0.0, 4.0),
)
def test_rectangles_meet_when_they_touch(start, twist, knots, own, its, aside, duration):
    """Two rectangles, one of them beside its frame, at many times."""
    middle, motion = complex(*aside), Motion(0.8 * np.arange(len(knots)), knots)
    body = CoastingBody(start, twist, 0j, math.hypot(*own), own)
    other = MovingBody.of(
        motion, abs(middle) + math.hypot(*its), middle=middle, radius=math.hypot(*its), half=its
    )
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    rings = corners * own, corners * its + np.array(aside)

    def apart(here, there):
        one, two = (
            shapely.Polygon(SE2(pose).act(ring))
            for pose, ring in zip((here, there), rings, strict=True)
        )
        return one.distance(two)

    times = np.linspace(0.0, duration, 60)
    least = min(apart(body.at(time), other.stretch(time).pose) for time in times.tolist())
    found = meet(body, other, duration=duration, distance=apart, contact=1e-2)
    rate = math.hypot(*twist[:2]) + abs(twist[2]) * math.hypot(*own)
    rate += other.speed + other.turn_rate * other.reach
    if found:
        assert least <= 1e-2 + rate * duration / 59 / 2 + 1e-9
    else:
        assert least > 0.0
