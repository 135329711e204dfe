"""Values that nearly agree, as one: where primitives of a file end, others begin."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array

DIGITS = 12  # after the point, of a level


def levels_of(begins: Array, ends: Array, *, apart: float) -> Array:
    """The levels (k,) of values, rising: those closer than `apart` are one.

    A level is the median of what begins there, and of what ends there where nothing begins.

    Examples
    --------
    >>> levels_of(np.array([0.0, 4.0]), np.array([3.999, 4.8]), apart=0.01).tolist()
    [0.0, 4.0, 4.8]
    """
    values = np.unique(np.concatenate([begins, ends]))
    levels = []
    for group in np.split(values, np.flatnonzero(np.diff(values) > apart) + 1):
        begun = begins[(begins >= group[0]) & (begins <= group[-1])]
        levels.append(float(np.median(begun if begun.size else group)))
    return np.round(levels, DIGITS) + 0.0


def nearest_level(values: Array, levels: Array) -> Array:
    """The level (n,) next to each value (n,)."""
    chosen: Array = levels[np.abs(levels - values[:, None]).argmin(axis=1)]
    return chosen
