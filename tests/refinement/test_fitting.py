"""Plans that are made to keep to the horizon: least coasting times, a fixed and a greatest time."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.refinement.conditions import broken_condition
from maneuver_automaton.refinement.fitting import fitted_plans
from maneuver_automaton.search.insertion import search_insertion
from maneuver_automaton.search.result import plan_of
from tests.inertia import unicycle_automaton


def test_trims_that_are_too_short_are_prolonged_or_left_out():
    pose, robot = [4.0, 1.5, 0.7], unicycle_automaton()
    free = Problem(robot, [0.0, 0.0, 0.0], pose)
    found = search_insertion(free, free.goals[0], budget=UNLIMITED, alternatives=6)
    mended = 0
    for plan in (plan_of(free, word) for word in found.solutions):
        least = 1.05 * float(plan.durations[plan.durations > 0.0].min())
        problem = Problem(robot, [0.0, 0.0, 0.0], pose, horizon=Horizon(min_coast=least))
        assert f"less than {least:g} s" in broken_condition(problem, plan)
        fitted = list(fitted_plans(problem, plan, problem.goals[0]))
        mended += bool(fitted)
        for one in fitted:
            lasting = zip(one.trims, one.durations.tolist(), strict=True)
            moving = [time for trim, time in lasting if not trim.is_rest]
            assert all(time == 0.0 or time >= least * (1.0 - 1e-12) for time in moving)
            assert max(problem.goals[0].off(one.end)) < 1e-9
    assert mended >= 4


def test_a_fixed_time_is_met_without_a_rest():
    """Two seconds more than it takes are coasted, and it still ends at the goal."""
    goal = Goal(pose=[4.0, 1.5, 0.7], trim="1, 0")
    known = Problem(unicycle_automaton(), [0, 0, 0], goal, start_trim="1, 0")
    found = search_insertion(known, goal, budget=Budget.from_now(60.0), alternatives=5)
    plans = [plan_of(known, word) for word in found.solutions]
    total = max(one.duration for one in plans) + 0.1
    problem = Problem(
        unicycle_automaton(), [0, 0, 0], goal, start_trim="1, 0", horizon=Horizon(time=total)
    )
    fitted = [one for plan in plans for one in fitted_plans(problem, plan, goal)]
    assert fitted
    for one in fitted:
        assert one.duration == pytest.approx(total, abs=1e-9)
        assert max(goal.off(one.end)) < 1e-9


def test_one_trim_at_rest_is_padded():
    robot = unicycle_automaton()
    problem = Problem(robot, [0, 0, 0], [0, 0, 0], horizon=Horizon(time=3.0))
    rest = robot.trims[robot.rest]
    (fitted,) = fitted_plans(problem, Plan([0, 0, 0], (rest,), durations=[0.0]), problem.goals[0])
    np.testing.assert_allclose(fitted.durations, [3.0])
