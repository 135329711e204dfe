"""Obstacles that move, as convex pieces in each interval of a motion, and how they shift with it.

In an interval a piece is all that the obstacle sweeps from its begin to its end, and it is parted
from the body in that interval alone. A motion that takes longer meets it elsewhere: to first order
each corner shifts by its velocity, times the share of the motion that has passed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.optimal_control.separation import Solid

INSIDE = (0.25, 0.5, 0.75)  # shares of an interval, at which it is looked at how far paths bend
NEARBY = 1e-3  # [s] for the velocity of a corner
ALWAYS, NEVER = -1, -2  # the interval of what is there in all of them, and in none


class MovingSolid(NamedTuple):
    """A convex solid that moves."""

    corners: Array  # (m, 2) [m] in its own frame
    rounding: float  # [m]
    poses: Callable[[Array], Array]  # (n, 3) at times (n,) since the begin of the motion [s]
    there: tuple[float, float]  # [s] since the same, from when until when


class Pieces(NamedTuple):
    """Convex pieces of obstacles, while a motion of some duration is driven."""

    solids: list[Solid]
    interval: IntArray  # (n,) in which alone each counts, or `ALWAYS`, or `NEVER`
    first: int  # the number of the first one that moves
    shifts: Array  # (moving, corners, 2) [m/s] of the corners, by seconds of duration

    @property
    def move(self) -> bool:
        """Whether some move."""
        return self.first < len(self.solids)


def pieces_during(
    still: Sequence[Solid], movers: Sequence[MovingSolid], durations: Array
) -> Pieces:
    """What stands still, and what moves in each interval of a motion of `durations` (n,) [s].

    Corners of what moves are those at the begin of the interval, then those at its end: their hull
    is the piece.

    Examples
    --------
    >>> def poses(times):
    ...     return np.stack([times, 0 * times, 0 * times], -1)
    >>> ahead = MovingSolid(np.zeros((1, 2)), 0.5, poses, (0.0, 9.0))
    >>> pieces = pieces_during([], [ahead], np.ones(2))
    >>> [corners[:, 0].tolist() for corners, _ in pieces.solids], pieces.interval.tolist()
    ([[0.0, 1.0], [1.0, 2.0]], [0, 1])
    >>> pieces.shifts[:, :, 0].round(6).tolist()
    [[0.0, 0.5], [0.5, 1.0]]
    """
    solids, intervals, shifts = list(still), [np.full(len(still), ALWAYS)], []
    ends = np.cumsum([0.0, *durations.tolist()])
    most = 2 * max((len(one.corners) for one in movers), default=0)
    for one in movers:
        first, last = one.there
        begin, end = np.clip(ends[:-1], first, last), np.clip(ends[1:], first, last)
        both = np.concatenate([_corners(one, begin), _corners(one, end)], axis=1)
        # Of a clipped time nothing shifts.
        shares = np.stack([ends[:-1], ends[1:]], axis=1) / max(ends[-1], NEARBY)
        shares *= np.stack([begin == ends[:-1], end == ends[1:]], axis=1)
        rates = np.concatenate([_rates(one, begin), _rates(one, end)], axis=1)
        rates *= np.repeat(shares, len(one.corners), axis=1)[..., None]
        bulges = one.rounding + _bulges(one, begin, end)
        solids += list(zip(both, bulges.tolist(), strict=True))
        there = (ends[:-1] <= last) & (ends[1:] >= first)
        intervals.append(np.where(there, np.arange(len(durations)), NEVER))
        pad = most - rates.shape[1]
        shifts.append(np.pad(rates, ((0, 0), (0, pad), (0, 0))))
    return Pieces(
        solids,
        np.concatenate(intervals).astype(np.int64),
        len(still),
        np.concatenate([np.zeros((0, most, 2)), *shifts]),
    )


def _corners(one: MovingSolid, times: Array) -> Array:
    """Where the corners are (n, m, 2) at times (n,)."""
    x, y, heading = np.moveaxis(one.poses(times), -1, 0)[..., None]
    c, s = np.cos(heading), np.sin(heading)
    along, aside = one.corners.T
    return np.stack([x + c * along - s * aside, y + s * along + c * aside], axis=-1)


def _rates(one: MovingSolid, times: Array) -> Array:
    """Velocities (n, m, 2) of the corners [m/s]."""
    ahead, behind = _corners(one, times + NEARBY), _corners(one, times - NEARBY)
    return np.asarray((ahead - behind) / (2.0 * NEARBY))


def _bulges(one: MovingSolid, begin: Array, end: Array) -> Array:
    """How far paths of corners lead beside the chords (n,) [m], by some looks."""
    here, there = _corners(one, begin), _corners(one, end)
    most = np.zeros(len(begin))
    for share in INSIDE:
        chord = here + share * (there - here)
        gap = _corners(one, begin + share * (end - begin)) - chord
        most = np.maximum(most, np.hypot(gap[..., 0], gap[..., 1]).max(axis=1))
    return most
