"""What is polished besides cars and robots: trailers, bodies of several parts, fixed times."""

from __future__ import annotations

import math
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.planning.lattice_words import LatticeWords
from maneuver_automaton.planning.polishing import _without_passed, guess_of_plan, polish_plans
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.receding_horizon import simulate
from tests.inertia import resting
from tests.search.cases import compiled_only

pytestmark = [
    compiled_only,
]
WORK = SearchSettings(max_expansions=200)
CAR = Box([4.2, 1.8], [1.2, 0.0])
MOVING = "speed 1.5, steering 0"


def unpolished(problem):
    with patch("maneuver_automaton.planning.polishing.Polish.polish", lambda *_, **__: None):
        return plan(problem, time_limit=60.0)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_plan_that_only_polishing_finds_does_not_wait_for_the_lattice():
    """In a bug trap: stops take too long for the horizon, and so do the words of the lattice."""
    trap = (
        Box([0.05, 1.55], [0.0, 0.0]),
        Box([2.05, 0.05], [-1.0, 0.75]),
        Box([2.05, 0.05], [-1.0, -0.75]),
    )
    problem = Problem(
        load_stock_library("second_order_unicycle"),
        [-1.0, 0.0, 0.0],
        [1.5, 0.0, 0.0],
        footprint=Box([0.5, 0.25]),
        obstacles=trap,
        horizon=Horizon(max_time=18.0),
        search=SearchSettings(max_expansions=400),
    )
    had = []

    def late(lattice):
        had.append(lattice.found.cost)
        return improved(lattice)

    improved = LatticeWords.improved
    with patch.object(LatticeWords, "improved", late):
        result = plan(problem, time_limit=60.0)
    assert had[0] < math.inf
    assert result.plan.word == ("polished",)
    assert result.plan.duration <= 18.0


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_trailer_without_maneuvers_is_led_by_paths_of_its_car():
    """Behind a wall that a library of rest alone leads past by no word."""
    trailer = {"trailer": (Box([3.2, 1.7], [-0.2, 0.0]), Box([0.4, 2.0], [-1.5, 0.0]))}
    problem = Problem(
        resting(load_stock_library("car_with_trailer").model),
        [0.0, 0.0, 0.0],
        [24.0, 0.0, 0.0],
        footprint=CAR,
        parts=trailer,
        obstacles=(Obstacle(Box([3.0, 8.0], [12.0, -2.5])),),
        search=WORK,
    )
    result = plan(problem, time_limit=60.0)
    assert result.plan.word == ("polished",)
    assert result.audit.passed
    assert result.cost < 8.6  # 8.0 s straight through the wall at 3 m/s
    by = SE2([20.0, -7.0, 1.1])
    moved = plan(problem.moved(by), time_limit=60.0)
    assert moved.cost == pytest.approx(result.cost, abs=1e-6)
    np.testing.assert_allclose((by @ SE2(result.plan.end)).pose, moved.plan.end, atol=1e-6)
    assert unpolished(problem).status is not PlanStatus.FOUND


@pytest.mark.slow
def test_a_fixed_time_is_kept_under_way_and_its_effort_falls():
    """It never rests, so that no wait can fill the time."""
    problem = Problem(
        load_stock_library("second_order_car"),
        [0.0, 0.0, 0.0],
        Goal(pose=[24.0, 4.0, 0.0], trim=MOVING),
        start_trim=MOVING,
        footprint=CAR,
        obstacles=(Obstacle(Disc(0.8, [12.0, 0.5])),),
        cost=Cost(effort=1.0),
        horizon=Horizon(time=12.0),
        search=WORK,
    )
    result = plan(problem, time_limit=60.0)
    assert result.plan.word == ("polished",)
    assert result.audit.passed
    assert result.plan.duration == pytest.approx(12.0, rel=1e-9)
    assert result.cost < 0.5 * unpolished(problem).cost


ROBOT = load_stock_library("second_order_unicycle")
ENDS = ([0.0, 0.0, 0.0], [4.0, 0.0, 0.0])


def posed(*obstacles, **more):
    more = {"footprint": Disc(0.3), "search": WORK} | more
    return Problem(ROBOT, *ENDS, obstacles=obstacles, **more)


def crossing(since=0.0):
    motion = Motion([since, since + 8.0], [[2.0, -2.0, 0.0], [2.0, 2.0, 1.0]])
    return Obstacle(Box([0.8, 0.6]), motion=motion)


def test_plans_past_what_moves_are_polished():
    result, plain = plan(posed(crossing()), time_limit=60.0), unpolished(posed(crossing()))
    assert result.plan.word == ("polished",)
    assert result.audit.passed
    assert result.cost < plain.cost
    words = plan(posed(crossing(), search=replace(WORK, polish=False)), time_limit=60.0)
    assert words.plan.word == plain.plan.word


@pytest.mark.slow
def test_a_moved_scene_and_a_later_start_have_the_moved_polished_plan():
    here, by = plan(posed(crossing()), time_limit=60.0), SE2([-30.0, 12.0, 2.2])
    moved = plan(posed(crossing()).moved(by), time_limit=60.0)
    later = plan(posed(crossing(100.0), start_time=100.0), time_limit=60.0)
    for other in (moved, later):
        assert other.cost == pytest.approx(here.cost, abs=1e-6)
    np.testing.assert_allclose((by @ SE2(here.plan.end)).pose, moved.plan.end, atol=1e-6)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_behind_a_wall_that_drives_ahead_it_arrives_as_soon_as_on_paper():
    """Where it is as slow as the wall it touches that, and brakes to the goal from there."""
    wall = Motion([0.0, 40.0], [[1.0, 0.0, 0.0], [11.0, 0.0, 0.0]])
    problem = posed(Obstacle(Box([0.2, 12.0]), motion=wall))
    speed, brake = 0.25, ROBOT.model.control_limits[0, 1]
    touches = 4.0 - 0.5 * speed * speed / brake + 0.3
    least = (touches - 0.9) / speed + speed / brake
    result, found = plan(problem, time_limit=60.0), []
    assert result.audit.passed
    assert least - 1e-6 <= result.cost < least + 0.05
    # From another plan, polishing comes to the same: an interval lasts 0.05 s in the end.
    slower = replace(problem, horizon=Horizon(time=least + 2.0))
    guess = guess_of_plan(plan(slower, time_limit=60.0).plan)
    polish_plans(problem, [guess], 0, None, budget=UNLIMITED, accepts=lambda p: not found.append(p))
    assert least - 1e-6 <= found[-1].duration < least + 0.06


@pytest.mark.slow
def test_what_comes_and_goes_leaves_the_plan_as_it_is_or_better():
    gate = Obstacle(Box([0.2, 12.0], [2.0, 0.0]), present_s=(0.0, 11.0))
    problem = posed(gate, search=SearchSettings(max_expansions=2000))
    result = plan(problem, time_limit=60.0)
    assert result.audit.passed
    least = 11.0 + 2.4 / 0.5 + 1.0  # at full speed through the gate as it opens, then it brakes
    assert least <= result.cost <= unpolished(problem).cost


@pytest.mark.slow
def test_in_closed_loop_past_what_moves_no_motion_of_one_piece_is_driven():
    loop = simulate(posed(crossing()), step=0.5, steps=40, time_limit=60.0)
    assert loop.reached
    known = {maneuver.name for maneuver in ROBOT.maneuvers}
    for step in loop.steps:
        assert all(one is None or one.name in known for one in step.plan.maneuvers)


@pytest.mark.parametrize(
    ("height", "across", "left"),
    [((4.0, 9.0), 3.0, [0, 1]), ((0.0, 9.0), 3.0, [1]), ((4.0, 9.0), 0.0, [0])],
    ids=["below one that is beside it", "beside one", "below one"],
)
def test_what_is_above_or_below_is_left_out_and_then_what_is_only_beside_stays(
    height, across, left
):
    library = load_stock_library("helicopter")
    bridge = Obstacle(Disc(1.0, [10.0, across]), height=height)
    problem = Problem(library, [0, 0, 0, 2], [20, 0, 0, 2], obstacles=bridge, footprint=Disc(1.0))
    on = Trim(name="on", body_velocity=[2.0, 0.0, 0.0, 0.0], control=library.trims[0].control)
    straight = Plan([0.0, 0.0, 0.0, 2.0], (on,), durations=[10.0])
    assert [len(one.obstacles) for one in _without_passed(problem, straight)] == left
