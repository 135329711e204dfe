"""Bounds of what a word costs while one time lies in a cell, and searches that leave cells out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton._compile import kernel
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups.chain import coasted
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search import search_words
from maneuver_automaton.search._kernels_cell_costs import closed_form, least_costs
from maneuver_automaton.search.setup import search_setup
from maneuver_automaton.search.word_scan import WordScan
from tests.search.cases import REEDS_SHEPP, TABLE_2, compiled_only, parking, robot

TRIPLES = {0: [1, 2, 3], 1: [0, 2, 3], 2: [0, 1, 3]}  # positions that are solved for, by the free
SPEEDS = st.sampled_from([0.0, 1.0, -0.25, 1.5]) | st.floats(-2.0, 2.0)


@kernel
def bound(problem, word, triple, q, low, high):
    """`least_costs` for Python: the cheaper branch."""
    return min(least_costs(closed_form(problem, word, triple, q), low, high))


def kernel_problem(twists, rates, goal):
    one = parking()
    problem, _ = next(WordScan(one, search_setup(one, one.goals[0]), 3, 0).modes()).kernel_problem
    library = problem.library._replace(twists=twists, rates=rates, goal=goal)
    return problem._replace(library=library)


def bounded(twists, times, rates, q, before, after):
    """The bound for a cell about one time of a word, to wherever its times lead; and its cost."""
    goal = coasted(np.zeros(3), twists[:, :3], times)[-1]
    problem = kernel_problem(twists, rates, np.append(goal, 0.0))
    low, high = max(times[q] - before, 0.0), times[q] + after
    word, triple = np.arange(4), np.array(TRIPLES[q])
    return bound(problem, word, triple, q, low, high), float(rates @ times)


def admitted(twists, q):
    """Whether a bound is known: at most one straight is solved for, no turn lies between."""
    turning = twists[:, 2] != 0.0
    return np.count_nonzero(~turning[TRIPLES[q]]) <= 1 and (q == 0 or not turning[q])


def within_a_turn(twists, shares):
    """Times that are these shares of a turn, and of 5 s for straights."""
    turns = np.abs(twists[:, 2])
    return shares * np.where(turns > 0.0, 2.0 * np.pi / np.where(turns > 0.0, turns, 1.0), 5.0)


@given(st.data())
def test_a_word_costs_no_less_than_the_bound_of_its_cell(data):
    twists = np.zeros((4, 4))
    for k in range(4):
        turn = data.draw(st.sampled_from([0.0, 1.0, -1.0, 0.5]) | st.floats(0.05, 2.0))
        twists[k, :3] = data.draw(SPEEDS), data.draw(st.sampled_from([0.0, 0.3])), turn
    q = data.draw(st.sampled_from([0, 1, 2]))
    shares = np.array([data.draw(st.floats(0.0, 0.999)) for _ in range(4)])
    rates = np.array([data.draw(st.floats(0.0, 4.0)) for _ in range(4)])
    if not admitted(twists, q):
        return
    times = within_a_turn(twists, shares)
    width = data.draw(st.floats(0.0, 2.0))
    least, cost = bounded(twists, times, rates, q, width, data.draw(st.floats(0.0, 2.0)))
    assert least <= cost + 1e-9 * (1.0 + cost)


def test_bounds_of_small_cells_are_close():
    """Random words: never above the cost, and as good as the cost for the cheaper branch."""
    rng = np.random.default_rng(5)
    gaps = []
    for _ in range(400):
        twists = np.zeros((4, 4))
        twists[:, 0] = rng.choice([1.5, -0.25, 0.5], 4)
        twists[:, 2] = rng.choice([1.0, -1.0, 0.7], 4)
        twists[rng.integers(0, 4), 2] = 0.0
        q = int(rng.integers(0, 3))
        if not admitted(twists, q):
            continue
        times = within_a_turn(twists, rng.uniform(0.02, 0.4, 4))
        wide, cost = bounded(twists, times, np.ones(4), q, 0.2, 0.2)
        narrow, _ = bounded(twists, times, np.ones(4), q, 1e-7, 1e-7)
        assert 0.0 <= wide <= narrow + 1e-9 <= cost + 2e-9
        gaps.append(1.0 - narrow / cost)
    assert len(gaps) > 100
    assert np.median(gaps) < 1e-4  # a rare one is the other branch, or a turn from none to a full


@compiled_only
@pytest.mark.parametrize("controls", [TABLE_2, REEDS_SHEPP])
def test_a_known_plan_leaves_out_no_word_that_is_cheaper(controls):
    """The search that knows an upper bound lists what the complete one has below it."""
    rng = np.random.default_rng(11)
    automaton = robot(controls)
    cost = Cost(effort=1.0, time=1.0)
    for _ in range(25):
        goal = [*rng.uniform(-2.0, 2.0, 2), rng.uniform(-np.pi, np.pi)]
        one = Problem(automaton, [0.0, 0.0, 0.0], goal, cost=cost, horizon=Horizon(max_trims=4))
        everything = search_words(one, one.goals[0], alternatives=None).solutions
        for rank in (0, 3):
            most = everything[rank].cost * (1.0 + 1e-7)
            found = search_words(one, one.goals[0], alternatives=rank, upper_bound=most).solutions
            costs = [word.cost for word in everything[: rank + 1]]
            assert [word.cost for word in found] == pytest.approx(costs, rel=1e-12)
            assert found[0].trims.tolist() == everything[0].trims.tolist()
