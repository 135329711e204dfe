"""What an ODE solver says of maneuvers: how far from where they claim to lead."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.models import Model, VectorField, rollout
from maneuver_automaton.optimal_control.vehicles import moving_frame
from maneuver_automaton.primitives.maneuver import Maneuver
from maneuver_automaton.primitives.trim import Trim

RTOL, ATOL = 1e-10, 1e-12


def maneuver_defect(
    model: Model, maneuver: Maneuver, *, source: Trim, target: Trim, rtol: float = RTOL
) -> float:
    """Greatest error of the end that a maneuver claims: of its pose and of its reduced state.

    Raises
    ------
    ValueError
        If the maneuver has no course, so that nobody knows how it is driven.
    """
    course = maneuver.course
    if course is None:
        raise ValueError(f"maneuver {maneuver.name!r}: has no course, so it cannot be driven again")
    state = np.concatenate([np.zeros(model.group.dof), source.reduced_state])
    rates = _rates(model)
    for begin, end, control in pieces(course.time, course.control):
        times = [begin, end]
        state = rollout(rates, state, control=control, times=times, rtol=rtol, atol=ATOL)[-1]
    claimed = np.concatenate([maneuver.displacement, target.reduced_state])
    return float(np.abs(state - claimed).max())


def _rates(model: Model) -> VectorField:
    """The whole vector field, component by component: quicker than on arrays."""
    rates = moving_frame(model.group, velocity=model.velocity, reduced=model.dynamics)
    return lambda state, control: np.array(rates(state.tolist(), control.tolist()))


def pieces(time: Array, control: Array) -> list[tuple[float, float, Array]]:
    """Stretches (begin, end, control) of one control each, of samples in time.

    Examples
    --------
    >>> time, control = np.array([0.0, 1.0, 2.0, 3.0]), np.array([[1.0], [1.0], [2.0], [2.0]])
    >>> [(begin, end, u.tolist()) for begin, end, u in pieces(time, control)]
    [(0.0, 2.0, [1.0]), (2.0, 3.0, [2.0])]
    """
    changes = 1 + np.flatnonzero((control[1:-1] != control[:-2]).any(axis=-1))
    firsts = [0, *changes.tolist()]
    lasts = [*changes.tolist(), time.size - 1]
    return [
        (float(time[a]), float(time[b]), control[a])
        for a, b in zip(firsts, lasts, strict=True)
        if time[b] > time[a]
    ]
