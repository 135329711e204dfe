"""Trims and maneuvers of a car on the road: what the limits admit, and where it leads."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.roads import RoadVehicle, _kernels_motion
from maneuver_automaton.roads.plans import plan_of_controls
from maneuver_automaton.roads.vehicle import road_library, tick_of

VEHICLE = RoadVehicle()
LIBRARY = road_library(VEHICLE, top_speed=14.0)
TICK, TICKS = LIBRARY.limits.tick, LIBRARY.limits.ticks


def sources():
    first = LIBRARY.maneuvers.first
    return np.repeat(np.arange(first.size - 1), np.diff(first))


def test_maneuvers_lead_from_trim_to_trim_within_the_limits():
    trims, maneuvers, source = LIBRARY.trims, LIBRARY.maneuvers, sources()
    lasts = TICK * TICKS
    gained = lasts * maneuvers.control
    np.testing.assert_allclose(
        trims.speed[source] + gained[:, 0], trims.speed[maneuvers.target], atol=1e-12
    )
    np.testing.assert_allclose(
        trims.steering[source] + gained[:, 1], trims.steering[maneuvers.target], atol=1e-12
    )
    limits = VEHICLE.model.control_limits + np.array([-1e-9, 1e-9])
    for k in range(2):
        assert (limits[k, 0] <= maneuvers.control[:, k]).all()
        assert (maneuvers.control[:, k] <= limits[k, 1]).all()


def test_every_trim_can_be_held():
    trims, maneuvers, source = LIBRARY.trims, LIBRARY.maneuvers, sources()
    held = (maneuvers.target == source) & ~maneuvers.control.any(axis=1)
    assert set(source[held]) == set(range(trims.speed.size))


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


def test_words_name_the_trims_of_the_automaton():
    names = road_library(VEHICLE, top_speed=3.0).automaton(VEHICLE.model).trim_names
    state, controls = np.array([0, 0, 0, 2.0, 0.0]), np.array([[2.0, 0.0]] * 5)
    ramp = plan_of_controls(VEHICLE.model, state, controls, tick=TICK)
    assert {trim.name for trim in ramp.trims} == {"speed 2, steering 0", "speed 3, steering 0"}
    assert {trim.name for trim in ramp.trims} <= set(names)


def test_a_state_beside_the_grid_has_maneuvers_too():
    found = _kernels_motion.maneuvers_from(LIBRARY.limits, LIBRARY.trims, 7.37, 0.011)
    assert found.target.size > 10
    np.testing.assert_allclose(
        7.37 + TICK * TICKS * found.control[:, 0], LIBRARY.trims.speed[found.target], atol=1e-12
    )


def test_the_library_has_a_mirror_image():
    trims = LIBRARY.trims
    rows = itertools.pairwise(trims.first.tolist())
    mirrored = np.concatenate([np.arange(low, high)[::-1] for low, high in rows])
    pairs = set(zip(sources().tolist(), LIBRARY.maneuvers.target.tolist(), strict=True))
    assert {(mirrored[a], mirrored[b]) for a, b in pairs} == pairs


def test_slow_driving_steers_as_far_as_the_car_can():
    trims = LIBRARY.trims
    slow = trims.steering[trims.first[1] : trims.first[2]]
    assert slow[[0, -1]].tolist() == [-VEHICLE.model.max_steering, VEHICLE.model.max_steering]


def test_neighbouring_angles_are_one_maneuver_apart():
    trims, maneuvers, source = LIBRARY.trims, LIBRARY.maneuvers, sources()
    pairs = set(zip(source.tolist(), maneuvers.target.tolist(), strict=True))
    for low, high in itertools.pairwise(trims.first.tolist()):
        assert {(k, k + 1) for k in range(low, high - 1)} <= pairs


@pytest.mark.parametrize(
    ("step", "tick", "ticks"), [(0.1, 0.1, 5), (0.25, 0.25 / 3, 6), (0.04, 0.04, 12)]
)
def test_ticks_divide_the_time_step(step, tick, ticks):
    assert tick_of(step) == pytest.approx(tick)
    limits = road_library(VEHICLE, top_speed=2.0, tick=tick_of(step)).limits
    assert (limits.tick, limits.ticks) == (tick_of(step), ticks)
