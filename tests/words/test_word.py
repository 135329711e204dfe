"""Words as values, and as plans."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle
from maneuver_automaton.words import Word
from maneuver_automaton.words.library import library_of
from maneuver_automaton.words.transitions import SWITCH
from maneuver_automaton.words.word import plan_of, with_price, word_of_steps
from tests.search.automata import linked

ROBOT = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "left": (1.0, 1.0)})


def test_a_kinematic_word_switches_everywhere():
    word = Word(trims=[0, 1, 0], durations=[1.0, 2.0, 0.5])
    assert word.transitions.tolist() == [SWITCH, SWITCH]
    assert word.duration == 3.5
    assert not word.durations.flags.writeable
    assert not word.trims.flags.writeable
    assert Word(trims=[], durations=[]).transitions.tolist() == []


def test_trims_of_no_time_beside_switches_vanish_and_equal_neighbours_join():
    steps = [(SWITCH, 0, 1.0), (SWITCH, 1, 0.0), (SWITCH, 0, 0.0), (SWITCH, 0, 2.0)]
    word = with_price(library_of(ROBOT), word_of_steps(steps, goal=0))
    assert (word.trims.tolist(), word.durations.tolist(), word.cost) == ([0], [3.0], 3.0)


def test_trims_of_no_time_between_maneuvers_stay():
    automaton = linked([[1.0, 0, 0], [1.0, 0, 1.0], [0.5, 0, 0]])
    library = library_of(automaton)
    (into, _), (out, _) = library.chain(0, 1)[0], library.chain(1, 2)[0]
    steps = [(SWITCH, 0, 1.0), (into, 1, 0.0), (out, 2, 0.0), (SWITCH, 2, 2.0)]
    word = with_price(library, word_of_steps(steps, goal=0))
    assert word.trims.tolist() == [0, 1, 2]
    lasting = sum(automaton.maneuvers[k].duration for k in (into, out))
    assert word.maneuver_time == pytest.approx(lasting)
    assert word.duration == pytest.approx(3.0 + lasting)
    assert with_price(library, word).cost == pytest.approx(3.0 + lasting)


@pytest.mark.parametrize("free_heading", [False, True])
def test_a_plan_ends_at_the_goal_and_a_moved_word_is_the_same_plan_moved(free_heading):
    automaton = linked([[1.0, 0, 0], [1.0, 0, 1.0], [0.5, 0.2, -0.7], [0.8, 0, 0]])
    library = library_of(automaton)
    links = [library.chain(a, b)[0][0] for a, b in ((0, 1), (1, 2), (2, 3))]
    word = Word(trims=[0, 1, 2, 3], durations=[1.0, 0.7, 1.2, 2.0], transitions=links)
    exact = plan_of(automaton, word, np.zeros(3))
    goal = exact.end + np.array([0.05, -0.03, 0.8 if free_heading else 0.02])
    plan = plan_of(automaton, word, np.zeros(3), goal=goal, free_heading=free_heading)
    off = plan.end - goal
    assert np.abs(off[:2]).max() < 1e-12
    assert free_heading or abs(off[2]) < 1e-12
    move = SE2([5.0, -3.0, 2.0])
    there = plan_of(
        automaton,
        word,
        move.pose,
        goal=(move @ SE2(goal)).pose,
        free_heading=free_heading,
    )
    assert there.durations == pytest.approx(plan.durations, abs=1e-9)
    assert there.end == pytest.approx((move @ SE2(plan.end)).pose, abs=1e-9)
