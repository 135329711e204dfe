"""What a person sees on the terminal: tables, facts, and a bar or a clock while they wait."""

from __future__ import annotations

import contextlib
import os
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

from maneuver_automaton import recording
from maneuver_automaton._interrupts import compiler_watched
from maneuver_automaton.cli.guard import complain
from maneuver_automaton.recording import Fact

FACTS = 18  # columns before what is said of a fact
MOST_ROWS = 60  # of a table of steps; the file has all of them
WIDE = 160  # columns where the output goes to no terminal, and COLUMNS does not say


def console() -> Any:
    """Standard output, without markup: names are printed as they are."""
    from rich.console import Console

    return Console(
        file=sys.stdout,
        width=None if sys.stdout.isatty() or "COLUMNS" in os.environ else WIDE,
        markup=False,
        emoji=False,
        highlight=False,
    )


def table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    numbers: Sequence[int] = (),
) -> Any:
    """Rows under `columns`; those in `numbers` are aligned to the right."""
    from rich import box
    from rich.table import Table

    made = Table(
        title=title or None,
        box=box.SIMPLE_HEAD,
        title_justify="left",
        title_style="bold",
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for k, column in enumerate(columns):
        side: Any = "right" if k in numbers else "left"
        made.add_column(column, justify=side, overflow="fold", no_wrap=k in numbers)
    for row in rows:
        made.add_row(*row)
    return made


def say(line: str) -> None:
    """Print a line as it is, however long."""
    console().print(line, soft_wrap=True)


def print_written(*paths: Path) -> None:
    """Say which files were written."""
    say(f"wrote {' and '.join(map(str, paths))}")


def print_result(name: str, tables: Sequence[recording.Table], facts: Iterable[Fact]) -> None:
    """The tables of a result under its `name`, its facts, and tables that have a title."""
    out, title = console(), name
    for one in tables:
        if one.title:
            continue
        if one.rows:
            out.print(table(title, one.columns, shortened(one.rows), numbers=one.numbers))
            title = ""
        elif one.instead:
            out.print(f"{title}\n\n  {one.instead}\n")
            title = ""
    if title:
        out.print(title, soft_wrap=True)
    for fact in facts:
        if said := fact.in_full:
            line = f"  {fact.label + ':':<{FACTS - 3}} {said}"
            wrapped = textwrap.wrap(
                line, out.width, subsequent_indent=" " * FACTS,
                break_long_words=False, break_on_hyphens=False,
            )  # fmt: skip
            out.print("\n".join(wrapped), soft_wrap=True)
    for one in tables:
        if one.title:
            out.print()
            out.print(table(one.title, one.columns, one.rows, numbers=one.numbers))


def shortened(rows: list[list[str]]) -> list[list[str]]:
    """The first and the last rows of a table that has many."""
    if len(rows) <= MOST_ROWS:
        return rows
    return [*rows[: MOST_ROWS - 5], ["...", *[""] * (len(rows[0]) - 1)], *rows[-4:]]


_shown: list[Any] = []  # what rich shows on the terminal: one bar at most
COMPILING = "compiling kernels, once, at their first use: this may take a minute ..."


class Advance(Protocol):
    """Function to call after each piece of work, or after several."""

    def __call__(self, n: int = 1) -> None:
        """Move the bar on by `n` pieces."""
        ...


def has_terminal() -> bool:
    """Whether somebody may be watching."""
    return sys.stderr.isatty()


@contextlib.contextmanager
def _live(bar: Any) -> Iterator[None]:
    with bar:
        _shown.append(bar)
        try:
            yield
        finally:
            _shown.remove(bar)


@contextlib.contextmanager
def progress_bar(what: str, total: int, *, quiet: bool) -> Iterator[Advance]:
    """A bar for `total` pieces of work; yields what to call after each."""
    if quiet or _shown or not has_terminal():
        yield lambda n=1: None
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
    """A clock while something is computed; what `more` says now is shown instead of `what`."""
    if quiet or _shown or not has_terminal():
        yield
        return
    from rich.console import Console
    from rich.progress import Progress, ProgressColumn, SpinnerColumn, Task, TimeElapsedColumn
    from rich.text import Text

    class More(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(more() or task.description, no_wrap=True, overflow="ellipsis")

    shown = SpinnerColumn(), TimeElapsedColumn(), More()
    clock = Progress(*shown, console=Console(stderr=True), transient=True)
    with _live(clock):
        clock.add_task(what, total=None)
        yield


@contextlib.contextmanager
def announced(*, quiet: bool = False) -> Iterator[None]:
    """Print one line when the compiler starts to work inside; loading from the cache is silent.

    The compiler asks for no time limit: while it is at work a signal breaks off. It may show a bar
    of its own: that of the command is gone meanwhile.
    """
    said, depth = quiet, 0

    def watch(begins: bool) -> None:
        nonlocal said, depth
        depth += 1 if begins else -1
        for bar in _shown if depth == begins else ():
            bar.stop() if begins else bar.start()
        if begins and not said:
            complain(COMPILING)
            said = True

    with compiler_watched(watch):
        yield
