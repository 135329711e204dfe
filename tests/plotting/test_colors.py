from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.plotting.colors import trim_colors, twist_color
from tests.plotting.cases import plan_of_trims

speeds = st.floats(-30.0, 30.0) | st.just(0.0)


@given(st.tuples(speeds, speeds, speeds))
def test_every_twist_has_a_colour(twist):
    color = twist_color(np.array(twist))
    assert len(color) == 3
    assert all(0.0 <= channel <= 1.0 for channel in color)


@pytest.mark.parametrize("count", [2, 12, 40, 200])
def test_alike_trims_are_told_apart(count):
    twists = {trim.name: trim.body_velocity for trim in plan_of_trims(count).trims}
    colors = np.array(list(trim_colors(twists).values()))
    assert len(np.unique(colors, axis=0)) == count
    if count <= 12:
        gaps = np.linalg.norm(colors[:, None] - colors, axis=-1)[np.triu_indices(count, 1)]
        assert gaps.min() > 0.1


def test_the_eight_directions_differ_for_colour_blind_readers():
    """Simulated deuteranopia and protanopia, after Viénot, Brettel, Mollon (1999)."""
    directions = [(v, 0.0, w) for v in (-1.0, 0.0, 1.0) for w in (-1.0, 0.0, 1.0) if v or w]
    colors = np.array([twist_color(np.array(twist)) for twist in directions]) ** 2.2
    for matrix in (
        [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]],
        [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]],
    ):
        seen = np.clip(colors @ np.array(matrix).T, 0.0, 1.0) ** (1 / 2.2)
        gaps = np.linalg.norm(seen[:, None] - seen, axis=-1)[np.triu_indices(8, 1)]
        assert gaps.min() > 0.07
