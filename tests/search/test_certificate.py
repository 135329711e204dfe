"""The certificate of words with maneuvers, against prices by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search.certificate import certificate
from maneuver_automaton.search.result import TimedWord
from maneuver_automaton.search.word_setup import word_setup
from tests.inertia import unicycle_automaton
from tests.search.cases import compiled_only

pytestmark = compiled_only  # the kernels have tests of their own


def test_time_that_may_be_left_over_has_a_price():
    """Fast, then slow, for all the time there is: each second less of it saves what it costs.

    Maneuvers move the unicycle on by 1 m, and the trims by 4 m and by 1 m.
    """
    automaton = unicycle_automaton(((0.0, 0.0), (1.0, 0.0), (0.5, 0.0)))
    free = Problem(automaton, [0.0, 0.0, 0.0], [6.0, 0.0, 0.0])
    setup = word_setup(free, free.goals[0], most_trims=9)
    word = setup.word(TimedWord((1, 2), np.array([4.0, 2.0])))
    assert setup.plan((1, 2), np.array([4.0, 2.0])).end[0] == pytest.approx(6.0)
    bound = replace(free, horizon=Horizon(max_time=word.duration))
    assert certificate(bound, bound.goals[0], word) == pytest.approx(-1.0)
