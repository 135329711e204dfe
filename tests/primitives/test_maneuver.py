"""Maneuvers: what they hold, and which of them change nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from maneuver_automaton.primitives import Maneuver


def maneuver(**changes):
    values = {"name": "brake", "source": "cruise", "target": "rest", "displacement": np.zeros(3)}
    return Maneuver(**(values | changes))


def test_the_displacement_is_a_read_only_copy():
    gained = np.array([2.0, 0.0, 0.0])
    brake = maneuver(displacement=gained)
    gained[0] = 5.0
    assert brake.displacement.tolist() == [2.0, 0.0, 0.0]
    with pytest.raises(ValueError, match="read-only"):
        brake.displacement[0] = 1.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"duration": -0.5}, "maneuver 'brake': duration must be at least 0, got -0.5 s"),
        ({"duration": math.nan}, "maneuver 'brake': duration must be at least 0, got nan s"),
        ({"displacement": [1.0]}, "displacement: got shape (1,), need 2 or 3 or 4 components last"),
        ({"displacement": [0, 0, math.inf]}, "displacement: got inf, need finite numbers"),
    ],
)
def test_what_is_wrong_is_said(changes, message):
    with pytest.raises(ValueError) as error:
        maneuver(**changes)
    assert str(error.value) == message
