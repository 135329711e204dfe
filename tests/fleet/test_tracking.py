"""Back onto a plan that is held: nearer to it after a step, and never beyond the tube."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.fleet import FleetProblem
from maneuver_automaton.fleet.held import off_plan
from maneuver_automaton.fleet.planning import plan_fleet
from maneuver_automaton.fleet.upkeep import back_onto
from maneuver_automaton.fleet.vehicle import OwnPlan, vehicles_of
from maneuver_automaton.groups import SE2
from tests.fleet.robots import crossing, problem_of
from tests.inertia import unicycle_automaton

STEP, TUBE = 0.5, 0.05


def held_by(problem):
    (vehicle,) = vehicles_of(FleetProblem([problem]))
    plan = plan_fleet(FleetProblem([problem]), time_limit=20.0, max_rounds=0).plans["1"]
    return vehicle, OwnPlan(plan, 1.0, 0, vehicle.course_of(plan))


def driven(vehicle, found, pose, steps, *, tube=TUBE):
    """Offsets from the plan [m] when a vehicle drives back onto it, step after step."""
    offs = []
    for number in range(steps):
        time = STEP * number
        back = back_onto(vehicle, found, time, pose, STEP, tube)
        assert back is not None
        assert back.start_time == time
        pose = back.pose_at(time + STEP)
        offs.append(off_plan(vehicle, found, time + STEP, pose))
    return offs


@pytest.mark.parametrize("beside", [(0.0, 0.03, 0.0), (0.0, -0.02, 0.02), (0.0, 0.0, -0.03)])
def test_it_comes_back(beside):
    vehicle, found = held_by(problem_of([0, 0, 0], [6, 1, 0.5], tolerance=0.1))
    pose = (SE2(vehicle.problem.start) @ SE2(beside)).pose
    offs = driven(vehicle, found, pose, 10)
    assert max(offs) <= TUBE
    assert offs[-1] < 4e-3


def test_who_is_early_waits():
    vehicle, found = held_by(problem_of([0, 0, 0], [6, 0, 0], tolerance=0.1))
    assert driven(vehicle, found, np.array([0.03, 0.0, 0.0]), 3)[-1] < 1e-3


def test_a_moved_plan_has_the_moved_way_back():
    by = SE2([3.0, -2.0, 2.1])
    problem = problem_of([0, 0, 0], [6, 1, 0.5], tolerance=0.1)
    vehicle, found = held_by(problem)
    moved = by @ SE2(found.plan.start)
    plan = type(found.plan)(
        moved.pose, found.plan.trims, durations=found.plan.durations, maneuvers=found.plan.maneuvers
    )
    there = OwnPlan(plan, 1.0, 0, vehicle.course_of(plan))
    pose = np.array([0.0, 0.02, 0.03])
    here = back_onto(vehicle, found, 0.0, pose, STEP, TUBE)
    away = back_onto(vehicle, there, 0.0, (by @ SE2(pose)).pose, STEP, TUBE)
    assert here.word == away.word
    assert here.durations == pytest.approx(away.durations, abs=1e-9)


def test_beyond_its_tube_there_is_none():
    vehicle, found = held_by(problem_of([0, 0, 0], [6, 0, 0], tolerance=0.1))
    # It looks so far aside that it is farther from its plan first, whatever it drives.
    assert back_onto(vehicle, found, 0.0, np.array([0.0, 0.02, 0.6]), STEP, 0.02) is None


def test_with_inertia_there_is_none():
    fleet = crossing()
    heavy = vehicles_of(
        FleetProblem([type(fleet.problems[0])(unicycle_automaton(), [0, 0, 0], [4, 0, 0])])
    )[0]
    vehicle, found = held_by(problem_of([0, 0, 0], [6, 0, 0], tolerance=0.1))
    assert back_onto(heavy, found, 0.0, np.zeros(3), STEP, TUBE) is None
    assert back_onto(vehicle, found, 0.0, np.zeros(3), STEP, TUBE) is not None
