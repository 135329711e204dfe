"""The steering function: coasting times of three trims, or of four with a climb, that end exactly.

Two circles: a turning trim's instantaneous centre stays where it is, so three turns leave two
unknown headings, each of which moves a point on a circle; where the circles meet, the goal is met.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.groups import SE2
from maneuver_automaton.words.closing import MET, EndConditions, closest_times
from maneuver_automaton.words.conjugation import conjugated

BoolArray = NDArray[np.bool_]

FULL_TURN = 2.0 * np.pi
SMALL = 1e-6  # [s] nearer to zero or a full turn, a time may be zero: rounding at tangent circles
TIMES_TOLERANCE = 1e-7  # [s] solutions closer than this are one
HALVINGS = 60  # of a bracket, to the last bit
BISECTIONS = 8  # of an interval between nodes that may hide two roots


def steer(
    twists: ArrayLike,
    goal: ArrayLike,
    *,
    displacements: ArrayLike | None = None,
    longest: float | None = None,
    nodes: int = 256,
    tolerance: float = 1e-12,
) -> Array:
    """Coasting times of three planar trims, or of four in SE(2) x R, that end exactly at `goal`.

    In the plane: all isolated solutions without a negative time and with less than one turn per
    trim, at most two. Trims that share a centre, parallel neighbours and three straights meet a
    goal never or in infinitely many ways; both give no row.

    In SE(2) x R the fourth trim makes up for the altitude: directly where it is purely vertical.
    Otherwise its time is scanned: the first three follow in closed form, and the excess of altitude
    is bracketed between nodes, halved where it bends. What is missed: a solution at which the
    excess touches zero without a change of sign, and one on a branch of the closed form that begins
    and ends between two nodes.

    Source: intersection of two circles. Special cases: Dubins (1957), *On curves of minimal
    length*; Reeds, Shepp (1990), *Optimal paths for a car that goes both forwards and backwards*.

    Parameters
    ----------
    twists : (3, 3) or (4, 4) array_like
        Body velocity of each trim [m/s, m/s, rad/s(, m/s)]; a purely vertical trim comes last.
    goal : (3,) or (4,) array_like
        Pose [m, m, rad(, m)] seen from the start; its heading counts modulo a full turn.
    displacements : (2, 3) or (3, 4) array_like, optional
        Displacement (x, y, heading(, z)) of the maneuver between each two trims; none if omitted.
    longest : float, optional
        Longest time of the fourth trim [s]; if omitted, a full turn or a path well beyond the goal.
    nodes : int
        Intervals of the scan of the fourth trim's time.
    tolerance : float
        Relative, without unit: below it circles count as tangent, lines as parallel.

    Returns
    -------
    (k, 3) or (k, 4) array
        Times [s], a row per solution, by rising total time. Times that may as well be zero are
        zero.

    Raises
    ------
    ValueError
        If a shape is wrong, a number is not finite, or a limit is not positive.

    Examples
    --------
    >>> left, ahead, right = [1, 0, 1], [1, 0, 0], [1, 0, -1]
    >>> steer([left, ahead, right], [4, 2, 0]).round(4).tolist()
    [[0.5236, 3.4641, 0.5236]]
    >>> steer([left, right, left], [4.5, 0, 0]).tolist()
    []
    >>> left, ahead, right, lift = [1, 0, 1, 0], [1, 0, 0, 0.5], [1, 0, -1, 0], [0, 0, 0, 2]
    >>> steer([left, ahead, right, lift], [4, 2, 0, 3]).round(4).tolist()
    [[0.5236, 3.4641, 0.5236, 0.634]]
    """
    rows = as_array("twists", twists, last=(3, 4))
    n = rows.shape[-1]
    if rows.shape != (n, n):
        raise ValueError(f"twists: got shape {rows.shape}, need (3, 3) or (4, 4)")
    end = _pose("goal", goal, n)
    steps = np.zeros((n - 1, n))
    if displacements is not None:
        steps = _rows("displacements", displacements, n - 1, n)
    relative = _positive("tolerance", tolerance)
    if nodes < 1:
        raise ValueError(f"nodes: got {nodes}, need at least 1")
    if n == 3:
        found: Iterable[Array] = _branches(rows, steps, end[None], relative)[0]
    elif not rows[3].any():
        return np.zeros((0, 4))
    else:
        climb = _Climb(rows, steps, end, relative)
        if not rows[3, :3].any():
            found = climb.lifted()
        else:
            reach = climb.reach() if longest is None else _positive("longest", longest)
            found = chain.from_iterable(climb.roots(branch, reach, nodes) for branch in range(2))
    return _distinct((_settled(rows, steps, end, times) for times in found), n)


@dataclass(frozen=True, slots=True, eq=False)
class _Climb:
    """Four trims, of which the first three are solved for in the plane."""

    rows: Array  # (4, 4)
    steps: Array  # (3, 4)
    goal: Array  # (4,)
    tolerance: float

    @property
    def periods(self) -> Array:
        """Time of a full turn of each trim (4,) [s], inf for straights."""
        return _periods(self.rows)

    def branches(self, last: Array) -> Array:
        """Times (n, 2, 3) of the first three trims, given those of the fourth (n,)."""
        back = SE2.exp(-last[:, None] * self.rows[3, :3]) @ SE2(self.steps[2, :3]).inverse()
        goals = (SE2(self.goal[:3]) @ back).pose
        return _branches(self.rows[:3, :3], self.steps[:2, :3], goals, self.tolerance)

    def along(self, branch: int, last: Array, near: Array | None = None) -> Array:
        """All times (n, 4) on one branch; turns shifted by whole ones to lie nearest to `near`."""
        times = np.column_stack([self.branches(last)[:, branch], last])
        if near is not None:
            turning = np.flatnonzero(np.isfinite(self.periods[:3]))
            period = self.periods[turning]
            times[:, turning] -= period * np.round((times - near)[:, turning] / period)
        return times

    def excess(self, times: Array) -> Array:
        """Altitude (n,) [m] by which times (n, 4) end too high; zero where it is only rounding."""
        value = times @ self.rows[:, 3] + self.steps[:, 3].sum() - self.goal[3]
        size = np.abs(times) @ np.abs(self.rows[:, 3]) + abs(self.goal[3]) + 1e-3
        return np.where(np.abs(value) <= 1e-13 * size, 0.0, value)

    def lifted(self) -> Iterator[Array]:
        """Both branches in the plane; the fourth trim makes up for the altitude."""
        before_lift = (SE2(self.goal[:3]) @ SE2(self.steps[2, :3]).inverse()).pose
        for times in self.branches(np.zeros(1))[0]:
            planar = _settled(self.rows[:3, :3], self.steps[:2, :3], before_lift, times)
            if planar is not None:
                excess = self.excess(np.append(planar, 0.0)[None])[0]
                yield np.append(planar, -excess / self.rows[3, 3])

    def reach(self) -> float:
        """Longest time of interest of the fourth trim [s]."""
        if np.isfinite(self.periods[3]):
            return float(self.periods[3])
        speeds = np.linalg.norm(self.rows[:, :2], axis=1)
        turning = self.rows[:, 2] != 0.0
        radius = (speeds[turning] / np.abs(self.rows[turning, 2])).max(initial=0.0)
        jumps = np.linalg.norm(self.steps[:, :2], axis=1).sum()
        length = np.linalg.norm(self.goal[:2]) + jumps + 4.0 * radius
        height = abs(self.goal[3]) + np.abs(self.steps[:, 3]).sum()
        return float(max(2.0 * length + height, 1e-3) / max(speeds[3], abs(self.rows[3, 3])))

    def roots(self, branch: int, reach: float, nodes: int) -> Iterator[Array]:
        """Times (4,) at which a branch has the altitude of the goal."""
        low, high = self._refined_intervals(branch, np.linspace(0.0, reach, nodes + 1))
        for shift in self._shifts():
            below, above = self.excess(low + shift), self.excess(high + shift)
            flat = (below == 0.0) & (above == 0.0)  # any of these times will do: none is isolated
            rows = self._within(low + shift, high + shift) & ~flat & (below * above <= 0.0)
            if rows.any():
                yield from self._bisected(branch, low[rows], high[rows], shift)

    def _shifts(self) -> Iterator[Array]:
        """Whole turns (4,) [s] by which times that are continued along a branch may be off."""
        turning = np.flatnonzero(np.isfinite(self.periods[:3]))
        for turns in product((0.0, -1.0, 1.0), repeat=turning.size):
            shift = np.zeros(4)
            shift[turning] = np.array(turns) * self.periods[turning]
            yield shift

    def _within(self, low: Array, high: Array) -> BoolArray:
        """Whether times between `low` and `high` (n, 4) can lie in [0, one turn]."""
        some = (np.maximum(low, high) >= -SMALL) & (np.minimum(low, high) <= self.periods + SMALL)
        return np.asarray(some.all(axis=1))

    def _refined_intervals(self, branch: int, last: Array) -> tuple[Array, Array]:
        """Intervals, as all times (n, 4) at both ends, halved where a bend may hide two roots."""
        low, high, bend = self._intervals(branch, last)
        for _ in range(BISECTIONS):
            split = self._hiding(low, high, bend)
            middle = self.along(branch, 0.5 * (low + high)[split, 3], low[split])
            inside = np.isfinite(middle).all(axis=1)
            split[split] = inside
            middle = middle[inside]
            if not len(middle):
                break
            mean = 0.5 * (self.excess(low[split]) + self.excess(high[split]))
            off = np.abs(self.excess(middle) - mean)
            low, high = (
                np.concatenate([low[~split], low[split], middle]),
                np.concatenate([high[~split], middle, high[split]]),
            )
            bend = np.concatenate([bend[~split], off, off])
        return low, high

    def _hiding(self, low: Array, high: Array, bend: Array) -> BoolArray:
        """Intervals that bend enough to hold roots that their ends do not show."""
        below, above = self.excess(low), self.excess(high)
        bent = bend > 0.25 * np.abs(above - below)
        hiding = np.zeros(len(low), dtype=np.bool_)
        for shift in self._shifts():
            nearest = np.minimum(
                np.abs(self.excess(low + shift)), np.abs(self.excess(high + shift))
            )
            hiding |= self._within(low + shift, high + shift) & bent & (nearest <= 2.0 * bend)
        return hiding

    def _intervals(self, branch: int, last: Array) -> tuple[Array, Array, Array]:
        """Neighbouring nodes, or a node and the end of its branch; how much each interval bends."""
        times = self.along(branch, last)
        there = np.asarray(np.isfinite(times).all(axis=1))
        both = np.flatnonzero(there[:-1] & there[1:])
        begins, ends = (
            np.flatnonzero(~there[:-1] & there[1:]),
            np.flatnonzero(there[:-1] & ~there[1:]),
        )
        inside = np.concatenate([last[begins + 1], last[ends]])
        edge, outside = inside, np.concatenate([last[begins], last[ends + 1]])
        for _ in range(HALVINGS if edge.size else 0):
            middle = 0.5 * (edge + outside)
            good = np.isfinite(self.along(branch, middle)).all(axis=1)
            edge, outside = np.where(good, middle, edge), np.where(good, outside, middle)
        low = np.concatenate([times[both], times[begins + 1], times[ends]])
        high = self.along(branch, np.concatenate([last[both + 1], edge]), low)
        rise = np.full(len(last) + 1, np.nan)  # of the excess; NaN where it is not known
        rise[both + 1] = self.excess(high[: both.size]) - self.excess(low[: both.size])
        curve = np.abs(np.diff(rise))[[both, both + 1]].max(axis=0, initial=0.0)
        bend = np.where(np.isnan(curve), np.inf, 0.5 * curve)
        return low, high, np.concatenate([bend, np.full(edge.size, np.inf)])

    def _bisected(self, branch: int, low: Array, high: Array, shift: Array) -> Array:
        """Roots (n, 4) between times `low` and `high` (n, 4), all halved at once."""
        near, below = low, np.sign(self.excess(low + shift))
        left, right = low[:, 3], high[:, 3]
        for _ in range(HALVINGS):
            middle = 0.5 * (left + right)
            times = self.along(branch, middle, near)
            stay = (np.sign(self.excess(times + shift)) == below) & (below != 0.0)
            left, right = np.where(stay, middle, left), np.where(stay, right, middle)
            near = np.where(np.isnan(times), near, times)
        return near + shift


def _branches(rows: Array, steps: Array, goals: Array, tolerance: float) -> Array:
    """Both branches (n, 2, 3) for goals (n, 3)."""
    from maneuver_automaton.words import _kernels_steering as kernels

    n = len(goals)
    triples = np.tile(np.arange(3), (n, 1))
    tiled = np.tile(steps, (n, 1, 1))
    times = kernels.steer_batch(
        np.ascontiguousarray(rows), triples, tiled, np.ascontiguousarray(goals), tolerance
    )
    return np.asarray(times)


def _settled(rows: Array, steps: Array, goal: Array, times: Array) -> Array | None:
    """A solution without negative times, refined if need be; None if there is none at `times`."""
    if not np.isfinite(times).all():
        return None
    twists, product = conjugated(rows, steps)
    conditions = EndConditions(start=np.zeros(goal.size), twists=twists, goal=goal, product=product)
    may_vanish = (times < SMALL) | (_periods(rows) - times < SMALL)
    times, error = closest_times(conditions, times)
    for k in np.flatnonzero(may_vanish):
        without = times.copy()
        without[k] = 0.0  # what lasts no time stays so
        pinned, pinned_error = closest_times(conditions, without)
        if pinned_error <= MET:
            times, error = pinned, pinned_error
    return times if error <= MET and (times >= 0.0).all() else None


def _periods(rows: Array) -> Array:
    """Time of a full turn of each trim (n,) [s], inf for straights."""
    with np.errstate(divide="ignore", over="ignore"):
        return np.asarray(FULL_TURN / np.abs(rows[:, 2]))


def _distinct(found: Iterable[Array | None], n: int) -> Array:
    """Solutions (k, n) by rising total time, each once."""
    kept: list[Array] = []
    for times in sorted((row for row in found if row is not None), key=lambda row: row.sum()):
        if not any(
            np.abs(times - other).max() <= TIMES_TOLERANCE * (1.0 + times.max()) for other in kept
        ):
            kept.append(times)
    return np.array(kept).reshape(len(kept), n)


def _rows(name: str, value: ArrayLike, n: int, dof: int) -> Array:
    rows = as_array(name, value, last=dof)
    if rows.shape != (n, dof):
        raise ValueError(f"{name}: got shape {rows.shape}, need ({n}, {dof})")
    return rows


def _pose(name: str, value: ArrayLike, dof: int) -> Array:
    pose = as_array(name, value, last=dof)
    if pose.shape != (dof,):
        raise ValueError(f"{name}: got shape {pose.shape}, need ({dof},)")
    return pose


def _positive(name: str, value: float) -> float:
    if not (np.isfinite(value) and value > 0.0):
        raise ValueError(f"{name}: got {value}, need a positive number")
    return float(value)
