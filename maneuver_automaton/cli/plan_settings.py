"""Options of `plan`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from maneuver_automaton.cli.looks import LookOptions
from maneuver_automaton.errors import InvalidScenario


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Options of `plan`, the same for every file of a folder."""

    time_limit: float | None = None  # [s], None: that of the scenario
    alternatives: int = 0
    plot: bool = True
    animate: bool = False
    html: bool = False
    quiet: bool = False
    gap: float | None = None  # share of the cost, None: nothing is proven beside the search
    leave: bool = False  # a start in contact is left first
    jobs: int = 1  # processes for one fleet
    scheduler: str | None = None  # of Dask, for one fleet
    look: LookOptions = field(default_factory=LookOptions)

    def __post_init__(self) -> None:
        if self.time_limit is not None and not 0.0 < self.time_limit < math.inf:
            raise InvalidScenario(
                f"--time-limit: got {self.time_limit}, need a positive number of seconds"
            )
        if self.gap is not None and not 0.0 <= self.gap < 1.0:
            raise InvalidScenario(
                f"--gap: got {self.gap}, need a share of the cost from 0 to below 1, such as 0.05"
            )
