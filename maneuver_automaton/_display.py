"""How values show themselves: pictures register here, and are loaded when somebody looks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol


class PlayerPage(Protocol):
    """A page that plays a plan; see `maneuver_automaton.plotting.Player`."""

    @property
    def html(self) -> str:
        """The whole page: one file that loads nothing."""
        ...

    def save(self, path: str | Path, /) -> None:
        """Write it to an .html file."""
        ...

    def _repr_html_(self) -> str: ...


class Drawing(Protocol):
    """What makes pages and pictures of values."""

    def player_of(self, value: Any, *, title: str) -> PlayerPage:
        """The page that plays a value."""

    def picture_of(self, value: Any) -> bytes:
        """The picture of a value as a PNG."""


_LOADERS: list[Callable[[], Drawing]] = []


def register(load: Callable[[], Drawing]) -> None:
    """Have values shown by what `load` returns; it is called when somebody looks."""
    _LOADERS[:] = [load]


class Drawn:
    """A value with a picture in notebooks."""

    __slots__ = ()

    def _repr_png_(self) -> bytes:
        return _LOADERS[0]().picture_of(self)


class Played(Drawn):
    """A value with a page that plays it, and a picture where no page can be shown."""

    __slots__ = ()

    def player(self, *, title: str = "") -> PlayerPage:
        """A page that plays it: `.html`, or `.save(path)`; `title` heads it."""
        return _LOADERS[0]().player_of(self, title=title)

    def _repr_html_(self) -> str:
        return self.player()._repr_html_()
