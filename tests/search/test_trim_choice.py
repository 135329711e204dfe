"""The few trims that stand for a large library, and those that can pay at all."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups.chain import coasted
from maneuver_automaton.models import Car, Unicycle
from maneuver_automaton.search.lattice_trims import (
    MOST_TRIMS,
    Chosen,
    at_two_paces,
    coarse_trims,
    paced_trims,
    paying_trims,
    trims_at_will,
)

AXIS = np.round(np.linspace(-2.0, 2.0, 41), 12)
GRID = Automaton.of_grid(Unicycle(), [AXIS, AXIS])
CAR = Automaton.of_grid(
    Car(wheelbase=2.8, max_steering=0.6),
    [np.round(np.linspace(-1.0, 1.0, 41), 12), np.round(np.linspace(-0.6, 0.6, 41), 12)],
)
COSTS = [Cost(time=1.0), Cost(time=1.0, effort=1.0), Cost(time=1.0, norm=0.5), Cost(effort=1.0)]
libraries = st.builds(
    lambda twists, rates: (np.insert(twists, 1, 0.0, axis=1), rates),
    arrays(np.float64, (60, 2), elements=st.floats(-3.0, 3.0).map(lambda v: round(v, 3))),
    arrays(np.float64, 60, elements=st.floats(0.1, 5.0)),
)


def moving(automaton, cost):
    twists = automaton.body_velocities
    rates = cost.rates(automaton.controls, twists)
    moves = twists.any(axis=1)
    return twists[moves], rates[moves]


@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("automaton", [GRID, CAR])
def test_the_few_trims_are_their_own_mirror_image_and_reverse(automaton, cost):
    """By hand: straight and sharp, both ways, for a car; spins beside them for a unicycle."""
    twists, rates = moving(automaton, cost)
    chosen = twists[coarse_trims(twists, rates)]
    assert len(chosen) == (8 if automaton is GRID else 6) <= MOST_TRIMS
    rows = {tuple(row) for row in chosen.round(9).tolist()}
    assert {(v + 0.0, u + 0.0, -w + 0.0) for v, u, w in rows} == rows
    assert {(-v + 0.0, u + 0.0, w + 0.0) for v, u, w in rows} == rows


def test_full_speed_where_time_counts_and_the_best_pace_where_effort_does():
    """By hand: ``(1 + v^2) / v`` is least at 1 m/s."""
    for cost, pace in ((Cost(time=1.0), 2.0), (Cost(time=1.0, effort=1.0), 1.0)):
        twists, rates = moving(GRID, cost)
        chosen = twists[coarse_trims(twists, rates)]
        straight = chosen[(chosen[:, 2] == 0.0) & (chosen[:, 0] > 0.0)]
        np.testing.assert_allclose(straight, [[pace, 0.0, 0.0]])


@given(libraries, arrays(np.float64, 2, elements=st.floats(-4.0, 4.0)))
def test_where_any_trim_pays_one_that_is_kept_pays_as_well(library, momentum):
    twists, rates = library
    if not np.abs(twists).max(axis=0)[[0, 2]].all():
        return
    kept = paying_trims(twists, rates)
    gains = -(twists[:, [0, 2]] @ momentum) / rates
    # looked at in many directions, not in all
    assert gains[kept].max() >= gains.max() - 1e-3 * np.abs(gains).max()


@pytest.mark.parametrize("cost", COSTS[:3])
def test_few_of_a_large_library_pay(cost):
    twists, rates = moving(GRID, cost)
    assert 8 <= len(paying_trims(twists, rates)) < 200


def test_all_are_priced_where_the_plane_does_not_tell():
    twists, rates = moving(GRID, COSTS[0])
    assert len(paying_trims(twists, np.zeros(len(rates)))) == len(rates)
    aside = twists + np.array([0.0, 0.1, 0.0])
    assert len(paying_trims(aside, rates)) == len(rates)


@given(st.floats(0.05, 0.95), st.floats(1.0, 20.0))
def test_paces_lie_around_the_one_that_fills_the_time(pace, length):
    """By hand: straight on, in the time that one speed takes."""
    speeds = np.arange(1, 21)[:, None] / 20.0 * np.array([[1.0, 0.0, 0.0]])
    word, durations = np.array([19]), np.array([length])
    paces = paced_trims(speeds, speeds[:, 0] ** 2, word, durations, length / pace)
    chosen = speeds[np.union1d(*paces)][:, 0]
    assert chosen.min() <= pace + 1e-9
    assert chosen.max() >= pace - 1e-9
    assert np.ptp(chosen) <= 0.15


@given(st.lists(st.sampled_from([0.2, -0.2, 0.0]), min_size=1, max_size=5), st.floats(1.1, 9.0))
def test_a_word_at_two_paces_fills_the_time_along_the_same_path(turns, longer):
    twists = np.array([[v, 0.0, v * w] for v in np.arange(1, 21) / 20 for w in (-0.2, 0.0, 0.2)])
    word = np.array([57 + [-0.2, 0.0, 0.2].index(turn) for turn in turns])
    durations = 1.0 + np.arange(len(word))
    most = longer * float(durations.sum())
    paces = paced_trims(twists, twists[:, 0] ** 2, word, durations, most)
    driven = at_two_paces(twists, word, durations, paces, most)
    rows, times = (np.array(column) for column in zip(*driven, strict=True))
    assert times.sum() == pytest.approx(most, rel=1e-9)
    end = coasted(np.zeros(3), twists[word], durations)[-1]
    np.testing.assert_allclose(coasted(np.zeros(3), twists[rows], times)[-1], end, atol=1e-9)


def test_a_word_that_no_pace_follows_is_left_alone():
    twists = np.array([[1.0, 0.0, 0.5], [0.5, 0.0, 0.2], [0.8, 0.0, 0.3]])
    paces = np.array([1]), np.array([2])
    assert at_two_paces(twists, np.array([0]), np.array([1.0]), paces, 9.0) is None


def test_a_choice_says_what_words_are_made_of():
    choice = Chosen(words=(0, 40, 1680), others=(20,))
    priced = trims_at_will(
        GRID, COSTS[0], fixed_time=False, waits=False, min_coast=0.0, choice=choice
    )
    assert priced.library.trims.tolist() == [0, 20, 40, 1680]
    assert set(np.unique(priced.library.arrays.tried.words)) == {0, 2, 3}
    assert priced.library.arrays.n_trims == 4


def test_a_small_library_is_used_as_it_is():
    few = Automaton.of_grid(Unicycle(), [[-1.0, 0.5, 1.0], [-1.0, 0.0, 1.0]])
    priced = trims_at_will(few, COSTS[0], fixed_time=False, waits=False, min_coast=0.0)
    assert priced.library.trims.tolist() == list(range(9))
