"""Kinematic vehicles in space among obstacles: heights, margins, zones, and what else there is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap, Zone
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.words.library import NO_TRIM
from tests.search.cases import compiled_only
from tests.test_planning import GLIDER

LIMIT = 60.0  # [s] a limit that a busy machine does not reach
RADIUS, TALL = 0.2, (-0.1, 0.1)
TOWER = Obstacle(Box([1.0, 1.0], [4.0, 0.3]))
LOW = Obstacle(Box([0.5, 40.0], [4.0, 0.0]), height=(-3.0, 0.8))
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


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_low_wall_is_flown_over_and_a_tower_round():
    free = found(BASE)
    over = found(replace(BASE, obstacles=(LOW,)))
    round_ = found(replace(BASE, obstacles=(TOWER,)), alternatives=1)
    for result, obstacle in ((over, LOW), (round_, TOWER)):
        assert clearance(result.plan, obstacle) > 0.0
        assert result.cost >= free.cost - 1e-9
        assert result.plan.end == pytest.approx([9.0, 1.0, 0.0, 1.0], abs=1e-9)
    assert clearance(free.plan, TOWER) < 0.0
    assert round_.cost > free.cost + 0.01
    assert over.cost < free.cost + 0.1  # to climb sooner costs nothing
    (other,) = round_.alternatives
    assert clearance(other.plan, TOWER) > 0.0


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_margin_is_kept():
    result = found(replace(BASE, obstacles=(TOWER,), margin=0.3))
    assert clearance(result.plan, TOWER) >= 0.3 - 1e-6


@pytest.mark.exhaustive
@pytest.mark.slow
def test_bounds_of_height_close_a_way():
    high = found(replace(BASE, obstacles=(LOW,)))
    closed = replace(BASE, obstacles=(LOW,), bounds=Bounds(z=(-4.0, 1.05), y=(-8.0, 8.0)))
    result = found(closed)
    z = result.plan.pose_at(np.linspace(0.0, result.plan.duration, 2000))[:, 3]
    assert z.max() <= 1.05 + 1e-9
    assert result.cost >= high.cost - 1e-9


@pytest.mark.exhaustive
@pytest.mark.slow
def test_an_occupancy_map_and_a_moving_obstacle():
    cells = np.random.default_rng(1).random((9, 12)) < 0.12
    found(replace(BASE, obstacles=(OccupancyMap(cells, resolution=0.25, origin=[3.0, -1.5, 0.3]),)))
    motion = Motion([0.0, 8.0], [[4.0, -4.0, 0.0], [4.0, 4.0, 0.0]])
    result = found(replace(BASE, obstacles=(Obstacle(Disc(0.5), motion=motion),)))
    times = np.linspace(0.0, result.plan.duration, 4000)
    middle = np.stack([np.full_like(times, 4.0), np.interp(times, [0, 8], [-4, 4])], axis=1)
    clearance = np.hypot(*(result.plan.pose_at(times)[:, :2] - middle).T).min() - 0.5 - RADIUS
    assert clearance > 0.0


@pytest.mark.exhaustive
@pytest.mark.slow
def test_zones_hold_in_space():
    zone = Zone(shape=Box([1.0, 3.0], [4.0, 0.3]), trims=("up", "left up"))
    result = found(replace(BASE, zones=(zone,)))
    begins = result.plan.switching_times
    for k, trim in enumerate(result.plan.trims):
        poses = result.plan.pose_at(np.linspace(begins[k], begins[k + 1], 300))
        inside = (np.abs(poses[:, 0] - 4.0) < 0.5) & (np.abs(poses[:, 1] - 0.3) < 1.5)
        assert trim.name in zone.trims or not inside.any()


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.parametrize("what", ["free heading", "several goals", "tolerance"])
def test_goals_of_every_kind(what):
    goal = BASE.goals[0]
    goals = {
        "free heading": (replace(goal, free_heading=True),),
        "several goals": (Goal(pose=[9.0, 1.0, 3.0, 1.0]), goal),
        "tolerance": (replace(goal, tolerance_m=0.3),),
    }[what]
    scene = replace(BASE, obstacles=(TOWER,))
    exact, result = found(scene), found(replace(scene, goals=goals))
    assert result.cost <= exact.cost + 1e-9 + 0.02 * exact.cost
    if what == "tolerance":
        assert result.cost < exact.cost - 0.2
        assert result.terminal_error.position_m <= 0.3 + 1e-9


@pytest.mark.exhaustive
@pytest.mark.slow
def test_times_and_prices():
    scene = replace(BASE, obstacles=(TOWER,))
    fixed = found(replace(scene, horizon=Horizon(time=17.0)))
    assert fixed.plan.duration == pytest.approx(17.0, abs=1e-9)
    costly = found(replace(scene, cost=Cost(time=1.0, switch=5.0)))
    assert len(costly.plan.word) <= len(found(scene).plan.word)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_longest_time_and_few_trims_are_kept():
    scene = replace(BASE, obstacles=(TOWER,))
    usual = found(scene)
    quick = found(replace(scene, horizon=Horizon(max_time=12.0)))
    few = found(replace(scene, horizon=Horizon(max_trims=8)))
    assert quick.plan.duration <= 12.0 + 1e-9
    assert len(few.plan.word) <= 8
    for result in (quick, few):
        assert result.cost <= usual.cost * 1.01


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
