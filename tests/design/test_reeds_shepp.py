"""Reeds-Shepp intervals: against OMPL, against the steering function, and as intervals."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.costs import Cost
from maneuver_automaton.design import reeds_shepp_length
from maneuver_automaton.design.proof import word_lengths
from maneuver_automaton.design.reeds_shepp import families
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search.words import search_words
from maneuver_automaton.words import _kernels_steering as kernels
from tests.quickly import draws
from tests.search.cases import REEDS_SHEPP, VECTORS, robot, vectors

ROBOT = robot(REEDS_SHEPP)
FAR = st.floats(-6.0, 6.0) | st.floats(-1e-6, 1e-6)
ANGLE = st.floats(-math.pi, math.pi) | st.sampled_from([0.0, math.pi / 2, math.pi])
GOALS = st.tuples(FAR, FAR, ANGLE).map(np.array)


def random_goals(n, seed, *, reach=5.0):
    rng = np.random.default_rng(seed)
    return rng.uniform([-reach, -reach, -math.pi], [reach, reach, math.pi], size=(n, 3))


def three_trims(goals):
    """Cheapest word of three of the six trims, by the steering function: (n,)."""
    rows = [row for row in product(range(6), repeat=3) if row[0] != row[1] != row[2]]
    triples = np.array(rows)
    steps = np.zeros((len(rows), 2, 3))
    costs = []
    for goal in goals:
        tiled = np.tile(goal, (len(rows), 1))
        times = kernels.steer_batch(ROBOT.body_velocities, triples, steps, tiled, 1e-10)
        sound = (times >= -1e-9).all(axis=2)
        costs.append(np.where(sound, np.abs(times).sum(axis=2), np.inf).min())
    return np.array(costs)


def test_by_hand():
    # a straight; a quarter turn; turning round on the spot in three strokes of pi / 3 each
    goals = [[3.0, 0.0, 0.0], [1.0, 1.0, math.pi / 2], [0.0, 0.0, math.pi]]
    assert reeds_shepp_length(goals).tolist() == pytest.approx([3.0, math.pi / 2, math.pi])
    assert reeds_shepp_length([-6.0, 0.0, 0.0], radius=2.0) == pytest.approx(6.0)


@pytest.mark.skipif(not VECTORS.exists(), reason="needs the given steering vectors")
def test_lengths_are_those_of_ompl():
    given_ones = list(vectors())
    goals = np.array([vector.goal for vector in given_ones])
    stated = np.array([vector.reeds_shepp for vector in given_ones])
    assert np.abs(reeds_shepp_length(goals) - stated).max() < 1e-8


@settings(max_examples=draws(16))
@given(goal=GOALS)
def test_a_path_driven_back_or_mirrored_is_as_long(goal):
    length = reeds_shepp_length(goal)
    assert reeds_shepp_length(SE2(goal).inverse().pose) == pytest.approx(length, abs=1e-6)
    assert reeds_shepp_length(goal * [1.0, -1.0, -1.0]) == pytest.approx(length, abs=1e-6)


@settings(max_examples=draws(16))
@given(first=GOALS, last=GOALS)
def test_two_paths_are_no_shorter_than_one(first, last):
    there = (SE2(first) @ SE2(last)).pose
    parts = reeds_shepp_length(first) + reeds_shepp_length(last)
    assert reeds_shepp_length(there) <= parts + 1e-6


def test_words_of_three_trims_are_all_of_the_steering_function():
    goals = random_goals(60, seed=1)
    lengths = word_lengths(goals, radius=1.0, max_trims=3)
    assert np.abs(lengths - three_trims(goals)).max() < 1e-7


@pytest.mark.slow
def test_words_of_four_trims_are_admitted_words():
    goals = random_goals(20, seed=2)
    for goal, length in zip(goals, word_lengths(goals, radius=1.0, max_trims=4), strict=True):
        four = Problem(
            ROBOT, np.zeros(3), goal, cost=Cost(length=1.0), horizon=Horizon(max_trims=4)
        )
        best = search_words(four, four.goals[0]).solutions[0]
        assert best.cost <= length + 1e-7
        assert best.cost >= reeds_shepp_length(goal) - 1e-7


def test_words_of_five_trims_are_shortest_paths():
    goals = random_goals(1000, seed=3)
    lengths = word_lengths(goals, radius=1.0, max_trims=5)
    assert np.abs(lengths - reeds_shepp_length(goals)).max() < 1e-9


def test_boxes_enclose_the_goals_in_them():
    rng = np.random.default_rng(0)
    low = random_goals(300, seed=10)
    special = rng.choice([0.0, 1.0, 2.0, -2.0], size=(100, 3)) * [1.0, 1.0, math.pi / 2]
    low[:100] = special - 10.0 ** rng.uniform(-4.0, -1.0, size=(100, 3))
    size = 10.0 ** rng.uniform(-3.0, -0.3, size=low.shape)
    boxes = list(families(low, low + size))
    for share in rng.uniform(size=(10, *low.shape)):
        goals = low + share * size
        points = list(families(goals, goals))
        for n in (3, 4, 5):
            pairs = [(a, b) for a, b in zip(boxes, points, strict=True) if a.trims == n]
            assert (
                np.min([b.lower() for _, b in pairs], axis=0)
                >= np.min([a.lower() for a, _ in pairs], axis=0) - 1e-9
            ).all()
        for n in (3, 4):
            most = np.min([a.upper() for a in boxes if a.trims <= n], axis=0)
            here = np.min([b.upper() for b in points if b.trims <= n], axis=0)
            assert (here <= most + 1e-9).all()
