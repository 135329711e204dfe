"""Plans that are one motion, whenever they begin."""

from __future__ import annotations

import pytest

from maneuver_automaton.automaton import Plan, same_motion
from maneuver_automaton.primitives import Trim

AHEAD = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
LEFT = Trim(name="left", body_velocity=[1.0, 0.0, 1.0], control=[1.0, 1.0])


@pytest.mark.parametrize("start_time", [0.0, 10.0])
def test_when_a_plan_begins_makes_no_difference(start_time):
    straight, bent, late = (
        Plan([0, 0, 0], trims, durations=durations, start_time=start_time)
        for trims, durations in (
            ((AHEAD,), [2.0]),
            ((AHEAD, LEFT), [1.0, 1.0]),
            ((AHEAD, LEFT), [1.95, 0.05]),  # halfway it is still the straight one
        )
    )
    assert same_motion(straight, Plan([0, 0, 0], (AHEAD,), durations=[2.0]))
    assert not same_motion(straight, bent)
    assert not same_motion(straight, late)
