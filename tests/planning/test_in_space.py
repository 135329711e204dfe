"""Kinematic vehicles in space among obstacles: heights, margins, zones, and what else there is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from maneuver_automaton.collision import Box, Disc, Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.problem import Goal, Problem, SearchSettings
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.words.library import NO_TRIM
from tests.search.cases import compiled_only
from tests.test_planning import GLIDER

LIMIT = 60.0  # [s] a limit that a busy machine does not reach
RADIUS, TALL = 0.2, (-0.1, 0.1)
TOWER = Obstacle(Box([1.0, 1.0], [4.0, 0.3]))
BASE = Problem(
    GLIDER,
    [0, 0, 0, 0],
    [9.0, 1.0, 0.0, 1.0],
    cost=Cost(time=1.0),
    footprint=Disc(RADIUS),
    body_height=TALL,
    search=SearchSettings(max_expansions=30_000),
)
pytestmark = compiled_only


def found(problem, **more):
    result = plan(problem, time_limit=LIMIT, **more)
    assert result.status is PlanStatus.FOUND, result.reason
    assert result.audit.passed
    assert result.lower_bound <= result.cost
    for one in (result, *result.alternatives):
        assert one.cost == problem.cost_of(one.plan)
        assert (one.plan.durations > 0.0).all()
    return result


def clearance(one, obstacle):
    """Distance of a plan to an upright box, where it is at its height."""
    times = np.linspace(0.0, one.duration, 4000)
    poses = one.pose_at(times)
    low, high = obstacle.height or (-np.inf, np.inf)
    beside = (poses[:, 3] + TALL[0] <= high) & (poses[:, 3] + TALL[1] >= low)
    aside = shapely.distance(shapely.points(poses[:, :2]), shapely.Polygon(obstacle.shape.corners))
    return float(np.where(beside, aside - RADIUS, np.inf).min())


def test_the_search_knows_what_a_switch_costs():
    """A word of three trims, at 15 for its switches; twelve would cost 45."""
    costly = found(replace(BASE, obstacles=(TOWER,), cost=Cost(time=1.0, switch=5.0)))
    assert costly.cost < 40.0


def test_any_trim_will_do_at_both_ends():
    query = lattice_query(replace(BASE, obstacles=(TOWER,)), (0,))
    assert query.start_trim == NO_TRIM
    assert query.goal_trims.tolist() == [NO_TRIM]


def test_walls_prove_that_there_is_no_way():
    walls = [Box([8.0, 0.5], [9.0, 1.0 + side]) for side in (-2.0, 2.0)]
    walls += [Box([0.5, 8.0], [9.0 + side, 1.0]) for side in (-2.5, 2.5)]
    result = plan(replace(BASE, obstacles=tuple(map(Obstacle, walls))), time_limit=LIMIT)
    assert (result.status, result.reason) == (
        PlanStatus.UNREACHABLE, "obstacles enclose the goal"
    )  # fmt: skip


@pytest.mark.slow
def test_a_blocked_goal_in_space_is_named():
    on_it = replace(BASE, obstacles=(Obstacle(Box([1.0, 1.0], [9.0, 1.0]), height=(0.5, 2.0)),))
    assert plan(on_it, time_limit=LIMIT).status is PlanStatus.GOAL_BLOCKED
    below = replace(on_it, goals=(Goal(pose=[9.0, 1.0, 0.0, 0.2]),))
    found(below)
