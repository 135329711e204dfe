"""Poses on the way beside every other condition: judged by `verify`, and by figures of its own."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import maneuver_automaton as ma
from tests.matrix.scenes import base
from tests.matrix.vehicles import VEHICLES
from tests.planning.test_along_poses import ROBOT, START, dubins, planned

GOAL, PAST = [8.0, 0.0, 0.0], ma.Via([4, 1, 0.2])
FALLING = ma.Motion([0, 20], [[2, 4, 0], [2, -6, 0]])
BODY = ma.Box([0.4, 0.3])


@pytest.mark.slow
@pytest.mark.parametrize(
    "given",
    [
        {"horizon": ma.Horizon(max_time=12)},
        {"horizon": ma.Horizon(max_trims=6)},
        {"place_costs": ma.Ground(ma.Box([2, 2], [6, 0]), 3.0)},
        {"obstacles": ma.Obstacle(ma.Disc(0.6), motion=FALLING), "footprint": BODY},
        {"bounds": ma.Bounds(x=(-1, 9), y=(-2, 2))},
    ],
)
def test_beside_other_conditions(given):
    planned(ma.Problem(ROBOT, START, GOAL, via=PAST, **given))


@pytest.mark.slow
@pytest.mark.parametrize(
    "goal",
    [
        [ma.Goal(GOAL), ma.Goal([0, 6, 3])],
        ma.Goal(GOAL, tolerance_m=0.5, tolerance_rad=0.3),
        ma.Goal(GOAL, free_heading=True),
    ],
)
def test_to_sets_of_goals(goal):
    planned(ma.Problem(ROBOT, START, goal, via=PAST))


def test_too_little_time_is_told():
    problem = ma.Problem(ROBOT, START, GOAL, via=PAST, horizon=ma.Horizon(max_time=7.9))
    result = ma.plan(problem, time_limit=60.0)
    assert result.status is ma.PlanStatus.UNREACHABLE
    assert result.reason.startswith("from the start to pose 1 on the way")


@pytest.mark.slow
def test_twelve_in_a_free_order_are_passed_in_the_best():
    """Beside it the shortest way by a Dubins formula and dynamic programming of its own."""
    rng = np.random.default_rng(3)
    poses = np.column_stack([rng.uniform(-10, 10, (12, 2)), np.zeros(12)])
    result = planned(ma.Problem(ROBOT, START, GOAL, via=list(poses), order="free"), 20_000)
    nodes = np.vstack([poses, [START]])
    legs = dubins(nodes[:, None], np.vstack([poses, [GOAL]])[None])
    best = {(1 << k, k): legs[12, k] for k in range(12)}
    for mask in range(1, 1 << 12):
        for last in (k for k in range(12) if (mask, k) in best):
            for k in (k for k in range(12) if not mask >> k & 1):
                cost = best[mask, last] + legs[last, k]
                best[mask | 1 << k, k] = min(cost, best.get((mask | 1 << k, k), np.inf))
    least = min(best[(1 << 12) - 1, k] + legs[k, 12] for k in range(12))
    assert result.cost == pytest.approx(least, rel=1e-6)
    times = [one.time for one in result.via]
    assert all(one < then for one, then in pairwise(times))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["car_with_trailer", "articulated_vehicle", "tractor_with_trailers", "helicopter"]
)
def test_other_vehicles(name):
    library = ma.load_stock_library(name)
    space = [1.0] if library.model.group.dof == 4 else []
    start, goal = [0.0, 0.0, 0.0, *(0.0 for _ in space)], [20.0, 0.0, 0.0, *space]
    way = ma.Via([8.0, 1.0, 0.1, *(0.5 for _ in space)])
    planned(ma.Problem(library, start, goal, via=way))


@pytest.mark.slow
def test_a_trailer_whose_speed_is_a_control_stops_for_no_time():
    one = base(VEHICLES["car_with_trailer"]).problem
    via = ma.Via([3.7, 1.2, 0.2], stop=True)
    result = ma.plan(
        replace(one, via=(via,), search=ma.SearchSettings(max_expansions=2000, improve=False))
    )
    assert [passed.number for passed in result.via] == [1]
    assert ma.verify(result.problem, result.plan).passed
