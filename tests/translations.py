"""Vehicles that translations alone move: a stage, and a boat in a current."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.groups import translations
from maneuver_automaton.models import UserModel


def stage() -> UserModel:
    """A table that moves along x and y, and never turns."""
    return UserModel(
        name="stage",
        group=translations(2),
        control_names=("v_x", "v_y"),
        velocity=lambda z, u: [u[0], u[1]],
    )


def boat(*, current: float = 0.3, turn_rate: float = 0.8, name: str = "boat") -> UserModel:
    """A boat in a current [m/s] along x, which breaks the symmetry of rotations."""
    return UserModel(
        name=name,
        group=translations(2),
        control_names=("speed", "turn_rate"),
        reduced_names=("heading",),
        velocity=lambda z, u: [u[0] * np.cos(z[0]) + current, u[0] * np.sin(z[0])],
        dynamics=lambda z, u: [u[1]],
        control_limits=np.array([[0.0, 1.0], [-turn_rate, turn_rate]]),
    )
