"""Every scenario of the repository: it plans, stays clear, ends at its goal, outlives its file."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.audit import audit_plan
from maneuver_automaton.collision.blocked import touched
from maneuver_automaton.formats import plan_to_dict

FOLDER = Path(__file__).parent.parent / "scenarios"
FILES = sorted(FOLDER.glob("*.yaml"))
EXPANSIONS = 40_000  # where obstacles are: it ends the search after the same work everywhere
IN_SPACE = 12.0  # [s], where searches are long
NAMES = {path.stem for path in FILES}


def plan_of(scenario):
    """The plan of a scenario; a generous limit, for machines that are busy."""
    problem = scenario.problem
    if problem.obstacles:
        problem = replace(problem, search=replace(problem.search, max_expansions=EXPANSIONS))
    return ma.plan(problem, time_limit=IN_SPACE if problem.start.size > 3 else 60.0)


@pytest.fixture(scope="module", params=FILES, ids=[path.stem for path in FILES])
def planned(request):
    """A scenario and its plan."""
    scenario = ma.load_scenario(request.param)
    return scenario, plan_of(scenario)


def test_there_are_scenarios():
    assert {
        "parking",
        "parallel_parking",
        "perpendicular_parking",
        "diagonal_parking",
        "dead_end",
        "narrow_corridor",
        "cluttered_room",
        "warehouse",
        "crossing_traffic",
        "opening_door",
    } <= NAMES


def test_it_says_what_it_shows(planned):
    scenario, _ = planned
    assert scenario.name
    first = Path(scenario.path).read_text(encoding="utf-8").splitlines()[0]
    assert first.startswith("# ")


def test_a_plan_is_found_and_passes_its_audit(planned):
    _, result = planned
    assert result.status is ma.PlanStatus.FOUND
    assert result.reason == ""
    assert result.audit.passed
    assert result.audit.max_dynamics_defect < 1e-7


def test_it_stays_clear(planned):
    scenario, result = planned
    problem, plan = scenario.problem, result.plan
    if not problem.obstacles:
        return
    assert result.clearance_m >= problem.margin - 1e-9
    assert result.clearance_m == result.audit.min_clearance_m
    if problem.start.size > 3:
        return  # heights are tested with the search that knows them
    begin = problem.start_time
    for time in np.linspace(begin, begin + plan.duration, 200):
        assert not touched(
            problem.footprint,
            problem.obstacles,
            plan.pose_at(time),
            time=time,
            margin=problem.margin,
            origin=tuple(problem.start[:2]),
        )


def test_it_ends_at_the_goal(planned):
    scenario, result = planned
    goal = scenario.problem.goals[result.goal_index]
    off = result.plan.end - goal.pose
    assert np.linalg.norm(off[[0, 1, *range(3, off.size)]]) <= goal.tolerance_m + 1e-9
    if not goal.free_heading:
        assert abs(math.remainder(off[2], 2 * math.pi)) <= goal.tolerance_rad + 1e-9
    assert result.terminal_error.position_m <= goal.tolerance_m + 1e-9


def test_it_keeps_to_the_horizon(planned):
    scenario, result = planned
    horizon = scenario.problem.horizon
    if horizon.time is not None:
        assert result.plan.duration == pytest.approx(horizon.time, abs=1e-9)
    if horizon.max_time is not None:
        assert result.plan.duration <= horizon.max_time + 1e-9
    if horizon.max_trims is not None:
        assert len(result.plan.word) <= horizon.max_trims
    assert (result.plan.primitive_durations > 0.0).all()


def test_its_cost_is_that_of_its_word(planned):
    scenario, result = planned
    problem, plan = scenario.problem, result.plan
    if any(plan.maneuvers):
        assert result.cost == pytest.approx(problem.cost_of(plan))
        return
    rows = [problem.automaton.index_of(name) for name in plan.word]
    switching = problem.cost.switching(problem.automaton.body_velocities[rows])
    assert result.cost == pytest.approx(problem.rates[rows] @ plan.durations + switching)
    assert result.lower_bound <= result.cost


def test_the_plan_comes_back_from_its_file(planned, tmp_path):
    _, result = planned
    ma.save_plan(result, tmp_path / "plan.json")
    read = ma.load_plan(tmp_path / "plan.json")
    assert read.word == result.plan.word
    assert read.durations.tolist() == result.plan.durations.tolist()
    assert read.start.tolist() == result.plan.start.tolist()
    times = np.linspace(0.0, read.duration, 40)
    np.testing.assert_allclose(read.pose_at(times), result.plan.pose_at(times), atol=1e-9)
    np.testing.assert_array_equal(read.control_at(times), result.plan.control_at(times))


def test_the_plan_from_the_file_passes_the_audit_again(planned, tmp_path):
    scenario, result = planned
    ma.save_plan(result, tmp_path / "plan.json")
    goal = scenario.problem.goals[result.goal_index]
    read = ma.load_plan(tmp_path / "plan.json")
    problem = scenario.problem
    assert audit_plan(
        read,
        goal,
        problem.automaton.model,
        footprint=problem.footprint,
        obstacles=problem.obstacles,
        margin=problem.margin,
    ).passed


def test_planning_again_writes_the_same(planned):
    scenario, result = planned
    if scenario.problem.start.size > 3:
        pytest.skip("cut short by its time")
    document = plan_to_dict(result)
    again = plan_to_dict(plan_of(scenario))
    for one in (document, again):  # the sequence is the same, not when it came
        one["improvements"] = [cost for _, cost in one["improvements"]]
    for key in document.keys() - {"timing_s"}:
        assert again[key] == document[key], key
