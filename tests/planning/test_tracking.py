from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning.tracking import clearance_at, free_until, stands_free, track
from maneuver_automaton.problem import Goal, Horizon, Problem
from tests.scenes import differential_robot
from tests.solids import check_plan

ROBOT = differential_robot(1.0, 1.5)
REST, AHEAD = ROBOT.trims[0], ROBOT.trims[1]
WALL = Obstacle(Box([0.2, 4.0], [3.0, 1.0]))
PASSING = Obstacle(Disc(0.5), motion=Motion([0.0, 6.0], [[3, -3, 0], [3, 3, 0]]))


def problem(*obstacles, **changed) -> Problem:
    goal = changed.pop("goal", [6.0, 0.0, 0.0])
    return Problem(
        ROBOT, [0.0, 0.0, 0.0], goal, obstacles=obstacles, footprint=Disc(0.3), **changed
    )


def straight(seconds: float, *, waiting: float = 0.0) -> Plan:
    return Plan([0.0, 0.0, 0.0], (REST, AHEAD), durations=[waiting, seconds])


class TestFreeUntil:
    def test_by_hand(self):
        # the front of the robot is 0.3 m ahead of it, the wall begins at 2.9 m
        assert free_until(problem(WALL), straight(6.0)) == pytest.approx(2.6, abs=1e-3)
        assert free_until(problem(WALL), straight(2.5)) == 2.5
        assert free_until(problem(WALL, margin=0.6), straight(6.0)) == pytest.approx(2.0, abs=1e-3)

    def test_what_moves_is_where_it_is_at_the_time(self):
        assert free_until(problem(PASSING), straight(6.0)) < 3.0
        assert free_until(problem(PASSING), straight(6.0, waiting=2.0)) == 8.0

    def test_an_empty_plan_is_free(self):
        assert free_until(problem(WALL), Plan([3.0, 0.0, 0.0], (), durations=[])) == 0.0


def test_standing_is_free_until_something_comes():
    here = np.array([3.0, 0.0, 0.0])
    free = stands_free(problem(PASSING), here, time=0.0, duration=60.0)
    assert free == pytest.approx(2.2, abs=1e-3)  # centres 0.8 m apart
    assert stands_free(problem(PASSING), here, time=3.9, duration=60.0) == 60.0
    assert stands_free(problem(PASSING), here, time=3.0, duration=60.0) == 0.0


def test_clearance_by_hand():
    poses = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 1.0]])
    times = np.array([0.0, 0.0])
    clearances = clearance_at(problem(PASSING), poses, times)
    assert clearances[1] == pytest.approx(2.2)
    assert clearances[0] <= np.hypot(3.0, 3.0) - 0.8 + 1e-9


class TestTrack:
    @pytest.mark.parametrize("obstacles", [(WALL,), (PASSING,), (WALL, PASSING), ()])
    def test_what_it_finds_is_free_and_ends_at_the_goal(self, obstacles):
        task = problem(*obstacles)
        found = track(task, budget=Budget.from_now(20.0))
        assert found.plan is not None
        assert check_plan(task, found.plan, found.goal_index or 0).passes(task, 0)
        assert found.cost == pytest.approx(task.cost_of(found.plan))

    def test_a_known_plan_is_improved_or_kept(self):
        task = problem(WALL)
        first = track(task, budget=Budget.from_now(20.0))
        again = track(task, budget=Budget.from_now(20.0), known=first.plan)
        assert again.cost <= first.cost + 1e-9

    def test_a_known_plan_that_hits_something_is_not_taken(self):
        found = track(problem(WALL), budget=Budget.from_now(20.0), known=straight(6.0))
        assert found.cost > 6.5

    def test_a_blocked_goal_is_left_out(self):
        goals = [Goal(pose=[3.0, 0.0, 0.0]), Goal(pose=[6.0, 0.0, 0.0])]
        assert track(problem(WALL, goal=goals), budget=Budget.from_now(20.0)).goal_index == 1
        found = track(problem(WALL, goal=goals[0]), budget=Budget.from_now(20.0))
        assert (found.plan, found.reason) == (None, "every goal is blocked")

    def test_the_limit_of_expansions(self):
        cage = Obstacle(
            Disc(0.5), motion=Motion([0.0, 9.0, 12.0], [[6, 0, 0], [6, 0, 0], [6, 9, 0]])
        )
        found = track(problem(cage), budget=Budget.from_now(20.0), max_expansions=10)
        assert (found.plan, found.reason) == (None, "no plan was found in the time given")

    @pytest.mark.slow
    def test_a_fixed_time_is_filled_with_rest(self):
        found = track(problem(WALL, horizon=Horizon(time=20.0)), budget=Budget.from_now(20.0))
        assert found.plan is not None
        assert found.plan.duration == pytest.approx(20.0)
        assert found.plan.word[-1] == "rest"

    def test_a_moved_problem_has_the_moved_plan(self):
        move = SE2(np.array([3.0, -8.0, 0.8]))
        task = problem(WALL, PASSING)
        one, two = (track(each, budget=Budget.from_now(20.0)) for each in (task, task.moved(move)))
        assert one.plan is not None
        assert two.plan is not None
        assert one.plan.word == two.plan.word
        assert two.cost == pytest.approx(one.cost, abs=1e-6)
