"""Courses of maneuvers as pieces of constant twist: never farther off than they say."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.collision import Box
from maneuver_automaton.groups import SE2
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.search.part_motion import (
    carried_twists,
    course_of,
    parts_of,
    pieces_of,
)
from tests.search.automata import inertial_unicycle, truck_with_trailer

CORNERS = np.array([[0.25, 0.125], [-0.25, 0.125], [-0.25, -0.125], [0.25, -0.125]])
REACH = float(np.hypot(0.25, 0.125))


def corners_of(poses):
    return np.stack([np.asarray(SE2(poses).act(corner)) for corner in CORNERS], axis=-2)


@pytest.mark.parametrize("timed", [False, True], ids=["way", "time"])
def test_no_corner_is_farther_from_its_pieces_than_stated(timed):
    automaton = inertial_unicycle(levels=5)
    courses = [course_of(m, np.zeros((len(m.course.time), 3))) for m in automaton.maneuvers]
    twists = {trim.name: trim.body_velocity for trim in automaton.trims}
    ends = np.array([[twists[m.source], twists[m.target]] for m in automaton.maneuvers])
    pieces = pieces_of(courses, ends=ends, reach=REACH, close=0.0025, timed=timed)
    assert pieces.first[-1] == len(pieces.time)
    assert len(pieces.time) < 0.7 * sum(len(times) for _, times in courses)
    for n, maneuver in enumerate(automaton.maneuvers[::7]):
        k = slice(pieces.first[7 * n], pieces.first[7 * n + 1])
        assert pieces.time[k].sum() == pytest.approx(maneuver.duration, abs=1e-9)
        keep = maneuver.course.control[:-1], np.diff(maneuver.course.time)
        fine = drive(automaton.model, maneuver.course.reduced_state[0], control=keep[0],
                     durations=keep[1], max_step_m=0.002, max_step_rad=0.002)  # fmt: skip
        knots = np.concatenate([[0.0], np.cumsum(pieces.time[k])])
        for j, knot in enumerate(knots[:-1]):
            inside = (fine.time >= knot - 1e-9) & (fine.time <= knots[j + 1] + 1e-9)
            lasting = knots[j + 1] - knot
            share = (fine.time[inside] - knot) if timed else np.linspace(0.0, lasting, 400)
            start, twist = SE2(pieces.pose[k][j]), pieces.twist[k][j]
            driven = corners_of((start @ SE2.exp(share[:, None] * twist)).pose)
            true = corners_of(fine.pose[inside])
            if timed:
                off = np.linalg.norm(driven - true, axis=-1).max()
            else:
                gaps = np.linalg.norm(driven[None] - true[:, None], axis=-1).max(axis=-1)
                off = gaps.min(axis=1).max()
            step = 0.0 if timed else lasting / 399 * (np.hypot(*twist[:2]) + abs(twist[2]) * REACH)
            assert off <= pieces.error[k][j] + step + 1e-9


def test_parts_are_carried_by_trims_and_maneuvers():
    automaton = truck_with_trailer(levels=3)
    own, trailer = parts_of(automaton, [Box([0.5, 0.25])], [[Box([0.3, 0.25])]])
    assert not own.trim_poses.any()
    twists = carried_twists(automaton.body_velocities, trailer.trim_poses)
    assert np.abs(twists[:, 1]).max() < 1e-12  # a trailer does not slide
    straight = automaton.index_of("0.5 at 0.00")
    assert twists[straight].tolist() == [0.5, 0.0, 0.0]
    for k, maneuver in enumerate(automaton.maneuvers):
        poses, times = course_of(maneuver, trailer.course_poses[k])
        ends = twists[[automaton.index_of(maneuver.source), automaton.index_of(maneuver.target)]]
        pieces = pieces_of([(poses, times)], ends=ends[None], reach=0.3, close=0.002, timed=False)
        sliding = np.abs(pieces.twist[:, 1]) / np.hypot(pieces.twist[:, 0], pieces.twist[:, 1])
        assert sliding.max() < 0.05
        assert pieces.error.max() < 0.01
    with pytest.raises(ValueError) as error:
        parts_of(automaton, [Box([0.5, 0.25])])
    assert str(error.value) == ("parts: got the bodies of 0 parts, need 1 for the car_with_trailer")
