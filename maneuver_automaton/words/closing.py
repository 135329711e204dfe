"""The end of a word with displacements, and the smallest change of times that closes it.

A word with displacements is one without: twists and goals are seen from before all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import group_of
from maneuver_automaton.groups.chain import chained, coasted
from maneuver_automaton.words import _kernels_closing

STEPS = 8
RANK = 1e-9  # singular values below this, relative, count as none
MET = 1e-9  # [m, rad, s] below this a condition is met, and no step that misses more is followed
EXACT = 1e-15  # nothing is left to be closed


def conjugated(twists: Array, displacements: Array) -> tuple[Array, Array]:
    """Twists (n, dof) seen from before all `displacements`, and the product of these (dof,).

    `displacements` are (n - 1, dof), one between each two trims, or (n, dof), one after each.

    Source: ``D exp(xi) = exp(Ad(D) xi) D``; Solà, Deray, Atchuthan (2018), Eq. (30).
    """
    n, dof = twists.shape
    before = chained(np.zeros(dof), displacements)
    adjoints = group_of(dof)(before[:n]).adjoint()
    return np.asarray((adjoints @ twists[:, :, None])[:, :, 0]), before[-1]


def conjugated_turn(product: Array) -> Array:
    """Twist (dof,) of a turn in place after all displacements, seen from before them."""
    turn = np.zeros(product.size)
    turn[2] = 1.0
    return np.asarray(group_of(product.size)(product).adjoint() @ turn)


def goal_before(goal: Array, product: Array) -> Array:
    """Where a word without its displacements has to end, for one with them to end at `goal`."""
    group = group_of(goal.size)
    return (group(goal) @ group(product).inverse()).pose


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class EndConditions:
    """Conditions on the times of a word of n trims: its end, and `rows` @ times = `targets`.

    The twists are seen from before all displacements of the word, whose product is `product`.
    """

    start: Array  # (dof,)
    twists: Array  # (n, dof)
    goal: Array  # (dof,)
    free_heading: bool = False
    product: Array | None = None  # (dof,) of all displacements; None if there are none
    rows: Array | None = None  # (m, n)
    targets: Array = field(default_factory=lambda: np.zeros(0))  # (m,)

    def missing(self, times: Array) -> tuple[Array, Array]:
        """Residuals (dof + m,) of the conditions, and the derivatives (.., n) of their values."""
        twists, places = self.twists, np.array(self.start)
        plane = [0, 1, *range(3, places.size)]  # places, not the heading
        places[plane] -= self.goal[plane]  # seen from the goal's place no digit is lost
        poses = coasted(places, twists, times)
        after, end = poses[1:], poses[-1]
        c, s = np.cos(after[:, 2]), np.sin(after[:, 2])
        arm = end[:2] - after[:, :2]
        columns = np.array(twists.T)
        columns[0] = c * twists[:, 0] - s * twists[:, 1] - twists[:, 2] * arm[:, 1]
        columns[1] = s * twists[:, 0] + c * twists[:, 1] + twists[:, 2] * arm[:, 0]
        aim = np.zeros(end.size)
        aim[2] = self.goal[2]
        if self.free_heading:  # the heading that the word has anyway
            aim[2] = end[2] if self.product is None else end[2] + self.product[2]
        gap = (aim if self.product is None else goal_before(aim, self.product)) - end
        gap[2] = math.remainder(float(gap[2]), 2.0 * math.pi)
        if self.free_heading:
            self._follow_the_heading(end, gap, columns)
        if self.rows is None:
            return gap, columns
        return (
            np.concatenate([gap, self.targets - self.rows @ times]),
            np.vstack([columns, self.rows]),
        )

    def _follow_the_heading(self, end: Array, gap: Array, columns: Array) -> None:
        """Let the aim turn with the end, so that no condition is left on the heading."""
        if self.product is not None:
            x, y = self.product[:2]
            c, s = math.cos(end[2]), math.sin(end[2])
            columns[0] -= (s * x + c * y) * columns[2]
            columns[1] -= (s * y - c * x) * columns[2]
        columns[2], gap[2] = 0.0, 0.0


def closest_times(
    conditions: EndConditions, durations: Array, *, rank: float = RANK, at_least: float = 0.0
) -> tuple[Array, float]:
    """Times (n,) near `durations` that miss the least, and what the worst condition then misses.

    Gauss-Newton with the smallest change; no time becomes less than `at_least` [s], and what lasts
    no time stays so: it stands between two maneuvers.
    """
    n, dof = len(durations), conditions.start.size
    start, twists, product = np.zeros(4), np.zeros((n, 4)), np.zeros(4)
    start[:dof] = conditions.start - conditions.goal  # from the goal's place no digit is lost
    start[2] = conditions.start[2]
    twists[:, :dof] = conditions.twists
    if conditions.product is not None:
        product[:dof] = conditions.product
    rows = np.zeros((len(conditions.targets), n))
    if conditions.rows is not None:
        rows[:] = conditions.rows
    return _kernels_closing.close_times(
        start,
        twists,
        float(conditions.goal[2]),
        product,
        bool(conditions.free_heading),
        rows,
        np.array(conditions.targets, dtype=np.float64),
        np.array(durations, dtype=np.float64),
        float(rank),
        float(at_least),
        STEPS,
        MET,
        EXACT,
    )


def closed_at(
    start: Array,
    twists: Array,
    durations: Array,
    goal: Array,
    *,
    displacements: Array | None = None,
    free_heading: bool = False,
) -> Array:
    """Durations (n,) near `durations` with which the word from `start` (dof,) ends at `goal`.

    The smallest change; as good as it gets where the word cannot meet the goal. Times stay at
    least zero, and those that are zero stay zero. `displacements` (n - 1, dof) or (n, dof) are
    those of the maneuvers after each trim.

    Source: the derivative of the end by a time, as a twist in its frame, is ``Ad(after^-1) xi``;
    maneuvers by conjugation, see `conjugated`.
    """
    if not len(durations):
        return np.array(durations)
    product = None
    if displacements is not None and displacements.any():
        twists, product = conjugated(twists, displacements)
    conditions = EndConditions(
        start=start, twists=twists, goal=goal, free_heading=free_heading, product=product
    )
    return closest_times(conditions, durations)[0]
