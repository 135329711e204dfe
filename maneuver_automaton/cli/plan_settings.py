"""Options of `plan`; `--title`, `--size` and `--style`: how pictures are to look."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.plotting import Look


@dataclass(frozen=True, slots=True, kw_only=True)
class LookOptions:
    """What the command line says of pictures."""

    title: str | None = None  # None: the name of the scenario, and none in a paper
    size: str | None = None  # WIDTH or WIDTHxHEIGHT [in]
    style: str = "screen"

    def __post_init__(self) -> None:
        if self.is_stated:
            self.look()  # Matplotlib is needed anyway, and a wrong size is told before planning

    @property
    def is_stated(self) -> bool:
        """Whether pictures are to have another size or style than they have of themselves."""
        return self.size is not None or self.style != "screen"

    def look(self, name: str = "") -> Look:
        """The look of a picture of the scenario `name`; raises InvalidScenario."""
        from maneuver_automaton.plotting.look import Look, size_of

        title = self.title if self.title is not None else name
        if self.title is None and self.style == "paper":
            title = ""  # the caption has it
        try:
            size = None if self.size is None else size_of(self.size)
            return Look(title=title, size=size, style=self.style)
        except ValueError as error:
            raise InvalidScenario(f"--{error}") from error


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
