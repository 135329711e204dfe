"""Forklift, four-wheel steering, wheel loader, trailers: each judged by an integration of its own.

What is integrated here are headings and axles in the world, written down from the constraint that
no wheel slips sideways; nothing of it comes from the package.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.integrate import solve_ivp
from shapely import affinity

import maneuver_automaton as ma
from maneuver_automaton.models import (
    ArticulatedVehicle,
    FourWheelSteeringCar,
    RearSteeredCar,
    TractorWithTrailers,
    rollout,
)
from maneuver_automaton.primitives.connecting import pieces

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NAMES = (
    "rear_steered_forklift",
    "four_wheel_steering",
    "wheel_loader",
    "two_trailers",
    "tugger_train",
)
LOADER = {"front": 1.5, "rear": 1.9, "max_articulation": 0.7, "max_articulation_rate": 0.35}
TRAIN = {"wheelbase": 1.2, "hitch_length": 1.4, "max_steering": 0.8, "max_hitch": 1.2}


def slip_free(wheels, joints, speed, given):
    """Velocities (vx, vy, omega) of bodies whose wheels do not slip and whose joints hold.

    `wheels` are (body, point, heading), points seen from the body's origin; `joints` are (body,
    point, body, point); `speed` is (body, direction, value) and `given` the turn rates that are
    set, as (body, other body, rate of the difference).
    """
    n = 3 * (1 + max(body for body, _, _ in wheels))
    rows, right = [], []

    def at(body, point, direction):
        row = np.zeros(n)
        across = np.array([-point[1], point[0]])  # what turning adds to the velocity there
        row[3 * body : 3 * body + 3] = *direction, across @ direction
        return row

    for body, point, heading in wheels:
        rows.append(at(body, point, np.array([-math.sin(heading), math.cos(heading)])))
        right.append(0.0)
    for a, here, b, there in joints:
        for direction in np.eye(2):
            rows.append(at(a, here, direction) - at(b, there, direction))
            right.append(0.0)
    rows.append(at(speed[0], (0.0, 0.0), np.asarray(speed[1])))
    right.append(speed[2])
    for a, b, rate in given:
        row = np.zeros(n)
        row[3 * a + 2], row[3 * b + 2] = 1.0, -1.0
        rows.append(row)
        right.append(rate)
    return np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0].reshape(-1, 3)


def turned(point, heading):
    """A point of a body, seen along the axes of the world."""
    cosine, sine = math.cos(heading), math.sin(heading)
    return np.array([cosine * point[0] - sine * point[1], sine * point[0] + cosine * point[1]])


def rates(model, state, u):
    """Velocities of the pose and headings of all parts, from wheels and joints alone."""
    headings = state[2:]
    if isinstance(model, RearSteeredCar):
        rear = turned((-model.wheelbase, 0.0), headings[0])
        wheels = [(0, (0.0, 0.0), headings[0]), (0, rear, headings[0] + u[1])]
        joints, given = [], []
    elif isinstance(model, FourWheelSteeringCar):
        half = turned((0.5 * model.wheelbase, 0.0), headings[0])
        wheels = [(0, half, headings[0] + u[1]), (0, -half, headings[0] + u[2])]
        slip = math.atan(0.5 * (math.tan(u[1]) + math.tan(u[2])))
        course = headings[0] + slip
        speed = (0, (math.cos(course), math.sin(course)), u[0])
        return slip_free(wheels, [], speed, [])
    elif isinstance(model, ArticulatedVehicle):
        front = turned((-model.front, 0.0), headings[0])
        wheels = [(k, (0.0, 0.0), heading) for k, heading in enumerate(headings)]
        joints = [(0, front, 1, turned((model.rear, 0.0), headings[1]))]
        given = [(0, 1, u[1])]
    else:
        steered = turned((model.wheelbase, 0.0), headings[0])
        wheels = [(k, (0.0, 0.0), heading) for k, heading in enumerate(headings)]
        wheels.append((0, steered, headings[0] + u[1]))
        offsets = (model.hitch_offset, model.hitch_offset_2, model.hitch_offset_3)
        joints = [
            (
                k,
                turned((-offsets[k], 0.0), headings[k]),
                k + 1,
                turned((length, 0), headings[k + 1]),
            )
            for k, length in enumerate(model.lengths)
        ]
        given = []
    ahead = (math.cos(headings[0]), math.sin(headings[0]))
    return slip_free(wheels, joints, (0, ahead, u[0]), given)


def integrated(model, state, control, times):
    """Pose and headings of all parts at the last of `times`, by DOP853."""

    def slope(_, x):
        velocities = rates(model, x, control)
        return [*velocities[0, :2], *velocities[:, 2]]

    solution = solve_ivp(
        slope, (times[0], times[-1]), state, t_eval=times, method="DOP853", rtol=1e-10, atol=1e-11
    )
    return solution.y.T


def headings_of(pose, reduced):
    """Pose and headings of all parts: each angle is what pulls less what is pulled."""
    return np.concatenate([pose, pose[2] - np.cumsum(reduced)])


MODELS = (
    (RearSteeredCar(wheelbase=1.5, max_steering=1.3), (), (1.0, -0.6)),
    (FourWheelSteeringCar(wheelbase=3.0, max_steering=1.5), (), (-0.8, 0.9, -0.4)),
    (ArticulatedVehicle(**LOADER, max_speed=2.0), (0.4,), (-1.5, 0.2)),
    (ArticulatedVehicle(**LOADER, max_speed=2.0), (0.4,), (0.0, 0.2)),
    (TractorWithTrailers(**TRAIN, max_speed=1.5, hitch_offset=-0.2), (0.4,), (1.0, 0.4)),
    (
        TractorWithTrailers(
            **TRAIN,
            max_speed=1.5,
            hitch_offset=0.4,
            hitch_length_2=2.0,
            hitch_offset_2=0.6,
            hitch_length_3=1.1,
            hitch_offset_3=-0.1,
        ),
        (0.4, -0.2, 0.3),
        (-1.0, 0.3),
    ),
)


@pytest.mark.parametrize(("model", "state", "control"), MODELS, ids=lambda one: str(one)[:14])
def test_a_motion_is_that_of_wheels_that_do_not_slip(model, state, control):
    start = np.array([1.0, -2.0, 0.7, *state])
    ours = rollout(model, start, control=list(control), times=[0.0, 1.2], rtol=1e-11)[-1]
    end = integrated(model, headings_of(start[:3], state), control, [0.0, 1.2])[-1]
    np.testing.assert_allclose(headings_of(ours[:3], ours[3:]), end, atol=1e-8)


def solids(shapes, pose):
    """Boxes of the package as polygons of shapely."""
    for shape in shapes:
        placed = affinity.rotate(
            shapely.Polygon(shape.corners), pose[2], origin=(0, 0), use_radians=True
        )
        yield affinity.translate(placed, pose[0], pose[1])


def judged(problem, result):
    """A plan driven anew by `rates`: it ends at the goal, holds its joints, touches nothing."""
    assert result.status is ma.PlanStatus.FOUND, result.reason
    assert result.audit.passed
    model, plan = problem.automaton.model, result.plan
    rows = plan.sample()
    world = []
    for obstacle in problem.obstacles:
        disc = isinstance(obstacle.shape, ma.Disc)
        bare = shapely.Point(obstacle.shape.center) if disc else None
        size = obstacle.shape.radius if disc else 0.0
        world.append(bare.buffer(size) if disc else shapely.Polygon(obstacle.shape.corners))
    whole = shapely.union_all(world)
    state = headings_of(rows.pose[0], rows.reduced_state[0])
    for begin, end, control in pieces(rows.time, rows.control):
        for row in integrated(model, state, control, np.linspace(begin, end, 5)):
            state = row
            around = list(solids(problem.footprint, state[:3]))
            if model.part_names:
                reduced = state[2:-1] - state[3:]
                for name, seen in zip(model.part_names, model.part_poses(reduced), strict=True):
                    there = (ma.SE2(state[:3]) @ ma.SE2(seen)).pose
                    around += solids(problem.parts[name], there)
            assert min(body.distance(whole) for body in around) > problem.margin - 1e-4
    goal = problem.goals[0]
    off = state[:3] - goal.pose
    off[2] = math.remainder(off[2], 2.0 * math.pi)
    np.testing.assert_allclose(off, 0.0, atol=1e-4)
    np.testing.assert_allclose(state[2:] - state[2], 0.0, atol=1e-4)


@pytest.mark.parametrize(
    "back", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["there", "back again"]
)
@pytest.mark.parametrize("name", NAMES)
def test_a_plan_among_obstacles_is_driven_anew(name, back):
    problem = ma.load_scenario(SCENARIOS / f"{name}.yaml").problem
    settings = replace(problem.search, max_expansions=12_000, improve=False)
    problem = replace(problem, search=settings)
    if back:
        end = problem.goals[0].pose
        problem = replace(problem, start=end, goals=(ma.Goal(problem.start),))
    judged(problem, ma.plan(problem, time_limit=120.0))
