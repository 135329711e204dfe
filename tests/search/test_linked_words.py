"""Words of trims and maneuvers: against all words from many starts, and by laws."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.linked_words import scan_linked_words, steer_linked_words
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.search.word_setup import word_setup
from tests.inertia import car_automaton, unicycle_automaton
from tests.search.cases import compiled_only

pytestmark = compiled_only  # whole searches; their kernels have tests of their own

SMALL = ((0.0, 0.0), (1.0, 0.0), (0.8, 0.8), (0.8, -0.8))


def problem(goal, *, automaton=None, **changed) -> Problem:
    return Problem(automaton or unicycle_automaton(), [0.0, 0.0, 0.0], goal, **changed)


def searched(one: Problem, **options):
    return scan_linked_words(one, one.goals[0], **options)


def by_brute_force(one: Problem, most_trims: int, starts: int):
    """Cheapest cost over all words, each from many random times."""
    setup = word_setup(one, one.goals[0], most_trims=99)
    moving = [k for k, trim in enumerate(one.automaton.trims) if not trim.is_rest]
    rng = np.random.default_rng(0)
    best = np.inf
    for n in range(1, most_trims + 1):
        for word in itertools.product(moving, repeat=n):
            if any(a == b for a, b in itertools.pairwise(word)):
                continue
            for _ in range(starts):
                found = setup.solved(word, [rng.exponential(1.5, n)])
                best = best if found is None else min(best, found.cost)
    return best


@pytest.mark.parametrize("goal", [[0.0, 3.0, 0.0], [4.0, 1.0, 1.0], [-2.0, 1.0, 3.0]])
def test_nothing_cheaper_is_found_by_brute_force(goal):
    one = problem(goal, automaton=unicycle_automaton(SMALL))
    best = searched(one).solutions[0]
    assert best.cost <= by_brute_force(one, 4, 6) + 1e-6


@compiled_only
@pytest.mark.parametrize("make", [unicycle_automaton, car_automaton])
def test_every_plan_passes_the_audit(make):
    one = problem([3.0, 2.0, 1.0], automaton=make())
    result = searched(one, alternatives=4)
    assert len(result.solutions) == 5
    costs = [s.cost for s in result.solutions]
    assert costs == sorted(costs)
    rest = one.automaton["rest"].reduced_state
    for solution in result.solutions:
        plan = plan_of(one, solution)
        audit = audit_plan(plan, one.goals[0], one.automaton.model, states=(rest, rest))
        assert audit.passed, audit.reason
        assert solution.cost == pytest.approx(plan.duration, abs=1e-9)  # the cost is time


@given(
    x=st.floats(-3.0, 3.0),
    y=st.floats(-3.0, 3.0),
    turn=st.floats(-3.0, 3.0),
    free=st.booleans(),
    by=st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-4.0, 4.0)),
)
@settings(max_examples=10)
def test_a_moved_problem_has_the_moved_words(x, y, turn, free, by):
    goal = Goal([x, y, turn], free_heading=free)
    one = problem(goal, automaton=unicycle_automaton(SMALL))
    moved = one.moved(SE2(by))
    for search, most in ((scan_linked_words, {"max_trims": 3}), (steer_linked_words, {})):
        here, there = (search(p, p.goals[0], **most).solutions for p in (one, moved))
        assert len(here) == len(there)
        if here:
            assert there[0].cost == pytest.approx(here[0].cost, abs=1e-5)


@pytest.mark.parametrize("switch", [0.3, 20.0])
def test_prices_of_switches_prune_words_and_miss_none(switch):
    one = problem([4.0, 1.0, 1.0], cost=Cost(time=1.0, switch=switch))
    every, cheapest = searched(one, alternatives=None), searched(one)
    least = min(word.cost for word in every.solutions)
    assert cheapest.solutions[0].cost == pytest.approx(least, rel=1e-9)
    assert 2 * cheapest.counts["steering_calls"] < every.counts["steering_calls"]
