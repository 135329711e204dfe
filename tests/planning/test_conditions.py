"""No plan leaves the planner that breaks a condition of its problem, and limits are searched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.models import Unicycle
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.planning.checking import Condition, check_plan
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.refinement.fitting import broken_condition
from tests import scenes

LIMIT = 60.0  # [s] a limit that a busy machine does not reach
AHEAD = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "ahead": (1, 0), "spin": (0, 1)})
TRIP = Plan([0, 0, 0], AHEAD.trims[1:2], durations=[5.0])
TO_FIVE = Problem(AHEAD, [0, 0, 0], [5, 0, 0])
AXIS = np.linspace(-2.0, 2.0, 9)
GRID = Automaton.of_grid(Unicycle(), [AXIS, AXIS])


@pytest.mark.parametrize(
    ("horizon", "reason"),
    [
        (Horizon(time=6.0), "it takes 5 s, 6 s are asked"),
        (Horizon(time=4.0), "it takes 5 s, 4 s are asked"),
        (Horizon(max_time=4.0), "it takes 5 s, at most 4 s are admitted"),
        (Horizon(min_coast=5.5), "trim 'ahead' lasts 5 s, less than 5.5 s"),
        (Horizon(max_time=5.0, max_trims=1, min_coast=5.0), ""),
        (Horizon(time=5.0), ""),
    ],
)
def test_each_condition_of_the_horizon_is_checked(horizon, reason):
    problem = replace(TO_FIVE, horizon=horizon)
    assert broken_condition(problem, TRIP) == reason
    checked = check_plan(problem, TRIP, problem.goals[0])
    assert (checked.passed, checked.reason) == (not reason, reason)
    assert checked.broken is (Condition.WORD if reason else None)


def test_trims_of_no_time_are_not_counted():
    rest, ahead, spin = AHEAD.trims
    two = Plan([0, 0, 0], (spin, ahead, rest), durations=[0.0, 5.0, 0.5])
    for most, reason in ((2, ""), (1, "it has 2 trims, 1 are admitted")):
        problem = replace(TO_FIVE, horizon=Horizon(max_trims=most, min_coast=1.0))
        assert broken_condition(problem, two) == reason


def test_a_trim_lasts_no_longer_than_it_may():
    brief = Trim(name="ahead", body_velocity=[1, 0, 0], control=[1, 0], max_duration=4.0)
    trip = Plan([0, 0, 0], (brief,), durations=[5.0])
    assert broken_condition(TO_FIVE, trip) == "trim 'ahead' lasts 5 s, more than 4 s"


@pytest.mark.parametrize("max_time", [9.0, 6.0, 3.0, 2.5])
def test_a_greatest_time_is_searched_for(max_time):
    # with no limit the cheapest plan takes 12.3 s; less time costs more effort
    free = Problem(GRID, [0, 0, 0], [0, 3, 0], cost=Cost(effort=1.0))
    limited = replace(free, horizon=Horizon(max_time=max_time, min_coast=0.0))
    result = plan(limited, time_limit=LIMIT, alternatives=2)
    assert result.status is PlanStatus.FOUND
    assert result.plan.duration == pytest.approx(max_time, abs=1e-9)  # the limit binds
    assert all(one.plan.duration <= max_time + 1e-9 for one in result.alternatives)
    assert result.certificate > -1e-9  # with the price of time
    exactly = Horizon(time=max_time, min_coast=0.0)
    fixed = plan(replace(free, horizon=exactly), time_limit=LIMIT)
    assert result.cost == pytest.approx(fixed.cost, rel=1e-9)  # rest is free here
    longer = plan(replace(free, horizon=Horizon(max_time=1.1 * max_time)), time_limit=LIMIT)
    assert longer.cost < result.cost


def test_no_trim_of_milliseconds_where_the_time_is_fixed():
    turns = {"rest": (0, 0), "ahead": (1, 0), "left": (1, 1), "right": (1, -1)}
    robot = Automaton.of_controls(Unicycle(), turns)
    exact = Plan([0, 0, 0], [robot[k] for k in ("left", "ahead", "right")], durations=[0.003, 2, 1])
    problem = Problem(robot, [0, 0, 0], exact.end, horizon=Horizon(time=5.0))
    result = plan(problem, time_limit=LIMIT)
    assert result.plan.duration == pytest.approx(5.0)
    assert result.plan.durations.min() >= 0.02
    assert np.abs(result.plan.end - exact.end).max() < 1e-9


def test_a_greatest_time_that_does_not_bind_changes_nothing():
    free = Problem(GRID, [0, 0, 0], [0, 3, 0], cost=Cost(effort=1.0))
    roomy = replace(free, horizon=Horizon(max_time=13.0))
    one, other = plan(free, time_limit=LIMIT), plan(roomy, time_limit=LIMIT)
    assert one.plan.word == other.plan.word
    assert one.plan.durations.tolist() == other.plan.durations.tolist()


def test_few_trims_meet_a_greatest_time():
    horizon = Horizon(max_time=4.0, max_trims=6)
    problem = Problem(GRID, [0, 0, 0], [0, 3, 0], cost=Cost(effort=1.0), horizon=horizon)
    result = plan(problem, time_limit=LIMIT)
    assert result.status is PlanStatus.FOUND
    assert len(result.plan.word) <= 6
    assert result.plan.duration <= 4.0 + 1e-9


def test_unreachable_is_said_with_a_proof_only():
    # least time is 4.547 s: by words of any length nobody has proven it
    car = scenes.reeds_shepp(1.0)
    problem = Problem(car, [0, 0, 0], [0, 3, 0], horizon=Horizon(max_time=4.5))
    result = plan(problem, time_limit=LIMIT)
    assert result.status is PlanStatus.NO_PLAN
    assert result.reason.endswith("the least time found is 4.5472 s")
    short = replace(problem, horizon=Horizon(max_time=4.5, max_trims=3))
    assert plan(short, time_limit=LIMIT).status is PlanStatus.UNREACHABLE
    far = replace(problem, horizon=Horizon(max_time=2.9))
    assert plan(far, time_limit=LIMIT).status is PlanStatus.UNREACHABLE
