"""Improving a word with maneuvers: cut where the state is known, and joined by transitions."""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.refinement import improve as improvement
from maneuver_automaton.refinement import work
from maneuver_automaton.refinement.improve import Patience, WordSchedule, words_of
from maneuver_automaton.search.lattice_pass import plan_of_word
from maneuver_automaton.words.library import SWITCH
from maneuver_automaton.words.word import word_of_steps
from tests.refinement.test_incumbent_words import GOAL, WALLS, least_clearance, off_goal, query
from tests.search.cases import compiled_only
from tests.search.maneuver_searches import word_is_free

pytestmark = compiled_only


@functools.cache
def first_word():
    """The first word past the walls, as the lattice finds it."""
    counted = replace(UNLIMITED, expansions=600)
    return next(iter(words_of(query(), budget=counted, schedule=WordSchedule())))


def improving(word, **changes):
    counted, schedule = (
        replace(UNLIMITED, expansions=0),
        WordSchedule(patience=Patience(), **changes),
    )
    return words_of(query(), budget=counted, schedule=schedule, known=word)


def assert_sound(word):
    """Free, from the start to the goal, from trim to trim, each where a maneuver leaves it."""
    here = query()
    plan = plan_of_word(here, word)
    assert off_goal(plan, GOAL) < 1e-12
    assert least_clearance(plan, WALLS) > 0.0
    assert word_is_free(here, word)
    assert plan.trims[0].name == plan.trims[-1].name == "0 0"
    assert plan.duration == pytest.approx(word.duration, abs=1e-6)
    maneuvers = here.automaton.maneuvers
    for k, (before, after) in enumerate(itertools.pairwise(plan.trims)):
        held = word.transitions[k]
        ends = (before.name, after.name)
        assert held != SWITCH
        assert (maneuvers[held].source, maneuvers[held].target) == ends


@pytest.mark.slow
def test_every_gain_is_a_sound_word_and_cheaper():
    """Without a new search, shortcuts and via-points alone."""
    first = first_word()
    gains = list(improving(first))
    costs = [first.cost, *(word.cost for word in gains)]
    assert gains
    assert all(b < a for a, b in itertools.pairwise(costs))
    for word in (first, *gains):
        assert_sound(word)


def test_the_same_twice_to_the_last_bit():
    one, other = (list(improving(first_word()))[-1] for _ in range(2))
    assert one.cost.hex() == other.cost.hex()
    assert one.durations.tobytes() == other.durations.tobytes()


def test_attempts_gain_beyond_the_dynamic_program(monkeypatch):
    def cost(attempts):
        monkeypatch.setattr(improvement, "SLICE", attempts)
        return list(improving(first_word()))[-1].cost

    assert cost(4000) < cost(0)


def test_points_lie_in_coasts_from_the_begin_to_the_end():
    """Between maneuvers, at both their ends, and the last at the end, whatever rounding says."""
    here, word = query(), first_word()
    lasting = [here.automaton.maneuvers[k].duration for k in word.transitions]
    begins = np.cumsum(np.append(0.0, word.durations[:-1] + lasting))
    ends = begins + word.durations
    for cut in (0.0, 0.3, 0.9):
        times = work.point_times(here, word, cut)
        assert times[0] == 0.0
        assert times[-1] == pytest.approx(word.duration, rel=1e-12)
        assert (np.diff(times) > 0.0).all()
        inside = (begins[:, None] <= times + 1e-9) & (times <= ends[:, None] + 1e-9)
        assert inside.any(axis=0).all()
        for moment in (*begins, *ends):
            assert np.abs(times - moment).min() < 1e-9


def test_the_last_point_is_the_end_of_every_word():
    """Where the time between points times their number is not quite the whole."""
    here = query(obstacles=())
    rest = here.automaton.index_of("0 0")
    for total in np.random.default_rng(3).uniform(0.1, 50.0, 200).tolist():
        word = word_of_steps([(SWITCH, rest, total)], goal=0)
        assert work.point_times(here, word, 0.0)[-1] == total


@pytest.mark.slow
def test_a_word_that_rests_on_the_way_is_cut_short():
    """What lasts no time does not hinder: a rest of 5 s in the middle is left out."""
    here, first = query(), first_word()
    rest = here.automaton.index_of("0 0")
    steps = [(SWITCH, rest, 5.0)]
    chain = zip(
        (SWITCH, *first.transitions.tolist()),
        first.trims.tolist(),
        first.durations.tolist(),
        strict=True,
    )
    slow = here.word_of([*steps, *chain], 0)
    few = here.library.arrays.library.tried.n_few
    better = work.shortcut(here, slow, n_words=few, cut=0.0)
    assert better.cost <= first.cost + 1e-9
    assert_sound(better)
