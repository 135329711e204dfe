"""Libraries of lattice primitives: every goal on the lattice is reached, the others are told."""

from __future__ import annotations

import heapq
import math

import numpy as np
import pytest
import shapely
from shapely.affinity import rotate, translate

from maneuver_automaton.collision import Box
from maneuver_automaton.formats.lattice import Lattice, Move, automaton_of_lattice
from maneuver_automaton.formats.libraries import read_primitives
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.problem import Goal, Problem, SearchSettings
from tests.formats.outside import DATA, needs_data

CELL, QUARTER = 0.5, math.pi / 2
WORK = SearchSettings(max_expansions=60000)
BODY = Box([0.5, 0.3])
WALL = Box([0.4, 3.0], center=[2.0, 0.0])


def moves():
    """Ahead by a cell, and quarter turns of two cells to either side, at four headings."""
    for k in range(4):
        pose = SE2(np.array([0.0, 0.0, k * QUARTER]))
        ahead = (pose @ SE2.exp(np.outer([0.0, 1.0], [CELL, 0.0, 0.0]))).pose
        yield Move(start=k, end=k, poses=ahead)
        for side in (1, -1):
            turn = np.array([2.0 * CELL * QUARTER, 0.0, side * QUARTER])
            poses = (pose @ SE2.exp(np.outer(np.linspace(0.0, 1.0, 9), turn))).pose
            yield Move(start=k, end=(k + side) % 4, poses=poses)


def library():
    headings = [k * QUARTER for k in range(4)]
    return automaton_of_lattice(
        Lattice(resolution=CELL, headings=headings, moves=tuple(moves()), turning_radius=1.0)
    )


def body_at(pose):
    shape = shapely.box(-0.25, -0.15, 0.25, 0.15)
    return translate(rotate(shape, pose[2], origin=(0, 0), use_radians=True), pose[0], pose[1])


def least_cost(automaton, start, goal, wall=None):
    """Dijkstra over cells and headings; the body is held against the wall by shapely."""
    cell = automaton.model.resolution
    world = SE2(np.array([0.0, 0.0, 0.0]))
    frontier, known = [(0.0, 0, 0, start)], {}
    while frontier:
        cost, i, j, trim = heapq.heappop(frontier)
        if (i, j, trim) in known:
            continue
        known[i, j, trim] = cost
        if (i, j, trim) == goal:
            return cost
        state = automaton[trim].reduced_state
        here = SE2(np.array([i * cell, j * cell, math.atan2(state[1], state[0])]))
        for one in automaton.maneuvers:
            if one.source != trim:
                continue
            poses = (world @ here @ SE2(one.course.pose)).pose
            if wall is not None and any(body_at(p).intersects(wall) for p in dense(poses)):
                continue
            column, row = np.round(poses[-1, :2] / cell).astype(int).tolist()
            if max(abs(column), abs(row)) <= 16:
                heapq.heappush(frontier, (cost + one.duration, column, row, one.target))
    return math.inf


def dense(poses):
    between = poses[:-1, None] + np.linspace(0.0, 1.0, 6)[:, None] * np.diff(poses, axis=0)[:, None]
    return between.reshape(-1, 3)


def on_grid(result):
    """How far the plan's switching poses are from the middle of a cell [m]."""
    across = result.plan.switching_poses[:, :2] / CELL
    return float(np.abs(across - np.round(across)).max()) * CELL


@pytest.mark.parametrize(
    ("goal", "there"),
    [([4.0, 0.0, 0.0], (8, 0, "heading 0")), ([3.0, 1.5, -QUARTER], (6, 3, "heading 3"))],
)
def test_a_goal_on_the_lattice_is_reached_at_the_least_cost(goal, there):
    problem = Problem(library(), [0, 0, 0], goal, footprint=BODY, obstacles=WALL, search=WORK)
    result = plan(problem, time_limit=60.0)
    assert result.status is PlanStatus.FOUND, result.reason
    np.testing.assert_allclose(result.plan.end[:2], goal[:2], atol=1e-9)
    assert math.remainder(result.plan.end[2] - goal[2], 2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert on_grid(result) < 1e-9
    names = {one.name for one in problem.automaton.maneuvers}
    assert set(result.plan.word) <= names
    wall = shapely.box(1.8, -1.5, 2.2, 1.5)
    best = least_cost(problem.automaton, "heading 0", there, wall)
    assert result.cost == pytest.approx(best, rel=1e-9)
    assert not any(body_at(p).intersects(wall) for p in result.plan.sample().pose)


def test_the_lattice_lies_under_the_start():
    by = SE2(np.array([3.0, -1.0, 0.4]))
    problem = Problem(library(), [0, 0, 0], [2.0, 1.0, QUARTER], search=WORK)
    one = plan(problem, time_limit=60.0)
    other = plan(problem.moved(by), time_limit=60.0)
    assert one.plan.word == other.plan.word
    np.testing.assert_allclose((by @ SE2(one.plan.end)).pose, other.plan.end, atol=1e-9)


NEAREST = "the goal is beside the lattice of 0.5 m that begins at the start: the nearest node, "


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        (Goal(pose=[1.1, 0.0, 0.0]), "(1, 0) m at 0 rad, is 0.1 m and 0 rad off"),
        (Goal(pose=[1.0, 0.5, 0.3]), "(1, 0.5) m at 0 rad, is 0 m and 0.3 rad off"),
        (Goal(pose=[1.1, 0.0, 1.5], tolerance_m=0.05, tolerance_rad=0.2),
         "(1, 0) m at 1.570796327 rad, is 0.1 m and 0.0707963 rad off; its tolerance is 0.05 m and "
         "0.2 rad"),
        (Goal(pose=[1.1, 0.0, 0.3], free_heading=True),
         "(1, 0) m at 0 rad, is 0.1 m and 0 rad off"),
    ],
)  # fmt: skip
def test_a_goal_beside_the_lattice_is_told(goal, said):
    result = plan(Problem(library(), [0, 0, 0], goal, search=WORK), time_limit=60.0)
    assert (result.status, result.reason) == (PlanStatus.NO_PLAN, NEAREST + said)
    assert result.counts == {}


def test_a_goal_beside_the_lattice_is_reached_within_its_tolerance():
    goal = Goal(pose=[1.1, -0.05, 0.1], tolerance_m=0.2, tolerance_rad=0.15)
    result = plan(Problem(library(), [0, 0, 0], goal, search=WORK), time_limit=60.0)
    assert result.status is PlanStatus.FOUND
    np.testing.assert_allclose(result.plan.end, [1.0, 0.0, 0.0], atol=1e-9)
    assert result.terminal_error.position_m == pytest.approx(math.hypot(0.1, 0.05))


@pytest.mark.slow
@needs_data
@pytest.mark.parametrize(
    ("name", "goal"),
    [
        ("nav2-lattice/ackermann_5cm_r0.5m.json", [2.0, 1.0, 0.0]),
        ("nav2-lattice/diff_5cm_r1m.json", [2.0, 0.0, 0.0]),
        ("nav2-lattice/omni_5cm_r0.5m.json", [2.0, 0.0, 0.0]),
        ("sbpl/mprim/pr2.mprim", [2.0, 0.0, 0.0]),
        ("sbpl/mprim/unicycle_noturninplace.mprim", [2.0, 1.0, 0.0]),
        ("sbpl/mprim/unicycle_first_order_0.mprim", [2.0, 1.0, 0.0]),
        ("sbpl/mprim/non_uniform_res01_rad3_err005.mprim", [16.0, 4.0, 0.0]),
    ],
)
def test_files_of_primitives_plan_around_a_wall(name, goal):
    automaton = read_primitives(DATA / name).automaton
    size = goal[0] / 2.0
    wall = Box([0.2 * size, 1.5 * size], center=[size, 0.0])
    problem = Problem(
        automaton, [0, 0, 0], goal, obstacles=wall, footprint=Box([0.3, 0.2]), search=WORK
    )
    result = plan(problem, time_limit=60.0)
    assert result.status is PlanStatus.FOUND, result.reason
    assert set(result.plan.word) <= {one.name for one in automaton.maneuvers}
    assert result.terminal_error.position_m < 1e-9
    inside = shapely.box(0.9 * size, -0.75 * size, 1.1 * size, 0.75 * size)
    places = shapely.points(result.plan.sample().pose[:, :2])
    assert shapely.distance(places, inside).min() > 0.1  # half the width of the body


@needs_data
def test_primitives_of_commonroad_plan_though_some_lead_nowhere():
    folder = DATA / "commonroad/primitives"
    (path,) = folder.glob("V_0.0_20.0_*.xml")
    automaton = read_primitives(path).automaton
    goal = Goal(pose=[60.0, 3.0, 0.0], trim="speed 8, steering 0")
    body, wall = Box([4.5, 1.6], center=[1.42, 0.0]), Box([4.0, 1.5], center=[30.0, 0.0])
    problem = Problem(
        automaton,
        [0, 0, 0],
        goal,
        start_trim="speed 8, steering 0",
        footprint=body,
        obstacles=wall,
        search=SearchSettings(max_expansions=400),
    )
    result = plan(problem, time_limit=60.0)
    assert result.status is PlanStatus.FOUND, result.reason
    assert result.terminal_error.position_m < 1e-9
