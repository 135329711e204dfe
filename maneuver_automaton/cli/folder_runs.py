"""The files of a folder, one by one or several at a time; a run that was killed goes on."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

from maneuver_automaton._files import journal, journal_lines
from maneuver_automaton._interrupts import stopped
from maneuver_automaton._parallel import check_scheduler, in_parallel
from maneuver_automaton.cli.guard import FOUND, NO_PLAN, complain
from maneuver_automaton.cli.inputs import Parts, writing
from maneuver_automaton.cli.terminal import console, progress_bar, say, table
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.movingai import map_beside
from maneuver_automaton.formats.registry import (
    YAML_ENDINGS,
    format_of,
    holds_several,
    states_a_problem,
)
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import Document, parse
from maneuver_automaton.recording.values import shown

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
    one: Callable[[Problem], tuple[Path, Row]],
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
    rows = {
        path: row
        for path, row in _kept(out, keys).items()
        if any((out / path.stem / name).exists() for name in FINISHED)
    }
    left = [problem for problem in problems if problem[0] not in rows]
    jobs = min(jobs, max(len(left), 1))
    with _as_option():
        results = in_parallel(
            one, left, jobs=jobs, scheduler=scheduler, order="as done", ends_early=True
        )
    if jobs > 1 and scheduler is None:
        ready()
    if rows and not quiet:
        say(f"{len(rows)} of {len(problems)} were done by a run before")
    with writing(out):
        kept = contextlib.ExitStack()
        write = kept.enter_context(journal(out / JOURNAL))
    with progress_bar("files", len(left), quiet=quiet) as advance, kept:
        for path, row in results:
            rows[path] = row
            if row.code <= NO_PLAN and not stopped():
                write([json.dumps({"key": keys[path], **asdict(row)})])
            if not quiet and len(problems) > 1:
                cost = "" if row.cost is None else f", cost {row.cost:.6g}"
                say(f"{row.name}: {row.status}{cost}")
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


def _key(path: Path, parts: Parts, options: str) -> str:
    from maneuver_automaton import __version__

    digest = hashlib.sha256(repr((__version__, options, parts)).encode())
    for file in (path, parts.beside):
        with contextlib.suppress(OSError):  # told when it is done
            digest.update(b"\0" if file is None else file.read_bytes())
    return digest.hexdigest()


def _kept(out: Path, keys: dict[Path, str]) -> dict[Path, Row]:
    """Rows of the journal that are still of use; a line cut off by a kill does not count."""
    known: dict[str, Row] = {}
    for line in journal_lines(out / JOURNAL):
        with contextlib.suppress(ValueError, TypeError, KeyError):
            entry = json.loads(line)
            key = entry.pop("key")
            known[key] = Row(**entry)
    return {path: known[key] for path, key in keys.items() if key in known}


def _print_rows(rows: Sequence[Row]) -> None:
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


def problems_in(folder: Path, parts: Parts) -> list[tuple[Path, Parts]]:
    """Every file of a folder that states a problem, with the parts that it has a use for.

    Left out is what belongs to another file: images, maps that a scenario or a list of queries
    names, models, outlines of robots, the scenario of --with. A scenario states all of its
    problem, and only formats with several problems need to know which one.
    """
    documents: dict[Path, Document | None] = {}  # None: it cannot be read, told when it is planned
    for path in (one for one in _files(folder) if one.suffix.lower() in YAML_ENDINGS):
        try:
            documents[path] = parse(read_text(path), name=str(path))
        except InvalidScenario:
            documents[path] = None
    used = set(_used(folder, documents))
    if parts.beside is not None:
        used.add(parts.beside.resolve())
    found = [
        (path, _parts_for(path, documents.get(path), parts))
        for path in _files(folder)
        if path.resolve() not in used and states_a_problem(path, documents.get(path))
    ]
    if not found:
        raise InvalidScenario(
            f"{folder}: holds no file that states a problem, need a scenario (.yaml, .yml) or "
            "another format that is read"
        )
    seen: dict[str, Path] = {}
    for path, _ in found:
        if path.stem in seen:
            raise InvalidScenario(
                f"{path}: has the same name as {seen[path.stem].name}, need another one"
            )
        seen[path.stem] = path
    return found


def _files(folder: Path) -> list[Path]:
    try:
        inside = sorted(folder.iterdir())
    except OSError as error:
        raise InvalidScenario(f"{folder}: cannot be read: {error.strerror}") from error
    return [path for path in inside if path.is_file() and not path.name.startswith(".")]


def _used(folder: Path, documents: dict[Path, Document | None]) -> Iterator[Path]:
    for path in _files(folder):
        if path.suffix.lower() == ".scen":
            with contextlib.suppress(InvalidScenario):  # told when the file is planned
                yield map_beside(path).resolve()
        document = documents.get(path)
        for obstacle in _obstacles(document.value if document is not None else None):
            name = obstacle.get("map") if isinstance(obstacle, dict) else None
            if isinstance(name, str) and "\0" not in name:
                yield (folder / name).resolve()


def _obstacles(value: Any) -> Iterator[Any]:
    """What a scenario lists as obstacles, at the top and of any of several vehicles."""
    vehicles = value.get("vehicles") if isinstance(value, dict) else None
    for part in (value, *(vehicles if isinstance(vehicles, list) else ())):
        listed = part.get("obstacles") if isinstance(part, dict) else None
        yield from listed if isinstance(listed, list) else ()


def _parts_for(path: Path, document: Document | None, parts: Parts) -> Parts:
    if path.suffix.lower() in YAML_ENDINGS:
        if document is None or format_of(path, document) is None:
            return Parts(model=parts.model)
        return replace(parts, case=None)
    return parts if holds_several(path) else replace(parts, case=None)
