from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.collision import Box, OccupancyMap, Polygon
from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.plotting.cast import Cast, cast_of
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.recording import recording_of
from tests.plotting.cases import ROBOT, plan_of, slalom_problem

PLAN = plan_of(["straight"], [2.0], start=(0.0, 0.0, 0.0))  # 3 m ahead
BODY = Box([0.6, 0.4])


def shown(problem, plan) -> Cast:
    status = PlanStatus.NO_PLAN if plan is None else PlanStatus.FOUND
    return cast_of(recording_of(PlanResult(problem=problem, status=status, reason="", plan=plan)))


def cast_among(obstacles, **options) -> Cast:
    return shown(Problem(ROBOT, PLAN.start, PLAN.end, obstacles=obstacles, **options), PLAN)


def view_of(obstacles, **options):
    return cast_among(obstacles, **options).box


def test_without_obstacles_the_plan_and_its_body_fill_the_view():
    np.testing.assert_allclose(view_of((), footprint=BODY), [[-0.3, -0.2], [3.3, 0.2]])


def test_obstacles_near_the_plan_are_all_shown():
    view = view_of([Box([1.0, 1.0], [5.0, 1.0]), Box([0.2, 0.2], [0.0, -2.0])], footprint=BODY)
    np.testing.assert_allclose(view, [[-0.3, -2.1], [5.5, 1.5]])


def test_a_map_much_larger_than_the_plan_is_cropped():
    blocked = np.ones((100, 200))
    cells = OccupancyMap(blocked, resolution=1.0, origin=[-50.0, -1.0, 0.0])
    low, high = view_of(cells, footprint=BODY)
    np.testing.assert_allclose(low, [-0.3 - 1.8, -1.0])  # half of 3.6 m, but not beyond the map
    np.testing.assert_allclose(high, [3.3 + 1.8, 0.2 + 1.8])


def test_only_blocked_cells_count():
    blocked = np.zeros((100, 100))
    blocked[50, 48:53] = 1.0
    cells = OccupancyMap(blocked, resolution=1.0, origin=[-48.0, -50.0, 0.0])
    np.testing.assert_allclose(view_of(cells, footprint=BODY), [[-0.3, -0.2], [5.0, 1.0]])
    turned = OccupancyMap(blocked, resolution=1.0, origin=[50.0, -48.0, np.pi / 2])
    np.testing.assert_allclose(view_of(turned, footprint=BODY), [[-1.0, -0.2], [3.3, 5.0]])


def test_what_moves_is_in_view_at_the_times_shown():
    plan = plan_of(["straight"], [3.0])
    scene = shown(slalom_problem(plan), plan).scene
    assert scene.moves
    assert scene.times[[0, -1]].tolist() == [0.0, 3.0]


def test_the_goal_reached_is_the_nearest():
    goals = [Goal(pose=[3.0, 0.0, 2.0]), Goal(pose=[3.0, 0.0, 2 * np.pi]), Goal(pose=[9, 0, 0])]
    problem = Problem(ROBOT, PLAN.start, goals)
    assert shown(problem, PLAN).scene.reached == 1
    assert shown(problem, None).scene.reached is None


@pytest.mark.parametrize("far", [30.0, 300.0])
def test_marks_suit_the_body_on_a_long_way(far):
    plan = plan_of(["straight"], [far / 1.5], start=(0.0, 0.0, 0.0))
    problem = Problem(ROBOT, plan.start, plan.end, footprint=BODY)
    assert shown(problem, plan).size == pytest.approx(0.35 * far)


def test_marks_stay_visible_where_obstacles_fill_the_picture():
    wall = Polygon([[-3.0, -3.0], [3.0, -3.0], [3.0, -2.5]])
    cast = cast_among(wall, footprint=BODY)
    assert cast.size == pytest.approx(0.5 * np.ptp(cast.box, axis=0).max())
