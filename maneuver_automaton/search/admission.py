"""Which motions of an automaton a zone admits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton.collision import Zone
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trim


def piece_is_admitted(zone: Zone, trim: Trim) -> bool:
    """Whether a zone admits a trim."""
    return zone.admits_names([trim.name]) and bool(zone.admits(trim.body_velocity))


def admitted_stretches(zone: Zone, maneuver: Maneuver, model: Model) -> NDArray[np.bool_]:
    """Which stretches (n - 1,) of a maneuver a zone admits, by their begin, middle and end."""
    course = maneuver.course
    assert course is not None
    if not zone.admits_names([maneuver.source, maneuver.target]):
        return np.zeros(course.time.size - 1, dtype=np.bool_)
    return np.asarray(zone.admits(course.twists(model)).all(axis=0))
