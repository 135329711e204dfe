"""Plans of vehicles with inertia: exact, within limits, free, and the same wherever they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.collision import Box, Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.problem import Goal, Horizon, Problem, SearchSettings
from tests.inertia import CAR, resting, unicycle_automaton
from tests.quickly import quick_are

BODY = Box([4.689, 1.942], [1.4155, 0.0])
SLOT = (
    Obstacle(Box([4.689, 1.942], [-5.0, 0.0])),
    Obstacle(Box([4.689, 1.942], [8.0, 0.0])),
    Obstacle(Box([20.0, 0.4], [1.5, -1.5])),
)
WORK = SearchSettings(max_expansions=4000)


def parking(**changes):
    values = {"obstacles": SLOT, "footprint": BODY, "search": WORK} | changes
    return Problem(resting(CAR), [-1.0, 3.0, 0.0], [0.0, 0.0, 0.0], **values)


def touched(problem, result):
    """Whether the body touches an obstacle at a dense sample of the plan, by shapely."""
    low, high = (
        np.array(BODY.center) - np.array(BODY.size) / 2,
        np.array(BODY.center) + np.array(BODY.size) / 2,
    )
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    around = shapely.union_all([
        shapely.box(
            *(np.array(one.shape.center) - np.array(one.shape.size) / 2),
            *(np.array(one.shape.center) + np.array(one.shape.size) / 2),
        )
        for one in problem.obstacles
    ])  # fmt: skip
    times = np.linspace(0.0, result.plan.duration, 3000)
    bodies = SE2(result.plan.pose_at(times)[:, None]).act(corners)
    return bool(shapely.intersects(shapely.polygons(bodies), around).any())


def test_a_car_parks_exactly_and_from_rest_to_rest():
    problem = parking(search=replace(WORK, improve=False))
    result = plan(problem, time_limit=60.0)
    assert result.status is PlanStatus.FOUND
    assert result.terminal_error.position_m < 1e-9
    assert result.terminal_error.heading_rad < 1e-9
    states = result.plan.sample().reduced_state
    np.testing.assert_allclose(states[[0, -1]], 0.0, atol=1e-12)
    assert (np.abs(states).max(axis=0) <= [2.5 + 1e-9, 0.75 + 1e-9]).all()
    assert not touched(problem, result)
    assert result.lower_bound <= result.cost
    assert result.audit.passed


@pytest.mark.slow
def test_costs_fall_and_the_first_plan_stops_and_steers():
    result = plan(parking(), time_limit=3.0)
    costs = [cost for _, cost in result.improvements]
    assert costs == sorted(costs, reverse=True)
    assert result.cost == costs[-1]


@pytest.mark.slow
def test_polishing_makes_it_quick():
    """10.19 s by polishing, more than 20 s by stopping and steering."""
    result = plan(parking(), time_limit=20.0)
    assert result.plan.word == ("polished",)
    assert result.cost < 10.3
    assert not touched(parking(), result)


def test_a_moved_problem_has_the_moved_plan():
    by = SE2([120.0, -40.0, 2.1])
    problem = Problem(
        unicycle_automaton(),
        [0.0, 0.0, 0.0],
        [6.0, 2.0, 1.0],
        obstacles=(Obstacle(Box([1.0, 2.0], [3.0, 0.5])),),
        footprint=Box([0.5, 0.3]),
        search=SearchSettings(max_expansions=3000, improve=False),
        cost=Cost(time=1.0, effort=0.1),
        horizon=Horizon(max_time=500.0),
    )
    one, other = plan(problem, time_limit=60.0), plan(problem.moved(by), time_limit=60.0)
    first, second = one.improvements[0][1], other.improvements[0][1]
    assert first == pytest.approx(second, abs=1e-9)
    assert other.terminal_error.position_m < 1e-9


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_fixed_time_is_filled_with_rest():
    search = replace(WORK, improve=False)
    problem = parking(horizon=Horizon(time=60.0), search=search)
    result = plan(problem, time_limit=60.0)
    assert result.status is PlanStatus.FOUND
    assert result.plan.duration == pytest.approx(60.0, abs=1e-12)
    assert result.plan.word[-1] == "rest"


def test_words_of_maneuvers_from_trim_to_trim():
    """From one moving trim to another, without any rest in between."""
    robot = unicycle_automaton()
    goal = Goal(pose=[8.0, 1.5, 0.0], trim="1, 0")
    problem = Problem(robot, [0.0, 0.0, 0.0], goal, start_trim="1, 0")
    result = plan(problem, time_limit=2.0)
    assert result.status is PlanStatus.FOUND
    states = result.plan.sample().reduced_state
    np.testing.assert_allclose(states[[0, -1]], [[1.0, 0.0], [1.0, 0.0]], atol=1e-9)
    assert result.terminal_error.position_m < 1e-9


def test_start_and_goal_that_are_blocked():
    blocked = parking(obstacles=(*SLOT, Obstacle(Box([1.0, 1.0], [-1.0, 3.0]))))
    assert plan(blocked).status is PlanStatus.START_BLOCKED


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hovercraft", "second_order_unicycle", "car_with_trailer"])
def test_stock_libraries_plan(name):
    library = load_stock_library(name)
    size = 1.0 if name == "second_order_unicycle" else 4.0
    problem = Problem(library, [0.0, 0.0, 0.0], [2.0 * size, size, 0.5])
    result = plan(problem, time_limit=2.0)
    assert result.status is PlanStatus.FOUND, result.reason
    assert result.audit.passed
    assert result.terminal_error.position_m < 1e-9


def test_maneuvers_without_a_course_are_refused():
    robot = unicycle_automaton()
    bare = Maneuver(name="hop", source="rest", target="1, 0", displacement=[1, 0, 0], duration=1.0)
    library = Automaton(robot.model, robot.trims, (bare,))
    with pytest.raises(ValueError, match=r"^maneuver 'hop': has no course, so its cost is not"):
        plan(Problem(library, [0, 0, 0], [5, 0, 0]))


@pytest.mark.parametrize("automaton", [resting(CAR), unicycle_automaton()])
def test_a_start_that_is_the_goal_is_an_empty_word(automaton):
    for goal in ([1.0, 2.0, 0.5], [1.0, 2.0, 0.5 + 2.0 * np.pi]):
        result = plan(Problem(automaton, [1.0, 2.0, 0.5], goal), time_limit=2.0)
        assert result.status is PlanStatus.FOUND
        assert (result.plan.word, result.cost, result.plan.duration) == ((), 0.0, 0.0)


def one_of(name, goal, *, trim=None, **changes):
    values = {"search": SearchSettings(max_expansions=800)} | changes
    goals = Goal(pose=goal, trim=trim)
    start = np.zeros(len(goal))
    return Problem(load_stock_library(name), start, goals, start_trim=trim, **values)


FREE = {
    "car_with_trailer": one_of("car_with_trailer", (24.0, 6.0, 0.3)),
    "hovercraft": one_of("hovercraft", (9.0, 3.0, 0.5)),
    "single_track": one_of("single_track", (120.0, 12.0, 0.1), trim="speed 20, turn_rate 0"),
}


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.parametrize("name", quick_are(["hovercraft"], FREE))
def test_counted_work_gives_the_same_plan_and_the_moved_one(name):
    problem = replace(FREE[name], obstacles=(Obstacle(Box([0.5, 0.5], [300.0, 50.0])),))
    one, again = plan(problem, time_limit=90.0), plan(problem, time_limit=90.0)
    assert one.plan.word == again.plan.word
    np.testing.assert_array_equal(one.plan.durations, again.plan.durations)
    assert one.cost == again.cost
    by = SE2([20.0, -7.0, 1.1])
    moved = plan(problem.moved(by), time_limit=90.0)
    assert moved.plan.word == one.plan.word
    assert moved.cost == pytest.approx(one.cost, abs=1e-7)
    np.testing.assert_allclose((by @ SE2(one.plan.end)).pose, moved.plan.end, atol=1e-6)
