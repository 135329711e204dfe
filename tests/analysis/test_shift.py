"""What is tied to a place moves along: the controls that solved a problem solve the moved one."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.groups import SE2
from maneuver_automaton.models import moved_state
from tests.reference_dynamics import flow

POSES = arrays(np.float64, 3, elements=st.floats(-5.0, 5.0))
CONTROLS = arrays(np.float64, 2, elements=st.floats(-2.0, 2.0))


def test_example_of_the_paper():
    duration, start, goal, by = 2.0, np.array([-1.0, 0.0, 0.0]), np.zeros(3), SE2([1.0, 1.0, 0.0])
    ahead, moved = [1 / duration, 0.0], moved_state(by, start)
    assert flow(start, ahead, duration=duration).tolist() == goal.tolist()
    assert flow(moved, ahead, duration=duration).tolist() == moved_state(by, goal).tolist()
    assert flow(moved, ahead, duration=duration).tolist() != goal.tolist()


@given(move=POSES, start=POSES, control=CONTROLS)
def test_the_same_controls_solve_the_moved_problem_at_the_same_cost(move, start, control):
    by, times = SE2(move), np.linspace(0.0, 3.0, 7)
    here = flow(start, control, duration=times)
    there = flow(moved_state(by, start), control, duration=times)
    for x, moved in zip(here, there, strict=True):
        back = moved_state(by.inverse(), moved)  # as costs and constraints see it
        np.testing.assert_allclose(back, x, rtol=0.0, atol=1e-10)
