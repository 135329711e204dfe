"""Dynamics of a vehicle on symbols: the pose rides in the frame of the body."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from maneuver_automaton.groups import SE2, LieGroup, SE2xR
from maneuver_automaton.optimal_control.problem import Components, Rates


def moving_frame(
    group: type[LieGroup],
    *,
    velocity: Callable[[Components, Components], Any],
    reduced: Callable[[Components, Components], Any] | None = None,
) -> Rates:
    """Rates of the state (pose, reduced state) of a vehicle: ``g' = g xi(z, u), z' = f(z, u)``.

    The models of the package work on arrays; the solver needs the same formulas on symbols, and
    the tests compare the two. For a `UserModel` they are its `velocity` and `dynamics`.

    Source: Frazzoli, Dahleh, Feron (2005), Sec. II; the paper, Example 1.

    Parameters
    ----------
    group : type[LieGroup]
        SE(2) or SE(2) x R.
    velocity : callable
        ``xi(z, u)``: the twist (dof) in the body frame, component by component.
    reduced : callable, optional
        ``f(z, u)``: rates of the reduced state; none for a kinematic vehicle.

    Raises
    ------
    ValueError
        If the group is another one.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> f = moving_frame(SE2, velocity=lambda z, u: [u[0], 0.0, u[1]])
    >>> [float(rate) for rate in f([3.0, 1.0, 0.0], [2.0, 0.5])]
    [2.0, 0.0, 0.5]
    """
    if group.coordinates not in (SE2.coordinates, SE2xR.coordinates):
        raise ValueError(
            f"moving_frame: got the group {group.__name__} with poses "
            f"({', '.join(group.coordinates)}), need SE2 or SE2xR"
        )
    dof = group.dof

    def rates(state: Components, control: Components) -> list[Any]:
        ahead, aside, *others = velocity(state[dof:], control)
        cosine, sine = np.cos(state[2]), np.sin(state[2])
        drift = [] if reduced is None else reduced(state[dof:], control)
        return [cosine * ahead - sine * aside, sine * ahead + cosine * aside, *others, *drift]

    return rates
