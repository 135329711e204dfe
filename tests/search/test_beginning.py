"""The first call of a query: what a query that goes on works out, and the same expansions."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton._kept import Prepared
from maneuver_automaton._kernel_files import kinds_of
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.collision import Box, Disc, Obstacle
from maneuver_automaton.planning import Planner, plan
from maneuver_automaton.problem import Bounds, Problem, SearchSettings
from maneuver_automaton.search import beginning
from maneuver_automaton.search.lattice import distance_grids
from maneuver_automaton.search.lattice_pass import pass_of
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.lattice_task import first_resolutions
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


@compiled_only
@pytest.mark.parametrize("bounds", [Bounds(), Bounds(x=(-90.0, 90.0), y=(-90.0, 90.0))])
@pytest.mark.parametrize("free_heading", [False, True])
def test_a_query_that_was_begun_is_what_a_query_is(free_heading: bool, bounds: Bounds) -> None:
    """To the last bit, and of the same types: those of its searches are not looked at again."""
    first, *others = room_queries(3, boxes=25)
    goals = [replace(goal, free_heading=free_heading) for one in others for goal in one.goals]
    problem, prepared = replace(first, goals=tuple(goals), bounds=bounds), Prepared()
    one = begun(problem, prepared)
    assert one is not None
    seen, query = one.query_of(problem), lattice_query(problem, (0, 1), prepared=prepared)
    for name in ("start", "goals", "goal_poses", "box", "free_heading", "goal_index", "most_time"):
        assert np.array_equal(getattr(seen, name), getattr(query, name)), name
    assert all(map(np.array_equal, seen.around[1:8], query.around[1:8]))
    searches = [one.search_of(seen)]
    for each in first_resolutions(seen.library, problem.search):
        for grid, sign in zip(distance_grids(seen), (1.0, -1.0), strict=True):
            searches.append(pass_of(seen, each, grid=grid, sign=sign))
    assert {kinds_of(each.search) for each in searches} == {kinds_of(one.call.search)}


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
