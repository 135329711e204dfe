"""Trims and maneuvers of a car on the road: what the limits admit, and where it leads."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.roads import RoadVehicle, _kernels_library
from maneuver_automaton.roads.library import TICK, TICKS, road_library

VEHICLE = RoadVehicle()
LIBRARY = road_library(VEHICLE, top_speed=14.0)


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


def test_a_state_beside_the_grid_has_maneuvers_too():
    found = _kernels_library.maneuvers_from(LIBRARY.limits, LIBRARY.trims, 7.37, 0.011)
    assert found.target.size > 10
    np.testing.assert_allclose(
        7.37 + TICK * TICKS * found.control[:, 0], LIBRARY.trims.speed[found.target], atol=1e-12
    )


def test_the_library_has_a_mirror_image():
    trims = LIBRARY.trims
    mirrored = np.arange(trims.speed.size).reshape(-1, trims.per_speed)[:, ::-1].ravel()
    pairs = set(zip(sources().tolist(), LIBRARY.maneuvers.target.tolist(), strict=True))
    assert {(mirrored[a], mirrored[b]) for a, b in pairs} == pairs
