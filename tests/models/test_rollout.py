"""The simulation by an ODE solver."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.models import Unicycle, rollout


def test_a_plain_field_will_do():
    fall = rollout(lambda x, u: [x[1], u[0]], [0.0, 0.0], control=[-9.81], times=[0.0, 2.0])
    np.testing.assert_allclose(fall[-1], [-19.62, -19.62], atol=1e-8)


def test_control_may_change_with_time():
    end = rollout(Unicycle(), np.zeros(3), control=lambda t: [2.0 * t, 0.0], times=[0.0, 1.0, 3.0])
    np.testing.assert_allclose(end[:, 0], [0.0, 1.0, 9.0], atol=1e-8)


def test_start_time_need_not_be_zero():
    states = rollout(Unicycle(), [1.0, 0.0, 0.0], control=[1.0, 0.0], times=[5.0, 6.0])
    np.testing.assert_allclose(states, [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], atol=1e-9)


def test_one_time_is_the_start():
    states = rollout(Unicycle(), [1.0, 2.0, 3.0], control=[1.0, 0.0], times=[0.0])
    assert states.tolist() == [[1.0, 2.0, 3.0]]


def test_times_must_increase():
    with pytest.raises(ValueError, match="rollout: times must be increasing"):
        rollout(Unicycle(), np.zeros(3), control=[1.0, 0.0], times=[0.0, 1.0, 1.0])


def test_a_state_that_escapes_is_an_error():
    with pytest.raises(ValueError, match=r"rollout: the solver stopped at .* s of 2 s|finite"):
        rollout(lambda x, u: x**2, [1.0], control=[0.0], times=[0.0, 2.0])
