"""Trims and maneuvers of a car on the road: what the limits admit, and where it leads."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.roads import RoadVehicle
from maneuver_automaton.roads.vehicle import road_library, tick_of

VEHICLE = RoadVehicle()
LIBRARY = road_library(VEHICLE, top_speed=14.0)
TICK, TICKS = LIBRARY.limits.tick, LIBRARY.limits.ticks


def sources():
    first = LIBRARY.maneuvers.first
    return np.repeat(np.arange(first.size - 1), np.diff(first))


def test_displacements_are_those_of_the_model():
    trims, maneuvers, source = LIBRARY.trims, LIBRARY.maneuvers, sources()
    for e in range(0, source.size, source.size // 40):
        state = [trims.speed[source[e]], trims.steering[source[e]]]
        course = drive(
            VEHICLE.model,
            state,
            control=np.repeat(maneuvers.control[e][None], TICKS, axis=0),
            durations=np.full(TICKS, TICK),
        )
        np.testing.assert_allclose(
            course.pose_at(TICK * np.arange(1, TICKS + 1)), maneuvers.pose[e], atol=1e-6
        )


def test_the_automaton_says_what_the_arrays_do():
    small = road_library(VEHICLE, top_speed=3.0)
    automaton = small.automaton(VEHICLE.model)
    states = np.array([trim.reduced_state for trim in automaton.trims])
    np.testing.assert_array_equal(states, np.stack([small.trims.speed, small.trims.steering], -1))
    source = np.repeat(np.arange(len(states)), np.diff(small.maneuvers.first))
    changing = np.flatnonzero(small.maneuvers.target != source)
    assert len(automaton.maneuvers) == len(changing)
    for one, e in zip(automaton.maneuvers, changing, strict=True):
        target = small.maneuvers.target[e]
        assert automaton.index_of(one.source) == source[e]
        assert automaton.index_of(one.target) == target
        np.testing.assert_allclose(one.course.pose_at(one.duration), one.displacement)
        np.testing.assert_allclose(one.displacement, small.maneuvers.pose[e, -1], atol=1e-6)


@pytest.mark.parametrize(
    ("step", "tick", "ticks"),
    [(0.1, 0.1, 5), (0.25, 0.25 / 3, 6), (0.04, 0.04, 12), (0.2, 0.1, 4), (0.3, 0.1, 6)],
)
def test_ticks_divide_the_time_step_and_steps_a_maneuver(step, tick, ticks):
    assert tick_of(step) == pytest.approx(tick)
    library = road_library(VEHICLE, top_speed=38.0, step=step, within=[(37.0, 37.5)])
    limits, speed, first = library.limits, library.trims.speed, library.maneuvers.first
    assert (limits.tick, limits.ticks) == (tick_of(step), ticks)
    # Straight ahead, the engine leads to the next speed, and hard braking is a maneuver.
    straight = [k for k in range(speed.size) if library.trims.steering[k] == 0.0]
    for k, after in itertools.pairwise(straight):
        reached = library.maneuvers.target[first[k] : first[k + 1]]
        assert after in reached
        hardest = -library.maneuvers.control[first[k] : first[k + 1], 0].min()
        assert not 5.0 < speed[k] < 28.0 or hardest == pytest.approx(limits.braking, rel=0.15)
