"""The scenes are what they say: the same for the same seed, free where they claim to be."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import cases
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Disc, Motion, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.problem import Problem
from tests import scenes
from tests.solids import World, check_plan, clearance_at, map_boxes

TIGHT = [
    *(scenes.parallel_slot(length) for length in scenes.SLOTS),
    *(scenes.bay(*sizes) for sizes in scenes.BAYS),
    *(scenes.corridor(width) for width in scenes.CORRIDORS),
]


def numbers(problem: Problem) -> np.ndarray:
    """All that a seed may change in a problem, as one row."""
    rows = [problem.start, *(goal.pose for goal in problem.goals), [problem.margin]]
    for obstacle in problem.obstacles:
        if isinstance(obstacle, OccupancyMap):
            rows += [obstacle.blocked.ravel(), obstacle.origin]
            continue
        shape = obstacle.shape
        rows.append(np.append(shape.center, shape.radius) if isinstance(shape, Disc)
                    else shape.corners.ravel())  # fmt: skip
        if obstacle.motion is not None:
            rows += [obstacle.motion.time, obstacle.motion.pose.ravel()]
    return np.concatenate([np.asarray(row, dtype=float) for row in rows])


@pytest.mark.parametrize("make", [scenes.random_scene, scenes.moving_scene])
def test_the_same_seed_makes_the_same_scene(make):
    for seed in (0, 3, 9):
        assert np.array_equal(numbers(make(seed)), numbers(make(seed)))
    assert not np.array_equal(numbers(make(1))[:3], numbers(make(2))[:3])


@pytest.mark.parametrize("problem", TIGHT)
def test_tight_places_are_free_at_both_ends(problem):
    assert clearance_at(problem, problem.start) > 0.2
    assert clearance_at(problem, problem.goals[0].pose) > 0.05


def test_queries_in_the_room_are_free_and_apart():
    queries = scenes.room_queries(10)
    assert len(queries) == 10
    for problem in queries:
        goal = problem.goals[0].pose
        assert min(clearance_at(problem, pose) for pose in (problem.start, goal)) > 0.3
        assert np.hypot(*(goal - problem.start)[:2]) >= 8.0


def test_field_queries_are_as_far_apart_as_asked():
    problem = scenes.field_query(60.0, 30.0, seed=1)
    assert np.hypot(*(problem.goals[0].pose - problem.start)[:2]) == pytest.approx(30.0)
    assert clearance_at(problem, problem.start) > 0.3


def test_the_slot_without_a_way_in_is_free_inside():
    problem = scenes.no_way_in(40.0)
    assert 0.0 < clearance_at(problem, problem.goals[0].pose) < 0.02
    assert clearance_at(problem, problem.start) > 0.3


def test_moving_scenes_start_free():
    for seed in range(5):
        problem = scenes.moving_scene(seed)
        assert clearance_at(problem, problem.start) > 0.3
        assert sum(o.motion is not None for o in problem.obstacles) == 12


def test_degenerate_scenes_are_degenerate():
    by_kind = [scenes.random_scene(9 + 10 * kind) for kind in range(9)]
    clearances = [clearance_at(problem, problem.start) for problem in by_kind]
    at_goal = [clearance_at(problem, problem.goals[0].pose) for problem in by_kind]
    assert by_kind[0].obstacles == ()
    assert np.array_equal(by_kind[1].start, by_kind[1].goals[0].pose)
    assert clearances[2] <= 0.0
    assert at_goal[2] <= 0.0
    assert by_kind[4].start[0] > 9e8
    assert clearances[5] == 0.0
    assert at_goal[6] == 0.0
    assert clearances[7] > 0.0
    assert at_goal[8] > 0.0


def test_random_scenes_hold_every_kind():
    drawn = [scenes.random_scene(seed) for seed in range(200)]
    shapes = {
        type(o if isinstance(o, OccupancyMap) else o.shape).__name__
        for problem in drawn
        for o in problem.obstacles
    }
    assert shapes == {"Box", "Disc", "OccupancyMap", "Polygon"}
    assert {len(problem.footprint) for problem in drawn} == {0, 1, 2}
    assert any(problem.goals[0].free_heading for problem in drawn)
    assert any(len(problem.goals) > 1 for problem in drawn)
    free = [clearance_at(problem, problem.start) > problem.margin for problem in drawn]
    assert 0.2 < np.mean(free) < 0.9


@pytest.mark.skipif(
    not (cases.DATA / "car-scenarios").exists(), reason="the car scenarios are not there"
)
@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("S1-0", scenes.parallel_slot(6.5)),
        ("S2-0", scenes.bay(2.6, 6.0)),
        ("S6-0", scenes.corridor(4.5)),
    ],
)
def test_the_geometry_is_that_of_the_car_scenarios(name, problem):
    given = cases.car_scenarios(name)[name]
    assert np.allclose(numbers(problem), numbers(given), atol=1e-9)
    assert np.allclose(
        np.sort(problem.automaton.body_velocities, axis=0),
        np.sort(given.automaton.body_velocities, axis=0),
    )


def test_solids_are_solid():
    ring = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    court = Polygon(5.0 * ring, [3.0 * ring])
    robot = scenes.differential_robot()

    def clearance(place, body, obstacle):
        problem = Problem(robot, [0, 0, 0], [0, 0, 0], obstacles=obstacle, footprint=body)
        return clearance_at(problem, [*place, 0.0])

    assert clearance([0, 0], Disc(1.0), court) == pytest.approx(2.0)
    assert clearance([4, 0], Disc(0.1), court) < 0.0
    assert clearance([0, 0], Polygon(9.0 * ring), court) <= 0.0
    assert clearance([0, 0], Polygon(9.0 * ring, [6.0 * ring]), court) == pytest.approx(1.0)
    assert clearance([3, 4], (), Disc(1.0)) == pytest.approx(4.0)
    assert clearance([7, 0], Polygon(2.0 * ring), court) == 0.0


def test_map_boxes_cover_the_blocked_cells_and_no_more():
    blocked = np.random.default_rng(4).random((7, 9)) < 0.5
    cells = OccupancyMap(blocked, resolution=0.5, origin=[3.0, 1.0, 0.4])
    robot = scenes.differential_robot()
    world = World(Problem(robot, [0, 0, 0], [0, 0, 0], obstacles=cells))
    columns, rows = np.meshgrid(np.arange(9) + 0.5, np.arange(7) + 0.5)
    turned = np.exp(0.4j) * 0.5 * (columns + 1j * rows)
    poses = np.stack([turned.real + 3.0, turned.imag + 1.0, 0 * columns], axis=-1).reshape(-1, 3)
    assert np.array_equal(world.clearance(poses) <= 0.0, blocked.ravel())
    assert len(map_boxes(cells)) < blocked.sum()


def test_a_plan_through_a_wall_is_seen():
    robot = scenes.differential_robot()
    free = Problem(robot, [0.0, 0.0, 0.0], [4.0, 0.0, 0.0], footprint=Disc(0.2))
    plan = Plan(free.start, (robot["ahead"],), durations=[8.0])
    assert check_plan(free, plan, 0).passes(free, 0)
    wall = Polygon([[2.0, -1.0], [2.01, -1.0], [2.01, 1.0], [2.0, 1.0]])
    walled = Problem(robot, free.start, free.goals[0], obstacles=wall, footprint=Disc(0.2))
    found = check_plan(walled, plan, 0)
    assert found.clearance_m < 0.0
    assert not found.passes(walled, 0)
    passing = Obstacle(Disc(0.3), motion=Motion([3.0, 5.0], [[2, 1, 0], [2, -1, 0]]))
    crossed = Problem(robot, free.start, free.goals[0], obstacles=passing, footprint=Disc(0.2))
    assert check_plan(crossed, plan, 0).clearance_m == pytest.approx(-0.5, abs=0.02)
