"""The steering function: coasting times of three trims that end exactly at a goal.

Two circles: a turning trim's instantaneous centre stays where it is, so three turns leave two
unknown headings, each of which moves a point on a circle; where the circles meet, the goal is met.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.words import _kernels_steering as kernels
from maneuver_automaton.words.closing import MET, EndConditions, closest_times, conjugated

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
    steps = _shaped(
        "displacements", np.zeros((2, 3)) if displacements is None else displacements, (2, 3)
    )
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise ValueError(f"tolerance: got {tolerance}, need a positive number")
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
