"""Plans of trims and maneuvers among obstacles: exact, free by another library, moved with all."""

from __future__ import annotations

import functools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely

from maneuver_automaton._arrays import wrapped
from maneuver_automaton.collision import Box, Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds, Goal, Problem
from maneuver_automaton.search.lattice_pass import plan_of_word
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.result import SearchStatus
from tests.search.automata import (
    inertial_unicycle,
    truck_with_trailer,
)
from tests.search.cases import compiled_only
from tests.search.maneuver_searches import search_maneuvers, word_is_free

pytestmark = compiled_only  # whole searches; their kernels have tests of their own

BODY = Box([0.5, 0.25])
WALLS = (Obstacle(Box([0.2, 3.0], [1.5, -0.6])), Obstacle(Box([0.2, 3.0], [3.0, 1.4])))
ROOM = Bounds(x=(-0.5, 5.0), y=(-1.5, 2.5))
HITCHED = ("0 at 0.00", "0 at 0.00")  # the trailer straight behind its truck
START, GOAL = np.array([0.5, 0.0, 0.0]), np.array([4.0, 1.0, 2.0])


@cache
@functools.cache
def unicycle():
    return inertial_unicycle(levels=3)


def posed(automaton, start, goal, *, trims, body=BODY, **settings):
    """The query of a vehicle from a pose in the first of two trims to one in the other."""
    aim = Goal(pose=np.array(goal), trim=trims[1])
    problem = Problem(automaton, start, aim, start_trim=trims[0], footprint=body, **settings)
    return lattice_query(problem, (0,))


def query(start=START, goal=GOAL, **changes):
    settings = {"obstacles": WALLS, "bounds": ROOM, "trims": ("0 0", "0 0")} | changes
    return posed(unicycle(), start, goal, **settings)


def least_clearance(plan, obstacles, *, model=None, carried=()):
    """Least distance of dense poses from the obstacles, by shapely, at the times of the plan."""
    times = np.linspace(0.0, plan.duration, 4000)
    poses = plan.pose_at(times)
    vehicles = [outlines(poses, BODY)]
    if carried:
        samples = plan.sample(max_step_m=0.01, max_step_rad=0.01)
        state = np.interp(times, samples.time, samples.reduced_state[:, 0])[:, None]
        there = (SE2(poses) @ SE2(model.part_poses(state)[:, 0])).pose
        vehicles.append(outlines(there, carried[0]))
    clearance = np.inf
    for obstacle in obstacles:
        box = obstacle.shape
        place = SE2([*box.center, box.heading]).pose[None]
        if obstacle.motion is not None:
            knots, now = obstacle.motion, times + plan.start_time
            columns = [np.interp(now, knots.time, knots.pose[:, k]) for k in range(3)]
            place = (SE2(np.stack(columns, axis=1)) @ SE2(place)).pose
        solid = outlines(place, Box(box.size))
        clearance = min(clearance, *(float(shapely.distance(one, solid).min()) for one in vehicles))
    return clearance


def outlines(poses, box):
    half = 0.5 * box.size
    ring = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * half + box.center
    return shapely.polygons(np.stack([np.asarray(SE2(poses).act(c)) for c in ring], axis=1))


def off_goal(plan, goal):
    off = plan.end - goal
    off[2] = wrapped(off[2])
    return float(np.abs(off).max())


@pytest.mark.slow
def test_plans_are_exact_free_inside_and_cheaper_one_by_one():
    here = query()
    result = search_maneuvers(here, max_expansions=600)
    assert result.status is SearchStatus.FOUND
    costs = [word.cost for word in result.words]
    assert costs == sorted(costs, reverse=True)
    assert len(costs) >= 2
    for word in result.words:
        plan = plan_of_word(here, word)
        assert off_goal(plan, GOAL) < 1e-12
        assert plan.duration == pytest.approx(word.cost, abs=1e-6)
        assert plan.trims[0].name == plan.trims[-1].name == "0 0"
        assert least_clearance(plan, WALLS) > 0.0
        poses = plan.sample(max_step_m=0.005).pose
        assert poses[:, 0].min() >= -0.5
        assert poses[:, 1].max() <= 2.5
        assert word_is_free(here, word)


def test_the_same_expansions_find_the_same_plan():
    first, second = (search_maneuvers(query(), max_expansions=400) for _ in range(2))
    assert first.best.trims.tolist() == second.best.trims.tolist()
    assert first.best.durations.tolist() == second.best.durations.tolist()
    assert first.found_after == second.found_after


def test_a_moved_problem_has_the_moved_plan():
    by = SE2([3.0, -2.0, 0.7])
    still = query(bounds=Bounds())
    moved = query(
        (by @ SE2(START)).pose,
        (by @ SE2(GOAL)).pose,
        obstacles=tuple(obstacle.moved(by) for obstacle in WALLS),
        bounds=Bounds(),
    )
    here, there = (search_maneuvers(one, max_expansions=400) for one in (still, moved))
    assert here.best.trims.tolist() == there.best.trims.tolist()
    a, b = plan_of_word(still, here.best), plan_of_word(moved, there.best)
    assert np.abs(a.durations - b.durations).max() < 1e-7
    assert np.abs((by @ SE2(a.end)).pose - b.end).max() < 1e-9


def test_the_goal_may_be_a_moving_trim():
    here = posed(unicycle(), START, [2.0, 1.5, 1.0], trims=("0 0", "0.5 0"))
    plan = plan_of_word(here, search_maneuvers(here, first_only=True).best)
    assert off_goal(plan, [2.0, 1.5, 1.0]) < 1e-12
    assert plan.trims[-1].name == "0.5 0"
    state = plan.sample().reduced_state[-1]
    assert np.abs(state - [0.5, 0.0]).max() < 1e-9


@pytest.mark.slow
def test_a_trailer_stays_free_too():
    automaton, trailer = truck_with_trailer(levels=3), Box([0.3, 0.25])
    goal = np.array([3.0, 1.5, 1.0])
    here = posed(
        automaton, START, goal, trims=HITCHED, parts={"trailer": (trailer,)},
        obstacles=(Obstacle(Box([0.2, 3.0], [1.5, -1.0])), Obstacle(Box([0.2, 3.0], [3.5, 2.6]))),
    )  # fmt: skip
    result = search_maneuvers(here, max_expansions=600)
    assert result.status is SearchStatus.FOUND
    for word in result.words:
        plan = plan_of_word(here, word)
        assert off_goal(plan, goal) < 1e-12
        assert abs(plan.sample().reduced_state[-1, 0]) < 1e-9
        assert (
            least_clearance(plan, here.problem.obstacles, model=automaton.model, carried=(trailer,))
            > 0.0
        )


def test_a_trailer_wider_than_its_truck_does_not_close_the_way_of_the_truck():
    automaton = truck_with_trailer(levels=3)
    beside = Obstacle(Box([0.1, 1.0], [0.1, 0.6]))  # nearer to the truck than half the trailer
    here = posed(
        automaton, np.zeros(3), [0.2, 0.0, 0.0], trims=HITCHED, body=Box([0.1, 0.1]),
        parts={"trailer": (Box([0.3, 0.6]),)}, obstacles=(beside,),
    )  # fmt: skip
    assert search_maneuvers(here, max_expansions=20, first_only=True).best is not None


def test_a_limit_of_time_is_kept():
    free = search_maneuvers(query(), max_expansions=400).best
    short = replace(query(), most_time=free.duration * 1.1)
    result = search_maneuvers(short, max_expansions=1500)
    assert all(word.duration <= free.duration * 1.1 for word in result.words)
    none = search_maneuvers(replace(query(), most_time=3.0), max_expansions=1500)
    assert none.best is None


@pytest.mark.slow
def test_a_switch_at_rest_proves_nothing():
    """Beside a wall, behind a switch of trims that takes no time, motions are looked at too."""
    automaton, trailer = truck_with_trailer(levels=3), Box([0.3, 0.25])
    incumbents = 0
    for side in (-0.4, 0.4):
        for distance in (0.02, 0.1, 0.25):
            wall = Obstacle(Box([0.3, 0.6], [0.25 + 0.15 + distance, 0.5 * side]))
            query = posed(
                automaton,
                [0.0, 0.0, 0.0],
                [3.0, 0.5 * side, 0.0],
                trims=HITCHED,
                parts={"trailer": (trailer,)},
                obstacles=(wall,),
            )
            for word in search_maneuvers(query, max_expansions=3000).words:
                incumbents += 1
                assert word_is_free(query, word)
    assert incumbents > 0
