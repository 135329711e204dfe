"""The checker is shown steps that break each promise, and has to see it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.problem import Goal, Horizon
from maneuver_automaton.receding_horizon import Guarantee, Promises, promises
from maneuver_automaton.receding_horizon.guarantees import broken, too_cheap
from tests.receding_horizon.loops import SPIN_TOO, made_up, parking_loop, straight

PROBLEM = straight(1.0)
GOAL = PROBLEM.goals[0]
PROMISED = promises(PROBLEM, step=0.5)
LAST = made_up(PROBLEM)  # value 1, of which 0.5 is applied
GOOD = made_up(PROBLEM, number=1, value=0.5, shifted_value=0.5, time=0.5, applied=0.5)


def seen(now, *, last=LAST, promised=PROMISED, most_steps=2, uniform=False) -> list[Guarantee]:
    found = broken(promised, GOAL, last, now, most_steps=most_steps, uniform=uniform)
    return [one.guarantee for one in found]


def test_a_good_step_breaks_nothing():
    assert seen(GOOD) == []
    assert list(too_cheap(PROMISED, GOOD)) == []


@pytest.mark.parametrize(
    ("changed", "guarantees"),
    [
        ({"value": 0.5 + 1e-6}, [Guarantee.DECREASE]),
        ({"value": 0.5 + 1e-12}, []),  # rounding
        ({"value": 1.0}, [Guarantee.DECREASE]),
        ({"shifted_value": None}, [Guarantee.FEASIBILITY]),
        ({"shifted_value": None, "value": 0.7}, [Guarantee.FEASIBILITY, Guarantee.DECREASE]),
        ({"number": 2}, [Guarantee.STEPS]),
        ({"number": 2, "arrived": True}, []),
        ({"value": 0.7, "arrived": True}, []),
        ({"number": 2, "off_plan": 0.1}, []),  # the bound holds where nothing disturbs
        ({"value": 0.7, "off_plan": 0.1}, [Guarantee.DECREASE]),
    ],
)
def test_what_a_step_breaks(changed, guarantees):
    assert seen(replace(GOOD, **changed)) == guarantees


def test_the_reason_says_whether_the_plan_was_followed():
    now = replace(GOOD, value=0.7, off_plan=0.25, shifted_value=None)
    lines = [str(one) for one in broken(PROMISED, GOAL, LAST, now, most_steps=2, uniform=False)]
    assert lines == [
        "recursive feasibility: the rest of the last plan does not lead to the goal in time; the "
        "state was measured 0.25 off the plan",
        "value decrease: noise raised the value by 0.2 above 0.5; the state was measured 0.25 off "
        "the plan",
    ]
    (one,) = broken(PROMISED, GOAL, LAST, replace(GOOD, value=0.7), most_steps=2, uniform=False)
    assert str(one) == "value decrease: the value is 0.7, need at most 0.5; the plan was followed"


def test_rest_that_costs_may_be_appended():
    costly = promises(straight(1.0, cost=Cost(effort=1.0, time=2.0)), step=0.5)
    assert costly.rest_rate == 2.0
    assert seen(replace(GOOD, value=1.5), promised=costly) == []
    assert seen(replace(GOOD, value=1.5 + 1e-6), promised=costly) == [Guarantee.DECREASE]


def test_uniform_effort_falls_by_the_square_of_the_way():
    # lambda c1 delta |x|^2 / T^2 = 0.5 / 16
    least = PROMISED.effort_decrease(LAST.pose, GOAL)
    assert least == pytest.approx(0.5 / 16.0)
    last = replace(LAST, applied_cost=0.0)
    for value, guarantees in (
        (1.0 - 0.9 * least, [Guarantee.EFFORT]),
        (1.0 - 1.1 * least, []),
    ):
        assert seen(replace(GOOD, value=value), last=last, uniform=True) == guarantees
        assert seen(replace(GOOD, value=value), last=last, uniform=False) == []
        disturbed = replace(GOOD, value=value, off_plan=0.1)
        assert seen(disturbed, last=last, uniform=True) == []


def test_the_way_counts_the_heading_modulo_a_turn():
    way = PROMISED.effort_decrease(np.array([3.0, 4.0, 2.0 * math.pi + 0.5]), GOAL)
    assert way == pytest.approx(0.5 * 25.25 / 16.0)
    free = Goal(pose=[0.0, 0.0, 0.0], free_heading=True)
    assert PROMISED.effort_decrease(np.array([3.0, 4.0, 1.0]), free) == pytest.approx(12.5 / 16.0)
    assert replace(PROMISED, horizon=None).effort_decrease(np.ones(3), GOAL) == 0.0


def test_a_step_that_rests_before_the_goal_is_too_cheap():
    rest, ahead = PROBLEM.automaton.trims
    start = PROBLEM.start
    waiting = Plan(start, (rest, ahead), durations=[1.0, 1.0])
    early = made_up(PROBLEM, plan=waiting, applied_cost=0.0)
    (violation,) = too_cheap(PROMISED, early)
    assert violation.guarantee is Guarantee.LEAST_COST
    assert violation.reason == ("the step costs 0, need at least 0.5: it rests before the goal")
    longer = Plan(start, (ahead, rest, ahead), durations=[0.2, 0.4, 0.8])
    assert [
        one.guarantee
        for one in too_cheap(PROMISED, made_up(PROBLEM, plan=longer, applied_cost=0.3))
    ]
    at_the_end = Plan(start, (ahead, rest), durations=[0.2, 3.8])
    arriving = made_up(PROBLEM, plan=at_the_end, applied_cost=0.2)
    assert list(too_cheap(PROMISED, arriving)) == []


class TestPromises:
    def test_the_cheapest_motion(self):
        promised = promises(parking_loop(), step=1.0)
        assert promised.least_rate == 1.0
        assert promised.rest_rate == 0.0
        assert promised.horizon == 8.0
        assert promised.most_steps(4.66) == 5

    @pytest.mark.parametrize(
        ("value", "steps"), [(1.0, 10), (0.95, 10), (1.05, 11), (0.0, 0), (math.inf, None)]
    )
    def test_steps(self, value, steps):
        promised = Promises(
            least_rate=1.0, rest_rate=0.0, time_rate=0.0, effort=0.0, horizon=4.0, step=0.1
        )
        assert promised.most_steps(value) == steps

    def test_no_bound_where_motion_costs_nothing_more_than_rest(self):
        problem = straight(1.0, controls=SPIN_TOO, cost=Cost(length=1.0))
        promised = promises(problem, step=0.1)
        assert promised.least_rate == 0.0  # to spin on the spot has no length
        assert promised.most_steps(3.0) is None

    def test_penalised_time(self):
        problem = straight(1.0, cost=Cost(time=2.0), horizon=Horizon())
        promised = promises(problem, step=0.1)
        assert promised.time_rate == 2.0
        assert promised.rest_rate == 0.0
        assert promised.most_steps(3.0) == 15

    def test_what_rest_costs_is_taken_off(self):
        problem = straight(1.0, cost=Cost(effort=1.0, time=2.0))
        promised = promises(problem, step=0.1)
        assert (promised.least_rate, promised.rest_rate) == (1.0, 2.0)
        assert promised.most_steps(1.0 + 8.0) == 10

    def test_the_smallest_eigenvalue_of_the_effort(self):
        matrix = np.array([[2.0, 1.0], [1.0, 2.0]])
        cost = Cost(effort=3.0, effort_matrix=matrix)
        assert promises(straight(1.0, cost=cost), step=1.0).effort == pytest.approx(3.0)
        assert promises(straight(1.0, cost=cost, horizon=Horizon()), step=1.0).effort == 0.0
