"""A word under work: trims and coasting times that a search changes until a `Word` comes of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, IntArray, freeze

SAME_TIME = 1e-6  # [s] times that differ by less are the same


@dataclass(frozen=True, slots=True, eq=False)
class TimedWord:
    """Trims by the numbers of a search, with their times; what leads from trim to trim follows."""

    trims: tuple[int, ...]
    durations: Array  # (n,) [s]
    cost: float = math.inf  # inf: as yet unknown, or the goal is not met
    certificate: float = -math.inf  # smallest reduced cost over the library, as far as it is known

    def __post_init__(self) -> None:
        freeze(self, "durations")

    @property
    def numbers(self) -> IntArray:
        """The trims as an array (n,)."""
        return np.array(self.trims, dtype=np.int64)

    def same_as(self, other: TimedWord) -> bool:
        """Whether both have the same trims and times.

        Examples
        --------
        >>> word = TimedWord((0, 1), np.array([1.0, 2.0]))
        >>> word.same_as(TimedWord((0, 1), np.array([1.0, 2.1])))
        False
        """
        return self.trims == other.trims and bool(
            np.abs(self.durations - other.durations).max(initial=0.0) <= SAME_TIME
        )
