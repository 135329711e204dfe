"""The least distance over a motion, against a fine scan."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.collision.approach import closest_approach


@given(
    waves=st.lists(
        st.tuples(st.floats(0.1, 2.0), st.floats(0.5, 9.0), st.floats(0.0, 7.0)),
        min_size=1,
        max_size=4,
    ),
    lift=st.floats(-1.0, 3.0),
)
def test_against_a_fine_scan(waves, lift):
    def distances(times):
        total = sum(a * (1.0 + np.sin(f * times + p)) for a, f, p in waves)
        return np.maximum(total + lift, 0.0)

    rate = sum(a * f for a, f, _ in waves)
    times = np.linspace(0.0, 5.0, 4)
    found = closest_approach(distances, times, np.full(3, rate), resolution=1e-3)
    assert found.distance == distances(np.array([found.time]))[0]
    truth = distances(np.linspace(0.0, 5.0, 5001)).min()
    assert found.distance <= max(truth / 0.9, truth + 1e-3)
    strict = closest_approach(
        distances, times, np.full(3, rate), resolution=1e-3, enough=0.99 * truth
    )
    assert strict.distance <= max(truth / 0.99, truth + 2e-3)


def test_only_where_it_matters_is_measured():
    measured = []

    def distances(times):
        measured.extend(times)
        return 1.0 + 10.0 * np.abs(times - 3.3)

    times = np.arange(101.0)
    found = closest_approach(distances, times, np.full(100, 10.0), resolution=1e-3)
    assert abs(found.distance - 1.0) <= 1e-3
    assert len(measured) < 200


def test_along_a_wall_few_are_measured():
    measured = []

    def distances(times):
        measured.extend(times)
        return np.full(times.shape, 0.5)

    times = np.linspace(0.0, 100.0, 9)
    found = closest_approach(distances, times, np.ones(8), resolution=1e-3)
    assert found.distance == 0.5
    assert len(measured) < 3000


def test_enough_is_enough():
    measured = []

    def distances(times):
        measured.extend(times)
        return np.abs(times - 1.0)

    found = closest_approach(distances, np.arange(3.0), np.ones(2), resolution=1e-9, enough=0.5)
    assert found == (1.0, 0.0)
    assert len(measured) == 3


def test_nothing_anywhere_is_infinitely_far():
    found = closest_approach(
        lambda times: np.full(times.shape, np.inf), np.arange(3.0), np.ones(2), resolution=1e-3
    )
    assert found.distance == np.inf
