"""What the tests of the exports write: one of every kind."""

from __future__ import annotations

import functools

import numpy as np

import maneuver_automaton as ma
from maneuver_automaton.planning import PlanStatus
from maneuver_automaton.roads import drive_scene, road_planner
from tests.plotting.cases import flight_plan, parking_plan, result_of, slalom_problem
from tests.plotting.loops import flight_loop, parking_loop, pushed_loop
from tests.roads.files import scene_of

CAR = ma.SecondOrderCar(wheelbase=2.5, max_speed=4.0, max_acceleration=2.0, max_steering=0.6,
                        max_steering_rate=0.8)  # fmt: skip
TRAILER = ma.CarWithTrailer(wheelbase=0.3, hitch_length=0.4, max_steering=0.6, max_speed=1.0)


def slalom():
    """A plan among one obstacle of every kind, as the answer to its problem."""
    plan = parking_plan()
    return ma.PlanResult(
        problem=slalom_problem(plan), status=PlanStatus.FOUND, reason="", plan=plan, cost=9.75
    )


@functools.cache
def trailer():
    """A car that draws a trailer through a bend, by trims that hold the angle of its hitch."""
    robot = ma.Automaton.of_model(TRAILER, {"speed": [0.5], "steering": [0.0, 0.2]})
    bend = robot["speed 0.5, steering 0.2"]
    plan = ma.Plan([1.0, 0.0, 0.3], (bend,), durations=[3.0])
    problem = ma.Problem(
        robot, plan.start, ma.Goal(pose=plan.end, trim=bend.name), start_trim=bend.name,
        footprint=ma.Box([0.4, 0.2], [0.15, 0.0]), parts={"trailer": ma.Box([0.3, 0.2])},
    )  # fmt: skip
    return ma.PlanResult(problem=problem, status=PlanStatus.FOUND, reason="", plan=plan, cost=3.0)


def inertia():
    """A car with inertia that speeds up and brakes."""
    robot = ma.Automaton.of_model(CAR, {"speed": [0.0, 2.0], "steering": [0.0]})
    rest, ahead = robot.trims[robot.rest], robot["speed 2, steering 0"]
    course = {(one.source, one.target): one for one in robot.maneuvers}
    between = [course[rest.name, ahead.name], course[ahead.name, rest.name]]
    plan = ma.Plan([0.0, 0.0, 0.5], [rest, ahead, rest], durations=[0.0, 1.0, 0.0],
                   maneuvers=between, start_time=10.0)  # fmt: skip
    problem = ma.Problem(robot, plan.start, plan.end, start_time=10.0)
    return ma.PlanResult(problem=problem, status=PlanStatus.FOUND, reason="", plan=plan)


def drive_on_lanes(folder, *parts, step=0.1):
    """A drive on two lanes of a CommonRoad file of our own."""
    return drive_scene(road_planner(scene_of(folder, *parts, step=step)))


VALUES = {
    "plan": parking_plan,
    "result": lambda: result_of(parking_plan()),
    "among obstacles": slalom,
    "flight": flight_plan,
    "trailer": trailer,
    "inertia": inertia,
    "loop": parking_loop,
    "pushed loop": pushed_loop,
    "flight loop": flight_loop,
}


def ends(value):
    """First and last pose of a value."""
    if isinstance(value, ma.Plan):
        return value.start, value.end
    if isinstance(value, ma.PlanResult):
        return value.plan.start, value.plan.end
    return np.array(value.poses[0]), np.array(value.poses[-1])


def assert_close(found, expected, *, atol=1e-9):
    """Fail unless two arrays agree."""
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=atol)
