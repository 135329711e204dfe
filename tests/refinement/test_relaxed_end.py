"""Ends within the tolerance of a goal: for words of maneuvers as for words of trims."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.refinement.relaxed_end import _Relaxation, with_relaxed_end
from maneuver_automaton.search.choose import search_insertion
from maneuver_automaton.search.result import plan_of
from tests.inertia import unicycle_automaton

GOAL = Goal(pose=[4.0, 1.5, 0.7], tolerance_m=0.1, tolerance_rad=0.2)


def found(offset):
    """Plans of trims and maneuvers to a goal, far from the origin or near to it."""
    goal = replace(GOAL, pose=np.add(GOAL.pose, [offset, -offset, 0.0]))
    problem = Problem(unicycle_automaton(), [offset, -offset, 0.0], goal)
    exact = replace(goal, tolerance_m=0.0, tolerance_rad=0.0)
    words = search_insertion(problem, exact, budget=Budget.from_now(60.0), alternatives=2)
    return problem, goal, [plan_of(problem, word) for word in words.solutions]


@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_the_end_and_how_it_follows_the_times(offset):
    problem, goal, plans = found(offset)
    assert plans
    for plan in plans:
        task = _Relaxation(problem, plan, goal, 1.0, 0)
        times = plan.durations + 0.05
        end, columns = task.off(times)
        other = replace(plan, durations=times).end - goal.pose
        np.testing.assert_allclose(end, other, atol=1e-12 * (1.0 + offset))
        for k, step in enumerate(1e-5 * np.eye(times.size)):
            slope = (task.off(times + step)[0] - task.off(times - step)[0]) / 2e-5
            np.testing.assert_allclose(slope, columns[:, k], atol=1e-6)


def test_a_word_of_maneuvers_ends_where_it_is_cheaper():
    problem, goal, plans = found(0.0)
    for plan in plans:
        relaxed = with_relaxed_end(problem, plan, goal)
        assert isinstance(relaxed, Plan)
        assert problem.cost_of(relaxed) < problem.cost_of(plan)
        way, turn = goal.off(relaxed.end)
        assert 1e-3 < way <= 0.1
        assert turn <= 0.2
