"""The first call of a query: what a query that goes on works out, and the same expansions."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from maneuver_automaton._kept import Prepared
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.collision import Box, Disc, Obstacle
from maneuver_automaton.planning import Planner, plan
from maneuver_automaton.problem import Problem, SearchSettings
from maneuver_automaton.search import beginning
from tests.scenes import CAR_BODY, differential_robot, random_scene, reeds_shepp, room_queries
from tests.search.cases import compiled_only

WALL = Obstacle(Box([1.0, 6.0], [6.0, 0.0]))
CAR = Problem(reeds_shepp(), [0, 0, 0], [12, 2, 0.4], obstacles=(WALL,), footprint=CAR_BODY)
ONCE = SearchSettings(improve=False)


def begun(problem: Problem, prepared: Prepared) -> beginning.Begun | None:
    beginning.prepare_first_call(problem, prepared)
    return beginning.begin(problem, prepared, UNLIMITED)


@compiled_only
def test_random_scenes_are_begun_so() -> None:
    """Most of them: not with something in the way of an end, nor with one bound alone."""
    assert sum(begun(random_scene(seed), Prepared()) is not None for seed in range(40)) > 12


@compiled_only  # the first one searches all there is
@pytest.mark.parametrize(
    ("start", "goal"),
    [
        ([6.0, 0.0, 0.0], [12.0, 2.0, 0.4]),  # in the wall
        ([0.0, 0.0, 0.0], [3.0, 0.0, 0.0]),  # too near to it
        ([0.0, 0.0, 0.0], [900.0, 2.0, 0.4]),  # more cells than there is memory for
    ],
)
def test_what_is_not_begun_is_planned_all_the_same(start, goal) -> None:
    planner = Planner(CAR.automaton, obstacles=CAR.obstacles, footprint=CAR_BODY, search=ONCE)
    query, prepared = planner.problem(start, goal), planner.workspace.prepared
    assert beginning.begin(query, prepared, UNLIMITED) is None
    near = planner.problem([0, 0, 0], [12, 2, 0.4])
    assert beginning.begin(near, prepared, UNLIMITED) is not None
    found, alone = planner.plan(start, goal), plan(query)
    assert (found.status, found.cost) == (alone.status, alone.cost)


@compiled_only  # otherwise the time is over first
@pytest.mark.parametrize("seed", [1, 3])
def test_a_planner_finds_what_a_plan_alone_finds(seed: int) -> None:
    room = room_queries(4, boxes=25)[seed]
    given = {"obstacles": room.obstacles, "footprint": room.footprint, "bounds": room.bounds}
    for search in (ONCE, SearchSettings(max_expansions=300)):
        planner = Planner(room.automaton, search=search, **given)
        many = planner.plan(room.start, room.goals)
        alone = plan(Problem(room.automaton, room.start, room.goals, search=search, **given))
        assert many.plan.word == alone.plan.word
        assert many.plan.durations.tolist() == alone.plan.durations.tolist()
        assert many.counts == alone.counts


@compiled_only
@pytest.mark.parametrize("number", [1, 2])
def test_another_goal_among_discs_is_planned_as_by_itself(number: int) -> None:
    """Of one disc nothing says in which direction it lies: what was begun was seen from a goal."""
    discs = (Disc(3.0, [1.0, 0.5]), Disc(1.0, [4.0, 7.0]))[:number]
    planner = Planner(CAR.automaton, obstacles=discs, footprint=CAR_BODY, search=ONCE)
    planner.plan([-9, 0, 0], [9, 0, 0])
    for goal in ([7.0, 6.0, 2.0], [6.0, -7.0, -1.0]):
        found, alone = planner.plan([-8, -3, 0.5], goal), plan(planner.problem([-8, -3, 0.5], goal))
        assert found.plan.durations.tolist() == alone.plan.durations.tolist()


@compiled_only
def test_threads_share_a_planner() -> None:
    robot = differential_robot()
    planner = Planner(robot, obstacles=(WALL,), footprint=Box([0.6, 0.4]), search=ONCE)
    starts = np.random.default_rng(2).uniform([-3, -3, -3], [3, 3, 3], (24, 3))
    expected = [planner.plan(start, [10, 0, 1]).cost for start in starts]
    found = [[0.0] * len(starts) for _ in range(3)]

    def ask(row: list[float]) -> None:
        for k, start in enumerate(starts):
            row[k] = planner.plan(start, [10, 0, 1]).cost

    threads = [threading.Thread(target=ask, args=(row,)) for row in found]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert found == [expected] * 3
