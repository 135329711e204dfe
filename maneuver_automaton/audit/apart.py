"""Distances between segments in the plane, many at once."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array

Points: TypeAlias = tuple[Array, Array]
"""x and y of many points: arrays of any shapes that broadcast."""

LEAST = 1e-300  # a squared length that is none


def point_apart(point: Points, a: Points, b: Points) -> Array:
    """Squared distances of points to segments.

    Examples
    --------
    >>> point_apart((0.5, 2.0), (0.0, 0.0), (1.0, 0.0)).item()
    4.0
    """
    along_x, along_y = b[0] - a[0], b[1] - a[1]
    to_x, to_y = point[0] - a[0], point[1] - a[1]
    length = np.maximum(along_x * along_x + along_y * along_y, LEAST)
    share = np.clip((to_x * along_x + to_y * along_y) / length, 0.0, 1.0)
    off_x, off_y = to_x - share * along_x, to_y - share * along_y
    return np.asarray(off_x * off_x + off_y * off_y)


def crossed(p: Points, q: Points, a: Points, b: Points) -> NDArray[np.bool_]:
    """Whether segments from p to q and from a to b cross.

    Examples
    --------
    >>> bool(crossed((0.0, 0.0), (2.0, 2.0), (0.0, 2.0), (2.0, 0.0)))
    True
    """
    first = _side(p, q, a) * _side(p, q, b)
    second = _side(a, b, p) * _side(a, b, q)
    return np.asarray((first < 0.0) & (second < 0.0))


def _side(a: Points, b: Points, point: Points) -> Array:
    return np.asarray((b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]))
