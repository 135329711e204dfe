"""Polished plans: cheaper, and all that they were before; the cost by which the search chooses."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.roads import RoadSettings, _kernels_costs, _kernels_motion, road_planner
from maneuver_automaton.roads.polishing import ROUNDS
from tests.roads.files import LANES, car, parked, problem, scene_of

QUICK = RoadSettings(width=40, narrow=20)


@pytest.fixture(scope="module")
def planner(tmp_path_factory):
    post = parked(3, x=33.0, y=0.8, size=(2.0, 1.0))
    other = car(7, x=35.0, y=6.0, speed=6.0, steps=40)
    scene = scene_of(tmp_path_factory.mktemp("road"), *LANES, post, other, problem())
    return road_planner(scene, settings=QUICK)


@pytest.fixture(scope="module")
def found(planner):
    plan = planner.search(planner.start_state, tick=0)
    assert plan.reaches
    assert plan.stops
    return plan


def assert_as_good(planner, plan, before):
    """Free, at the goal when it was, at rest after it, and within all limits."""
    horizon, vehicle = planner.horizon, planner.vehicle
    assert (plan.tick, plan.lasting, plan.reaches) == (before.tick, before.lasting, True)
    states, controls = np.array(plan.states), np.array(plan.controls)
    assert _kernels_motion.free_ticks(horizon.clearing, states, plan.tick) == len(controls)
    at_end = states[plan.lasting : plan.lasting + 1]
    assert _kernels_costs.first_goal(horizon, at_end, plan.tick + plan.lasting) == 0
    assert plan.stops
    limits = vehicle.model.control_limits
    assert (controls >= limits[:, 0] - 1e-9).all()
    assert (controls <= limits[:, 1] + 1e-9).all()
    assert (states[:, 3] >= -1e-9).all()
    assert np.abs(states[:, 4]).max() <= vehicle.model.max_steering
    across = states[:, 3] ** 2 * np.tan(states[:, 4]) / vehicle.model.wheelbase
    assert np.abs(across).max() <= vehicle.lateral + 1e-6


def test_a_polished_plan_is_cheaper_and_all_that_it_was(planner, found):
    once = planner.polished(found)
    assert_as_good(planner, once, found)
    more = planner.polished(found, rounds=ROUNDS)
    assert_as_good(planner, more, found)
    assert planner.price(more) < planner.price(once) < 0.97 * planner.price(found)
    assert planner.polished(found, rounds=ROUNDS).controls.tolist() == more.controls.tolist()


def test_a_plan_that_is_kept_is_polished_on(planner, found):
    plan, as_it_was = found, found
    for tick in range(1, 9):
        before, as_it_was = plan.tail(), as_it_was.tail()
        plan, replanned = planner.decide(plan.states[1], tick=tick, tail=before)
        assert planner.price(plan) <= planner.price(before) + 1e-12
        assert replanned == (plan.controls.tolist() != before.controls.tolist())
        assert_as_good(planner, plan, plan)
    assert planner.price(plan) < 0.97 * planner.price(as_it_was)


def test_what_leads_to_no_goal_is_left_as_it_is(planner, found):
    stop = planner._emergency(np.array(found.states[0]), 0)
    assert planner.polished(stop) is stop


def test_the_search_compares_costs_of_whole_plans(planner, found):
    assert planner.search(planner.start_state, tick=0).reaches
    # Of controls that hold for a maneuver, the effort is an integral there and a sum here.
    assert planner.room.reached[0, 0] == pytest.approx(planner.price(found), rel=0.03)


def test_a_search_below_a_cost_answers_with_less_or_nothing(planner, found):
    cost = planner.price(found)
    assert planner.search(planner.start_state, tick=0, below=0.5 * cost) is None
    again = planner.search(planner.start_state, tick=0, below=1.1 * cost)
    assert planner.price(again) <= cost
