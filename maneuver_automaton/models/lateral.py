"""The lateral acceleration that a vehicle may have: its speed times its turn rate."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.models.model import Model

EXCEEDED = 1e-9  # relative, by which a limit may be exceeded


def lateral_limit(model: Model) -> float:
    """Greatest lateral acceleration of a vehicle [m/s^2]; infinite where it has no limit.

    Examples
    --------
    >>> from maneuver_automaton.models import Car
    >>> lateral_limit(Car(wheelbase=2.5, max_lateral_acceleration=3.0))
    3.0
    """
    most = getattr(model, "max_lateral_acceleration", None)
    return math.inf if most is None else float(most)


def lateral_acceleration(twists: Array) -> Array:
    """Speed times turn rate (...,) [m/s^2] of body velocities (..., dof)."""
    return np.asarray(np.linalg.norm(twists[..., :2], axis=-1) * np.abs(twists[..., 2]))


def is_too_sharp(model: Model, twists: Array) -> NDArray[np.bool_]:
    """Whether body velocities (..., dof) exceed the lateral acceleration of a vehicle (...,)."""
    most = lateral_limit(model)
    if math.isinf(most):  # its twists may have no turn rate at all
        return np.zeros(twists.shape[:-1], dtype=np.bool_)
    return np.asarray(lateral_acceleration(twists) > most * (1.0 + EXCEEDED))


def pace_within(model: Model, twist: Array) -> float:
    """By how much a body velocity (dof,) may be driven faster within the lateral limit.

    Examples
    --------
    >>> from maneuver_automaton.models import Car
    >>> car = Car(wheelbase=2.5, max_lateral_acceleration=4.0)
    >>> pace_within(car, np.array([2.0, 0.0, -0.5]))
    2.0
    """
    most = lateral_limit(model)
    across = 0.0 if math.isinf(most) else float(lateral_acceleration(twist))
    return math.sqrt(most / across) if across > 0.0 else math.inf
