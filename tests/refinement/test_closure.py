"""Closing the end of a motion: exact, or a reason why it could not be done."""

from __future__ import annotations

import itertools

import numpy as np

from maneuver_automaton.budget import Budget
from maneuver_automaton.models import SecondOrderUnicycle
from maneuver_automaton.refinement.closure import closed

ROBOT = SecondOrderUnicycle(
    max_speed=1.0, max_turn_rate=1.0, max_acceleration=1.0, max_angular_acceleration=1.0
)


def test_an_end_that_is_nearly_met_is_met_exactly():
    control = np.array([[0.9, 0.0], [-0.9, 0.0]])
    ending = closed(
        ROBOT,
        np.zeros(2),
        (0.801, 0.0, 0.0, 0.0, 0.0),
        control=control,
        durations=np.array([0.94, 0.94]),
    )
    assert not isinstance(ending, str)
    assert ending.error < 1e-12


def test_an_end_to_which_only_a_negative_pace_leads_is_no_traceback():
    """At a limit no control can change, so that the pace alone is left: it would be negative."""
    ending = closed(
        ROBOT,
        np.array([1.0, 0.0]),
        (-1.0, None, None, None, None),
        control=np.array([[1.0, 0.0]]),
        durations=np.array([0.5]),
    )
    assert isinstance(ending, str)
    assert "could not be closed" in ending


def test_no_step_is_begun_that_takes_longer_than_there_is_time():
    """The clock shows 0.1 s more at every look: a step would take three times the first drive."""
    for seconds, is_closed in ((0.35, False), (100.0, True)):
        clock = itertools.count(0)
        budget = Budget(began=0.0, deadline=seconds, clock=lambda now=clock: 0.1 * next(now))
        ending = closed(
            ROBOT,
            np.zeros(2),
            (0.801, 0.0, 0.0, 0.0, 0.0),
            control=np.array([[0.9, 0.0], [-0.9, 0.0]]),
            durations=np.array([0.94, 0.94]),
            budget=budget,
        )
        assert (not isinstance(ending, str)) == is_closed
