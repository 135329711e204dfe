"""Plans in space among prisms: over, round, below, and above, judged by shapely and heights."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely

from maneuver_automaton._arrays import wrapped
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.collision import Box, Disc, Obstacle
from maneuver_automaton.collision.layers import MOST_LAYERS, Layer, always, bands_of
from maneuver_automaton.groups import SE2xR
from maneuver_automaton.planning.checking import check_plan
from maneuver_automaton.problem import Bounds, Goal, Problem
from maneuver_automaton.search.lattice_library import altitude_ranges
from maneuver_automaton.search.lattice_pass import plan_of_word
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.result import SearchStatus
from maneuver_automaton.words._kernels_library import NO_TRIM
from maneuver_automaton.words.library import library_of
from tests.reference_words import candidates
from tests.search.cases import compiled_only
from tests.search.maneuver_searches import search_maneuvers

pytestmark = compiled_only  # whole searches; their kernels have tests of their own

HOVER = "speed 0, turn_rate 0, climb 0"
BODY, TALL = Disc(2.0), (-1.0, 1.0)
GOAL = np.array([80.0, 0.0, 0.0, 10.0])
WALL = Box([4.0, 60.0], [40.0, 0.0])


@cache
def craft() -> Automaton:
    return load_stock_library("helicopter")


def flight(obstacles, *, goal=GOAL, start=(0.0, 0.0, 0.0, 10.0), z=None, margin=0.3):
    return Problem(
        craft(), start, Goal(pose=goal, trim=HOVER), start_trim=HOVER, obstacles=obstacles,
        footprint=BODY, body_height=TALL, margin=margin,
        bounds=Bounds(x=(-20.0, 110.0), y=(-50.0, 50.0), z=z),
    )  # fmt: skip


def solved(problem, *, expansions=60000, first_only=True):
    query = lattice_query(problem, (0,))
    result = search_maneuvers(query, max_expansions=expansions, first_only=first_only)
    assert result.status is SearchStatus.FOUND
    return [plan_of_word(query, word) for word in result.words]


def least_distance(plan, obstacles):
    """Least distance of dense poses from prisms: by shapely aside, by heights up and down."""
    times = np.linspace(0.0, plan.duration, 5000)
    poses = plan.pose_at(times)
    places, z = shapely.points(poses[:, :2]), poses[:, 3]
    least = np.inf
    for obstacle in obstacles:
        aside = shapely.distance(places, shapely.Polygon(obstacle.shape.corners)) - BODY.radius
        low, high = obstacle.height or (-np.inf, np.inf)
        beside = np.maximum(np.maximum(z + TALL[0] - high, low - z - TALL[1]), 0.0)
        least = min(least, float(np.hypot(np.maximum(aside, 0.0), beside).min()))
    return least


def crossing(plan, x=40.0):
    """Place (y, z) where a plan first comes to `x`."""
    poses = plan.pose_at(np.linspace(0.0, plan.duration, 5000))
    return poses[np.argmax(poses[:, 0] >= x)][[1, 3]]


def test_a_low_wall_is_flown_over_and_a_tower_round():
    over = Obstacle(Box([4.0, 200.0], [40.0, 0.0]), height=(0.0, 14.0))
    round_ = Obstacle(WALL, height=(0.0, 300.0))
    (low,) = solved(flight((over,), z=(2.0, 30.0)))
    (high,) = solved(flight((round_,), z=(2.0, 30.0)))
    assert least_distance(low, (over,)) >= 0.3
    assert least_distance(high, (round_,)) >= 0.3
    y, z = crossing(low)
    assert z > 15.0
    assert abs(y) < 50.0
    y, z = crossing(high)
    assert abs(y) > 32.0
    assert z < 30.0


def test_a_slab_is_passed_below_or_above_where_only_one_is_left():
    slab = Obstacle(Box([4.0, 200.0], [40.0, 0.0]), height=(6.0, 16.0))
    for bounds, below in (((2.0, 15.0), True), ((7.5, 30.0), False)):
        (plan,) = solved(flight((slab,), z=bounds))
        assert least_distance(plan, (slab,)) >= 0.3
        assert (crossing(plan)[1] < 6.0) == below
        z = plan.pose_at(np.linspace(0.0, plan.duration, 3000))[:, 3]
        assert z.min() >= bounds[0]
        assert z.max() <= bounds[1]


def test_a_wall_across_every_altitude_exhausts_the_search():
    wall = Obstacle(Box([4.0, 200.0], [12.0, 0.0]), height=(0.0, 40.0))
    problem = replace(
        flight((wall,), goal=[24.0, 0.0, 0.0, 10.0], z=(8.0, 12.0)),
        bounds=Bounds(x=(-4.0, 30.0), y=(-4.0, 4.0), z=(8.0, 12.0)),
    )
    query = lattice_query(problem, (0,))
    assert search_maneuvers(query, max_expansions=20000).best is None


@pytest.mark.exhaustive
@pytest.mark.slow
def test_plans_get_cheaper_and_pass_every_check():
    town = [
        (14.0, 8.0, 10.0, 12.0, 0.1, 14.0), (20.0, -14.0, 12.0, 10.0, -0.2, 30.0),
        (40.0, 3.0, 10.0, 16.0, 0.3, 22.0), (56.0, -12.0, 12.0, 14.0, -0.3, 28.0),
        (58.0, 16.0, 10.0, 12.0, 0.15, 18.0),
    ]  # fmt: skip
    obstacles = tuple(
        Obstacle(Box([length, width], [x, y], heading), height=(0.0, top))
        for x, y, length, width, heading, top in town
    )
    problem = flight(obstacles, goal=[80.0, 2.0, 0.0, 20.0], start=(0.0, 0.0, 0.0, 4.0),
                     z=(2.0, 34.0))  # fmt: skip
    plans = solved(problem, first_only=False, expansions=30000)
    costs = [problem.cost_of(plan) for plan in plans]
    assert costs == sorted(costs, reverse=True)
    assert len(costs) >= 2
    for plan in (plans[0], plans[-1]):
        checked = check_plan(problem, plan, problem.goals[0])
        assert checked.passed, checked.reason
        assert least_distance(plan, obstacles) >= 0.3
        off = plan.end - problem.goals[0].pose
        assert max(np.abs(off[[0, 1, 3]]).max(), abs(float(wrapped(off[2])))) < 1e-11


def test_a_moved_problem_has_the_moved_plan():
    by = SE2xR([30.0, -12.0, 0.8, 25.0])
    tower, slab = (
        Obstacle(WALL, height=(0.0, 14.0)),
        Obstacle(Box([6.0, 20.0], [60.0, 8.0], 0.4), height=(12.0, 30.0)),
    )
    here = replace(flight((tower, slab)), bounds=Bounds())
    there = here.moved(by)
    assert there.obstacles[0].height == (25.0, 39.0)
    (a,), (b,) = solved(here), solved(there)
    assert [trim.name for trim in a.trims] == [trim.name for trim in b.trims]
    assert np.abs(a.durations - b.durations).max() < 1e-7
    assert np.abs(a.moved(by).end - b.end).max() < 1e-9


def test_a_slope_makes_up_for_the_altitude_in_flight():
    library = library_of(craft())
    cruise = craft().index_of("speed 10, turn_rate 0, climb 0")
    rows = candidates(library, [0, 0, 0, 0], [150.0, 10.0, 0.2, 12.0], start_trim=cruise,
                     goal_trim=cruise)  # fmt: skip
    slopes = [row for row in rows if craft().trims[row.trims[-1]].body_velocity[0] > 0.0]
    assert slopes
    assert rows[0].cost == slopes[0].cost  # hovering to climb costs more
    best = slopes[0]
    pose = SE2xR([0.0, 0.0, 0.0, 0.0])
    at = cruise
    for trim, t in zip((*best.trims, cruise), (*best.durations, 0.0), strict=True):
        for maneuver, _ in library.chain(at, trim):
            assert maneuver != NO_TRIM
            pose = pose @ SE2xR(craft().maneuvers[maneuver].displacement)
        pose = pose @ SE2xR.exp(t * craft().trims[trim].body_velocity)
        at = trim
    assert np.abs(pose.pose - [150.0, 10.0, 0.2, 12.0]).max() < 1e-8


def test_altitudes_of_courses_hold_every_sample():
    maneuvers = craft().maneuvers[::7]
    climbs = {trim.name: trim.body_velocity[3] for trim in craft().trims}
    ends = np.array([[climbs[one.source], climbs[one.target]] for one in maneuvers])
    sizes = np.array([len(one.course.time) for one in maneuvers])
    begin = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    low, high = altitude_ranges(maneuvers, ends, begin, begin + sizes - 1)
    for k, one in enumerate(maneuvers):
        fine = one.course.pose_at(np.linspace(0.0, one.duration, 997))[:, 3]
        assert low[k] <= fine.min() + 1e-9
        assert high[k] >= fine.max() - 1e-9
        assert high[k] - low[k] <= np.ptp(one.course.pose[:, 3]) + 0.2


def test_bands_hold_what_stands_in_them():
    disc = Disc(1.0)
    obstacles = tuple(
        Obstacle(disc, height=pair) for pair in ((0.0, 5.0), (3.0, 9.0), (20.0, 30.0))
    )
    bands = bands_of((*obstacles, Obstacle(disc)), in_space=True)
    assert [(band.low, band.high, band.numbers) for band in bands] == [
        (-math.inf, 0.0, (3,)), (0.0, 3.0, (0, 3)), (3.0, 5.0, (0, 1, 3)), (5.0, 9.0, (1, 3)),
        (9.0, 20.0, (3,)), (20.0, 30.0, (2, 3)), (30.0, math.inf, (3,)),
    ]  # fmt: skip
    everything = (*obstacles, Obstacle(disc))
    assert always(everything, low=-50.0, high=50.0) == everything[3:]
    assert len(always(everything, low=3.5, high=4.5)) == 3
    thin = tuple(Obstacle(disc, height=(k, k + 0.5)) for k in range(2 * MOST_LAYERS))
    assert always(thin, low=3.0, high=4.2) == ()  # however many heights are joined to one band
    assert bands_of(obstacles, in_space=False) == (
        Layer(-math.inf, math.inf, obstacles, (0, 1, 2)),
    )
    assert bands_of((), in_space=True)[0].obstacles == ()


def test_many_heights_are_joined_without_losing_anything():
    obstacles = tuple(Obstacle(Disc(1.0), height=(0.0, 5.0 + 0.37 * k)) for k in range(80))
    bands = bands_of(obstacles, in_space=True)
    assert len(bands) <= MOST_LAYERS
    assert (bands[0].low, bands[-1].high) == (0.0, 5.0 + 0.37 * 79)
    for height in np.linspace(0.01, 34.0, 200):
        (band,) = (one for one in bands if one.low <= height < one.high)
        standing = {k for k, one in enumerate(obstacles) if one.height[1] > height}
        assert standing <= set(band.numbers)


@pytest.mark.parametrize("altitude", [3.0, 16.0])
def test_ends_are_judged_at_their_altitude(altitude):
    from maneuver_automaton.planning.blocked import blocked_ends

    wall = Obstacle(Box([4.0, 60.0], [0.0, 0.0]), height=(0.0, 14.0))
    blocked = blocked_ends(flight((wall,), start=(0.0, 0.0, 0.0, altitude)))
    assert (blocked is None) == (altitude > 15.3)
