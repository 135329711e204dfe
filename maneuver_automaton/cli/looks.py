"""`--title`, `--size` and `--style`: how pictures are to look."""

from __future__ import annotations

from dataclasses import dataclass
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
