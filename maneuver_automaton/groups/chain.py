"""Poses along a chain of motions."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups.se2 import _turned


def chained(start: Array, steps: Array) -> Array:
    """Poses (n + 1, dof) from `start` (dof,) on, each one of `steps` (n, dof) after the last.

    The products ``start @ steps[0] @ ... @ steps[k - 1]``, all at once.

    Examples
    --------
    >>> forward_then_left = np.array([[1.0, 0.0, np.pi / 2], [1.0, 0.0, 0.0]])
    >>> chained(np.zeros(3), forward_then_left)[-1].round(3).tolist()
    [1.0, 1.0, 1.571]
    """
    poses = np.empty((len(steps) + 1, start.size))
    poses[0] = start
    poses[1:] = steps
    np.cumsum(poses[:, 2:], axis=0, out=poses[:, 2:])
    poses[1:, :2] = _turned(poses[:-1, 2], steps[:, :2])
    np.cumsum(poses[:, :2], axis=0, out=poses[:, :2])
    return poses
