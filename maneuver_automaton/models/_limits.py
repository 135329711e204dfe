"""Limits of controls and reduced states: (n, 2) arrays, infinite where there is no limit."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array


def check_positive(owner: str, **values: float | None) -> None:
    """Refuse a parameter that is neither positive nor, where that is allowed, None."""
    for name, value in values.items():
        if value is not None and not 0.0 < value < math.inf:
            raise ValueError(f"{owner}: {name} must be positive, got {value}")


def check_steering(owner: str, max_steering: float) -> None:
    """Refuse wheels that can be turned across."""
    if not max_steering < math.pi / 2:
        raise ValueError(f"{owner}: max_steering must be less than pi / 2, got {max_steering} rad")


def speed_limits(
    owner: str, least: float | None, greatest: float, *, what: str = "speed", unit: str = "m/s"
) -> tuple[float, float]:
    """Least and greatest speed; a least one of None is as fast in reverse."""
    if least is None:
        return -greatest, greatest
    if not -math.inf < least < greatest:
        raise ValueError(
            f"{owner}: min_{what} must be less than max_{what} {greatest} {unit}, "
            f"got {least} {unit}"
        )
    return least, greatest


def symmetric_limits(*greatest: float | None) -> Array:
    """(n, 2): each value and its negative; None is no limit."""
    high = np.array([np.inf if value is None else value for value in greatest], dtype=np.float64)
    return np.stack([-high, high], axis=-1)


def unlimited() -> Array:
    """(2,): no limit on either side; serves any number of values."""
    return np.array([-np.inf, np.inf])


def limits_of(what: str, limits: ArrayLike, *, names: Sequence[str]) -> Array:
    """Read-only limits (n, 2), one row for each name, from rows or from one row for all."""
    array = np.asarray(limits, dtype=np.float64)
    if array.shape != (2,) and array.shape != (len(names), 2):
        raise ValueError(
            f"{what}: got shape {array.shape}, need ({len(names)}, 2): least and greatest "
            f"{', '.join(names) or '(nothing)'}"
        )
    array = np.broadcast_to(array, (len(names), 2)).copy()
    for name, (low, high) in zip(names, array, strict=True):
        if not low <= high:
            raise ValueError(f"{what}: {name} needs least <= greatest, got ({low:.6g}, {high:.6g})")
    array.setflags(write=False)
    return array
