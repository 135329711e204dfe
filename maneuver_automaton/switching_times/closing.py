"""Close the last digits: the smallest change of coasting times that ends a word at its goal."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import group_of
from maneuver_automaton.groups.chain import chained

STEPS = 4
RANK = 1e-9  # singular values below this, relative, count as none


def closed_at(
    start: Array, twists: Array, durations: Array, goal: Array, *, free_heading: bool = False
) -> Array:
    """Durations (n,) near `durations` with which the word from `start` (3,) ends at `goal` (3,).

    Gauss-Newton with the smallest change; as good as it gets where the word cannot meet the goal.
    Times stay at least zero.

    Examples
    --------
    >>> ahead, left = [1.0, 0.0, 0.0], [1.0, 0.0, 1.0]
    >>> twists = np.array([ahead, left, ahead])
    >>> goal = np.array([2.0, 2.0, np.pi / 2])
    >>> closed_at(np.zeros(3), twists, np.array([1.0, 1.57, 1.0]), goal).round(6).tolist()
    [1.0, 1.570796, 1.0]
    """
    best, least = durations, math.inf
    now = np.array(durations)
    places = np.array(start)
    places[:2] -= goal[:2]  # seen from the goal's place no digit is lost
    for _ in range(STEPS):
        steps = group_of(3).exp(now[:, None] * twists).pose if len(now) else np.zeros((0, 3))
        poses = chained(places, steps)
        turn = 0.0 if free_heading else math.remainder(float(goal[2] - poses[-1, 2]), 2 * math.pi)
        gap = np.array([-poses[-1, 0], -poses[-1, 1], turn])
        size = float(np.abs(gap).max())
        if size < least:
            best, least = now, size
        if size < 1e-15 or not len(now):
            break
        after = poses[1:]
        c, s = np.cos(after[:, 2]), np.sin(after[:, 2])
        arm = poses[-1, :2] - after[:, :2]
        columns = np.stack(
            [
                c * twists[:, 0] - s * twists[:, 1] - twists[:, 2] * arm[:, 1],
                s * twists[:, 0] + c * twists[:, 1] + twists[:, 2] * arm[:, 0],
                0.0 * twists[:, 2] if free_heading else twists[:, 2],
            ]
        )
        now = np.maximum(now + np.linalg.lstsq(columns, gap, rcond=RANK)[0], 0.0)
    return np.asarray(best)
