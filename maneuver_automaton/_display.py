"""How values show themselves: each hands itself to the pictures, which are imported only then."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any, Protocol


class Player(Protocol):
    """A page that plays a plan; see `maneuver_automaton.plotting.Player`."""

    @property
    def html(self) -> str:
        """The whole page: one file that loads nothing."""
        ...

    def save(self, path: str | Path, /) -> None:
        """Write it to an .html file."""
        ...

    def _repr_html_(self) -> str: ...


def player_page(value: Any, *, title: str = "") -> Player:
    """The player of a plan, an answer for one or a fleet, a closed loop, or a plan on roads."""
    page: Player = _drawing().player_of(value, title=title)
    return page


def player_frame(value: Any) -> str:
    """The player of a value in a frame, for notebooks."""
    return player_page(value)._repr_html_()


def picture(value: Any) -> bytes | None:
    """The picture of a value as a PNG, for notebooks; None if it holds nothing to draw."""
    drawn: bytes | None = _drawing().picture_of(value)
    return drawn


def _drawing() -> Any:
    # The one import that points up. It is by name: data knows nothing of pictures, for the checks
    # of types and of imports either, until somebody looks at it.
    return importlib.import_module("maneuver_automaton.plotting.notebooks")
