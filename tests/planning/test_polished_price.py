"""What polishing makes least is what the problem asks for, as far as a solver can be told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.collision import Disc, Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning import plan
from maneuver_automaton.planning.polished_price import admitted_durations, polished_price
from maneuver_automaton.planning.polishing import why_not_polished
from maneuver_automaton.problem import Goal, Horizon, Problem, SearchSettings
from tests.search.cases import compiled_only

ROBOT = load_stock_library("second_order_unicycle")
GOAL = (3.0, 1.0, 0.5)


def posed(**changes):
    values = {"search": SearchSettings(max_expansions=800)} | changes
    return Problem(ROBOT, [0.0, 0.0, 0.0], GOAL, **values)


def test_prices_of_switches_are_left_out():
    """What is polished is one piece, whatever it was before."""
    price = polished_price(posed(cost=Cost(time=2.0, switch=9.0, direction_change=4.0)))
    assert (price.cost.time, price.cost.switch, price.cost.direction_change) == (2.0, 0.0, 0.0)


@compiled_only
@pytest.mark.parametrize("priced", ["switch", "direction_change"])
def test_switches_alone_may_have_a_price(priced):
    search = SearchSettings(max_expansions=100, polish=False)
    assert plan(posed(cost=Cost(**{priced: 1.0}), search=search), time_limit=600.0).cost <= 6.0


@pytest.mark.parametrize("order", [1.0, 2.0])
def test_a_norm_is_priced_nearly(order):
    problem = posed(cost=Cost(norm=3.0, time=2.0, norm_order=order))
    rest = ROBOT.trims[ROBOT.rest]
    known = plan_of_rest(problem, rest)
    price = polished_price(problem).stage_cost(known)
    control = ROBOT.model.control_limits[:, 1]
    exact = problem.cost.rates(control[None], np.zeros((1, 3)))[0] / 2.0 - 1.0
    assert price(np.zeros(2), control) == pytest.approx(exact, rel=2e-2)


def plan_of_rest(problem, rest):
    return Plan(problem.start, (rest,), durations=[1.0])


def test_a_longest_time_bounds_what_is_polished():
    assert admitted_durations(posed())[1] > 1e3
    assert admitted_durations(posed(horizon=Horizon(max_time=7.0)))[1] == pytest.approx(
        7.0, rel=1e-5
    )
    least, most = admitted_durations(posed(horizon=Horizon(time=7.0)))
    assert least < 1.0 < most <= 7.0
    least, most = admitted_durations(posed(horizon=Horizon(max_time=1e-3)))
    assert 0.0 < least <= most < 1e-3


def test_effort_alone_has_no_quickest_motion():
    assert why_not_polished(posed(cost=Cost(effort=1.0))) == "time costs nothing"
    assert not why_not_polished(posed(cost=Cost(effort=1.0), horizon=Horizon(max_time=9.0)))


@pytest.mark.exhaustive
@pytest.mark.slow
@compiled_only
def test_metres_alone_are_polished_where_the_vehicle_keeps_moving():
    """A car from one cruise to another: fewer metres than along the best word found."""
    car, cruise = load_stock_library("second_order_car"), "speed 1.5, steering 0"
    rng = np.random.default_rng(0)
    goal = Goal(pose=[*rng.uniform(-15.0, 15.0, 2), rng.uniform(-3.0, 3.0)], trim=cruise)
    problem = Problem(car, [0, 0, 0], goal, start_trim=cruise, cost=Cost(length=1.0))
    assert not why_not_polished(problem)
    words = replace(problem, search=SearchSettings(polish=False))
    assert plan(problem, time_limit=20.0).cost < plan(words, time_limit=20.0).cost - 0.1


@pytest.mark.slow
@compiled_only
def test_what_is_passed_above_or_below_does_not_keep_from_polishing():
    bridge = Obstacle(Disc(1.6, [15.0, 2.0]), height=(50.0, 60.0))
    problem = Problem(
        load_stock_library("helicopter"),
        [0.0, 0.0, 0.0, 0.0],
        (30.0, 4.0, 0.2, 4.0),
        footprint=Disc(2.0),
        body_height=(-0.5, 0.5),
        obstacles=bridge,
        search=SearchSettings(max_expansions=800),
    )
    result = plan(problem, time_limit=30.0)
    assert result.plan.word == ("polished",)
    assert result.audit.passed
