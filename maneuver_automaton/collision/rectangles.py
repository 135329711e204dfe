"""Blocked cells of an occupancy map as few rectangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import IntArray


def blocked_rectangles(blocked: NDArray[np.bool_]) -> IntArray:
    """Rectangles (n, 4) of cells [low column, low row, high column, high row), none twice.

    Runs of blocked cells, joined with the run below where that has the same ends.

    Examples
    --------
    >>> blocked_rectangles(np.array([[1, 1, 0], [1, 1, 1]], dtype=bool)).tolist()
    [[0, 0, 2, 1], [0, 1, 3, 2]]
    """
    rows, columns = blocked.shape
    padded = np.zeros((rows, columns + 2), dtype=np.int8)
    padded[:, 1:-1] = blocked
    edge = np.diff(padded, axis=1)
    row, first = np.nonzero(edge == 1)
    _, last = np.nonzero(edge == -1)
    if not row.size:
        return np.zeros((0, 4), dtype=np.int64)
    order = np.lexsort((row, last, first))
    row, first, last = row[order], first[order], last[order]
    joined = (np.diff(first) == 0) & (np.diff(last) == 0) & (np.diff(row) == 1)
    begins = np.flatnonzero(np.append(True, ~joined))
    ends = np.append(begins[1:], row.size) - 1
    boxes = np.stack([first[begins], row[begins], last[begins], row[ends] + 1], axis=1)
    return boxes[np.lexsort((boxes[:, 0], boxes[:, 1]))].astype(np.int64)
