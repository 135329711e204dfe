"""Local search over words with maneuvers, and the planner made of it and of exhaustive search."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search.choose import search_insertion
from maneuver_automaton.search.linked_insertion import improve_linked_words
from maneuver_automaton.search.linked_words import scan_linked_words
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.search.word_setup import word_setup
from maneuver_automaton.words.word import Word
from tests.inertia import car_automaton, unicycle_automaton
from tests.search.cases import compiled_only, lasting

GOALS = ([0.0, 3.0, 0.0], [5.0, 1.0, 1.0], [0.5, 0.0, 0.0], [-3.0, 2.0, 3.14])
FEW = ((0.0, 0.0), (1.0, 0.0), (0.8, 0.8), (0.8, -0.8))
pytestmark = compiled_only


def posed(goal, automaton=None, **changed) -> Problem:
    return Problem(automaton or unicycle_automaton(), [0.0, 0.0, 0.0], goal, **changed)


def improved(one: Problem, seeds) -> Word:
    """The cheapest word that insertion makes of some."""
    stages = improve_linked_words(one, one.goals[0], seeds)
    return min((word for stage in stages for word in stage.solutions), key=lambda word: word.cost)


@pytest.mark.parametrize("goal", GOALS)
def test_insertion_never_ends_dearer_than_it_began(goal):
    one = posed(goal)
    seeds = scan_linked_words(one, one.goals[0], alternatives=3, max_trims=3).solutions
    best = improved(one, seeds)
    plan = plan_of(one, best)
    assert best.cost <= seeds[0].cost + 1e-9
    assert max(one.goals[0].off(plan.end)) < 1e-9
    assert one.cost_of(plan) == pytest.approx(best.cost, abs=1e-9)


@pytest.mark.parametrize("goal", GOALS)
def test_no_single_change_is_cheaper_at_the_end(goal):
    one = posed(goal, unicycle_automaton(FEW))
    seeds = scan_linked_words(one, one.goals[0], max_trims=3).solutions
    best = improved(one, seeds)
    setup = word_setup(one, one.goals[0], most_trims=99)
    timed = setup.timed(best)
    n = len(timed.trims)
    for k in range(n + 1):
        for trim in (1, 2, 3):
            for after in (k, k + 1):
                word = (*timed.trims[:k], trim, *timed.trims[after:])
                if any(a == b for a, b in itertools.pairwise(word)):
                    continue
                times = np.concatenate([timed.durations[:k], [0.25], timed.durations[after:]])
                other = setup.solved(word, [times])
                assert other is None or other.cost > best.cost - 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("goal", GOALS)
def test_with_exhaustive_search_it_is_as_cheap_as_all_words_of_four_trims(goal):
    one = posed(goal, unicycle_automaton(FEW))
    both = search_insertion(one, one.goals[0])
    words = scan_linked_words(one, one.goals[0], max_trims=4)
    assert both.solutions[0].cost <= words.solutions[0].cost + 1e-9


def test_the_planners_alternatives_differ_and_pass_the_audit():
    one = posed([5.0, 1.0, 1.0], car_automaton())
    result = search_insertion(one, one.goals[0], alternatives=4)
    rest = one.automaton["rest"].reduced_state
    assert len(result.solutions) == 5
    assert len({(s.trims.tobytes(), s.durations.round(6).tobytes()) for s in result.solutions}) == 5
    for plan in (plan_of(one, word) for word in result.solutions):
        audit = audit_plan(plan, one.goals[0], one.automaton.model, states=(rest, rest))
        assert audit.passed, audit.reason


def test_a_moved_problem_has_the_moved_plan():
    one = posed([2.0, 1.0, 0.5])
    moved = one.moved(SE2([10.0, -3.0, 2.0]))
    here, there = (search_insertion(p, p.goals[0]).solutions[0] for p in (one, moved))
    assert there.trims.tolist() == here.trims.tolist()
    assert np.abs(there.durations - here.durations).max() < 1e-6


def test_limits_hold():
    one = posed([5.0, 1.0, 1.0], horizon=Horizon(max_trims=4, max_time=9.0))
    result = search_insertion(one, one.goals[0], alternatives=3)
    for solution in result.solutions:
        assert len(lasting(solution)[0]) <= 4
        assert solution.duration == pytest.approx(plan_of(one, solution).duration)
        assert solution.duration <= 9.0 + 1e-8


@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize("time", [None, 30.0])
def test_a_word_under_work_comes_back_from_the_whole_word(goal, time):
    """Padding and the trims that chains lead through are left out, and the motion is the same."""
    one = posed(goal, horizon=Horizon(time=time))
    setup = word_setup(one, one.goals[0], most_trims=99)
    for word in scan_linked_words(one, one.goals[0], alternatives=5).solutions:
        timed = setup.timed(word)
        assert setup.word(timed).trims.tolist() == word.trims.tolist()
        assert setup.word(timed).durations == pytest.approx(word.durations, abs=1e-12)
        passed = np.count_nonzero(timed.durations == 0.0)
        assert passed <= np.count_nonzero(word.durations == 0.0) - 2 + (time is not None)


def test_a_time_limit_ends_the_search_with_what_it_has():
    one = posed([5.0, 1.0, 1.0], car_automaton())
    assert search_insertion(one, one.goals[0], budget=Budget.from_now(0.05)).solutions
