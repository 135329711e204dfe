"""What holds for every search: a moved problem has the moved plan, and more is never costlier."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.choose import search_insertion
from maneuver_automaton.search.words import search_words
from tests.search.cases import (
    REEDS_SHEPP,
    REVERSED_SPIN,
    TABLE_2,
    compiled_only,
    end_off_goal,
    names,
    parking,
    robot,
)

pytestmark = compiled_only  # laws of the search, whoever runs its kernels
SEARCHES = pytest.mark.parametrize("search", [search_words, search_insertion])
FEW = settings(max_examples=20)
NEAR = arrays(np.float64, 3, elements=st.floats(-3.0, 3.0).map(lambda x: round(x, 3)))
FAR = arrays(np.float64, 3, elements=st.floats(-200.0, 200.0))
COSTS = st.builds(
    Cost,
    effort=st.sampled_from([0.0, 1.0]),
    norm=st.sampled_from([0.0, 0.5]),
    time=st.sampled_from([0.1, 1.0]),
)
LIBRARIES = st.sampled_from([TABLE_2, REVERSED_SPIN])


def cheapest(search, problem):
    solutions = search(problem, problem.goals[0]).solutions
    return solutions[0] if solutions else None


def assert_same_cost(one, other):
    """Within what rounding does: at tangent circles times follow only as its square root."""
    assert (one is None) == (other is None)
    if one is not None:
        assert other.cost == pytest.approx(one.cost, rel=1e-6, abs=1e-6)


@SEARCHES
@FEW
@given(library=LIBRARIES, start=NEAR, by=FAR, cost=COSTS)
def test_a_moved_problem_has_the_moved_plan(search, library, start, by, cost):
    problem = replace(parking(library, cost=cost, max_trims=4), start=start)
    moved = problem.moved(SE2(by))
    here, there = cheapest(search, problem), cheapest(search, moved)
    assert_same_cost(here, there)
    if there is not None:
        distance, angle = end_off_goal(moved, there)
        assert distance < 1e-9
        assert angle < 1e-9


@SEARCHES
def test_random_moves_change_neither_word_nor_cost(search):
    rng = np.random.default_rng(0)
    for _ in range(25):
        problem = replace(parking(), start=rng.uniform(-3.0, 3.0, 3))
        by = SE2(rng.uniform(-1.0, 1.0, 3) * [100.0, 100.0, 7.0])
        here, there = cheapest(search, problem), cheapest(search, problem.moved(by))
        assert names(problem, here) == names(problem, there)
        assert there.durations == pytest.approx(here.durations, abs=1e-7)
        assert there.cost == pytest.approx(here.cost, abs=1e-9)


@SEARCHES
@FEW
@given(start=NEAR, turns=st.integers(-3, 3))
def test_whole_turns_of_the_start_change_nothing(search, start, turns):
    problem = replace(parking(), start=start)
    turned = replace(problem, start=start + np.array([0.0, 0.0, 2.0 * np.pi * turns]))
    assert_same_cost(cheapest(search, problem), cheapest(search, turned))


@SEARCHES
@FEW
@given(start=NEAR)
def test_one_more_trim_is_never_dearer(search, start):
    three, four = (replace(parking(max_trims=k), start=start) for k in (3, 4))
    few, more = cheapest(search, three), cheapest(search, four)
    if few is not None:
        assert more.cost < few.cost + 1e-7


@FEW
@given(start=NEAR, cost=COSTS)
def test_insertion_is_never_cheaper_than_an_exhaustive_search(start, cost):
    problem = replace(parking(cost=cost), start=start)
    exhaustive, inserted = (
        cheapest(search, problem) for search in (search_words, search_insertion)
    )
    if inserted is not None:
        assert exhaustive is not None
        assert inserted.cost > exhaustive.cost - 1e-7


@pytest.mark.slow
@SEARCHES
@FEW
@given(start=NEAR, factor=st.sampled_from([0.5, 3.0]))
def test_a_cost_times_a_factor_has_the_same_plan(search, start, factor):
    one = replace(parking(cost=Cost(effort=1.0, time=0.5)), start=start)
    many = replace(one, cost=Cost(effort=factor, time=0.5 * factor))
    here, there = cheapest(search, one), cheapest(search, many)
    if here is not None:
        assert there.cost == pytest.approx(factor * here.cost, rel=1e-6, abs=1e-6)


@FEW
@given(goal=NEAR)
def test_a_mirrored_goal_has_the_mirrored_plan(goal):
    assume(abs(goal[1]) > 1e-3)
    library = robot(REEDS_SHEPP)
    lengths = []
    for mirror in (1.0, -1.0):
        problem = Problem(library, [0, 0, 0], goal * [1.0, mirror, mirror])
        lengths.append(cheapest(search_insertion, problem).cost)
    assert lengths[1] == pytest.approx(lengths[0], abs=1e-6)


@FEW
@given(goal=NEAR)
def test_the_way_back_takes_the_reversed_trims_as_long(goal):
    controls = {name: control for name, control in REEDS_SHEPP.items() if name != "S-"}
    reversed_controls = {name: (-v, -w) for name, (v, w) in controls.items()}
    there = Problem(robot(controls), [0, 0, 0], goal)
    back = Problem(robot(reversed_controls), goal, [0, 0, 0])
    ahead, behind = (
        search_words(problem, problem.goals[0], nodes=48).solutions[0]
        for problem in (
            replace(there, horizon=replace(there.horizon, max_trims=3)),
            replace(back, horizon=replace(back.horizon, max_trims=3)),
        )
    )
    assert behind.cost == pytest.approx(ahead.cost, rel=1e-6, abs=1e-6)
