"""A bar or a clock on a terminal, nothing elsewhere."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import Protocol


class Advance(Protocol):
    """Function to call after each piece of work, or after several."""

    def __call__(self, n: int = 1) -> None:
        """Move the bar on by `n` pieces."""
        ...


def has_terminal() -> bool:
    """Whether somebody may be watching."""
    return sys.stderr.isatty()


def _nothing(n: int = 1) -> None:
    """Where there is no terminal."""


@contextlib.contextmanager
def progress_bar(what: str, total: int, *, quiet: bool) -> Iterator[Advance]:
    """A bar for `total` pieces of work; yields what to call after each."""
    if quiet or not has_terminal():
        yield _nothing
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)

        def advance(n: int = 1) -> None:
            bar.advance(task, n)

        yield advance


@contextlib.contextmanager
def waiting(what: str, *, quiet: bool, more: Callable[[], str] = lambda: "") -> Iterator[None]:
    """A clock that runs while something is computed of which no one knows how long it takes.

    What `more` says is shown beside it, and asked for again and again.
    """
    if quiet or not has_terminal():
        yield
        return
    from rich.console import Console
    from rich.progress import (
        Progress,
        ProgressColumn,
        SpinnerColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
    )
    from rich.text import Text

    class More(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(more())

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn(), More())
    with Progress(*columns, console=Console(stderr=True), transient=True) as clock:
        clock.add_task(what, total=None)
        yield
