"""Shortest paths of a car: against all 48 kinds, also where parts vanish, and where they end."""

from __future__ import annotations

import math

import numpy as np
import pytest

from maneuver_automaton.design.reeds_shepp import families
from maneuver_automaton.groups import SE2
from maneuver_automaton.words.shortest import least_radius, shortest_paths


def ends_of(turns, lengths):
    """Poses (n, 3) where paths on circles of radius 1 end, and all poses between their parts."""
    pose = SE2(np.zeros((len(turns), 3)))
    twists = np.stack([np.ones(turns.shape), np.zeros(turns.shape), turns], axis=-1)
    for part in range(turns.shape[1]):
        pose = pose @ SE2.exp(lengths[:, part, None] * twists[:, part])
    return pose.pose


@pytest.mark.parametrize("reach", [1.0, 3.0, 8.0, 40.0, None])
def test_no_kind_of_path_is_shorter(reach):
    rng = np.random.default_rng(1)
    if reach:
        goals = rng.uniform(-1.0, 1.0, size=(3000, 3)) * [reach, reach, math.pi]
    else:  # where parts of a word vanish, and another takes its place
        turns = rng.integers(-1, 2, size=(6000, 5))
        lengths = rng.choice([0, 0, 1, -1, 2, -3, math.pi / 3, -math.pi / 4], size=(6000, 5))
        goals = ends_of(turns, lengths * np.where(turns == 0, 1.0, math.pi / 2))
        goals = goals[np.abs(goals[:, :2]).max(axis=1) > 1e-6]
    turns, lengths = shortest_paths(goals, 1.0)
    least = np.min([family.lower() for family in families(goals, goals)], axis=0)
    assert np.abs(lengths).sum(axis=1) == pytest.approx(least, abs=1e-11)
    missed = (SE2(goals).inverse() @ SE2(ends_of(turns, lengths))).pose
    assert np.abs(missed[:, :2]).max() < 1e-12
    assert np.abs(np.sin(0.5 * missed[:, 2])).max() < 1e-12


def test_the_least_radius_is_of_trims_that_all_move_along_the_heading():
    car = np.array([[2.0, 0.0, 0.5], [-1.0, 0.0, 0.4], [3.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert least_radius(car) == 2.5
    assert least_radius(car[2:]) == 0.0  # none turns
    assert least_radius(np.vstack([car, [0.0, 0.0, 1.0]])) == 0.0
    assert least_radius(np.vstack([car, [0.0, 1.0, 0.0]])) == 0.0
