"""The unicycle by hand, and the closed forms of the paper against an ODE solver."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import expm

from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle, rollout
from tests.reference_dynamics import flow, spatial_twist, symmetry_action

STATES = arrays(np.float64, 3, elements=st.floats(-3.0, 3.0))
CONTROLS = arrays(np.float64, 2, elements=st.floats(-2.0, 2.0) | st.floats(-1e-9, 1e-9))


def printed_translation(xi, t):
    """The translation of Prop. 6 as its statement prints it, for u2 != 0 and u2 == 0."""
    v1, v2, u2 = xi
    if u2 == 0.0:
        return np.array([v1 * t, v2 * t, 0.0])
    sin, cos = np.sin(u2 * t), np.cos(u2 * t)
    return np.array([(v1 * sin - v2 * (1 - cos)) / u2, (v1 * (1 - cos) + v2 * sin) / u2, u2 * t])


@given(state=STATES, control=CONTROLS)
def test_spatial_twist_is_the_adjoint_of_the_body_twist(state, control):
    body = Unicycle().body_velocity(np.zeros(0), control)
    np.testing.assert_allclose(
        spatial_twist(state, control), SE2(state).adjoint() @ body, rtol=0.0, atol=1e-14
    )


@settings(max_examples=30)
@given(state=STATES, control=CONTROLS)
def test_flow_agrees_with_an_ode_solver(state, control):
    times = np.array([0.0, 0.5, 4.0])
    solved = rollout(Unicycle(), state, control=control, times=times, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(flow(state, control, duration=times), solved, rtol=0.0, atol=1e-9)


@given(state=STATES, control=arrays(np.float64, 2, elements=st.floats(0.1, 2.0)))
def test_flow_is_the_printed_statement(state, control):
    t, xi = 1.7, spatial_twist(state, control)
    turned = symmetry_action([0.0, 0.0, control[1] * t], state)
    turned[2] = state[2]
    expected = turned + printed_translation(xi, t)
    np.testing.assert_allclose(flow(state, control, duration=t), expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("control", [(1.5, 0.7), (1.5, 0.0)])
def test_flow_is_the_matrix_exponential_of_the_paper(control):
    state, t = np.array([1.0, -2.0, 0.4]), 2.3
    v1, v2, u2 = spatial_twist(state, control)
    xi = np.array([[0.0, -u2, 0.0, v1], [u2, 0.0, 0.0, v2], [0.0, 0.0, 0.0, u2], [0.0] * 4])
    moved = expm(t * xi) @ [*state, 1.0]
    np.testing.assert_allclose(flow(state, control, duration=t), moved[:3], atol=1e-13)


@given(shift=STATES, state=STATES)
def test_symmetry_action_is_composition(shift, state):
    np.testing.assert_allclose(
        symmetry_action(shift, state), (SE2(shift) @ SE2(state)).pose, rtol=0.0, atol=1e-14
    )


def test_limits():
    limited = Unicycle(max_speed=2.0, max_turn_rate=1.0)
    assert limited.control_limits.tolist() == [[-2.0, 2.0], [-1.0, 1.0]]
    assert np.isinf(Unicycle().control_limits).all()
    with pytest.raises(ValueError, match=r"unicycle: max_speed must be positive, got 0\.0"):
        Unicycle(max_speed=0.0)
    with pytest.raises(ValueError, match="unicycle: max_turn_rate must be positive, got nan"):
        Unicycle(max_turn_rate=float("nan"))
