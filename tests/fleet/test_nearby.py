"""Boxes around what plans sweep: they hold every body, and no meeting is missed."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.collision import Box, Disc
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.fleet.courses import FleetCourse
from maneuver_automaton.fleet.meetings import SLOT, Nearby, meetings, near_pairs, swept
from maneuver_automaton.groups import SE2

BODY = (Box([1.2, 0.6], [0.3, 0.0]),)


def course(rng, *, begin=0.0, size=12.0, until=math.inf) -> FleetCourse:
    """Coasts at random."""
    count = int(rng.integers(1, 6))
    times = begin + np.cumsum([0.0, *rng.uniform(0.2, 3.0, count)])
    speeds, turns = rng.uniform(-1, 2, count), rng.uniform(-2, 2, count)
    twists = np.column_stack([speeds, np.zeros(count), turns])
    poses = [np.array([*rng.uniform(0, size, 2), rng.uniform(-3, 3)])]
    for twist, lasting in zip(twists, np.diff(times), strict=True):
        poses.append((SE2(poses[-1]) @ SE2.exp(lasting * twist)).pose)
    return FleetCourse((BODY,), (Motion(times, poses, twist=twists),), until)


@pytest.mark.parametrize("seed", range(20))
def test_boxes_hold_the_bodies(seed):
    rng = np.random.default_rng(seed)
    one = course(rng, begin=float(rng.uniform(-3, 9)))
    first, boxes, _ = swept(one)
    (way,), corners = one.motions, np.array([[-0.3, -0.3], [0.9, -0.3], [0.9, 0.3], [-0.3, 0.3]])
    for time in np.linspace(way.time[0] - 2.0, way.time[-1] + 2.0, 200):
        x, y, heading = way.at(time)
        places = SE2([x, y, heading]).act(corners)
        box = boxes[min(max(math.floor(time / SLOT) - first, 0), len(boxes) - 1)]
        assert (places >= box[:2] - 1e-9).all()
        assert (places <= box[2:] + 1e-9).all()


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("since", [0.0, 4.3, 1e6])
def test_no_meeting_is_missed(seed, since):
    rng = np.random.default_rng([seed, 1])
    courses = [course(rng, begin=since - float(rng.uniform(0, 4))) for _ in range(12)]
    left = {k: one.after(since) for k, one in enumerate(courses)}
    met = {(row.one, row.other) for row in meetings(left, keep=0.3)}
    near = Nearby(since)
    found = {
        (a, b)
        for a, one in enumerate(courses)
        for b, may in enumerate(near.near(one, courses, keep=0.3))
        if may and a < b
    }
    assert met <= found
    assert len(found) < 12 * 11 / 2


def test_who_leaves_is_met_by_nobody_later():
    stands = FleetCourse(((Disc(0.5),),), (Motion([0.0], [[4.0, 0.0, 0.0]]),))
    passes = Motion([0.0, 8.0], [[0, 0, 0], [8, 0, 0]], twist=[[1, 0, 0]])
    goes = FleetCourse(
        ((Disc(0.5),),), (Motion([0.0, 1.0], [[4, 0, 0], [4, 1, 0]], twist=[[0, 1, 0]]),)
    )
    one = FleetCourse(((Disc(0.5),),), (passes,))
    near = Nearby(0.0)
    assert near.near(one, [stands, goes, replace(goes, until=1.0)], keep=0.1) == [True, True, False]


@pytest.mark.parametrize("seed", range(5))
def test_pairs_that_stand_near(seed):
    rng = np.random.default_rng(seed)
    standing = {
        3 * k: FleetCourse((BODY,), (Motion([0.0], [[*rng.uniform(0, 9, 2), rng.uniform(-3, 3)]]),))
        for k in range(20)
    }
    met = {(row.one, row.other) for row in meetings(standing, keep=0.2)}
    discs = [(k, *one.motions[0].pose[0, :2], math.hypot(0.9, 0.3)) for k, one in standing.items()]
    pairs = near_pairs(discs, 0.2)
    assert met <= set(pairs)
    assert pairs == sorted(pairs)
    assert set(pairs) <= set(itertools.combinations(standing, 2))
    assert near_pairs(discs[:1], 0.2) == []
