"""Verdicts before any search: who stands in the way at the start, and at the goals."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.collision.blocked import touched_all_round
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.planning.blocked import blocked_ends, why_goal_blocked
from maneuver_automaton.problem import Bounds, Goal, Problem, SearchSettings
from tests import scenes
from tests.quickly import quick_are
from tests.solids import clearance_at

ROBOT, BODY = scenes.differential_robot(), Box([2.0, 1.0])
PILLAR = Obstacle(Disc(1.0, [5.0, 0.0]), name="pillar")
FREE = Problem(ROBOT, [0, 0, 0], [10, 0, 0], obstacles=PILLAR, footprint=BODY)
CONTACT = 1e-8


def is_outside(problem, pose):
    return any(
        pair is not None and not pair[0] <= pose[k] <= pair[1]
        for k, pair in enumerate((problem.bounds.x, problem.bounds.y))
    )


def test_verdicts_agree_with_shapely():
    met = set()
    for seed in range(20):
        problem = scenes.random_scene(seed)
        said = blocked_ends(problem)
        clearance = clearance_at(problem, problem.start)
        least = max(problem.margin, 0.0)
        outside = is_outside(problem, problem.start)
        if outside or clearance < least - CONTACT or clearance <= 0.0:
            assert said is not None
            assert said.status is PlanStatus.START_BLOCKED
            assert said.reason.startswith("the start is outside" if outside else "at the start ")
            met.add("start")
            continue
        if clearance < least + CONTACT:
            continue  # a matter of the last digit
        assert said is None or said.status is PlanStatus.GOAL_BLOCKED
        still = replace(problem, obstacles=tuple(
            o for o in problem.obstacles if getattr(o, "motion", None) is None
        ))  # fmt: skip
        blocked = []
        for goal in problem.goals:
            poses = [goal.pose]
            if goal.free_heading and still.footprint:
                turns = np.linspace(0.0, 2.0 * np.pi, 97)[1:]
                poses = [goal.pose, *(goal.pose + np.array([0.0, 0.0, turn]) for turn in turns)]
            near = max(clearance_at(still, pose) for pose in poses)
            hit = near < least - CONTACT or near <= 0.0
            blocked.append(is_outside(problem, goal.pose) or hit)
            assert bool(why_goal_blocked(problem, goal)) == blocked[-1]
        assert (said is not None) == all(blocked)
        met.add("goal" if all(blocked) else "free")
    assert met == {"start", "goal", "free"}


def test_reasons_name_the_obstacle():
    def at_start(*obstacles, start=(5.0, 0.0, 0.0), **more):
        return plan(replace(FREE, obstacles=obstacles, start=np.array(start), **more))

    result = at_start(PILLAR)
    assert result.status is PlanStatus.START_BLOCKED
    assert result.reason == "at the start the vehicle touches obstacle 'pillar'"
    assert result.cost is result.plan is None
    result = at_start(Obstacle(Disc(1.0)), Obstacle(Box([4.0, 4.0], [5.0, 1.0])))
    assert result.reason.startswith("at the start the vehicle touches obstacle 1 (box near (")
    cells = OccupancyMap([[0, 1]], resolution=1.0, origin=[5.0, 0.0, 0.0], name="depot")
    assert at_start(cells).reason.startswith("at the start the vehicle touches map depot, cell")
    result = at_start(PILLAR, start=(2.9, 0.0, 0.0), margin=0.2)
    assert result.reason == (
        "at the start the vehicle is 0.1 m from obstacle 'pillar', closer than 0.2 m"
    )


def test_a_goal_that_is_touched_or_outside():
    result = plan(replace(FREE, goals=(Goal(pose=[3.5, 0.0, 0.0]),)))
    assert (result.status, result.reason) == (
        PlanStatus.GOAL_BLOCKED, "at the goal the vehicle touches obstacle 'pillar'"
    )  # fmt: skip
    result = plan(replace(FREE, bounds=Bounds(x=(-1.0, 9.0))))
    assert result.status is PlanStatus.GOAL_BLOCKED
    assert result.reason.startswith("the goal is outside the bounds: x = 10 m")
    two = (Goal(pose=[5.0, 0.0, 0.0]), Goal(pose=[99.0, 0.0, 0.0]))
    result = plan(replace(FREE, goals=two, bounds=Bounds(x=(-1.0, 9.0))))
    assert result.reason == (
        "every goal is blocked; the first: at the goal the vehicle touches obstacle 'pillar'"
    )


@pytest.mark.parametrize("off", [0.0, 1e-10, -1e-10])
def test_to_touch_is_to_be_blocked(off):
    touching = replace(FREE, start=np.array([3.0 + off, 0.0, 0.0]))
    assert plan(touching).status is PlanStatus.START_BLOCKED


def test_a_body_inside_a_solid_and_around_one():
    court = Polygon(np.array([[-9, -9], [9, -9], [9, 9], [-9, 9]]) * 3.0)
    inside = replace(FREE, obstacles=(Obstacle(court),))
    assert plan(inside).status is PlanStatus.START_BLOCKED
    around = replace(FREE, obstacles=(Obstacle(Disc(0.1)),))
    assert plan(around).status is PlanStatus.START_BLOCKED
    in_a_hole = Polygon(court.corners, [court.corners * 0.9])
    free = replace(FREE, obstacles=(Obstacle(in_a_hole),), search=SearchSettings(max_expansions=50))
    assert plan(free).status is PlanStatus.FOUND


def test_what_moves_blocks_the_start_then_and_no_goal():
    gone = Motion([0.0, 5.0], [[0, 0, 0], [0, 20, 0]])
    leaving = Obstacle(Disc(1.0), motion=gone, name="cart")
    here = replace(FREE, obstacles=(leaving,))
    assert plan(here).reason == "at the start the vehicle touches obstacle 'cart'"
    later = replace(here, start_time=4.0)
    assert blocked_ends(later) is None
    at_goal = Obstacle(Disc(1.0), motion=Motion([0.0], [[10, 0, 0]]))
    assert blocked_ends(replace(FREE, obstacles=(at_goal,))) is None


@pytest.mark.parametrize("footprint", [(), (Disc(0.3),)])
def test_a_goal_of_any_heading_in_a_solid_is_blocked(footprint):
    goal = Goal(pose=[5.0, 0.0, 0.0], free_heading=True)
    problem = replace(FREE, goals=(goal,), footprint=footprint,
                      search=SearchSettings(max_expansions=300))  # fmt: skip
    result = plan(problem)
    assert result.status is PlanStatus.GOAL_BLOCKED
    assert math.isclose(result.problem.goals[0].pose[0], 5.0)


def ring_of_posts(place, count, *, radius=0.3, away=1.5):
    """Round posts about a place, with gaps too narrow for a body as long as they are apart."""
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    middles = place + away * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return tuple(Obstacle(Disc(radius, middle)) for middle in middles)


@pytest.mark.parametrize(("count", "blocked"), [(8, True), (2, False)])
def test_a_goal_of_any_heading_with_room_for_none(count, blocked):
    """A disc inside the body would have room."""
    goal = Goal(pose=[10.0, 0.0, 0.4], free_heading=True)
    posts = ring_of_posts(np.array([10.0, 0.0]), count)
    problem = replace(FREE, goals=(goal,), obstacles=posts, footprint=(Box([4.0, 2.0]),))
    said = blocked_ends(problem)
    assert (said is not None) == blocked
    if said is not None:
        assert said.status is PlanStatus.GOAL_BLOCKED
        assert said.reason.startswith(
            "at the goal no heading is free; at that given the vehicle touches obstacle "
        )


@pytest.mark.parametrize("seed", quick_are(range(3), range(24)))
def test_touched_all_round_is_touched_at_each_heading(seed):
    """Against headings one by one, with shapely; moved it is the same."""
    rng = np.random.default_rng([7, seed])
    body, margin = (Box([3.0, 1.6], [0.7, 0.0]), Disc(0.6, [2.0, 0.0])), rng.choice([0.0, 0.2])
    place = rng.uniform(-3.0, 3.0, 2)
    many = int(rng.integers(3, 14))
    obstacles = tuple(
        Obstacle(Disc(rng.uniform(0.1, 0.6), place + rng.uniform(-3.0, 3.0, 2))) if k % 2
        else Obstacle(Box(rng.uniform(0.1, 2.0, 2), place + rng.uniform(-3.0, 3.0, 2), heading=k))
        for k in range(many)
    )  # fmt: skip
    problem = replace(FREE, obstacles=obstacles, footprint=body, margin=margin)
    headings = np.linspace(0.0, 2.0 * np.pi, 360)
    clearances = [clearance_at(problem, np.array([*place, one])) for one in headings]
    said = touched_all_round(body, obstacles, place, margin=margin)
    if said:
        assert max(clearances) <= max(margin, 0.0) + CONTACT
    elif max(clearances) <= max(margin, 0.0):
        assert max(clearances) > margin - 0.02  # hardly: between two of them one may be free
    there = SE2(np.array([50.0, -20.0, 1.0]))
    moved = tuple(one.moved(there) for one in obstacles)
    assert touched_all_round(body, moved, there.act(place), margin=margin) == said
