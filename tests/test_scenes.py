"""The scenes are what they say: the same for the same seed, free where they claim to be."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Disc, Motion, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.problem import Problem
from tests import scenes
from tests.solids import World, check_plan, clearance_at, map_boxes


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
