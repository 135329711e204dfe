"""Poses along a chain of motions, on plain numbers and on arrays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.groups import group_of
from maneuver_automaton.groups.se2 import chained, coasted, end_of_coasting, seen_from

RATES = st.sampled_from([0.0, 1.0]) | st.floats(-3.0, 3.0) | st.floats(-1e-7, 1e-7)


def poses(dof):
    return arrays(np.float64, dof, elements=st.floats(-1e4, 1e4))


@pytest.mark.parametrize("dof", [3, 4])
@given(data=st.data())
def test_coasting_on_plain_numbers_is_the_group_s_exponential_to_the_last_bit(dof, data):
    start = data.draw(poses(dof))
    n = data.draw(st.integers(0, 5))
    twists = data.draw(arrays(np.float64, (n, dof), elements=RATES))
    durations = data.draw(arrays(np.float64, n, elements=st.just(0.0) | st.floats(0.0, 20.0)))
    group = group_of(dof)
    steps = group.exp(durations[:, None] * twists).pose
    poses_along = chained(start, steps)
    assert coasted(start, twists, durations).tolist() == poses_along.tolist()
    assert end_of_coasting(start, twists, durations.tolist()).tolist() == poses_along[-1].tolist()
    for twist, duration in zip(twists, durations.tolist(), strict=True):
        once = (group(start) @ group.exp(duration * twist)).pose
        assert end_of_coasting(start, [twist], [duration]).tolist() == once.tolist()


@pytest.mark.parametrize("dof", [3, 4])
@given(data=st.data())
def test_a_pose_is_seen_from_another_as_the_group_has_it(dof, data):
    start, pose = data.draw(poses(dof)), data.draw(poses(dof))
    group = group_of(dof)
    expected = (group(start).inverse() @ group(pose)).pose
    size = 1.0 + np.abs(start).max() + np.abs(pose).max()
    np.testing.assert_allclose(seen_from(start, pose), expected, rtol=0.0, atol=1e-13 * size)
