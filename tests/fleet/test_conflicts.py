"""Who meets whom: proven for all times, against dense looks by shapely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.collision import Box
from maneuver_automaton.collision.surroundings import parts_of
from maneuver_automaton.fleet.courses import FleetCourse
from maneuver_automaton.fleet.meetings import meetings
from maneuver_automaton.fleet.verdict import measured, nearest
from maneuver_automaton.groups import SE2
from tests.collision.test_arcs import arcs
from tests.quickly import draws

BODY = (Box([1.0, 0.6]),)
rates = st.tuples(st.floats(-2.0, 2.0), st.just(0.0), st.floats(-1.5, 1.5))
runs = st.lists(st.tuples(rates, st.floats(0.3, 2.0)), min_size=1, max_size=3)
places = st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0), st.floats(-3.0, 3.0))


def course(start, parts, begin=0.0, **more):
    return FleetCourse((BODY,), (arcs(start, parts, begin),), **more)


def dense(one, other, step=0.002):
    """Times and distances of two bodies, before and after they drive too."""
    last = max(one.quiet_after, other.quiet_after) + 0.5
    times = np.arange(-0.5, last, step)
    (part,) = parts_of(BODY)
    bodies = [part.at(way.motions[0].at(times)) for way in (one, other)]
    return times, shapely.distance(*bodies)


@settings(max_examples=draws(60))
@given(places, runs, places, runs, st.floats(0.0, 2.0), st.floats(0.0, 0.5))
def test_meetings_against_dense_looks(here, parts, there, others, begin, keep):
    ways = {3: course(here, parts), 5: course(there, others, begin)}
    times, apart = dense(ways[3], ways[5])
    met = meetings(ways, keep=keep)
    near = np.flatnonzero(apart <= keep)
    if near.size:
        (row,) = met
        assert (row.one, row.other) == (3, 5)
        assert row.time <= times[near[0]] + 1e-9 or times[near[0]] < min(0.0, begin)
    if not met:
        assert apart.min() > keep
    if apart.min() > keep + 0.02:
        assert not met


@settings(max_examples=draws(40))
@given(places, runs, places, runs)
def test_measured_distances_against_dense_looks(here, parts, there, others):
    ways = {0: course(here, parts), 1: course(there, others)}
    _, apart = dense(ways[0], ways[1])
    rows = measured(ways, ["a", "b"], keep=0.0)
    if apart.min() > 1.1:
        assert not rows
    if apart.min() < 0.99:
        ((pair, _, distance),) = rows
        assert pair == ("a", "b")
        assert distance <= apart.min() + 1e-9
        assert distance >= 0.99 * apart.min() - 0.02


def test_who_is_gone_before_its_motion_is_over_is_met_by_nobody():
    """One is gone after a second of the four that it drives; another one comes there after two."""
    gone = course([0.0, 0.0, 0.0], [((0.1, 0.0, 0.0), 4.0)], until=1.0)
    comes = course([-3.0, 0.0, 0.0], [((1.0, 0.0, 0.0), 4.0)])
    for ways in ((gone, comes), (comes, gone)):
        assert nearest(*ways).distance == pytest.approx(1.1, abs=0.02)


def test_who_begins_later_stands_at_its_start_until_then():
    """By the kernels and by the audit, in whatever order the two are asked for."""
    passes = course([-6.0, 0.0, 0.0], [((1.0, 0.0, 0.0), 12.0)])
    later = course([0.0, 1.2, 0.0], [((1.0, 0.0, 0.0), 2.0)], begin=30.0)
    for ways in ({0: passes, 1: later}, {0: later, 1: passes}):
        assert nearest(ways[0], ways[1]).distance == pytest.approx(0.6, abs=0.01)
        assert meetings(ways, keep=0.7)
        ((_, time, distance),) = measured(ways, ["a", "b"], keep=0.5)
        assert distance == pytest.approx(0.6, abs=0.01)
        assert time < 12.0


def test_a_moved_pair_meets_at_the_same_time():
    by = SE2([100.0, -30.0, 2.0])
    ways = {
        0: course([0, 0, 0], [((1.0, 0.0, 0.2), 5.0)]),
        1: course([4, -3, 1.5], [((1.0, 0.0, 0.0), 5.0)]),
    }
    moved = {k: FleetCourse(one.shapes, (one.motions[0].moved(by),)) for k, one in ways.items()}
    (first,), (second,) = meetings(ways, keep=0.3), meetings(moved, keep=0.3)
    assert second.time == pytest.approx(first.time, abs=1e-4)
