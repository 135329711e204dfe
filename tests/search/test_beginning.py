"""The first call of a query: what a query that goes on works out, and the same expansions."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from maneuver_automaton._kept import Prepared
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.collision import Box, Obstacle
from maneuver_automaton.planning import Planner, plan
from maneuver_automaton.problem import Bounds, Goal, Problem, SearchSettings
from maneuver_automaton.search import beginning
from maneuver_automaton.search.cost_to_go import NO_TABLE
from maneuver_automaton.search.lattice import _Guides
from maneuver_automaton.search.lattice_pass import pass_of
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.lattice_task import task_of
from tests.quickly import quick_are
from tests.scenes import CAR_BODY, differential_robot, random_scene, reeds_shepp, room_queries
from tests.search.cases import compiled_only

WALL = Obstacle(Box([1.0, 6.0], [6.0, 0.0]))
CAR = Problem(reeds_shepp(), [0, 0, 0], [12, 2, 0.4], obstacles=(WALL,), footprint=CAR_BODY)
ANY_HEADING = Goal(pose=[12.0, 0.0, 0.0], free_heading=True)
ONCE = SearchSettings(improve=False)


def begun(problem: Problem, prepared: Prepared) -> beginning.Begun | None:
    beginning.prepare_first_call(problem, prepared)
    return beginning.begin(problem, prepared, UNLIMITED)


def assert_same(one: object, other: object) -> None:
    """Records within records have the same values."""
    if isinstance(one, tuple):
        for a, b in zip(one, other, strict=True):
            assert_same(a, b)
    else:
        assert np.array_equal(one, other)


def assert_begun_as(one: beginning.Begun, query: LatticeQuery) -> None:
    """All that the first call has worked out is what the query says, to the last bit."""
    call, search, arrays = one.call, one.call.search, one.call.search.arrays
    ends = np.vstack([query.start, query.goals])
    assert call.arrays.seen.tolist() == ends.tolist()
    assert call.arrays.margin[0] == query.margin
    assert call.arrays.window_box.tolist() == query.box.tolist()
    assert search.scene.window.tolist() == query.window.tolist()
    assert search.scene.edge_window.tolist() == query.around.edge_window.tolist()
    grid = _Guides(query, NO_TABLE, None).grid(call.resolution, 1.0)
    slow = pass_of(query, call.resolution, grid=grid)
    slow.run(int(call.arrays.asked[0]), np.inf)
    assert arrays.state[1:].tolist()[:1] == slow.arrays.state[1:].tolist()[:1]
    assert arrays.state[3:].tolist() == slow.arrays.state[3:].tolist()
    n = int(arrays.state[0])
    assert n == slow.arrays.state[0]
    assert arrays.nodes[:n].tolist() == slow.arrays.nodes[:n].tolist()
    assert arrays.links[:n].tolist() == slow.arrays.links[:n].tolist()
    if one.is_found:
        assert arrays.found.tolist() == slow.arrays.found.tolist()
        return
    again = one.search_of(query)
    task = task_of(query, call.resolution)
    assert_same(again.search.task, task)
    assert (again.search.grid.layout, again.search.grid.walls) == (grid.layout, grid.walls)


@pytest.mark.parametrize("seed", quick_are(range(12), range(72)))
def test_the_first_call_does_what_the_search_does(seed: int) -> None:
    problem, prepared = random_scene(seed), Prepared()
    one = begun(problem, prepared)
    if one is not None:
        assert one.call.steps == 64
        query = lattice_query(problem, tuple(range(len(problem.goals))), prepared=prepared)
        assert_begun_as(one, query)


@compiled_only
def test_random_scenes_are_begun_so() -> None:
    """Most of them: not with something in the way of an end, nor with one bound alone."""
    assert sum(begun(random_scene(seed), Prepared()) is not None for seed in range(40)) > 12


@pytest.mark.parametrize(
    "change",
    [
        {"bounds": Bounds(x=(-5.0, 20.0), y=(-9.0, 9.0))},
        {"margin": 0.2},
        {"goals": (ANY_HEADING,)},
        {"goals": ([12.0, 2.0, 0.4], [-9.0, 1.0, 3.0])},
        {"search": SearchSettings(weight=1.5, cell=0.3, headings=40)},
        {"search": SearchSettings(max_expansions=7)},
    ],
    ids=["bounds", "margin", "free heading", "several goals", "settings", "few expansions"],
)
def test_a_call_serves_every_query_of_its_setting(change) -> None:
    first = Problem(
        CAR.automaton,
        CAR.start,
        change.get("goals", CAR.goals),
        obstacles=CAR.obstacles,
        footprint=CAR.footprint,
        **{name: value for name, value in change.items() if name != "goals"},
    )
    prepared = Prepared()
    rng = np.random.default_rng(5)
    for _ in range(6):
        start = rng.uniform([-6.0, -6.0, -3.0], [0.5, 6.0, 3.0])
        query = first.starting_at(start, time=0.0)
        one = begun(query, prepared)
        assert one is not None
        many = tuple(range(len(query.goals)))
        assert_begun_as(one, lattice_query(query, many, prepared=prepared))
        beginning.end(query, one, prepared)


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


def test_what_moves_or_has_maneuvers_has_no_first_call() -> None:
    prepared = Prepared()
    moving = Obstacle(Box([1.0, 1.0]), motion=[[0.0, 9.0, 9.0, 0.0], [5.0, 9.0, 3.0, 0.0]])
    bounded = Bounds(x=(-20.0, 20.0))
    for change in ({"obstacles": (WALL, moving)}, {"obstacles": ()}, {"bounds": bounded}):
        given = {"obstacles": CAR.obstacles, "footprint": CAR.footprint} | change
        problem = Problem(CAR.automaton, CAR.start, CAR.goals, **given)
        assert begun(problem, prepared) is None


@compiled_only  # otherwise the time is over first
@pytest.mark.parametrize("seed", range(4))
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
