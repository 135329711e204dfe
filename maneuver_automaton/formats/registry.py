"""Formats of files that state a problem: the one place that knows which format a file is in.

Scenarios are no other format, they are read by `maneuver_automaton.scenario`. A package may bring a
format of its own: its entry point in the group `maneuver_automaton.formats` names a `Format`.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Protocol, TypeAlias

from maneuver_automaton.collision import OccupancyMap
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.statement import Statement
from maneuver_automaton.formats.yaml_source import Document

GROUP = "maneuver_automaton.formats"  # of entry points
YAML_ENDINGS = (".yaml", ".yml")
PRIMITIVES = "motion primitives, need a file that states a problem (see automaton show, convert)"
NOT_READ: Mapping[str, str] = {
    ".mprim": f"holds {PRIMITIVES}",
    ".pb": "is a scenario of CommonRoad as protobuf, need it as XML (commonroad-io writes both)",
    ".pgm": "is the image of a map, need the YAML file that states its resolution",
}

Reader: TypeAlias = Callable[[Path], tuple[Statement, ...]]


class Format(Protocol):
    """A format of files that state a problem, or a part of one: obstacles, start, goal."""

    @property
    def name(self) -> str:
        """What people call it."""

    def recognises(self, path: Path, document: Document | None) -> bool:
        """Whether a file is in it; the `document` is that of a YAML file, None of any other."""

    def read(self, path: Path, document: Document | None) -> tuple[Statement, ...]:
        """What a file states, problem by problem.

        Raises
        ------
        InvalidScenario
            If it cannot be used: one line with file, place, value met, what would be right.
        """

    def writes(self, path: Path) -> bool:
        """Whether a file of this name is written in it."""

    def write(self, cells: OccupancyMap, path: Path) -> None:
        """Write a map; called only where `writes` says so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltIn:
    """A format of this package, whose module is loaded when it is asked; see `Format`."""

    name: str
    endings: tuple[str, ...]
    module: str
    reads: str  # the function that does
    test: str = ""  # of a path, or of a YAML document; empty: the ending is enough
    saves: str = ""
    stands_alone: bool = True  # in a folder, and belongs to no other file
    counts: str = ""  # how many problems a path holds, where they may be several

    def recognises(self, path: Path, document: Document | None) -> bool:
        """Whether a file is in it, by its ending and its content."""
        if path.suffix.lower() not in self.endings:
            return False
        return not self.test or bool(self._call(self.test, path if document is None else document))

    def read(self, path: Path, document: Document | None) -> tuple[Statement, ...]:
        """What a file states, problem by problem."""
        given = (path,) if document is None else (path, document)
        statements: tuple[Statement, ...] = self._call(self.reads, *given)
        return statements

    def writes(self, path: Path) -> bool:
        """Whether a map of this name is written in it."""
        return bool(self.saves) and path.suffix.lower() in self.endings

    def write(self, cells: OccupancyMap, path: Path) -> None:
        """Write a map."""
        self._call(self.saves, cells, path)

    def _call(self, function: str, *given: Any) -> Any:
        module = importlib.import_module(f"{__package__}.{self.module}")
        return getattr(module, function)(*given)


BUILT_IN = (  # of one ending: the last is read where none recognises the file, and says why
    BuiltIn(
        name="Bench-MR",
        endings=(".csv",),
        module="benchmr_svg",
        reads="read_benchmr_queries",
        test="is_queries",
        stands_alone=False,
    ),
    BuiltIn(
        name="poses", endings=(".csv",), module="poses_csv", reads="read_poses", test="is_poses"
    ),
    BuiltIn(name="TPCAP", endings=(".csv",), module="tpcap", reads="read_tpcap", test="is_tpcap"),
    BuiltIn(
        name="MovingAI",
        endings=(".map",),
        module="movingai",
        reads="read_movingai_map",
        saves="save_movingai_map",
    ),
    BuiltIn(
        name="MovingAI",
        endings=(".scen",),
        module="movingai",
        reads="read_movingai_scenario",
        counts="several",
    ),
    BuiltIn(
        name="SBPL",
        endings=(".cfg", ".env", ".nav2d", ".nav3d"),
        module="sbpl_cfg",
        reads="read_sbpl",
        test="is_sbpl",
    ),
    BuiltIn(
        name="CommonRoad",
        endings=(".xml",),
        module="commonroad",
        reads="read_commonroad",
        test="is_commonroad",
        counts="several",
    ),
    BuiltIn(
        name="Bench-MR",
        endings=(".svg",),
        module="benchmr_svg",
        reads="read_benchmr",
        test="n_queries",
        counts="n_queries",
    ),
    BuiltIn(
        name="Bench-MR",
        endings=(".png", ".bmp"),
        module="benchmr_image",
        reads="read_benchmr_image",
        stands_alone=False,
    ),
    BuiltIn(
        name="dynobench",
        endings=YAML_ENDINGS,
        module="dynobench",
        reads="read_dynobench",
        test="is_dynobench",
    ),
    BuiltIn(
        name="CL-CBS",
        endings=YAML_ENDINGS,
        module="cl_cbs",
        reads="read_cl_cbs",
        test="is_cl_cbs",
    ),
    BuiltIn(
        name="Nav2",
        endings=YAML_ENDINGS,
        module="nav2_map",
        reads="read_nav2_map",
        test="is_nav2_map",
        saves="save_nav2_map",
    ),
)


@functools.cache
def from_outside() -> tuple[Format, ...]:
    """The formats that other packages bring, by the names of their entry points.

    Raises
    ------
    InvalidScenario
        If one cannot be loaded.
    """
    found = []
    for entry in sorted(metadata.entry_points(group=GROUP), key=lambda one: one.name):
        try:
            found.append(entry.load())
        except Exception as error:
            raise InvalidScenario(
                f"format {entry.name!r}: {entry.value} cannot be loaded: {error}"
            ) from error
    return tuple(found)


def format_of(path: Path, document: Document | None = None) -> Format | None:
    """The format of a file; None of a scenario, and of what nothing recognises.

    Those of other packages are asked first, and all only of files that are no scenario.

    Raises
    ------
    InvalidScenario
        If the ending is that of a format that is not read.
    """
    ending = path.suffix.lower()
    if document is not None and isinstance(document.value, dict) and "schema" in document.value:
        return None
    if document is None and ending in YAML_ENDINGS:
        return None  # not parsed yet
    for one in from_outside():
        if one.recognises(path, document):
            return one
    if ending == ".xml" and _holds_primitives(path):
        raise InvalidScenario(f"{path}: holds {PRIMITIVES}")
    if said := NOT_READ.get(ending):
        raise InvalidScenario(f"{path}: {said}")
    of_it = [one for one in BUILT_IN if ending in one.endings]
    if document is None and of_it:
        return next((one for one in of_it[:-1] if one.recognises(path, None)), of_it[-1])
    return next((one for one in of_it if one.recognises(path, document)), None)


def reader_of(path: Path) -> Reader | None:
    """What reads a file that is no YAML; None for scenarios and all that is YAML.

    Raises
    ------
    InvalidScenario
        If the ending is that of a format that is not read.
    """
    found = format_of(path)
    return None if found is None else functools.partial(found.read, document=None)


def yaml_statements(document: Document, path: Path) -> tuple[Statement, ...] | None:
    """What a YAML file of another format states; None for a scenario.

    Raises
    ------
    InvalidScenario
        If the file belongs to a problem and states none, or cannot be used.
    """
    if (found := format_of(path, document)) is not None:
        return found.read(path, document)
    if said := belongs_to(document):
        raise document.error((), said)
    return None


def belongs_to(document: Document) -> str:
    """Why a YAML file states no problem, if it belongs to one; empty if it does not."""
    from maneuver_automaton.formats import cl_cbs, dynobench

    if dynobench.belongs_to_dynobench(document):
        return "is a model or a solution of dynobench, need the problem (environment, robots)"
    if cl_cbs.belongs_to_cl_cbs(document):
        return "is a solution of CL-CBS, need the problem (agents, map)"
    return ""


def map_writer_of(path: Path) -> Format | None:
    """The format in which a map of this name is written; None if there is none."""
    return next((one for one in (*BUILT_IN, *from_outside()) if one.writes(path)), None)


def states_a_problem(path: Path, document: Document | None) -> bool:
    """Whether a file of a folder is a problem by itself; a damaged one is, which tells why.

    The `document` is that of a YAML file; None of one that cannot be read.
    """
    ending = path.suffix.lower()
    if ending in YAML_ENDINGS:
        return document is None or not belongs_to(document)
    try:
        if any(one.recognises(path, None) for one in from_outside()):
            return True
        return any(one.stands_alone and one.recognises(path, None) for one in BUILT_IN)
    except (OSError, InvalidScenario):
        return True


def holds_several(path: Path) -> bool:
    """Whether a file that is no YAML may hold several problems, for one of which --case asks."""
    of_it = [one for one in BUILT_IN if path.suffix.lower() in one.endings and one.counts]
    if not of_it or of_it[-1].counts == "several":
        return bool(of_it)
    try:
        return int(of_it[-1]._call(of_it[-1].counts, path)) > 1
    except InvalidScenario:
        return False


def _holds_primitives(path: Path) -> bool:
    """Whether an XML file holds motion primitives of CommonRoad; not if it cannot be read."""
    from maneuver_automaton.formats.commonroad_primitives import is_commonroad_primitives

    try:
        return is_commonroad_primitives(path)
    except (OSError, ValueError):
        return False
