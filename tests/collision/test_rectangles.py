"""Rectangles of a map cover its blocked cells, each once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.collision.outline import blocked_rectangles


@given(cells=arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12))))
def test_every_blocked_cell_is_covered_once(cells):
    covered = np.zeros(cells.shape, dtype=int)
    boxes = blocked_rectangles(cells)
    for left, low, right, high in boxes:
        assert left < right
        assert low < high
        covered[low:high, left:right] += 1
    assert np.array_equal(covered, cells.astype(int))


@pytest.mark.parametrize(
    ("cells", "boxes"),
    [
        ([[0]], []),
        ([[1]], [[0, 0, 1, 1]]),
        ([[1, 1], [1, 1]], [[0, 0, 2, 2]]),
        ([[1, 0, 1]], [[0, 0, 1, 1], [2, 0, 3, 1]]),
        ([[1, 0], [0, 1]], [[0, 0, 1, 1], [1, 1, 2, 2]]),
        ([[0, 1, 0], [1, 1, 1], [0, 1, 0]], [[1, 0, 2, 1], [0, 1, 3, 2], [1, 2, 2, 3]]),
    ],
)
def test_by_hand(cells, boxes):
    assert blocked_rectangles(np.array(cells, dtype=bool)).tolist() == boxes


def test_a_wall_is_one_rectangle():
    cells = np.zeros((200, 300), dtype=bool)
    cells[:, 7:9] = True
    assert blocked_rectangles(cells).tolist() == [[7, 0, 9, 200]]
