"""The factor of short words: what is proven is never below what goals show."""

from __future__ import annotations

import math

import numpy as np
import pytest

from maneuver_automaton.design import reeds_shepp_length
from maneuver_automaton.design.proof import proven_factor, word_lengths
from tests.quickly import quick_are


def proof(max_trims, *, scale=1.0, radius=3.0, least=1.0, tolerance=0.05, most_boxes=10**6):
    return proven_factor(
        turning_radius=scale,
        radius=scale * radius,
        max_trims=max_trims,
        least=scale * least,
        goals=np.zeros((0, 3)),
        tolerance=tolerance,
        most_boxes=most_boxes,
    )


@pytest.mark.parametrize("max_trims", quick_are([5], [3, 4, 5], exhaustive=True))
def test_no_goal_has_a_greater_factor_than_the_proven_one(max_trims):
    proven = proof(max_trims)
    assert proven.finished
    assert proven.factor <= proven.sampled + 0.05
    rng = np.random.default_rng(0)
    distance, angle, heading = rng.uniform(size=(3, 20_000)) * [[3.0], [2 * math.pi], [7.0]]
    goals = np.stack([distance * np.cos(angle), distance * np.sin(angle), heading], axis=-1)
    goals = np.concatenate([goals, goals[:1000] * [1e-3, 1.0, 1e-2]])  # sideways: the worst
    shortest = reeds_shepp_length(goals)
    ratios = word_lengths(goals, radius=1.0, max_trims=max_trims) / shortest
    assert ratios[shortest >= 1.0].max() <= proven.factor + 1e-9
    assert ratios.min() >= 1.0 - 1e-9


@pytest.mark.exhaustive
@pytest.mark.slow
def test_the_worst_goal_has_the_factor_that_is_stated():
    found = proof(3, scale=2.0)
    lengths = word_lengths(found.worst, radius=2.0, max_trims=3)
    assert lengths / reeds_shepp_length(found.worst, radius=2.0) == pytest.approx(found.sampled)
    assert np.hypot(*found.worst[:2]) <= found.radius


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_larger_car_in_a_larger_disc_is_the_same():
    small, large = proof(4), proof(4, scale=4.0)
    assert large.factor == pytest.approx(small.factor, rel=1e-12)
    assert large.worst == pytest.approx(small.worst * [4.0, 4.0, 1.0])
    again = proof(4)
    assert (again.factor, again.boxes, *again.worst) == (small.factor, small.boxes, *small.worst)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_what_is_cut_short_is_still_proven():
    early, late = proof(4, most_boxes=2000), proof(4)
    assert not early.finished
    assert early.factor > late.factor >= late.sampled >= early.sampled


def test_five_trims_are_enough_for_every_shortest_path():
    assert proof(5).factor == 1.0
