"""Plans as they come: each better, each audited, the last one the answer of `plan`."""

from __future__ import annotations

import itertools
import threading
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton import load_scenario
from maneuver_automaton.planning import PlanStatus, plan, plans
from tests.quickly import quick_are

ROOM = "scenarios/cluttered_room.yaml"


def counted(problem, n=3000):
    """The problem with the same sequence of plans at every call."""
    return replace(problem, search=replace(problem.search, max_expansions=n))


@pytest.mark.parametrize(
    "name",
    quick_are(
        ["cluttered_room", "parking"], ["cluttered_room", "parking", "trailer"], exhaustive=True
    ),
)
def test_each_is_better_and_audited_and_the_last_is_the_answer(name):
    problem = counted(load_scenario(f"scenarios/{name}.yaml").problem, 1000)
    *before, last = plans(problem, time_limit=60.0)
    assert last.cost == plan(problem, time_limit=60.0).cost
    for result in (*before, last):
        assert result.audit.passed
        assert result.cost == problem.cost_of(result.plan)
        assert result.lower_bound <= last.cost
    assert all(b.cost < a.cost for a, b in itertools.pairwise(before))
    assert not before or before[-1].cost == last.cost


def test_a_loop_that_is_left_ends_the_search():
    threads = threading.active_count()
    for better in plans(load_scenario(ROOM).problem, time_limit=600.0):
        assert better.audit.passed
        break
    assert threading.active_count() == threads


def test_without_a_plan_the_answer_says_why():
    problem = load_scenario(ROOM).problem
    inside = replace(problem, start=np.array([14.9, 14.9, 0.0]))
    (only,) = plans(inside, time_limit=5.0)
    assert only.status is not PlanStatus.FOUND
    assert only.reason


def test_a_callback_gets_what_the_iterator_gives():
    problem, seen = counted(load_scenario(ROOM).problem), []
    last = plan(problem, time_limit=60.0, on_better=seen.append)
    assert [one.cost for one in seen] == [
        one.cost for one in [*plans(problem, time_limit=60.0)][:-1]
    ]
    assert seen[-1].cost == last.cost


def test_wrong_arguments_are_told_at_the_first_plan():
    with pytest.raises(ValueError, match=r"time_limit must be positive, got 0\.0 s"):
        next(plans(load_scenario(ROOM).problem, time_limit=0))
