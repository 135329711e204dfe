"""Shortest paths of a car in free space, in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, IntArray, as_array
from maneuver_automaton.words._kernels_shortest import shortest_batch


def least_radius(twists: Array) -> float:
    """Radius of the tightest turn [m] of trims (m, 3 or 4) that all move along the heading.

    0 where one moves aside or turns on the spot, or where none turns.
    """
    speed, turn = np.abs(twists[:, 0]), np.abs(twists[:, 2])
    turns = turn > 0.0
    if twists[:, 1].any() or not turns.any():
        return 0.0
    return float((speed[turns] / turn[turns]).min())


def shortest_paths(goals: Array, radius: float) -> tuple[IntArray, Array]:
    """Turns (n, 5), 1 to the left and -1 to the right, and lengths (n, 5) [m], negative backwards.

    Parts of the shortest paths to goals (n, 3) of a car that drives as well backwards.
    """
    turns, parts = np.zeros((len(goals), 5), dtype=np.int64), np.zeros((len(goals), 5))
    shortest_batch(goals / np.array([radius, radius, 1.0]), turns, parts)
    return turns, radius * parts


def reeds_shepp_length(goals: ArrayLike, *, radius: float = 1.0) -> Array:
    """Length (...,) of the shortest path to poses (..., 3) of a car that also reverses [m].

    Source: Reeds, Shepp (1990), *Optimal paths for a car that goes both forwards and backwards*.

    Examples
    --------
    >>> reeds_shepp_length([[3.0, 0.0, 0.0], [0.0, 0.0, np.pi]]).round(6).tolist()
    [3.0, 3.141593]
    """
    poses = as_array("goals", goals, last=3)
    _, lengths = shortest_paths(poses.reshape(-1, 3), radius)
    return np.asarray(np.abs(lengths).sum(axis=1).reshape(poses.shape[:-1]))
