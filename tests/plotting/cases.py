"""Plans, results and files that the tests of the pictures share."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image

from maneuver_automaton.audit import TerminalError
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning import Alternative, PlanResult, PlanStatus
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Problem
from tests.search.cases import NAMED_TABLE_2, robot

ROBOT = robot(NAMED_TABLE_2)
NO_ERROR = TerminalError(position_m=2e-16, heading_rad=0.0)


def plan_of(word, durations, *, start=(0.0, 1.0, 0.0), start_time=0.0):
    trims = tuple(ROBOT[name] for name in word)
    return Plan(np.array(start), trims, durations=np.array(durations), start_time=start_time)


def parking_plan():
    return plan_of(["spin", "straight", "anticlockwise", "rest"], [1.0, 0.8, 4.2, 2.0])


def plan_of_trims(count):
    """A plan of `count` different trims, all of them turns to the left."""
    trims = tuple(
        Trim(
            name=f"left {k}",
            body_velocity=np.array([1.0, 0.0, 0.1 + 0.1 * k]),
            control=np.array([1.0, 0.1 + 0.1 * k]),
        )
        for k in range(count)
    )
    return Plan(np.zeros(3), trims, durations=np.full(count, 0.5))


def flight_plan():
    """A plan in SE(2) x R: up on the spot, then a climbing turn, then a descent."""
    twists = {"up": [0, 0, 0, 2], "climbing turn": [4, 0, 0.5, 1], "descend": [5, 0, 0, -1.5]}
    trims = tuple(
        Trim(name=name, body_velocity=np.array(twist), control=np.array(twist)[[0, 2, 3]])
        for name, twist in twists.items()
    )
    return Plan(np.zeros(4), trims, durations=np.array([3.0, 4.0, 5.0]))


TOWN = (
    Obstacle(Box([4.0, 3.0], [10.0, 4.0], 0.3), height=(0.0, 9.0)),
    Obstacle(Disc(2.0, [18.0, -4.0]), height=(2.0, 5.0)),
    Obstacle(Polygon([[25.0, 0.0], [30.0, 0.0], [30.0, 5.0], [28.0, 1.0]])),
    Obstacle(Box([1.0, 1.0]), height=(0.0, 3.0), motion=Motion([0.0, 1.0], np.ones((2, 3)))),
)


def flight(obstacles=TOWN, plan=None):
    """The answer of a helicopter that flies over a town."""
    craft = load_stock_library("helicopter")
    plan = flight_plan() if plan is None else plan
    problem = Problem(craft, plan.start, plan.end, obstacles=obstacles)
    return PlanResult(
        problem=problem, status=PlanStatus.FOUND, reason="", plan=plan, goal_index=0, cost=12.0,
        terminal_error=NO_ERROR, clearance_m=0.5,
    )  # fmt: skip


def slalom_problem(plan, **more):
    """The problem that `plan` solves, among one obstacle of every kind."""
    x, y = plan.start[:2]
    ring = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    crossing = Motion([0.0, 4.0], [[x - 2.0, y + 1.5, 0.0], [x + 2.0, y + 1.5, 0.5]])
    obstacles = [
        Polygon([x - 2.0, y] + 0.6 * ring, holes=[[x - 2.0, y] + 0.3 * ring]),
        Disc(0.3, [x + 2.0, y - 1.0]),
        Box([1.0, 0.4], [x, y - 1.5], 0.4),
        OccupancyMap([[1, 0, 1], [0, 1, 1]], resolution=0.2, origin=[x - 1.0, y + 2.0, 0.6]),
        Obstacle(Box([0.6, 0.3], [0.1, 0.0]), motion=crossing),
    ]
    goal = more.pop("goal", plan.end)
    footprint = more.pop("footprint", Box([0.5, 0.3]))
    return Problem(ROBOT, plan.start, goal, obstacles=obstacles, footprint=footprint, **more)


def result_of(plan, *, others=(), problem=None):
    return PlanResult(
        problem=problem or Problem(ROBOT, plan.start, plan.end, cost=Cost(effort=1.0)),
        status=PlanStatus.FOUND,
        reason="",
        plan=plan,
        goal_index=0,
        cost=9.75,
        terminal_error=NO_ERROR,
        alternatives=tuple(
            Alternative(plan=other, cost=10.0 + k, terminal_error=NO_ERROR)
            for k, other in enumerate(others)
        ),
    )


def document_of(plan, *, rate=40.0):
    """The plan as a loaded plan.json, written out by hand."""
    times, controls = [], []
    for k, trim in enumerate(plan.trims):
        begin, end = plan.switching_times[k : k + 2]
        steps = int(np.ceil(rate * (end - begin)))
        times += np.linspace(begin, end, steps + 1)[:-1].tolist()
        controls += [trim.control.tolist()] * steps
    times.append(float(plan.switching_times[-1]))
    controls.append(controls[-1] if controls else [])
    text = json.dumps(
        {
            "schema": 1,
            "status": "found",
            "reason": "",
            "cost": 9.75,
            "duration_s": plan.duration,
            "primitives": [
                {"kind": "trim", "name": t.name, "control": t.control.tolist(), "duration_s": d}
                for t, d in zip(plan.trims, plan.durations.tolist(), strict=True)
            ],
            "terminal_error": {"position_m": 2e-16, "heading_rad": 0.0},
            "trajectory": {
                "origin": [0.0, 0.0],
                "time_s": times,
                "pose": plan.pose_at(times).tolist(),
                "reduced_state": [[] for _ in times],
                "control": controls,
            },
            "alternatives": [],
        }
    )
    return json.loads(text)


def assert_picture(path):
    """`path` is a whole PNG that shows something, and nothing was left beside it."""
    with Image.open(path) as image:
        assert image.format == "PNG"
        pixels = np.asarray(image.convert("L"))
    assert pixels.min() < 60
    assert pixels.max() == 255
    edge = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
    assert edge.min() == 255, "something is clipped at the edge"
    assert [other.name for other in Path(path).parent.iterdir()] == [Path(path).name]
