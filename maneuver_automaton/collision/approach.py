"""The least distance over many poses: measured where it may be, and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2


def least_over_poses(
    distance: Callable[[Sequence[float], Sequence[float]], float],
    poses: Array,
    others: Array,
    *,
    moved: Array,
    least: float,
) -> float:
    """Least of `least` and the distances [m] of two bodies at poses (n, 3) each.

    `moved` (n,) is how far their points may have come closer since the poses before [m]; where the
    last distance less that is no smaller than the least, none is measured.
    """
    bound = -math.inf
    for here, there, closer in zip(poses.tolist(), others.tolist(), moved.tolist(), strict=True):
        bound -= closer
        if bound < least:
            bound = distance(here, there)
            least = min(least, bound)
    return least


def travel(poses: Array, middle: Array, reach: float) -> Array:
    """How far (n,) any point of a disc can have moved since the pose (n, 3) before [m].

    Examples
    --------
    >>> travel(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, np.pi]]), np.zeros(2), 2.0).tolist()
    [0.0, 5.0]
    """
    places = SE2(poses).act(middle)
    steps = np.hypot(*np.diff(places, axis=0).T)
    turns = 2.0 * reach * np.abs(np.sin(0.5 * np.diff(poses[:, 2])))
    return np.concatenate([[0.0], steps + turns])
