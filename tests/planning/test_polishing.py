"""What is polished besides cars and robots: trailers, bodies of several parts, fixed times."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest

from maneuver_automaton.automaton.stock import load_stock_library
from maneuver_automaton.collision import Box, Disc, Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.optimal_control import has_casadi
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.problem import Goal, Horizon, Problem, SearchSettings
from tests.inertia import resting
from tests.search.cases import compiled_only

pytestmark = [
    compiled_only,
    pytest.mark.skipif(not has_casadi(), reason="polishing needs CasADi"),
]
WORK = SearchSettings(max_expansions=200)
CAR = Box([4.2, 1.8], [1.2, 0.0])
MOVING = "speed 1.5, steering 0"


def unpolished(problem):
    with patch("maneuver_automaton.planning.in_steps.polish_found", lambda *_: None):
        return plan(problem, time_limit=60.0)


@pytest.mark.slow
def test_a_trailer_without_maneuvers_is_led_by_paths_of_its_car():
    """Behind a wall that a library of rest alone leads past by no word."""
    trailer = {"trailer": (Box([3.2, 1.7], [-0.2, 0.0]), Box([0.4, 2.0], [-1.5, 0.0]))}
    problem = Problem(
        resting(load_stock_library("car_with_trailer").model),
        [0.0, 0.0, 0.0],
        [24.0, 0.0, 0.0],
        footprint=CAR,
        parts=trailer,
        obstacles=(Obstacle(Box([3.0, 8.0], [12.0, -2.5])),),
        search=WORK,
    )
    result = plan(problem, time_limit=60.0)
    assert result.plan.word == ("polished",)
    assert result.audit.passed
    assert result.cost < 8.6  # 8.0 s straight through the wall at 3 m/s
    by = SE2([20.0, -7.0, 1.1])
    moved = plan(problem.moved(by), time_limit=60.0)
    assert moved.cost == pytest.approx(result.cost, abs=1e-6)
    np.testing.assert_allclose((by @ SE2(result.plan.end)).pose, moved.plan.end, atol=1e-6)
    assert unpolished(problem).status is not PlanStatus.FOUND


@pytest.mark.slow
def test_a_fixed_time_is_kept_under_way_and_its_effort_falls():
    """It never rests, so that no wait can fill the time."""
    problem = Problem(
        load_stock_library("second_order_car"),
        [0.0, 0.0, 0.0],
        Goal(pose=[24.0, 4.0, 0.0], trim=MOVING),
        start_trim=MOVING,
        footprint=CAR,
        obstacles=(Obstacle(Disc(0.8, [12.0, 0.5])),),
        cost=Cost(effort=1.0),
        horizon=Horizon(time=12.0),
        search=WORK,
    )
    result = plan(problem, time_limit=60.0)
    assert result.plan.word == ("polished",)
    assert result.audit.passed
    assert result.plan.duration == pytest.approx(12.0, rel=1e-9)
    assert result.cost < 0.5 * unpolished(problem).cost


@pytest.mark.slow
def test_a_body_of_several_parts_is_polished_between_posts():
    """A shelf stands out to its sides, and its nose is round."""
    body = (CAR, Box([0.6, 2.6], [2.0, 0.0]), Disc(0.9, [3.2, 0.0]))
    posts = (Obstacle(Disc(0.9, [10.0, 1.9])), Obstacle(Disc(0.6, [10.0, -2.8])))
    problem = Problem(
        load_stock_library("second_order_car"),
        [0.0, 0.0, 0.0],
        [20.0, 2.0, 0.0],
        footprint=body,
        obstacles=posts,
        search=WORK,
    )
    result = plan(problem, time_limit=60.0)
    assert result.plan.word == ("polished",)
    assert result.audit.passed
    assert result.cost < unpolished(problem).cost
