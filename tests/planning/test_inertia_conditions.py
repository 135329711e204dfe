"""Vehicles with inertia among obstacles: every condition takes part in the search."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.collision import Box, Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Problem, SearchSettings
from maneuver_automaton.refinement.improve import WordSchedule, words_of
from maneuver_automaton.search.lattice import forward_word, reversed_query
from maneuver_automaton.search.lattice_pass import plan_of_word
from maneuver_automaton.search.lattice_query import lattice_query
from tests.inertia import unicycle_automaton
from tests.search.cases import compiled_only

pytestmark = compiled_only
WALL = Box([0.6, 2.4], [3.0, 0.0])
BODY = Box([0.5, 0.3])
CORNERS = np.array([[-0.25, -0.15], [0.25, -0.15], [0.25, 0.15], [-0.25, 0.15]])
WORK = SearchSettings(max_expansions=4000)


def counted(expansions):
    return UNLIMITED._replace(expansions=expansions)


def posed(goal=(6.0, 0.0, 0.0), *, states=None, **changes):
    automaton = unicycle_automaton() if states is None else unicycle_automaton(states)
    values = {"obstacles": (Obstacle(WALL),), "footprint": BODY, "search": WORK} | changes
    return Problem(automaton, [0.0, 0.0, 0.0], goal, **values)


def bodies_of(one):
    """The body at a dense sample of a plan, and the times, for shapely."""
    times = np.linspace(0.0, one.duration, 2000)
    return times, shapely.polygons(SE2(one.pose_at(times)[:, None]).act(CORNERS))


def box_of(shape):
    low, high = np.array(shape.center) - np.array(shape.size) / 2, shape.center
    return shapely.box(*low, *(np.array(high) + np.array(shape.size) / 2))


def assert_free(one):
    assert not shapely.intersects(bodies_of(one)[1], box_of(WALL)).any()


def test_a_search_from_the_goal_finds_plans_from_the_start():
    """Every word of the reversed query, turned round, is a free plan of the query."""
    query = lattice_query(posed(), (0,))
    back = reversed_query(query)
    words = list(words_of(back, budget=counted(3000), schedule=WordSchedule()))
    assert words
    for word in words:
        one = plan_of_word(query, forward_word(word))
        np.testing.assert_allclose(one.start, [0.0, 0.0, 0.0])
        np.testing.assert_allclose(one.end, [6.0, 0.0, 0.0], atol=1e-9)
        assert one.duration == pytest.approx(word.duration, abs=1e-6)
        assert_free(one)
