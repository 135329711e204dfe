"""What moves, as pieces in the intervals of a motion: all that it sweeps, shifting with time."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.groups import SE2
from maneuver_automaton.optimal_control.scene import ALWAYS, NEVER, MovingSolid, pieces_during
from maneuver_automaton.optimal_control.separation import SolidPairs, near_pairs

BOX = np.array([[1.0, 0.5], [-1.0, 0.5], [-1.0, -0.5], [1.0, -0.5]])
STILL = (BOX + 9.0, 0.0)


def mover(rate=(1.0, 0.0, 0.5), there=(-np.inf, np.inf), rounding=0.2) -> MovingSolid:
    end = SE2.exp(4.0 * np.array(rate)).pose
    motion = Motion([0.0, 4.0], [[0.0, 0.0, 0.0], end], [rate])
    return MovingSolid(BOX, rounding, motion.at, there)


def swept(one: MovingSolid, begin: float, end: float):
    """All that it covers between two times, by many looks."""
    times = np.linspace(max(begin, one.there[0]), min(end, one.there[1]), 60)
    at = SE2(one.poses(times)[:, None]).act(BOX)
    return shapely.union_all(shapely.buffer(shapely.polygons(at), one.rounding, quad_segs=4))


@given(
    st.tuples(st.floats(-2.0, 2.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
    st.lists(st.floats(0.05, 0.6), min_size=1, max_size=6),
)
def test_pieces_hold_all_that_is_swept(rate, durations):
    one, ends = mover(rate), np.cumsum([0.0, *durations])
    pieces = pieces_during([STILL], [one], np.array(durations))
    assert pieces.interval.tolist() == [ALWAYS, *range(len(durations))]
    assert pieces.first == 1
    for k, (corners, rounding) in enumerate(pieces.solids[1:]):
        hull = shapely.convex_hull(shapely.multipoints(corners)).buffer(rounding + 1e-3)
        assert hull.contains(swept(one, ends[k], ends[k + 1]))


@given(st.floats(-1.0, 1.0), st.floats(1.0, 3.0))
def test_corners_shift_with_the_duration(turn, duration):
    one = mover((1.0, 0.3, turn))
    now, later = (
        pieces_during([], [one], np.full(5, total / 5)) for total in (duration, duration + 1e-4)
    )
    for (here, _), (there, _), shift in zip(now.solids, later.solids, now.shifts, strict=True):
        assert there == pytest.approx(here + 1e-4 * shift, abs=1e-7)


def test_what_is_there_for_a_while_is_in_no_other_interval():
    pieces = pieces_during([], [mover(there=(0.6, 1.4))], np.full(8, 0.25))
    assert pieces.interval.tolist() == [NEVER, NEVER, 2, 3, 4, 5, NEVER, NEVER]
    whole = pieces_during([], [mover()], np.full(8, 0.25))
    assert np.array_equal(pieces.solids[3][0], whole.solids[3][0])
    assert not pieces.shifts[2, :4].any()  # it comes when it comes


def test_pairs_of_its_interval_alone():
    point = [(np.zeros((4, 3)), np.zeros((4, 3)))]
    body = [(np.zeros((1, 2)), 0.1)]
    pieces = [(np.array([[1.0, 0.0]]), 0.1)] * 2
    pairs = near_pairs(point, body, pieces, within=2.0, during=np.array([ALWAYS, 1]))
    assert sorted(zip(*(column.tolist() for column in pairs), strict=True)) == sorted(
        [(0, 0, 0), (1, 0, 0), (2, 0, 0), (1, 0, 1)]
    )
    assert isinstance(pairs, SolidPairs)
