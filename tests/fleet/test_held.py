"""What is left of a plan that is held goes on from the speed and hitch that the vehicle has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton import Box, Disc, Goal, Problem
from maneuver_automaton.automaton.automaton import same_state
from maneuver_automaton.automaton.cutting import begin_state, committed, end_state
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.budget import Budget
from maneuver_automaton.fleet import FleetHorizon, FleetProblem, plan_fleet
from maneuver_automaton.fleet.held import onward, rejoined, rest_of_plan, resting, stopping
from maneuver_automaton.fleet.vehicle import vehicles_of
from maneuver_automaton.fleet.workers import PlanRequest, Terms, answered
from tests.inertia import car_automaton, unicycle_automaton

TUBE = 0.05  # [m]
LONG, TRAILER = Box([4.0, 1.8], [1.2, 0.0]), Box([3.2, 1.7], [0.2, 0.0])


def problem_of(kind: str) -> Problem:
    if kind == "trailer":
        end = Goal(pose=[20.0, 6.0, 0.5], tolerance_m=0.4, tolerance_rad=0.3)
        parts = {"trailer": (TRAILER,)}
        library = load_stock_library("car_with_trailer")
        return Problem(library, [0, 0, 0], end, footprint=LONG, parts=parts, margin=TUBE)
    automaton = car_automaton() if kind == "car" else unicycle_automaton()
    end = Goal(pose=[4.0, 2.0, 0.4], tolerance_m=0.15, tolerance_rad=0.25)
    begin = "1, 0" if kind == "moving" else None
    return Problem(automaton, [0, 0, 0], end, start_trim=begin, footprint=Disc(0.3), margin=TUBE)


@pytest.fixture(scope="module", params=["moving", "trailer"])
def driving(request):
    """A vehicle with inertia, and a plan of it."""
    (vehicle,) = vehicles_of(FleetProblem([problem_of(request.param)]))
    vehicle.plan_alone(Budget.from_now(60.0))
    return vehicle, vehicle.alone


def times_of(plan, count=41):
    return plan.start_time + np.linspace(0.0, 1.1, count) * plan.duration


def state_at(vehicle, found, time):
    return begin_state(rest_of_plan(vehicle, found, time))


def test_a_maneuver_under_way_is_driven_to_its_end(driving):
    vehicle, found = driving
    within = 0
    for time in times_of(found.plan):
        rest = rest_of_plan(vehicle, found, time)
        left = committed(found.plan, time - found.plan.start_time)
        assert committed(rest, 0.0) == pytest.approx(left, abs=1e-9)
        head, problem = onward(vehicle, found, time)
        if left > 0.0:
            within += 1
            assert head is not None
            assert head.duration >= left - 1e-9
        state = begin_state(rest)
        if head is not None:
            assert same_state(begin_state(head), state)
            state = end_state(head)
        if problem is not None:
            assert same_state(problem.first_trim.reduced_state, state)
    assert within > 2


def test_whatever_is_driven_next_goes_on_from_the_state_that_it_has(driving):
    vehicle, found = driving
    plan = found.plan
    for time in times_of(plan, 9):
        state = state_at(vehicle, found, time)
        pose = plan.pose_at(min(time, plan.start_time + plan.duration))
        beside = pose + np.array([0.01, -0.01, 0.001])
        for one in (found, found.given_up()):
            choices = [*rejoined(vehicle, one, time, beside, TUBE)]
            for other in [*choices, stopping(vehicle, one, time, beside)]:
                if other.plan.trims:
                    assert same_state(state_at(vehicle, other, time), state)


def test_who_stops_leaves_its_trims_at_once(driving):
    """A trim may be left at any moment, also one that is the plan's own, of no library."""
    vehicle, found = driving
    for time in times_of(found.plan, 9)[:-1]:
        rest = rest_of_plan(vehicle, found, time)
        stop = stopping(vehicle, found, time, rest.start).plan
        assert stop.trims[-1].is_rest
        assert stop.duration <= rest.duration - rest.durations.sum() + 1e-9
        assert same_state(begin_state(stop), begin_state(rest))


def test_another_plan_goes_on_from_the_state_that_it_has(driving):
    vehicle, found = driving
    budget = Budget.from_now(60.0)
    for time in times_of(found.plan, 6)[1:-1]:
        terms = Terms(time, 0.0, 0.0, known=np.inf, most=200, tube_m=TUBE, keep=np.inf)
        request = PlanRequest(0, found, (), terms)
        other, _ = answered(vehicle, request, budget, lambda one: one.course)
        assert other is not None
        assert same_state(begin_state(other.plan), state_at(vehicle, found, time))


def test_who_rests_keeps_what_it_carries_as_it_is():
    (vehicle,) = vehicles_of(FleetProblem([problem_of("trailer")]))
    assert resting(vehicle, [1.0, 2.0, 0.3], 0.5).plan.trims[0].reduced_state.tolist() == [0.0]
    bent = next(
        one for one in vehicle.problem.automaton.trims if one.is_rest and one.reduced_state[0] > 0.4
    )
    begun = resting(vehicle, [1.0, 2.0, 0.3], 0.5)
    held = replace(begun, plan=replace(begun.plan, trims=(bent,)))
    assert resting(vehicle, [1.0, 2.0, 0.3], 1.0, held).plan.trims == (bent,)


@pytest.mark.parametrize("ahead_s", [0.0, 0.4])
def test_a_late_answer_with_another_speed_is_not_taken(ahead_s):
    """It is for a plan that has been rejoined since: at the same place it would be faster."""
    fleet = FleetProblem([problem_of("robot")])
    first = plan_fleet(fleet, time_limit=60.0, max_rounds=0)
    loop = FleetHorizon(fleet, step=0.25, first=first, delay_steps=1, time_limit=60.0)
    (name,), (vehicle,) = fleet.names, loop.state.vehicles
    loop.step({name: fleet.problems[0].start})
    held, now = loop.state.held[0], 0.25
    assert not same_state(state_at(vehicle, held, now), state_at(vehicle, held, now + 0.4))
    pose = held.plan.pose_at(now)
    plan = replace(rest_of_plan(vehicle, held, now + ahead_s), start=pose, start_time=now)
    sooner = replace(held, plan=plan, cost=0.5 * held.cost, course=vehicle.course_of(plan))
    loop.state.due[0] = (1, sooner, held)
    step = loop.step({name: pose})
    assert bool(step.swaps) is (ahead_s == 0.0)
    assert same_state(begin_state(step.driven[name]), state_at(vehicle, held, now))
