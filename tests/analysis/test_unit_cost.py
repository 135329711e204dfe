"""What coasting costs per second."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.analysis import unit_cost
from maneuver_automaton.errors import BrokenSymmetry, NotATrim
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle, UserModel, rollout

ROVER = UserModel(
    name="rover",
    group=SE2,
    control_names=("push", "turn"),
    reduced_names=("speed",),
    velocity=lambda z, u: [z[0], 0.0, u[1]],
    dynamics=lambda z, u: [u[0] - 0.5 * z[0]],
)


def test_coasting_for_T_seconds_costs_T_times_the_unit_cost():
    def cost(x, u):
        return 2.0 * u @ u + 1.0

    u, duration = np.array([1.5, -0.4]), 7.0
    rate = unit_cost(cost, Unicycle(), state=[1.0, 2.0, 0.3], control=u)
    times = np.linspace(0.0, duration, 201)
    states = rollout(Unicycle(), [1.0, 2.0, 0.3], control=u, times=times)
    integral = np.trapezoid([cost(x, u) for x in states], times)
    assert integral == pytest.approx(duration * rate, rel=1e-12)


def test_it_is_the_same_wherever_the_trim_starts():
    def cost(x, u):
        return x[3] ** 2 + u @ u

    rng = np.random.default_rng(6)
    starts = np.column_stack([rng.normal(size=(5, 3)), np.full(5, 2.0)])
    rates = {unit_cost(cost, ROVER, state=start, control=[1.0, 0.2]) for start in starts}
    assert rates == {4.0 + 1.04}


def test_a_cost_of_the_place_has_no_unit_cost():
    with pytest.raises(
        BrokenSymmetry,
        match=r"not constant along the trim u = \(1, 0\) of the unicycle: 0 at the start, "
        r"100 after 10 s at pose \(10, 0, 0\)",
    ):
        unit_cost(lambda x, u: x[0] ** 2, Unicycle(), state=np.zeros(3), control=[1.0, 0.0])


def test_accelerating_is_no_trim():
    with pytest.raises(
        NotATrim, match=r"rover: no trim at u = \(1, 0\): speed changes by 1 per second, need 0"
    ):
        unit_cost(lambda x, u: 1.0, ROVER, state=np.zeros(4), control=[1.0, 0.0])


def test_shapes_are_checked():
    with pytest.raises(ValueError, match=r"state: got shape \(3,\), need 4 components last"):
        unit_cost(lambda x, u: 1.0, ROVER, state=np.zeros(3), control=[1.0, 0.0])
