"""Close the last digits: the smallest change of coasting times that ends a word at its goal."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import group_of
from maneuver_automaton.groups.chain import chained

STEPS = 6
RANK = 1e-9  # singular values below this, relative, count as none
MET = 1e-9  # [m, rad, s] below this a condition is met, and no step that misses more is followed
EXACT = 1e-15  # nothing is left to be closed


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class EndConditions:
    """What the times of a word of n trims must meet: its end, and `rows` @ times = `targets`."""

    start: Array  # (dof,)
    twists: Array  # (n, dof)
    goal: Array  # (dof,)
    free_heading: bool = False
    rows: Array | None = None  # (m, n)
    targets: Array = field(default_factory=lambda: np.zeros(0))  # (m,)

    def missing(self, times: Array) -> tuple[Array, Array]:
        """What is missing of each condition (dof + m,), and how it follows the times (.., n)."""
        twists, places = self.twists, np.array(self.start)
        plane = [0, 1, *range(3, places.size)]  # places, not the heading
        places[plane] -= self.goal[plane]  # seen from the goal's place no digit is lost
        poses = chained(places, group_of(places.size).exp(times[:, None] * twists).pose)
        after, end = poses[1:], poses[-1]
        c, s = np.cos(after[:, 2]), np.sin(after[:, 2])
        arm = end[:2] - after[:, :2]
        columns = np.array(twists.T)
        columns[0] = c * twists[:, 0] - s * twists[:, 1] - twists[:, 2] * arm[:, 1]
        columns[1] = s * twists[:, 0] + c * twists[:, 1] + twists[:, 2] * arm[:, 0]
        gap = -end
        gap[2] = math.remainder(float(self.goal[2] - end[2]), 2.0 * math.pi)
        if self.free_heading:
            columns[2], gap[2] = 0.0, 0.0
        if self.rows is None:
            return gap, columns
        return (
            np.concatenate([gap, self.targets - self.rows @ times]),
            np.vstack([columns, self.rows]),
        )


def closest_times(
    conditions: EndConditions, durations: Array, *, rank: float = RANK, at_least: float = 0.0
) -> tuple[Array, float]:
    """Times (n,) near `durations` that miss the least, and what the worst condition then misses.

    Gauss-Newton with the smallest change; no time becomes less than `at_least` [s].
    """
    best, least = durations, math.inf
    now = np.array(durations)
    for _ in range(STEPS):
        gap, columns = conditions.missing(now)
        worst = float(np.abs(gap).max())
        if worst < least:
            best, least = now, worst
        elif least < MET:
            break
        if worst < EXACT:
            break
        now = np.maximum(now + np.linalg.lstsq(columns, gap, rcond=rank)[0], at_least)
    return np.asarray(best), least


def closed_at(
    start: Array, twists: Array, durations: Array, goal: Array, *, free_heading: bool = False
) -> Array:
    """Durations (n,) near `durations` with which the word from `start` (dof,) ends at `goal`.

    The smallest change; as good as it gets where the word cannot meet the goal. Times stay at
    least zero.

    Examples
    --------
    >>> ahead, left = [1.0, 0.0, 0.0], [1.0, 0.0, 1.0]
    >>> twists = np.array([ahead, left, ahead])
    >>> goal = np.array([2.0, 2.0, np.pi / 2])
    >>> closed_at(np.zeros(3), twists, np.array([1.0, 1.57, 1.0]), goal).round(6).tolist()
    [1.0, 1.570796, 1.0]
    """
    if not len(durations):
        return np.array(durations)
    conditions = EndConditions(start=start, twists=twists, goal=goal, free_heading=free_heading)
    return closest_times(conditions, durations)[0]
