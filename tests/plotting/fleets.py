"""Fleets that the tests of the pictures share, put together by hand."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.fleet import FleetProblem, FleetResult, FleetStatus
from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.problem import Problem
from tests.plotting.cases import ROBOT, plan_of

WALL = Box([0.2, 2.0], [-3.0, 0.0])
CART = Obstacle(Box([0.6, 0.3]), motion=Motion([0.0, 4.0], [[-2.0, 5.0, 0.0], [2.0, 5.0, 0.0]]))
DOOR = Obstacle(Box([1.0, 0.1], [0.0, -3.0]), present_s=(-np.inf, 1.0))


def answer(plan, **more):
    problem = Problem(ROBOT, plan.start, plan.end, start_time=plan.start_time, **more)
    return PlanResult(problem=problem, status=PlanStatus.FOUND, reason="", plan=plan, cost=1.0)


def no_answer(start, goal, **more):
    problem = Problem(ROBOT, start, goal, **more)
    return PlanResult(problem=problem, status=PlanStatus.NO_PLAN, reason="too narrow")


def fleet_of(answers, *, names, margin=0.05, leaves=(), reasons=None):
    """What is known of a fleet of these answers."""
    problems = [one.problem for one in answers]
    found = sum(one.plan is not None for one in answers)
    status = FleetStatus.FOUND if found == len(answers) else FleetStatus.PARTIAL
    return FleetResult(
        problem=FleetProblem(problems, names=names, margin=margin, leaves=leaves),
        status=status if found else FleetStatus.NO_PLAN,
        results=dict(zip(names, answers, strict=True)),
        reasons=reasons or {},
        clearance_m=0.3,
    )


def crossing(**more):
    """Two that pass each other at 1 m between their paths; one rests and leaves; one is stuck."""
    around = {"obstacles": [WALL, CART, DOOR], "footprint": Box([0.6, 0.4])}
    there = plan_of(["straight"], [4.0], start=(-3.0, 1.0, 0.0))
    back = plan_of(["rest", "straight"], [1.0, 4.0], start=(3.0, -0.5, np.pi), start_time=0.5)
    stuck = no_answer([5.0, 3.0, 0.0], [0.0, 3.0, 0.0], **around)
    return fleet_of(
        [answer(there, **around), answer(back, **(around | {"footprint": Disc(0.3)})), stuck],
        names=["there", "back", "stuck"],
        leaves=(False, True, False),
        reasons={"stuck": "walls enclose the start"},
        **more,
    )


def row_of(count):
    """Vehicles beside each other, all of them straight ahead."""
    starts = [(0.0, 1.0 * k, 0.0) for k in range(count)]
    plans = [plan_of(["straight"], [2.0 + 0.01 * k], start=at) for k, at in enumerate(starts)]
    answers = [answer(plan, footprint=Box([0.6, 0.4])) for plan in plans]
    return fleet_of(answers, names=[f"robot {k}" for k in range(count)])
