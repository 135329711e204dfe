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
from maneuver_automaton.formats.plan_json import plan_to_dict

FOLDER = Path(__file__).parent.parent / "scenarios"
FILES = sorted(FOLDER.glob("*.yaml"))
FEW, MANY = 3000, 40_000  # expansions: they end a search after the same work everywhere
NEED_MORE = {
    "effort_among_obstacles": 6000,
    "helicopter_city": 36_000,
    "narrow_corridor": MANY,
    "omnidirectional": MANY,
    "parallel_parking": MANY,
    "two_trailers": 12_000,
}
COSTLY = {  # seconds to improve them so far: the first plan is looked at
    "clearance_corridor",
    "helicopter_city",
    "hovercraft",
    "lane_change",
    "narrow_corridor",
    "off_the_library",
    "omnidirectional",
    "priced_ground",
    "robot_with_inertia",
    "through_poses",
    "tpcap_full",
    "trailer",
    "tugger_train",
    "two_trailers",
    "yard_loop",
}
UNHURRIED = 600.0  # [s], so that the clock decides nothing
NAMES = {path.stem for path in FILES}
LONG = [
    pytest.param(
        (path, MANY, True),
        id=f"{path.stem}, long",
        marks=[pytest.mark.slow, pytest.mark.exhaustive],
    )
    for path in FILES
]
SHORT = [
    pytest.param((path, NEED_MORE.get(path.stem, FEW), path.stem not in COSTLY), id=path.stem)
    for path in FILES
]


def plan_of(path, expansions, improve):
    """A scenario and its plan after so much work, or its first one."""
    scenario = ma.load_scenario(path)
    problem = scenario.problem
    settings = replace(problem.search, max_expansions=expansions, improve=improve)
    problem = replace(problem, search=settings)
    return scenario, ma.plan(problem, time_limit=UNHURRIED)


@pytest.fixture(scope="module", params=[*LONG, *SHORT])
def planned(request):
    """A scenario and its plan."""
    return plan_of(*request.param)


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
    if any(plan.maneuvers) or problem.place_costs:
        assert result.cost == pytest.approx(problem.cost_of(plan))
        return
    rows = [problem.automaton.index_of(name) for name in plan.word]
    switching = problem.cost.switching(problem.automaton.body_velocities[rows])
    assert result.cost == pytest.approx(problem.rates[rows] @ plan.durations + switching)
    assert result.lower_bound <= result.cost


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


@pytest.mark.parametrize("planned", LONG, indirect=True)
def test_planning_again_writes_the_same(planned, request):
    document = plan_to_dict(planned[1])
    _, result = plan_of(*request.node.callspec.params["planned"])
    again = plan_to_dict(result)
    for one in (document, again):  # the sequence is the same, not when it came
        one["improvements"] = [cost for _, cost in one["improvements"]]
    for key in document.keys() - {"timing_s"}:
        assert again[key] == document[key], key
