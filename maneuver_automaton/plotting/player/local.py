"""Numbers of a page: places counted from near the start, rounded to what can be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array

POSE_DIGITS, PLACE_DIGITS, VALUE_DIGITS = 9, 4, 5  # decimals


@dataclass(frozen=True, slots=True, eq=False)
class Local:
    """Coordinates from an `origin` (2,) [m]: browsers draw with single precision."""

    origin: Array

    def poses(self, poses: Array) -> list[Any]:
        """Poses (..., dof) as lists, exact enough to compute with."""
        near = np.array(poses, dtype=np.float64)
        near[..., :2] -= self.origin
        return rounded(near, POSE_DIGITS)

    def places(self, places: Array) -> list[Any]:
        """Places (..., 2) as lists, exact enough to draw."""
        return rounded(np.asarray(places) - self.origin, PLACE_DIGITS)


def rounded(values: Array | Sequence[float], digits: int = VALUE_DIGITS) -> list[Any]:
    """Numbers (...,) as lists with so many decimals; no negative zero."""
    numbers: list[Any] = (np.round(np.asarray(values, dtype=np.float64), digits) + 0.0).tolist()
    return numbers


def hex_color(color: Sequence[float]) -> str:
    """A colour as the browser reads it.

    Examples
    --------
    >>> hex_color((1.0, 0.5, 0.0))
    '#ff8000'
    """
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in color)
