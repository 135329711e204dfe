"""A moved problem has the moved plan."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.analysis import (
    ControlProblem,
    QuadraticCost,
    shifted_boundary_condition,
    shifted_cost,
    shifted_function,
    shifted_problem,
)
from maneuver_automaton.groups import SE2, SE2xR, product, translations
from maneuver_automaton.models import moved_state
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


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.__name__)
@given(data=st.data())
def test_shifted_quadratic_costs_are_the_costs_of_the_moved_back_state(group, data):
    n, number = group.dof + 1, st.floats(-3.0, 3.0)
    square = data.draw(arrays(np.float64, (n, n), elements=number))
    reference, state = data.draw(arrays(np.float64, (2, n), elements=number))
    by = group(data.draw(arrays(np.float64, group.dof, elements=number)))
    cost = QuadraticCost(
        state_weight=square @ square.T,
        control_weight=np.eye(2),
        state_reference=reference,
        control_reference=[0.5, 0.0],
    )
    control, shifted = np.array([1.0, 0.2]), shifted_cost(cost, by)
    value = cost(state, control)
    moved = moved_state(by, state)
    assert shifted(moved, control) == pytest.approx(value, rel=1e-9, abs=1e-9)
    assert shifted_function(cost, by)(moved, control) == pytest.approx(value, rel=1e-9, abs=1e-9)


@given(move=POSES, first=POSES, last=POSES)
def test_shifted_boundary_conditions(move, first, last):
    by = SE2(move)

    def ends(a, b):
        return np.concatenate([a - [1.0, 0.0, 0.0], b])

    shifted = shifted_boundary_condition(ends, by)
    np.testing.assert_allclose(
        shifted(moved_state(by, first), moved_state(by, last)), ends(first, last), atol=1e-12
    )


def test_headings_of_quadratic_costs_are_compared_as_they_are():
    cost = QuadraticCost(
        state_weight=np.eye(3),
        control_weight=np.eye(2),
        state_reference=np.zeros(3),
        control_reference=np.zeros(2),
    )
    assert cost(np.array([0.0, 0.0, 2 * np.pi]), np.zeros(2)) == pytest.approx(4 * np.pi**2)


def test_weights_must_fit():
    with pytest.raises(ValueError, match=r"state_weight has shape \(2, 2\), need \(3, 3\)"):
        QuadraticCost(
            state_weight=np.eye(2),
            control_weight=np.eye(2),
            state_reference=np.zeros(3),
            control_reference=np.zeros(2),
        )
    with pytest.raises(ValueError, match=r"goal: got shape \(4,\), need 3 components last"):
        ControlProblem(start=np.zeros(3), goal=np.zeros(4))
