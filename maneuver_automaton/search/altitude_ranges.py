"""Ranges of altitude of the pieces of maneuvers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.primitives import Maneuver

BETWEEN = 0.25  # of the change of climb from sample to sample times their spacing


def altitude_ranges(
    maneuvers: Sequence[Maneuver], climbs: Array, begin: IntArray, end: IntArray
) -> tuple[Array, Array]:
    """Least and greatest altitude (n,) [m] of pieces, seen from where their maneuver begins.

    Parameters
    ----------
    maneuvers : sequence of Maneuver
        Whose samples, one course after the other, the pieces are made of.
    climbs : (k, 2) array
        Climb [m/s] in the trims before and after each.
    begin, end : (n,) array of int
        First and last sample of every piece.

    Examples
    --------
    >>> stroke = Maneuver(name="up", source="low", target="high", duration=2.0,
    ...                   displacement=[1.0, 0.0, 0.0, 3.0])
    >>> low, high = altitude_ranges([stroke], np.full((1, 2), 1.5), np.array([0]), np.array([1]))
    >>> low.tolist(), high.tolist()
    ([0.0], [3.0])
    """
    if not begin.size:
        return np.zeros(0), np.zeros(0)
    rows, swings = [], []
    for maneuver, (before, after) in zip(maneuvers, climbs.tolist(), strict=True):
        if maneuver.displacement.size == 3:
            n = 2 if maneuver.course is None else len(maneuver.course.time)
            rows.append(np.zeros(n))
            swings.append(np.zeros(n))
            continue
        if maneuver.course is None:
            z, t = np.array([0.0, maneuver.displacement[3]]), np.array([0.0, maneuver.duration])
        else:
            z, t = maneuver.course.pose[:, 3], maneuver.course.time
        spacing = np.maximum(np.diff(t), 1e-300)
        rates = np.concatenate([[before], np.diff(z) / spacing, [after]])
        change = np.abs(np.diff(rates))
        rows.append(z)
        swings.append(np.append(BETWEEN * np.maximum(change[:-1], change[1:]) * np.diff(t), 0.0))
    altitude, swing = np.concatenate(rows), np.concatenate(swings)
    span = np.stack([begin, end + 1], axis=1).ravel()
    more = np.maximum.reduceat(np.append(swing, 0.0), span)[::2]
    low = np.minimum.reduceat(np.append(altitude, np.inf), span)[::2] - more
    high = np.maximum.reduceat(np.append(altitude, -np.inf), span)[::2] + more
    return np.asarray(low), np.asarray(high)
