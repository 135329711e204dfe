"""A word as the search sees it, from before its transitions, against conjugation step by step."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton._compile import kernel
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search import _kernels_problem as kernels
from maneuver_automaton.search._kernels_scan_costs import least_after, least_per_metre
from maneuver_automaton.search.result import TimedWord, plan_of
from maneuver_automaton.search.setup import search_setup
from maneuver_automaton.search.word_scan import WordScan
from maneuver_automaton.search.word_setup import word_setup
from maneuver_automaton.words.closing import conjugated, conjugated_turn, goal_before
from tests.inertia import unicycle_automaton
from tests.search.cases import parking

CONTROLS = ((0.0, 0.0), (1.0, 0.0), (0.8, 0.8), (0.8, -0.8))


@kernel
def looked_at(problem, links, word, rows):
    """`look` for Python: it counts no references, so that only kernels may call it."""
    seen = kernels.room_for(problem, word.size)
    kernels.look_ahead(problem, links, seen, word, word.size)
    kernels.look(problem, links, seen, word, word.size, rows)
    return seen


@kernel
def least_cost_after(seen, rows, time):
    """`least_after` for Python, of the first trim of a word that is seen."""
    per_metre = least_per_metre(seen, rows, rows.size, 0)
    return least_after(seen, rows[0], time, per_metre)


@kernel
def price_of_transitions(links, word, tail):
    """`transitions_cost` for Python."""
    return kernels.transitions_cost(links, word, word.size, tail)


def searched(goal: Goal):
    """The setup of a search for a goal, and its kernels' problem and transitions."""
    one = Problem(unicycle_automaton(CONTROLS), [0.0, 0.0, 0.0], goal)
    setup = word_setup(one, goal, most_trims=99)
    return setup, next(WordScan(one, setup.as_search(), 4, 0).modes()).kernel_problem


@pytest.mark.parametrize("word", [[0, 1, 2], [2, 0], [1, 2, 0, 1]])
@pytest.mark.parametrize("free", [False, True])
def test_a_word_is_seen_as_its_conjugation(word, free):
    goal = Goal(pose=[3.0, 2.0, 1.0], free_heading=free)
    setup, (problem, links) = searched(goal)
    rows = np.zeros(len(word) + free, dtype=np.int64)
    seen = looked_at(problem, links, np.array([*word, problem.tail] if free else word), rows)
    trims = setup.as_search().library.trims[word].tolist()
    steps = setup.library.displacements([setup.start_trim, *trims, setup.goal_trim])[:, :3]
    own = setup.library.arrays.twists[trims, :3]
    twists, product = conjugated(np.vstack([np.zeros(3), own]), steps)
    assert rows.tolist() == list(range(len(rows)))
    np.testing.assert_allclose(seen.library.twists[: len(word), :3], twists[1:], atol=1e-12)
    if free:
        np.testing.assert_allclose(
            seen.library.twists[-1, :3], conjugated_turn(product), atol=1e-12
        )
    before = goal_before(goal.pose, product)
    np.testing.assert_allclose(seen.library.goal[:2], before[:2], atol=1e-12)
    assert np.cos(seen.library.goal[2] - before[2]) == pytest.approx(1.0, abs=1e-12)
    assert seen.fixed[:2].tolist() == pytest.approx(setup.fixed(trims))


def test_the_transitions_of_a_word_are_priced_before_it_is_seen():
    setup, (problem, links) = searched(Goal(pose=[3.0, 2.0, 1.0]))
    trims = setup.as_search().library.trims[[0, 2, 1]].tolist()
    priced = price_of_transitions(links, np.array([0, 2, 1]), problem.tail)
    assert priced == pytest.approx(setup.fixed(trims)[0])


@given(st.permutations(range(3)), st.lists(st.floats(0.0, 5.0), min_size=3, max_size=3))
def test_a_word_coasts_for_no_less_than_its_first_trim_leaves_to_do(word, times):
    """To wherever these times lead: the bound holds for them, as for all that lead there."""
    one = Problem(unicycle_automaton(CONTROLS), [0.0, 0.0, 0.0], Goal(pose=[1.0, 0.0, 0.0]))
    setup = word_setup(one, one.goals[0], most_trims=99)
    trims = setup.as_search().library.trims[list(word)]
    end = plan_of(one, setup.word(TimedWord(tuple(trims.tolist()), np.array(times)))).end
    setup, (problem, links) = searched(Goal(pose=end))
    rows = np.zeros(3, dtype=np.int64)
    seen = looked_at(problem, links, np.array(word), rows)
    cost = float(setup.library.arrays.rates[trims] @ times)
    assert least_cost_after(seen, rows, times[0]) <= cost + 1e-9


def test_a_trim_does_not_follow_itself():
    _, (problem, links) = searched(Goal(pose=[3.0, 2.0, 1.0]))
    assert price_of_transitions(links, np.array([1, 0, 0]), problem.tail) == np.inf


def test_a_kinematic_vehicle_has_one_transition_the_identity():
    one = parking()
    problem, links = next(
        WordScan(one, search_setup(one, one.goals[0]), 3, 0).modes()
    ).kernel_problem
    assert links.displacement.tolist() == [[[0.0, 0.0, 0.0, 0.0]]]
    assert links.cost.tolist() == links.time.tolist() == [[0.0]]
    assert problem.fixed[:2].tolist() == [0.0, 0.0]
