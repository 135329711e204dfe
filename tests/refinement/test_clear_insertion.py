"""Insertion with clearance: sections of a word improved by all trims of a large library."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.collision import Box, Disc, Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Bounds, Horizon, Problem
from maneuver_automaton.refinement.clear_insertion import Whole, paced
from maneuver_automaton.search.lattice import first_plan
from maneuver_automaton.search.lattice_pass import plan_of_word, with_cost
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.lattice_trims import stands_for_more
from maneuver_automaton.search.waiting import is_free
from maneuver_automaton.words.transitions import SWITCH
from tests.search.cases import compiled_only
from tests.solids import check_plan

pytestmark = compiled_only
AXIS = np.round(np.linspace(-1.0, 1.0, 21), 12)
GRID = Automaton.of_grid(Unicycle(), [AXIS, AXIS])
BLOCKS = (Obstacle(Box([1.0, 0.4], [2.0, 0.2])), Obstacle(Disc(0.4, [3.4, -0.9])))
PROBLEM = Problem(
    GRID, [0, 0, 0], [4.5, 0.5, 0.5], obstacles=BLOCKS, footprint=(Box([0.5, 0.4]),),
    cost=Cost(time=1.0, effort=1.0),
)  # fmt: skip


def begun(problem):
    query = lattice_query(problem, (0,))
    return query, with_cost(first_plan(query).word, query)


def unshortened(query, word):
    return word


def gains(whole, word, *, step=16):
    return list(whole.gains(word, step=step, budget=UNLIMITED, shorten=unshortened))


@pytest.mark.parametrize(
    "problem",
    [
        PROBLEM,
        replace(PROBLEM, cost=Cost(time=1.0)),
        replace(PROBLEM, cost=Cost(effort=1.0), horizon=Horizon(time=14.0)),
        replace(PROBLEM, horizon=Horizon(max_trims=5)),
        replace(PROBLEM, horizon=Horizon(min_coast=0.2)),
        replace(PROBLEM, bounds=Bounds(x=(-0.5, 5.0), y=(-1.2, 1.2))),
    ],
    ids=["mixed", "time", "fixed time", "max_trims", "min_coast", "bounds"],
)
def test_every_gain_is_cheaper_free_and_ends_at_the_goal(problem):
    query, word = begun(problem)
    query, word = paced(query, word)
    last, found = word.cost, gains(Whole(query), word)
    assert found
    for one in found:
        assert one.cost < last
        last = one.cost
        plan = plan_of_word(query, one)
        assert check_plan(problem, plan, 0).passes(problem, 0)
        assert problem.cost_of(plan) == pytest.approx(one.cost + query.padding, rel=1e-7)
        if problem.horizon.max_trims is not None:
            assert len(one.trims) <= problem.horizon.max_trims
        assert one.durations.min() >= problem.horizon.min_coast
        assert one.duration <= query.most_time


def test_the_gains_go_on_from_where_they_stood():
    query, word = begun(PROBLEM)
    once, twice = Whole(query), Whole(query)
    whole = gains(once, word, step=16)
    parts = gains(twice, word, step=8) + gains(twice, word, step=8)
    assert [one.cost for one in whole] == [one.cost for one in parts]
    assert once.attempts == twice.attempts


def test_nothing_more_is_tried_once_nothing_is_gained():
    query, word = begun(PROBLEM)
    whole = Whole(query)
    while gains(whole, word, step=32):
        pass
    spent = whole.attempts
    gains(whole, word, step=64)
    gains(whole, word, step=64)
    assert whole.attempts <= spent + 300


def test_small_libraries_are_left_alone():
    few = Automaton.of_grid(Unicycle(), [[-1.0, 1.0], [-1.0, 0.0, 1.0]])
    query, word = begun(replace(PROBLEM, automaton=few))
    assert not stands_for_more(query.problem)
    limited = replace(PROBLEM, automaton=few, horizon=Horizon(max_time=20.0))
    query, word = begun(limited)
    assert paced(query, word) == (query, word)


@given(st.integers(0, 10_000))
def test_a_word_is_free_where_shapely_sees_it_far_and_blocked_where_it_hits(seed):
    rng = np.random.default_rng(seed)
    query = lattice_query(replace(PROBLEM, bounds=Bounds(x=(-3.0, 5.0), y=(-3.0, 3.0))), (0,))
    trims = rng.choice(query.library.trims, 3)
    times = rng.uniform(0, 2, 3)
    steps = [(SWITCH, int(trim), float(t)) for trim, t in zip(trims, times, strict=True)]
    word = query.word_of(steps, 0)
    trims = tuple(query.automaton.trims[k] for k in word.trims)
    plan = Plan(query.problem.start, trims, durations=word.durations)
    checked = check_plan(query.problem, plan, 0, step_m=0.002, step_rad=0.002)
    inside = checked.outside_m <= 1e-9
    if is_free(query, word):
        assert checked.clearance_m > 0.0
        assert inside
    else:
        assert checked.clearance_m < 0.02 or not inside or near_rim(query.problem, plan)


def near_rim(problem, plan):
    """Whether a plan comes within the bulge that pieces of arcs are given."""
    places = plan.sample(max_step_m=0.01).pose[:, :2]
    low = [problem.bounds.x[0], problem.bounds.y[0]]
    high = [problem.bounds.x[1], problem.bounds.y[1]]
    return bool(np.minimum(places - low, high - places).min() < 0.02)
