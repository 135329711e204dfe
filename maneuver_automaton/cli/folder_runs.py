"""The files of a folder, one by one or several at a time; a run that was killed goes on."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeAlias

from maneuver_automaton._interrupts import stopped
from maneuver_automaton._parallel import check_scheduler, in_parallel
from maneuver_automaton.cli.guard import FOUND, NO_PLAN, complain
from maneuver_automaton.cli.inputs import Parts, not_written
from maneuver_automaton.cli.progress import progress_bar
from maneuver_automaton.errors import InvalidScenario

JOURNAL = ".journal"  # in the folder of the results, until all is done
FINISHED = ("plan.json", "closed_loop.json", "statistics.json")

Problem: TypeAlias = tuple[Path, Parts]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """How one file of a folder ended, for the table at the end."""

    name: str
    code: int
    status: str
    reason: str = ""
    cost: float | None = None
    duration: float | None = None
    clearance: float | None = None
    first_plan: float | None = None


def run_folder(
    one: Callable[[Problem], Row],
    problems: Sequence[Problem],
    out: Path,
    *,
    options: str,
    jobs: int,
    scheduler: str | None,
    quiet: bool,
    ready: Callable[[], None],
) -> int:
    """Do `one` of every problem, print each result as it comes and a table; the exit code.

    What a run before had finished when it was killed is not done again: its journal, which is
    removed at the end, knows it by its file, by --with and by the `options`. Processes begin once
    all is `ready`.
    """
    keys = {path: _key(path, parts, options) for path, parts in problems}
    rows = {path: row for path, row in _kept(out, keys).items() if _is_written(out, path)}
    left = [problem for problem in problems if problem[0] not in rows]
    jobs = min(jobs, max(len(left), 1))
    results = _results(one, left, jobs=jobs, scheduler=scheduler)
    if jobs > 1 and scheduler is None:
        ready()
    if rows and not quiet:
        _say(f"{len(rows)} of {len(problems)} were done by a run before")
    with progress_bar("files", len(left), quiet=quiet) as advance, _journal(out) as write:
        for path, row in results:
            rows[path] = row
            if row.code <= NO_PLAN and not stopped():
                write({"key": keys[path], **asdict(row)})
            if not quiet and len(problems) > 1:
                _say(_line(row))
            advance()
    if not stopped():
        (out / JOURNAL).unlink(missing_ok=True)
    ordered = [rows[path] for path, _ in problems if path in rows]
    for row in ordered:
        for line in row.reason.splitlines() if row.code != FOUND else ():
            complain(line)
    if not quiet:
        _print_rows(ordered)
    return max((row.code for row in ordered), default=NO_PLAN)


def check_address(scheduler: str | None) -> None:
    """Refuse an address of --dask at which nothing answers, before any file is read."""
    if scheduler is not None:
        with _as_option():
            check_scheduler(scheduler)


@contextlib.contextmanager
def _as_option() -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise InvalidScenario(f"--dask: {str(error).removeprefix('scheduler: ')}") from error


@dataclass(frozen=True, slots=True)
class _Named:
    """A function whose result comes with the file that it is of."""

    one: Callable[[Problem], Row]

    def __call__(self, problem: Problem) -> tuple[Path, Row]:
        return problem[0], self.one(problem)


def _results(
    one: Callable[[Problem], Row], left: Sequence[Problem], *, jobs: int, scheduler: str | None
) -> Iterator[tuple[Path, Row]]:
    with _as_option():
        return in_parallel(
            _Named(one), left, jobs=jobs, scheduler=scheduler, order="as done", ends_early=True
        )


def _key(path: Path, parts: Parts, options: str) -> str:
    """Hash of what a result is made from."""
    from maneuver_automaton import __version__

    digest = hashlib.sha256(repr((__version__, options, parts)).encode())
    for file in (path, parts.beside):
        with contextlib.suppress(OSError):  # told when it is done
            digest.update(b"\0" if file is None else file.read_bytes())
    return digest.hexdigest()


def _kept(out: Path, keys: dict[Path, str]) -> dict[Path, Row]:
    """Rows of the journal that are still of use; a line cut off by a kill does not count."""
    try:
        lines = (out / JOURNAL).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return {}
    known: dict[str, Row] = {}
    for line in lines:
        with contextlib.suppress(ValueError, TypeError, KeyError):
            entry = json.loads(line)
            key = entry.pop("key")
            known[key] = Row(**entry)
    return {path: known[key] for path, key in keys.items() if key in known}


def _is_written(out: Path, path: Path) -> bool:
    return any((out / path.stem / name).exists() for name in FINISHED)


@contextlib.contextmanager
def _journal(out: Path) -> Iterator[Callable[[dict[str, Any]], None]]:
    """What writes a line to the journal and sees to it that it is on the disk."""
    try:
        stream = (out / JOURNAL).open("a", encoding="utf-8")
    except OSError as error:
        raise not_written(out / JOURNAL, error) from error

    def write(entry: dict[str, Any]) -> None:
        stream.write(json.dumps(entry) + "\n")
        stream.flush()
        os.fsync(stream.fileno())

    with stream:
        yield write


def _say(line: str) -> None:
    from maneuver_automaton.cli.tables import console

    console().print(line, soft_wrap=True, markup=False)


def _line(row: Row) -> str:
    cost = "" if row.cost is None else f", cost {row.cost:.6g}"
    return f"{row.name}: {row.status}{cost}"


def _print_rows(rows: Sequence[Row]) -> None:
    from maneuver_automaton.cli.tables import console, table

    def shown(value: float | None, digits: int) -> str:
        return "" if value is None else f"{value:.{digits}g}"

    cells = [
        [
            row.name,
            row.status,
            shown(row.cost, 6),
            shown(row.duration, 6),
            shown(row.clearance, 2),
            shown(row.first_plan, 2),
        ]
        for row in rows
    ]
    columns = ["file", "status", "cost", "duration [s]", "clearance [m]", "first plan [s]"]
    console().print(table("", columns, cells, numbers=(2, 3, 4, 5)))
