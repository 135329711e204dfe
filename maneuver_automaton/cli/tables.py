"""What the commands print: tables, and a line for each fact."""

from __future__ import annotations

import os
import sys
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path

from rich import box
from rich.console import Console, JustifyMethod
from rich.table import Table
from rich.text import Text

from maneuver_automaton import recording
from maneuver_automaton.recording import Fact

FACTS = 18  # columns before what is said of a fact
MOST_ROWS = 60  # of a table of steps; the file has all of them
WIDE = 160  # columns where the output goes to no terminal, and COLUMNS does not say


def console() -> Console:
    """Standard output, without markup: names are printed as they are."""
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
) -> Table:
    """Rows under `columns`; those in `numbers` are aligned to the right."""
    made = Table(
        title=title or None,
        box=box.SIMPLE_HEAD,
        title_justify="left",
        title_style="bold",
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for k, column in enumerate(columns):
        number = k in numbers
        justify: JustifyMethod = "right" if number else "left"
        made.add_column(column, justify=justify, overflow="fold", no_wrap=number)
    for row in rows:
        made.add_row(*(Text(cell) for cell in row))
    return made


def print_written(*paths: Path) -> None:
    """Say which files were written."""
    console().print(f"wrote {' and '.join(map(str, paths))}", soft_wrap=True)


def print_facts(facts: Iterable[Fact]) -> None:
    """A line for each fact that is known, wrapped where the terminal ends."""
    out = console()
    for one in facts:
        if said := one.in_full:
            line = f"  {one.label + ':':<{FACTS - 3}} {said}"
            wrapped = textwrap.wrap(
                line, out.width, subsequent_indent=" " * FACTS,
                break_long_words=False, break_on_hyphens=False,
            )  # fmt: skip
            out.print(Text("\n".join(wrapped)), soft_wrap=True)


def print_result(name: str, tables: Sequence[recording.Table], facts: Iterable[Fact]) -> None:
    """The tables of a result under its `name`, its facts, and tables that have a title."""
    out, title = console(), name
    for one in tables:
        if one.title:
            continue
        if one.rows:
            rows = shortened(one.rows)
            out.print(table(title, one.columns, rows, numbers=one.numbers))
            title = ""
        elif one.instead:
            out.print(Text(f"{title}\n\n  {one.instead}\n"))
            title = ""
    if title:
        out.print(Text(title), soft_wrap=True)
    print_facts(facts)
    for one in tables:
        if one.title:
            out.print()
            out.print(table(one.title, one.columns, one.rows, numbers=one.numbers))


def shortened(rows: list[list[str]]) -> list[list[str]]:
    """The first and the last rows of a table that has many."""
    if len(rows) <= MOST_ROWS:
        return rows
    gap = ["...", *[""] * (len(rows[0]) - 1)]
    return [*rows[: MOST_ROWS - 5], gap, *rows[-4:]]
