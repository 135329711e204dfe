"""Plans that start or end in a reduced state that no trim of the library has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton.cutting import begin_state
from maneuver_automaton.formats.plan_json import load_plan, save_plan
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning.checking import check_plan
from tests.quickly import quick_are

BODY = {  # length and width [m], and a state beside the trims
    "second_order_car": ((4.0, 1.8), [1.37, 0.12]),
    "second_order_unicycle": ((0.5, 0.3), [0.2, -0.13]),
    "single_track": ((4.5, 1.8), [15.0, 0.1, 0.05, 0.01]),
    "hovercraft": ((0.6, 0.4), [0.7, 0.1, 0.2]),
    "helicopter": ((1.0, 1.0), [3.3, 0.4, 0.2, 0.1, 0.05, 0.02]),
    "car_with_trailer": ((0.3, 0.2), [0.23]),
}
FAR = {"single_track": 100.0, "helicopter": 30.0}  # [m]; others go five times their length
FIRST = ma.SearchSettings(improve=False, polish=False)


def problem_of(name: str, **more: object) -> ma.Problem:
    """A way past a box, from a state beside the trims."""
    library, (size, state) = ma.load_stock_library(name), BODY[name]
    far = FAR.get(name, 5.0 * size[0])
    end = np.zeros(library.model.group.dof)
    end[:2] = far, 0.3 * far
    goal = ma.Goal(end, trim=None if library.rest is not None else library.trim_names[0])
    box = ma.Box([0.1 * far, 0.1 * far], [0.5 * far, -0.05 * far])
    given = {"start_state": state, "footprint": ma.Box(size), "obstacles": box, "search": FIRST}
    return ma.Problem(library, np.zeros(end.size), goal, **(given | more))


@pytest.mark.parametrize("name", quick_are(["second_order_car", "hovercraft", "helicopter"], BODY))
def test_starts_in_its_state_among_obstacles(name: str) -> None:
    problem = problem_of(name)
    result = ma.plan(problem, time_limit=10.0)
    assert result.plan is not None, result.reason
    first = result.plan.maneuvers[0]
    np.testing.assert_allclose(first.course.reduced_state[0], problem.start_state, atol=1e-12)
    assert result.audit.passed
    assert check_plan(problem, result.plan, problem.goals[0]).passed
    assert result.lower_bound <= result.cost


def test_ends_in_a_state() -> None:
    problem = problem_of("second_order_car")
    end = ma.Goal(problem.goals[0].pose, state=problem.start_state)
    there = replace(problem, goals=(end,), start_state=None)
    result = ma.plan(there, time_limit=10.0)
    assert result.plan is not None, result.reason
    last = result.plan.maneuvers[-1]
    np.testing.assert_allclose(last.course.reduced_state[-1], end.state, atol=1e-9)
    assert max(end.off(result.plan.end)) < 1e-9
    assert result.audit.passed


def test_moved_problem_has_the_moved_plan() -> None:
    problem = problem_of("second_order_car", search=replace(FIRST, max_expansions=3000))
    by = SE2([30.0, -20.0, 0.5 * np.pi])
    here, there = (ma.plan(one, time_limit=60.0) for one in (problem, problem.moved(by)))
    assert here.plan.word == there.plan.word
    assert there.cost == pytest.approx(here.cost, rel=1e-9)
    np.testing.assert_allclose((by @ SE2(here.plan.end)).pose, there.plan.end, atol=1e-8)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_polished_is_no_costlier_and_keeps_its_ends() -> None:
    problem = problem_of("second_order_car")
    alone = ma.plan(problem, time_limit=5.0)
    polished = ma.plan(replace(problem, search=ma.SearchSettings()), time_limit=10.0)
    assert polished.cost <= alone.cost * (1.0 + 1e-9)
    assert polished.audit.passed


@pytest.mark.slow
def test_polished_is_the_optimum_of_a_straight_line() -> None:
    """From 1.3 m/s over 12 m to rest: up to 2.5 m/s at 1 m/s^2, along, and down."""
    library = ma.load_stock_library("second_order_car")
    search = ma.SearchSettings(max_expansions=100)
    problem = ma.Problem(library, [0, 0, 0], [12, 0, 0], start_state={"speed": 1.3}, search=search)
    up, down = 2.5 - 1.3, 2.5
    ways = 0.5 * (2.5**2 - 1.3**2) + 0.5 * 2.5**2
    optimum = up + down + (12.0 - ways) / 2.5
    result = ma.plan(problem, time_limit=60.0)
    assert optimum * (1.0 - 1e-6) < result.cost < optimum * 1.002


def test_fixed_time_counts_the_maneuver() -> None:
    result = ma.plan(problem_of("second_order_car", horizon=ma.Horizon(time=30.0)), time_limit=8.0)
    assert result.plan is not None, result.reason
    assert result.plan.duration == pytest.approx(30.0)


def test_plan_json_reads_back_and_is_judged(tmp_path) -> None:
    problem = problem_of("second_order_car")
    result = ma.plan(problem, time_limit=5.0)
    save_plan(result, tmp_path / "plan.json")
    again = load_plan(tmp_path / "plan.json", model=problem.automaton.model)
    np.testing.assert_allclose(again.end, result.plan.end, atol=1e-9)
    states = (problem.start_state, problem.last_trim(problem.goals[0]).reduced_state)
    judged = audit_plan(again, problem.goals[0], problem.automaton.model, states=states)
    assert judged.passed, judged.reason


def test_state_of_a_trim_is_that_trim() -> None:
    library = ma.load_stock_library("second_order_car")
    problem = ma.Problem(library, [0, 0, 0], [9, 0, 0], start_state=[1.0 + 1e-10, 0.375])
    assert problem.start_state is None
    assert problem.start_trim == "speed 1, steering 0.375"
    assert ma.Problem(library, [0, 0, 0], [9, 0, 0], start_state={}).first_trim.is_rest


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"start_state": [3.0, 0.0]}, "start: state: speed is 3, need one of the second_order_car"),
        ({"start_state": [1.0]}, "need 2 numbers: speed, steering"),
        ({"start_state": {"pace": 1.0}}, "has no 'pace', need some of speed, steering"),
        ({"start_state": [1.1, 0.0], "start_trim": "speed 1, steering 0"}, "need one of them"),
        ({"start_state": [np.nan, 0.0]}, "need finite numbers"),
    ],
)
def test_what_is_no_state_is_told(given: dict, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        ma.Problem(ma.load_stock_library("second_order_car"), [0, 0, 0], [9, 0, 0], **given)


def test_kinematic_vehicles_have_no_state() -> None:
    robot = ma.Automaton.of_controls(ma.Unicycle(), {"ahead": (1, 0), "left": (0, 1)})
    with pytest.raises(ValueError, match="has no reduced state: it changes its velocity at will"):
        ma.Problem(robot, [0, 0, 0], [1, 1, 0], start_state=[0.5])


def test_a_first_maneuver_that_hits_is_no_plan() -> None:
    wall = ma.Box([0.2, 6.0], [2.4, 0.0])  # 0.3 m ahead, at 1.37 m/s
    result = ma.plan(problem_of("second_order_car", obstacles=wall), time_limit=2.0)
    assert result.plan is None
    assert result.reason.startswith("no first maneuver")


def test_a_goal_that_is_blocked_is_met_within_its_tolerance() -> None:
    end = np.array([20.0, 6.0, 0.0])
    at_goal = ma.Disc(0.2, [22.15, 6.0])  # 5 cm within its front
    problem = problem_of("second_order_car", obstacles=at_goal)
    near = replace(problem, goals=(ma.Goal(end, tolerance_m=0.5),))
    assert ma.plan(near, time_limit=10.0).plan is not None
    assert ma.plan(problem, time_limit=10.0).status is ma.PlanStatus.GOAL_BLOCKED


@pytest.mark.parametrize("horizon", [{"time": 0.1}, {"max_time": 0.1}])
def test_less_time_than_the_first_maneuver_takes_is_told(horizon: dict) -> None:
    end = ma.Goal([0.12, 0.0, 0.0], state=[1.4, 0.1])
    here = problem_of("second_order_car", horizon=ma.Horizon(**horizon), obstacles=())
    result = ma.plan(replace(here, goals=(end,)), time_limit=2.0)
    assert result.reason == "the first and the last maneuver take longer than the horizon admits"


def test_a_fleet_starts_in_the_states_of_its_vehicles() -> None:
    library, body = ma.load_stock_library("second_order_car"), ma.Box([4.0, 1.8])
    ways = ([0.0, 0.0, 0.0], [20.0, 3.0, 0.0]), ([20.0, -4.0, np.pi], [0.0, -6.0, np.pi])
    states = [1.37, 0.12], None
    problems = [
        ma.Problem(library, start, goal, start_state=state, footprint=body)
        for (start, goal), state in zip(ways, states, strict=True)
    ]
    result = ma.plan_fleet(ma.FleetProblem(problems), time_limit=60.0, max_rounds=0)
    first = result.results["1"]
    assert first.audit.passed
    np.testing.assert_allclose(begin_state(first.plan), states[0], atol=1e-12)
