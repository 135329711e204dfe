"""Prices of places in polishing: slopes by differences, the middle of a corridor, a moved one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton import Box, Clearance, Ground, Plan, Problem
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.groups import SE2
from maneuver_automaton.optimal_control.place_term import place_term, price_of_places
from maneuver_automaton.optimal_control.scene import PlacesAt, Point
from maneuver_automaton.planning.polished_price import polished_price
from maneuver_automaton.planning.polishing import guess_of_plan, polish_plans
from maneuver_automaton.primitives import Trim
from tests.inertia import CAR, resting

LIBRARY = resting(CAR)
BODY = Box([0.6, 0.4])
RATES = np.array([2.0, 1.0])


def hills(poses, states, controls):
    """Smooth rates per metre and per second that see the place and the heading."""
    x, y, heading = poses.T
    seen = np.exp(-((x - 2.0) ** 2) - (y - 0.4) ** 2) * (1.5 + np.sin(heading))
    return seen[:, None] * RATES


def wave(count: int = 40) -> Point:
    rng = np.random.default_rng(4)
    times = np.linspace(0.0, 6.0, count)
    pose = np.column_stack([0.8 * times, np.sin(times), np.cos(times)])
    state = np.hstack([pose, rng.uniform(-0.3, 0.3, (count, 2))])
    return Point(state, rng.uniform(-0.3, 0.3, (count - 1, 2)), np.diff(times))


@pytest.mark.parametrize("scale", [math.inf, 0.05])  # looks at nodes, and at three between two
def test_its_slope_is_that_of_the_price(scale: float) -> None:
    point, rng = wave(), np.random.default_rng(7)
    places = PlacesAt(hills, scale)
    model = place_term(places, point, 3, beside=1e-3)
    for _ in range(5):
        by = 1e-5 * rng.normal(size=point.state.shape)
        longer = 1e-5 * rng.normal(size=point.durations.shape)
        ahead, behind = (
            Point(point.state + sign * by, point.control, point.durations + sign * longer)
            for sign in (1.0, -1.0)
        )
        asked = price_of_places(places, ahead, 3) - price_of_places(places, behind, 3)
        assert model.price(ahead) - model.price(behind) == pytest.approx(asked, rel=1e-3)


def test_an_area_between_two_nodes_costs_what_it_does_along_the_way() -> None:
    problem = replace(
        corridor(SE2([0.0, 0.0, 0.0])), place_costs=Ground(Box([0.3, 1.0], [8.0, -0.5]))
    )
    times = np.linspace(0.0, 16.0, 17)  # of nodes a metre apart, none of which is in the area
    state = np.outer(times + 0.5, [1.0, 0.0, 0.0, 0.0, 0.0])
    places = polished_price(problem).places(None)
    assert places is not None
    point = Point(state, np.zeros((16, 2)), np.diff(times))
    assert price_of_places(places, point, 3) == pytest.approx(0.3, rel=0.2)


def corridor(place: SE2) -> Problem:
    """4 m wide, 16 m long; in at one side, out at the other, 0.9 m off the middle."""
    walls = [Box([24.0, 0.4], [8.0, side * 2.2]).moved(place) for side in (1.0, -1.0)]
    start, goal = ((place @ SE2([x, -0.9, 0.0])).pose for x in (0.0, 16.0))
    return Problem(
        LIBRARY, start, goal, obstacles=walls, footprint=BODY, place_costs=Clearance(2.0, 1.9)
    )


def polished(problem: Problem, *, priced: bool) -> Plan:
    ahead = Trim(
        name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[0.0, 0.0], reduced_state=[1.0, 0.0]
    )
    straight = Plan(problem.start, (ahead,), durations=[16.0])
    found: list[Plan] = []
    polish_plans(
        problem,
        [guess_of_plan(straight)],
        0,
        None,
        places=polished_price(problem).places(None) if priced else None,
        budget=UNLIMITED,
        most_iterations=400,
        accepts=lambda plan: not found.append(plan),
    )
    return found[-1]


def test_it_keeps_to_the_middle_of_a_corridor_wherever_that_is() -> None:
    place = SE2([300.0, -70.0, 2.0])
    problem = corridor(place)
    plan, unpriced = (polished(problem, priced=priced) for priced in (True, False))
    seen = (place.inverse() @ SE2(plan.sample().pose)).pose
    middle = seen[(seen[:, 0] > 5.0) & (seen[:, 0] < 11.0)]
    assert np.abs(middle[:, 1]).max() < 0.1
    assert problem.cost_of(plan) < 0.9 * problem.cost_of(unpriced)


def test_prices_per_second_are_told_too() -> None:
    by_time = replace(corridor(SE2([0.0, 0.0, 0.0])), place_costs=Clearance(1.0, 1.9, per="second"))
    plan = polished(by_time, priced=True)
    assert by_time.cost_of(plan) < 0.9 * by_time.cost_of(polished(by_time, priced=False))
