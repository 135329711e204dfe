"""When two motions are the same motion primitive."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.analysis import same_motion_primitive
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import moved_state
from tests.compare import assert_same_motion
from tests.reference_dynamics import flow

TIMES = np.linspace(0.0, 3.0, 13)
POSES = arrays(np.float64, 3, elements=st.floats(-10.0, 10.0))


@given(move=POSES, start=POSES)
def test_a_moved_motion_is_the_same_primitive_and_the_move_is_found(move, start):
    b = flow(start, [1.0, 0.7], duration=TIMES)
    a = moved_state(SE2(move), b)
    same = same_motion_primitive(a, b, times=TIMES, group=SE2)
    assert same.equivalent
    assert_same_motion(same.group_element, SE2(move), atol=1e-12)


@given(one=POSES, other=POSES)
def test_the_same_controls_give_the_same_primitive_everywhere(one, other):
    a, b = (flow(start, [1.0, -0.5], duration=TIMES) for start in (one, other))
    assert same_motion_primitive(a, b, times=TIMES, group=SE2).equivalent


def test_a_tighter_circle_is_another_primitive():
    a = flow(np.zeros(3), [1.0, 0.5], duration=TIMES)
    b = flow(np.zeros(3), [1.0, 0.6], duration=TIMES)
    other = same_motion_primitive(a, b, times=TIMES, group=SE2)
    assert not other.equivalent
    assert other.worst_time == 3.0
    assert other.component in SE2.coordinates
    assert other.worst_deviation > 0.29


def test_reduced_states_have_to_agree():
    a = np.column_stack([flow(np.zeros(3), [1.0, 0.5], duration=TIMES), np.full(13, 1.0)])
    b = a.copy()
    b[:, 3] = 1.25
    other = same_motion_primitive(a, b, times=TIMES, group=SE2)
    assert (other.equivalent, other.component, other.worst_deviation) == (False, "z1", 0.25)
    assert same_motion_primitive(a, a, times=TIMES, group=SE2).equivalent


def test_adding_a_shift_to_the_states_makes_another_motion():
    a = flow(np.zeros(3), [1.0, 0.5], duration=TIMES)
    added = np.add(a, [3.0, 2.5, 1.2])
    assert not same_motion_primitive(added, a, times=TIMES, group=SE2).equivalent


def test_shapes_are_named():
    with pytest.raises(ValueError, match=r"got shapes \(13, 3\), \(12, 3\) and \(13,\)"):
        same_motion_primitive(np.zeros((13, 3)), np.zeros((12, 3)), times=TIMES, group=SE2)
    with pytest.raises(ValueError, match="got no samples, need at least 1"):
        same_motion_primitive(np.zeros((0, 3)), np.zeros((0, 3)), times=[], group=SE2)
