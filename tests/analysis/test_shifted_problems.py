"""A moved problem has the moved plan."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.analysis import (
    ControlProblem,
    shifted_problem,
)
from maneuver_automaton.groups import SE2, SE2xR, product, translations
from tests.reference_dynamics import flow

POSES = arrays(np.float64, 3, elements=st.floats(-5.0, 5.0))
CONTROLS = arrays(np.float64, 2, elements=st.floats(-2.0, 2.0))
GROUPS = [SE2, SE2xR, translations(3), product(SE2, translations(2))]


def wall(x, u):
    return [x[0] + 0.3 * x[1] - 3.0, u[0] - 1.0]


def test_example_of_the_paper():
    duration = 2.0
    ahead = [1 / duration, 0.0]
    problem = ControlProblem(start=[-1.0, 0.0, 0.0], goal=[0.0, 0.0, 0.0])
    shifted = shifted_problem(problem, SE2([1.0, 1.0, 0.0]))
    assert flow(problem.start, ahead, duration=duration).tolist() == problem.goal.tolist()
    assert flow(shifted.start, ahead, duration=duration).tolist() == shifted.goal.tolist()
    assert flow(shifted.start, ahead, duration=duration).tolist() != problem.goal.tolist()


@given(move=POSES, start=POSES, control=CONTROLS)
def test_the_same_controls_solve_the_shifted_problem_at_the_same_cost(move, start, control):
    duration = 3.0
    by, cost = SE2(move), lambda x, u: x @ x + u @ u
    goal = flow(start, control, duration=duration)
    problem = ControlProblem(start=start, goal=goal, stage_cost=cost, constraints=(wall,))
    shifted = shifted_problem(problem, by)
    times = np.linspace(0.0, duration, 7)
    here, there = (flow(p.start, control, duration=times) for p in (problem, shifted))
    np.testing.assert_allclose(there[-1], shifted.goal, rtol=0.0, atol=1e-12)
    for x, moved in zip(here, there, strict=True):
        assert shifted.stage_cost(moved, control) == pytest.approx(cost(x, control), abs=1e-9)
        np.testing.assert_allclose(
            shifted.constraints[0](moved, control), wall(x, control), rtol=0.0, atol=1e-10
        )


def test_the_goal_must_fit_the_start():
    with pytest.raises(ValueError, match=r"goal: got shape \(4,\), need 3 components last"):
        ControlProblem(start=np.zeros(3), goal=np.zeros(4))
