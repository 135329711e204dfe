"""The least distance over a motion or many poses: measured where it may be, and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2

PARTS = 4  # into which a stretch that may hold the least distance is cut
SHARE = 0.1  # of the least distance, by which another stretch may be nearer


class Approach(NamedTuple):
    """When a distance is least."""

    time: float  # [s]
    distance: float  # [m]


def closest_approach(
    distances: Callable[[Array], Array],
    times: Array,
    rates: Array,
    *,
    resolution: float,
    enough: float = 0.0,
) -> Approach:
    """The least distance over a stretch of time.

    Between two times the distance is no less than the mean of both less half of what it can change
    on the way. Where that is less than the least one measured, it is measured in between: next to
    that one down to `resolution` [m], elsewhere until nothing can be nearer by more than a tenth,
    which is soon so even along a wall, and nothing nearer than `enough` by more than `resolution`.

    Parameters
    ----------
    distances : callable
        Distances (k,) [m] at times (k,) [s].
    times : (n + 1,) array
        Where to begin [s], in order.
    rates : (n,) array
        How fast the distance can change in between [m/s].
    resolution : float
        What does not count [m].
    enough : float
        A distance that ends the search [m].

    Returns
    -------
    Approach
        The least distance measured, and when.

    Examples
    --------
    >>> parabola = lambda t: (t - 0.3) ** 2 + 0.5
    >>> least = closest_approach(parabola, np.arange(2.0), np.array([2.0]), resolution=1e-6)
    >>> round(least.time, 3), round(least.distance, 6)
    (0.3, 0.5)
    """
    known = distances(times)
    best = int(np.argmin(known))
    least = Approach(float(times[best]), float(known[best]))
    begins, ends, at_begin, at_end = times[:-1], times[1:], known[:-1], known[1:]
    steps = np.arange(PARTS + 1) / PARTS
    while enough < least.distance < math.inf:
        change = rates * (ends - begins)
        nearer = least.distance - 0.5 * (at_begin + at_end - change)
        beside = (begins == least.time) | (ends == least.time)
        spare = max(resolution, min(SHARE * least.distance, least.distance - enough))
        open_ = nearer > np.where(beside, resolution, spare)
        if not open_.any():
            return least
        times = begins[open_, None] + (ends - begins)[open_, None] * steps
        times[:, -1] = ends[open_]
        inner = distances(times[:, 1:-1].reshape(-1)).reshape(len(times), -1)
        known = np.column_stack([at_begin[open_], inner, at_end[open_]])
        best = int(np.argmin(inner))
        if inner.flat[best] < least.distance:
            least = Approach(float(times[:, 1:-1].flat[best]), float(inner.flat[best]))
        begins, ends = times[:, :-1].reshape(-1), times[:, 1:].reshape(-1)
        at_begin, at_end = known[:, :-1].reshape(-1), known[:, 1:].reshape(-1)
        rates = np.repeat(rates[open_], PARTS)
    return least


def least_over_poses(
    distance: Callable[[Array, Array], float],
    poses: Array,
    others: Array,
    *,
    moved: Array,
    least: float,
) -> float:
    """Least of `least` and the distances [m] of two bodies at poses (n, 3) each.

    `moved` (n,) is how far their points may have come closer since the poses before [m]; where the
    last distance less that is no smaller than the least, none is measured.
    """
    bound = -math.inf
    for here, there, closer in zip(poses, others, moved, strict=True):
        bound -= closer
        if bound < least:
            bound = distance(here, there)
            least = min(least, bound)
    return least


def travel(poses: Array, middle: Array, reach: float) -> Array:
    """How far (n,) any point of a disc can have moved since the pose (n, 3) before [m].

    Examples
    --------
    >>> travel(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, np.pi]]), np.zeros(2), 2.0).tolist()
    [0.0, 5.0]
    """
    places = SE2(poses).act(middle)
    steps = np.hypot(*np.diff(places, axis=0).T)
    turns = 2.0 * reach * np.abs(np.sin(0.5 * np.diff(poses[:, 2])))
    return np.concatenate([[0.0], steps + turns])
