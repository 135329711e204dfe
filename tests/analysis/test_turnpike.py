"""The turnpike of a second-order vehicle: away from the trim for a time that does not grow."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from maneuver_automaton.analysis import turnpike
from maneuver_automaton.models import SecondOrderUnicycle
from maneuver_automaton.optimal_control import SolveStatus
from maneuver_automaton.primitives import trims_of
from maneuver_automaton.primitives.closed_form import bang_bang

ROBOT = SecondOrderUnicycle(
    max_speed=2.0, max_turn_rate=2.0, max_acceleration=1.0, max_angular_acceleration=1.0
)
REST, AHEAD = trims_of(ROBOT, {"speed": [0.0, 1.0], "turn_rate": [0.0]}).trims
UP, DOWN = bang_bang(ROBOT, REST, AHEAD), bang_bang(ROBOT, AHEAD, REST)


def effort(z, u):
    """What it takes to move, and to change that."""
    return z[0] ** 2 + z[1] ** 2 + u[0] ** 2 + u[1] ** 2


def study_of(coasts, **changes):
    word = {"source": REST, "up": UP, "trim": AHEAD, "down": DOWN, "target": REST}
    return turnpike(ROBOT, **{**word, "stage_cost": effort, "coasts": coasts, **changes})


@pytest.fixture(scope="module")
def study():
    return study_of([12.0, 24.0, 48.0])


@pytest.mark.slow
def test_the_time_away_does_not_grow(study):
    away = [case.away for case in study.cases]
    assert all(case.optimum.status is SolveStatus.SOLVED for case in study.cases)
    limit = 2.0 * np.log(1.0 / study.distance)  # speed 1 - e^-t at either end
    assert max(away) <= limit + 0.2
    assert away[2] < 0.1 * study.cases[2].duration


def test_the_optimum_is_that_of_the_euler_lagrange_equation(study):
    """Ahead only: least integral of v^2 + v'^2 over a given way, so v'' = v - c."""
    for case in study.cases:
        duration, way = case.duration, case.goal[0]
        level = way / (duration - 2.0 * np.tanh(duration / 2.0))
        speed = level * (1.0 - np.cosh(case.optimum.time - duration / 2) / np.cosh(duration / 2))
        assert case.optimum.state[:, 3] == pytest.approx(speed, abs=5e-3)
        assert case.optimum.cost == pytest.approx(level * way, rel=1e-3)


def test_what_the_automaton_pays_more_does_not_grow(study):
    assert study.unit_cost == 1.0
    gaps = [case.gap for case in study.cases]
    for case in study.cases:
        # speeding up: 1 s at 1 m/s^2, costs 1 + 1/3, and so does braking
        assert case.automaton_cost == pytest.approx(case.coast + 8.0 / 3.0, abs=1e-9)
    assert 0.0 < gaps[0] < gaps[1] < gaps[2] < 2.0 / 3.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"coasts": [1.0, 0.0]}, "turnpike: coasts must be positive times, got [1.0, 0.0] s"),
        (
            {"up": dataclasses.replace(UP, course=None)},
            "turnpike: maneuver 'speed 0, turn_rate 0 to speed 1, turn_rate 0' has no course",
        ),
    ],
)
def test_what_is_wrong_is_said(changes, message):
    with pytest.raises(ValueError) as error:
        study_of(**{"coasts": [1.0], **changes})
    assert str(error.value) == message
