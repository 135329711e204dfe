"""Scenes with a free way that is known by construction: nothing says that there is none."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.free_ways import drawn, wrong
from maneuver_automaton import Automaton, Box, Disc, Obstacle, PlanStatus, Problem, Unicycle, plan
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.bounds import free_end, separation
from maneuver_automaton.groups import SE2xR
from maneuver_automaton.models import UserModel
from maneuver_automaton.planning.proving import known_bound
from maneuver_automaton.problem import Bounds, Goal, SearchSettings
from maneuver_automaton.scenario import load_scenario

FIELD = Path(__file__).parents[3] / "shared" / "data" / "field"
ROBOT = Automaton.of_controls(
    Unicycle(), {"ahead": (0.4, 0.0), "left": (0.3, 0.6), "right": (0.3, -0.6), "spin": (0.0, 0.6)}
)
QUICKLY = [150, *range(0, 5000, 1002)]  # the first: a goal that something comes to later


@pytest.mark.parametrize("seed", QUICKLY)
def test_no_drawn_scene_is_called_impossible(seed):
    assert wrong(drawn(seed)) == []


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 5000, 100))
def test_none_of_5000_drawn_scenes_is_called_impossible(first):
    said = {k: what for k in range(first, first + 100) if (what := wrong(drawn(k)))}
    assert said == {}


@pytest.mark.skipif(not FIELD.exists(), reason="the scenes of others are not here")
@pytest.mark.parametrize(("name", "cost"), [("thin-part", 3.75), ("u-dock", 7.5)])
def test_scenes_of_others(name, cost):
    problem = load_scenario(FIELD / f"{name}.yaml").problem
    assert plan(problem, time_limit=20.0).cost == pytest.approx(cost)


def corridor(footprint, **more):
    """A corridor 0.9 m wide, straight ahead."""
    walls = [Box([7.5, 0.1], [0.75, 0.5 * s]) for s in (1, -1)]
    return Problem(ROBOT, [0, 0, 0], [1.5, 0, 0], obstacles=walls, footprint=footprint, **more)


@pytest.mark.parametrize(
    "small", [Disc(0.02), Disc(0.02, [0.25, 0.0]), Box([0.3, 0.01], [0.3, 0.1]), Box([0.02, 0.4])]
)
def test_a_thin_part_changes_nothing(small):
    settings = SearchSettings(max_expansions=500)
    alone = plan(corridor([Box([0.5, 0.36])], search=settings), time_limit=30.0)
    both = plan(corridor([Box([0.5, 0.36]), small], search=settings), time_limit=30.0)
    assert both.cost == pytest.approx(alone.cost) == pytest.approx(3.75)


def test_a_wall_that_thick_parts_enclose_is_still_proven():
    """What is proven of a convex body is proven of one with a thin part."""
    shut = [Box([6.0, 0.2], [0.0, 1.5 * s]) for s in (1, -1)]
    shut += [Box([0.2, 3.0], [3.0 * s, 0.0]) for s in (1, -1)]
    settings = SearchSettings(max_expansions=2000)
    for more in ([], [Disc(0.02)]):
        body = [Box([0.5, 0.4]), *more]
        problem = Problem(
            ROBOT, [0, 0, 0], [6, 0, 0], obstacles=shut, footprint=body, search=settings
        )
        result = plan(problem, time_limit=30.0)
        assert (result.status, result.reason) == (
            PlanStatus.UNREACHABLE,
            "obstacles enclose the start",
        )


@pytest.mark.slow
def test_towers_that_can_be_flown_over_enclose_nothing():
    glider = UserModel(
        name="glider",
        group=SE2xR,
        control_names=("speed", "turn_rate", "climb"),
        velocity=lambda z, u: [u[0], 0.0, u[1], u[2]],
    )
    rates = {"on": (1, 0, 0), "up": (1, 0, 0.4), "down": (1, 0, -0.4), "left": (1, 0.5, 0)}
    robot = Automaton.of_controls(glider, {**rates, "right": (1, -0.5, 0)})
    ring = [
        Obstacle(
            Disc(1.0, [10.0 + 4.0 * math.cos(a), 4.0 * math.sin(a)]), height=(0.0, 2.0 + 0.01 * k)
        )
        for k, a in enumerate(np.arange(40) * math.tau / 40)
    ]
    problem = Problem(
        robot,
        [-10.0, 0, 0, 1.0],
        [10.0, 0, 0, 4.0],
        footprint=Disc(0.4),
        obstacles=ring,
        bounds=Bounds(z=(0.5, 8.0)),
        search=SearchSettings(max_expansions=3000),
    )
    assert separation(problem, most_boxes=20_000) is None
    result = plan(problem, time_limit=30.0)
    assert result.status is PlanStatus.FOUND
    assert known_bound(problem).value <= result.cost


def test_a_goal_is_blocked_only_if_all_of_its_tolerance_is():
    def within(width):
        goal = Goal([5.0, 0.0, 0.0], tolerance_m=1.0, tolerance_rad=0.3)
        walls = [Box([3.0, 2.0], [5.0, side * (1.0 + 0.5 * width) + 0.43]) for side in (1, -1)]
        return Problem(ROBOT, [0, 0, 0], goal, obstacles=walls, footprint=Box([0.5, 0.2]))

    closed, slot = within(0.19), within(0.24)  # the body is 0.2 m wide
    assert free_end(closed, closed.goals[0], most_boxes=50_000) is None
    assert abs(free_end(slot, slot.goals[0], most_boxes=50_000)[1] - 0.43) < 0.02
    beside = replace(slot, bounds=Bounds(y=(-9.0, 0.3)))  # which the slot is not in
    assert free_end(beside, beside.goals[0], most_boxes=50_000) is None
    quick = replace(slot, search=SearchSettings(max_expansions=2000, improve=False))
    assert plan(quick, time_limit=60.0).status is PlanStatus.FOUND


def test_a_goal_that_something_comes_to_later_is_not_left_out():
    """Of two goals the other lies behind walls; the vehicle is there long before the disc."""
    walls = [Box([4.0, 0.2], [0.0, 30.0 + 2.0 * side]) for side in (1, -1)]
    walls += [Box([0.2, 4.2], [2.0 * side, 30.0]) for side in (1, -1)]
    there = Obstacle(Disc(0.3, [6.0, 0.0]), present_s=(50.0, 60.0))
    problem = Problem(
        load_stock_library("hovercraft"),
        [0, 0, 0],
        [Goal([6, 0, 0]), Goal([0, 30, 0])],
        obstacles=[there, *walls],
        footprint=Box([0.5, 0.3]),
        search=SearchSettings(max_expansions=2000, improve=False),
    )
    found = plan(problem, time_limit=60.0)
    assert (found.status, found.goal_index) == (PlanStatus.FOUND, 0)
