"""A word under work: trims and coasting times that a search changes until a `Word` comes of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, IntArray, freeze


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
