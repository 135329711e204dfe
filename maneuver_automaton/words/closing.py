"""The steering function, the end of a word with displacements, and times that close a word.

A word with displacements is one without: twists and goals are seen from before all of them. For the
steering function, two circles: a turning trim's instantaneous centre stays where it is, so three
turns leave two unknown headings, each of which moves a point on a circle; where the circles meet,
the goal is met.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, check_range
from maneuver_automaton.groups import group_of
from maneuver_automaton.groups.se2 import chained, coasted
from maneuver_automaton.words import _kernels_steering as kernels
from maneuver_automaton.words._kernels_closing import MET, STEPS, close_times

RANK = 1e-9  # singular values below this, relative, count as none


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
        if self.free_heading:  # the aim turns with the end: no condition is left on the heading
            if self.product is not None:
                x, y = self.product[:2]
                cos, sin = math.cos(end[2]), math.sin(end[2])
                columns[0] -= (sin * x + cos * y) * columns[2]
                columns[1] -= (sin * y - cos * x) * columns[2]
            columns[2], gap[2] = 0.0, 0.0
        if self.rows is None:
            return gap, columns
        left = self.targets - self.rows @ times
        return np.concatenate([gap, left]), np.vstack([columns, self.rows])


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
    return close_times(
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
    )


def times_through(
    conditions: Sequence[EndConditions], durations: Array, *, at_least: ArrayLike = 0.0
) -> tuple[Array, float]:
    """As `closest_times`, for words whose beginnings meet conditions too: each of its twists."""
    n, now, best, least = len(durations), durations, durations, math.inf
    for _ in range(STEPS):
        missed = (one.missing(now[: len(one.twists)]) for one in conditions)
        gaps, columns = zip(*missed, strict=True)
        gap = np.concatenate(gaps)
        worst = float(np.abs(gap).max())
        if worst < least:
            best, least = now, worst
        elif least < MET:
            break
        rows = np.vstack([np.pad(one, ((0, 0), (0, n - one.shape[1]))) for one in columns])
        change = np.linalg.lstsq(rows * (durations > 0.0), gap, rcond=RANK)[0]
        now = np.where(durations > 0.0, np.maximum(now + change, at_least), 0.0)
    return best, least


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


FULL_TURN = 2.0 * np.pi
SMALL = 1e-6  # [s] nearer to zero or a full turn, a time may be zero: rounding at tangent circles
TIMES_TOLERANCE = 1e-7  # [s] solutions closer than this are one


def steer(
    twists: ArrayLike,
    goal: ArrayLike,
    *,
    displacements: ArrayLike | None = None,
    tolerance: float = 1e-12,
) -> Array:
    """Coasting times of three planar trims that end exactly at `goal`.

    All isolated solutions without a negative time and with less than one turn per trim, at most
    two. Trims that share a centre, parallel neighbours and three straights meet a goal never or in
    infinitely many ways; both give no row.

    Source: intersection of two circles. Special cases: Dubins (1957), *On curves of minimal
    length*; Reeds, Shepp (1990), *Optimal paths for a car that goes both forwards and backwards*.

    Parameters
    ----------
    twists : (3, 3) array_like
        Body velocity of each trim [m/s, m/s, rad/s].
    goal : (3,) array_like
        Pose [m, m, rad] seen from the start; its heading counts modulo a full turn.
    displacements : (2, 3) array_like, optional
        Displacement (x, y, heading) of the maneuver between each two trims; none if omitted.
    tolerance : float
        Relative, without unit: below it circles count as tangent, lines as parallel.

    Returns
    -------
    (k, 3) array
        Times [s], a row per solution, by rising total time. Times that may as well be zero are
        zero.

    Raises
    ------
    ValueError
        If a shape is wrong, a number is not finite, or the tolerance is not positive.

    Examples
    --------
    >>> left, ahead, right = [1, 0, 1], [1, 0, 0], [1, 0, -1]
    >>> steer([left, ahead, right], [4, 2, 0]).round(4).tolist()
    [[0.5236, 3.4641, 0.5236]]
    >>> steer([left, right, left], [4.5, 0, 0]).tolist()
    []
    """
    rows = _shaped("twists", twists, (3, 3))
    end = _shaped("goal", goal, (3,))
    given = np.zeros((2, 3)) if displacements is None else displacements
    steps = _shaped("displacements", given, (2, 3))
    check_range("tolerance", tolerance)
    branches = kernels.steer_batch(
        np.array(rows), np.arange(3)[None], np.array(steps)[None], np.array(end)[None], tolerance
    )[0]
    found = [_settled(rows, steps, end, times) for times in branches]
    kept: list[Array] = []
    for times in sorted((one for one in found if one is not None), key=lambda one: one.sum()):
        same = TIMES_TOLERANCE * (1.0 + times.max())
        if not any(np.abs(times - other).max() <= same for other in kept):
            kept.append(times)
    return np.array(kept).reshape(len(kept), 3)


def _settled(rows: Array, steps: Array, goal: Array, times: Array) -> Array | None:
    """A solution without negative times, refined if need be; None if there is none at `times`."""
    if not np.isfinite(times).all():
        return None
    twists, product = conjugated(rows, steps)
    conditions = EndConditions(start=np.zeros(3), twists=twists, goal=goal, product=product)
    with np.errstate(divide="ignore", over="ignore"):
        periods = FULL_TURN / np.abs(rows[:, 2])  # inf for straights
    may_vanish = (times < SMALL) | (periods - times < SMALL)
    times, error = closest_times(conditions, times)
    for k in np.flatnonzero(may_vanish):
        without = times.copy()
        without[k] = 0.0  # what lasts no time stays so
        pinned, pinned_error = closest_times(conditions, without)
        if pinned_error <= MET:
            times, error = pinned, pinned_error
    return times if error <= MET and (times >= 0.0).all() else None


def _shaped(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = as_array(name, value, last=3)
    if array.shape != shape:
        raise ValueError(f"{name}: got shape {array.shape}, need {shape}")
    return array
