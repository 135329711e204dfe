"""Where plans of a fleet end: with room for noise, and beside who stands at the goal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton import Disturbance, FleetProblem, Goal, Problem, plan_fleet, simulate_fleet
from maneuver_automaton.collision import Disc
from maneuver_automaton.fleet.held import aimed_at, beside, with_room
from maneuver_automaton.groups import SE2
from maneuver_automaton.receding_horizon.candidates import within
from tests.fleet.mortal import Mortal
from tests.fleet.robots import at_rest, least_distance, problem_of
from tests.inertia import unicycle_automaton

TUBE = 0.05
HERE = SE2([0.0, 0.0, 0.0])


def heavy(goal, *, tolerance_m=0.15, tolerance_rad=0.25) -> Problem:
    """A robot with inertia: its word alone cannot make up for what noise turned it."""
    end = Goal(pose=goal, tolerance_m=tolerance_m, tolerance_rad=tolerance_rad)
    return Problem(unicycle_automaton(), [0, 0, 0], end, footprint=Disc(0.3), margin=TUBE)


@pytest.mark.parametrize(("metres", "radians"), [(0.15, 0.25), (0.06, 0.1), (0.0, 0.0)])
def test_from_anywhere_in_its_tube_it_arrives(metres, radians):
    problem = heavy([3, 1, 0], tolerance_m=metres, tolerance_rad=radians)
    (inner,), (goal,) = with_room(problem, TUBE).goals, problem.goals
    assert 0.5 * metres <= inner.tolerance_m <= metres
    assert 0.5 * radians <= inner.tolerance_rad <= radians
    if metres - TUBE <= 0.5 * metres or radians - TUBE / 0.3 <= 0.5 * radians:
        return  # half is left, whatever the tube is
    rng = np.random.default_rng(3)
    ends = rng.uniform(-1.0, 1.0, (500, 3)) * [inner.tolerance_m, inner.tolerance_m, 0.0]
    ends = ends[np.hypot(*ends[:, :2].T) <= inner.tolerance_m] + goal.pose
    ends[:, 2] += rng.uniform(-inner.tolerance_rad, inner.tolerance_rad, len(ends))
    off = rng.uniform(-TUBE, TUBE, (len(ends), 3)) / [1.0, 1.0, 0.3]
    here = beside(ends + off, ends, 0.3) <= TUBE
    assert here.sum() > 20
    assert all(within(pose, goal) for pose in (ends + off)[here])


def test_where_a_plan_aims():
    goal = Goal(pose=[2, 0, 0], tolerance_m=0.2, tolerance_rad=0.1)
    for end, aim in (([2, 0, 0], [2, 0, 0]), ([2.1, 0, 0], [2.1, 0, 0]), ([3, 0, 0], [2, 0, 0])):
        problem = problem_of([0, 0, 0], end)
        plan = plan_fleet(FleetProblem([problem]), time_limit=20.0, max_rounds=0).plans["1"]
        assert aimed_at(plan, goal).pose == pytest.approx(np.array(aim), abs=1e-8)


def test_a_worker_may_die_once_a_plan_is_held():
    """With inertia a plan ends beside its goal, where that is cheapest: noise leads it farther."""
    fleet = FleetProblem([heavy([8.22001169498152, 8.231763158945975, 0.030651122084284])])
    fleet = replace(fleet, margin=0.1)
    log = simulate_fleet(
        fleet,
        step=0.5,
        steps=60,
        first=plan_fleet(fleet, time_limit=60.0, max_rounds=0),
        disturbance=Disturbance(position_m=3e-4, heading_rad=3e-4),
        workers=Mortal(fleet, {0: 0.0}),
    )
    assert log.reached


def test_first_plans_keep_room():
    fleet = FleetProblem([heavy([3, 1, 0])], margin=0.1)
    log = simulate_fleet(fleet, step=0.5, steps=1, first_time_limit=1.0)
    off, turn = fleet.problems[0].goals[0].off(log.steps[0].plans["1"].end)
    assert off <= 0.1 + 1e-9
    assert turn <= 0.125 + 1e-9


def beside_its_goal(by=HERE, *, tolerance=0.2, gap=0.65, stays=0.1):
    """One robot stands so near to the goal of another that this may not end there exactly."""
    going = problem_of([0, 0, 0], [4, 0, 0], tolerance=tolerance, margin=TUBE)
    place = [4.0 + gap, 0, 0]
    standing = problem_of(place, place, tolerance=stays, margin=TUBE)
    return FleetProblem([going, standing], names=("a", "b"), margin=0.1).moved(by)


def test_a_plan_ends_beside_who_stands_at_its_goal():
    log = simulate_fleet(beside_its_goal(), step=0.5, first=at_rest(beside_its_goal()), steps=30)
    assert set(log.arrived_s) == {"a", "b"}
    assert [*log.violations] == []
    assert least_distance(log) >= 0.1 - 1e-9


def test_a_moved_fleet_ends_beside_the_moved_one():
    by = SE2([3.0, -2.0, 2.1])
    here = plan_fleet(beside_its_goal(), time_limit=60.0, max_rounds=0)
    there = plan_fleet(beside_its_goal(by), time_limit=60.0, max_rounds=0)
    end = (by @ SE2(here.plans["a"].end)).pose
    assert end[:2] == pytest.approx(there.plans["a"].end[:2], abs=1e-6)
    off = np.hypot(*(here.plans["a"].end[:2] - [4.65, 0.0]))
    assert off >= 0.7
    assert within(here.plans["a"].end, beside_its_goal().problems[0].goals[0])


@pytest.mark.slow
@pytest.mark.parametrize(("tolerance", "gap"), [(0.05, 0.6)])
def test_where_no_place_is_left_there_is_no_plan(tolerance, gap):
    fleet = beside_its_goal(tolerance=tolerance, gap=gap, stays=0.0)
    assert "a" not in plan_fleet(fleet, time_limit=1.0, max_rounds=0).plans


def test_who_stands_makes_room_within_its_tolerance():
    fleet = beside_its_goal(tolerance=0.0)
    plans = plan_fleet(fleet, time_limit=60.0, max_rounds=0).plans
    assert within(plans["b"].end, fleet.problems[1].goals[0])
    assert np.hypot(*(plans["b"].end - plans["a"].end)[:2]) >= 0.7


def test_noise_at_a_goal_beside_another():
    fleet = beside_its_goal(tolerance=0.3)
    for seed in range(3):
        noise = Disturbance(position_m=0.003, heading_rad=0.003)
        log = simulate_fleet(
            fleet, step=0.5, first=at_rest(fleet), steps=60, seed=seed, disturbance=noise
        )
        assert set(log.arrived_s) == {"a", "b"}
        assert [*log.violations] == []
