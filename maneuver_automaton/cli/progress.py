"""A bar or a clock on a terminal, nothing elsewhere; and why nothing happens for a while."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import Any, Protocol

from maneuver_automaton._interrupts import compiler_began, compiler_ended
from maneuver_automaton.cli.guard import complain

_shown: list[Any] = []  # what rich shows on the terminal: one bar at most
COMPILING = "compiling kernels, once after installation: this may take a minute ..."


class Advance(Protocol):
    """Function to call after each piece of work, or after several."""

    def __call__(self, n: int = 1) -> None:
        """Move the bar on by `n` pieces."""
        ...


def has_terminal() -> bool:
    """Whether somebody may be watching."""
    return sys.stderr.isatty()


def make_room() -> None:
    """Take the bar from the terminal, for lines and the bar of the compiler."""
    for bar in _shown:
        bar.stop()


def come_back() -> None:
    """Show the bar again."""
    for bar in _shown:
        bar.start()


@contextlib.contextmanager
def _live(bar: Any) -> Iterator[None]:
    with bar:
        _shown.append(bar)
        try:
            yield
        finally:
            _shown.remove(bar)


def _nothing(n: int = 1) -> None:
    """Where there is no terminal, or a bar already."""


@contextlib.contextmanager
def progress_bar(what: str, total: int, *, quiet: bool) -> Iterator[Advance]:
    """A bar for `total` pieces of work; yields what to call after each."""
    if quiet or _shown or not has_terminal():
        yield _nothing
        return
    from rich.console import Console
    from rich.progress import Progress

    bar = Progress(console=Console(stderr=True), transient=True)
    with _live(bar):
        task = bar.add_task(what, total=total)

        def advance(n: int = 1) -> None:
            bar.advance(task, n)

        yield advance


def counted(advance: Advance) -> Callable[[int, int], None]:
    """Moves a bar on, told how many pieces are done in all."""
    done = 0

    def count(n: int, _total: int) -> None:
        nonlocal done
        advance(n - done)
        done = n

    return count


@contextlib.contextmanager
def waiting(what: str, *, quiet: bool, more: Callable[[], str] = lambda: "") -> Iterator[None]:
    """A clock that runs while something is computed of which no one knows how long it takes.

    What `more` says is shown beside it, and asked for again and again.
    """
    if quiet or _shown or not has_terminal():
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
    clock = Progress(*columns, console=Console(stderr=True), transient=True)
    with _live(clock):
        clock.add_task(what, total=None)
        yield


@contextlib.contextmanager
def announced(*, quiet: bool = False) -> Iterator[None]:
    """Print one line when the compiler starts to work inside; loading from the cache is silent.

    The compiler asks for no time limit: while it is at work a signal breaks off. It may show a bar
    of its own: that of the command is gone meanwhile.
    """
    from numba.core import event

    class Announcement(event.Listener):  # type: ignore[misc]
        said = quiet
        depth = 0

        def on_start(self, event: Any) -> None:
            compiler_began()
            self.depth += 1
            if self.depth == 1:
                make_room()
            if not self.said:
                complain(COMPILING)
            self.said = True

        def on_end(self, event: Any) -> None:
            compiler_ended()
            self.depth -= 1
            if self.depth == 0:
                come_back()

    with event.install_listener("numba:compile", Announcement()):
        yield
