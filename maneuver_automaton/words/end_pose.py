"""End of a word of trims, and how it moves when a trim lasts longer."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.groups import LieGroup, group_of


def end_pose(twists: ArrayLike, durations: ArrayLike) -> Array:
    """Pose (dof,) reached from the identity by coasting each trim in turn.

    Examples
    --------
    >>> end_pose([[1, 0, 0], [0, 0, 1]], [2.0, 0.5]).tolist()
    [2.0, 0.0, 0.5]
    """
    rows, times = _checked(twists, durations)
    group = group_of(rows.shape[1])
    pose: LieGroup = group.identity()
    for twist, time in zip(rows, times, strict=True):
        pose = pose @ group.exp(time * twist)
    return pose.pose


def end_twists(twists: ArrayLike, durations: ArrayLike) -> Array:
    """How the end moves, as twists (n, dof) in the end frame, per second each trim lasts longer.

    With ``end = before @ exp(duration xi) @ after`` the derivative is ``Ad(after^-1) xi``.
    Source: product rule; Ad from Solà, Deray, Atchuthan (2018), Eq. (159).

    Examples
    --------
    >>> end_twists([[2.0, 0.0, 0.0]], [1.0]).tolist()
    [[2.0, 0.0, 0.0]]
    """
    rows, times = _checked(twists, durations)
    group = group_of(rows.shape[1])
    after: LieGroup = group.identity()
    columns = np.empty_like(rows)
    for i in range(len(rows) - 1, -1, -1):
        columns[i] = after.inverse().adjoint() @ rows[i]
        after = group.exp(times[i] * rows[i]) @ after
    return columns


def _checked(twists: ArrayLike, durations: ArrayLike) -> tuple[Array, Array]:
    rows = as_array("twists", twists, last=(3, 4))
    times = as_array("durations", durations)
    if rows.ndim != 2 or times.shape != rows.shape[:1]:
        raise ValueError(
            f"durations: got shape {times.shape} for twists of shape {rows.shape}, need one each"
        )
    return rows, times
