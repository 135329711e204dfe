"""Words of free space, for vehicles that switch at will and for others, through one function."""

from __future__ import annotations

import pytest

from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Disc, Obstacle
from maneuver_automaton.planning.free_space import free_words, word_candidate, words_once
from maneuver_automaton.planning.incumbents import Incumbents
from maneuver_automaton.planning.result import Workspace
from maneuver_automaton.problem import Goal, Problem, SearchSettings
from tests.inertia import unicycle_automaton
from tests.search.cases import TABLE_2, compiled_only, robot

pytestmark = compiled_only
GOALS = (Goal(pose=[3.0, 1.0, 0.3]), Goal(pose=[2.0, -1.0, 0.0]))
AUTOMATA = {"at will": robot(TABLE_2), "by maneuvers": unicycle_automaton()}


def incumbents(name, **changes):
    problem = Problem(
        AUTOMATA[name],
        [0, 0, 0],
        GOALS,
        search=SearchSettings(max_expansions=400),
        **changes,
    )
    budget = Budget.from_now(600.0, expansions=400)
    return Incumbents(problem, budget, Workspace(problem.obstacles))


@pytest.mark.parametrize("name", AUTOMATA)
def test_every_goal_has_its_words_each_once(name):
    found = incumbents(name)
    words = list(words_once(free_words(found, (1, 0), others=2)))
    assert [index for _, index in words] == sorted((index for _, index in words), reverse=True)
    assert {index for _, index in words} == {0, 1}
    assert len({id(word) for word, _ in words}) == len(words)
    for word, index in words:
        one = word_candidate(found.problem, word, index)
        assert (one.goal_index, one.cost) == (index, word.cost)
        assert found.problem.cost_of(one.plan()) == pytest.approx(word.cost)
        assert max(GOALS[index].off(one.plan().end)) < 1e-9


@pytest.mark.parametrize("name", AUTOMATA)
def test_words_look_at_no_obstacle(name):
    free, among = incumbents(name), incumbents(name, obstacles=(Obstacle(Disc(0.4, [1.0, 0.0])),))
    costs = [
        [word.cost for word, _ in words_once(free_words(one, (0,), others=2))]
        for one in (free, among)
    ]
    assert costs[0] == costs[1] != []
