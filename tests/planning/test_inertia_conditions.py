"""Vehicles with inertia among obstacles: every condition takes part in the search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.problem import Goal, Problem, SearchSettings
from maneuver_automaton.refinement.improve import WordSchedule, words_of
from maneuver_automaton.search import lattice, lattice_task
from maneuver_automaton.search.lattice import forward_word, reversed_query
from maneuver_automaton.search.lattice_pass import pass_of, plan_of_word
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.lattice_task import LINKED, WEIGHT, Resolution, task_of
from tests.inertia import unicycle_automaton
from tests.quickly import quick_are
from tests.search.cases import compiled_only

pytestmark = compiled_only
WALL = Box([0.6, 2.4], [3.0, 0.0])
BODY = Box([0.5, 0.3])
CORNERS = np.array([[-0.25, -0.15], [0.25, -0.15], [0.25, 0.15], [-0.25, 0.15]])
WORK = SearchSettings(max_expansions=4000)
SLOW = ((0.0, 0.0), (1.0, 0.0), (0.3, 0.0), (0.8, 0.8), (0.8, -0.8))


def counted(expansions):
    return replace(UNLIMITED, expansions=expansions)


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


@pytest.fixture(scope="module")
def usual():
    """The plan without any condition."""
    result = plan(posed(), time_limit=60.0)
    assert result.status is PlanStatus.FOUND
    assert_free(result.plan)
    return result


def test_settings_of_the_lattice_are_read(monkeypatch):
    """The weight is that of the first pass; those that begin after it have their own."""
    settings = SearchSettings(cell=0.31, headings=36, weight=1.3)
    query = lattice_query(posed(search=settings), (0,))
    first = task_of(query, Resolution())
    assert (first.cells.cell, first.cells.headings) == (0.31, 36)
    assert task_of(query, Resolution(scale=0.5)).cells.cell == 0.155
    weights = []
    monkeypatch.setattr(
        lattice, "pass_of", lambda *a, **k: weights.append(a[1].weight) or pass_of(*a, **k)
    )
    stages = ((0, (Resolution(),)), (0, (Resolution(scale=0.5),)))
    monkeypatch.setattr(lattice_task, "LINKED", LINKED._replace(stages=stages, first_chunk=4))
    next(iter(words_of(query, budget=counted(200), schedule=WordSchedule())))
    assert weights == [1.3, WEIGHT]


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


def test_it_says_how_near_it_came():
    """The way into the pocket is long for so few expansions: the reason tells what is missing."""
    walls = [Obstacle(Box(size, middle)) for size, middle in (
        ([0.2, 4.2], [4.0, 0.0]),
        ([4.2, 0.2], [6.0, 2.0]),
        ([4.2, 0.2], [6.0, -2.0]),
    )]  # fmt: skip
    goal = Goal(pose=[6.0, 0.0, 0.0], trim="1, 0")
    result = plan(posed(goal, obstacles=walls, search=SearchSettings(max_expansions=15)))
    assert result.plan is None
    assert result.reason.endswith("rad off")


@pytest.mark.slow
@pytest.mark.parametrize("aside", [0.0, 1.5, -1.5])
@pytest.mark.parametrize("along", quick_are([60.0], [40.0, 60.0, 80.0]))
def test_a_fast_car_passes_a_box(along, aside):
    """Its turns are wide for its size: cells and coasts of that width find the way, soon."""
    box = Box([3.0, 3.0], [along, 0.1 * along + aside])
    problem = Problem(
        load_stock_library("single_track"),
        [0.0, 0.0, 0.0],
        Goal(pose=[120.0, 12.0, 0.1], trim="speed 20, turn_rate 0"),
        start_trim="speed 20, turn_rate 0",
        obstacles=(Obstacle(box),),
        footprint=Box([4.5, 1.6]),
    )
    query = lattice_query(problem, (0,))
    word = next(iter(words_of(query, budget=counted(5000), schedule=WordSchedule())))
    assert word.duration < 6.5


def test_nothing_is_refused_by_the_checks_where_an_obstacle_moves():
    """A path that is free at the pace of a kinematic vehicle is not so at one with inertia."""
    for begin in (0.0, 2.0, 4.0):
        crossing = Obstacle(
            Disc(0.6), motion=Motion([begin, begin + 6.0], [[3.0, -4.0, 0.0], [3.0, 4.0, 0.0]])
        )
        result = plan(posed(obstacles=(crossing,)), time_limit=60.0)
        assert result.status is PlanStatus.FOUND, result.reason
        assert result.counts["rejected"] == 0
        times, bodies = bodies_of(result.plan)
        centers = np.stack([np.interp(times, [begin, begin + 6.0], [v, w]) for v, w in
                            ((3.0, 3.0), (-4.0, 4.0))], axis=1)  # fmt: skip
        assert (shapely.distance(bodies, shapely.points(centers)) > 0.6).all()
