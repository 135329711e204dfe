"""Formats of files that state a problem: the one place that knows which format a file is in.

Scenarios are no other format, they are read by `maneuver_automaton.scenario`. A package may bring a
format of its own: its entry point in the group `maneuver_automaton.formats` names a `FileFormat`.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Protocol, TypeAlias

from maneuver_automaton.collision import OccupancyMap
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats import commonroad_primitives as primitives
from maneuver_automaton.formats import movingai, nav2_map
from maneuver_automaton.formats.statement import Statement, Unknown
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


class FileFormat(Protocol):
    """A format of files that state a problem, or a part of one: obstacles, start, goal."""

    @property
    def name(self) -> str:
        """What people call it."""

    def recognises(self, path: Path, document: Document | None) -> bool:
        """Whether a file is in it; the `document` is that of a YAML file, None of any other."""

    def read(self, path: Path, document: Document | None) -> tuple[Statement, ...]:
        """What a file states, problem by problem; raises InvalidScenario."""

    def writes(self, path: Path) -> bool:
        """Whether a file of this name is written in it."""

    def write(self, cells: OccupancyMap, path: Path) -> None:
        """Write a map; called only where `writes` says so."""


@dataclass(frozen=True, slots=True)
class BuiltIn:
    """A format of this package, whose module is loaded when it is asked; see `FileFormat`."""

    name: str
    endings: str
    module: str
    reads: str  # the function that does
    test: str = ""  # of a path; empty: the ending is enough
    keys: tuple[str, ...] = ()  # of a YAML file: the words of one of these
    saves: str = ""
    several: bool = False  # whether a file may hold several problems, so that --case tells which

    def recognises(self, path: Path, document: Document | None) -> bool:
        """Whether a file is in it, by its ending and its content."""
        if path.suffix.lower() not in self.endings.split():
            return False
        if self.keys:
            return document is not None and _has_keys(document, *self.keys)
        return not self.test or bool(self.call(self.test, path))

    def read(self, path: Path, document: Document | None) -> tuple[Statement, ...]:
        """What a file states, problem by problem."""
        given = (path,) if document is None else (path, document)
        statements: tuple[Statement, ...] = self.call(self.reads, *given)
        return statements

    def writes(self, path: Path) -> bool:
        """Whether a map of this name is written in it."""
        return bool(self.saves) and path.suffix.lower() in self.endings.split()

    def write(self, cells: OccupancyMap, path: Path) -> None:
        """Write a map."""
        self.call(self.saves, cells, path)

    def call(self, function: str, *given: Any) -> Any:
        """What a function of its module returns."""
        return getattr(importlib.import_module(f"{__package__}.{self.module}"), function)(*given)


YAML, CSV = " ".join(YAML_ENDINGS), ".csv"
BUILT_IN = (  # of one ending: the last is read where none recognises the file, and says why
    BuiltIn("table of poses", CSV, "poses_csv", "read_poses", "is_poses"),
    BuiltIn("TPCAP", CSV, "tpcap", "read_tpcap", "is_tpcap"),
    BuiltIn("MovingAI", ".map", "movingai", "read_movingai_map", saves="save_movingai_map"),
    BuiltIn("MovingAI", ".scen", "movingai", "read_movingai_scenario", several=True),
    BuiltIn("SBPL", ".cfg .env .nav2d .nav3d", "sbpl_cfg", "read_sbpl", "is_sbpl"),
    BuiltIn("CommonRoad", ".xml", "commonroad", "read_commonroad", "is_commonroad", several=True),
    BuiltIn("dynobench", YAML, "dynobench", "read_dynobench", keys=("robots",)),
    BuiltIn("CL-CBS", YAML, "cl_cbs", "read_cl_cbs", keys=("agents map",)),
    BuiltIn(
        "Nav2",
        YAML,
        "nav2_map",
        "read_nav2_map",
        keys=("image", "resolution"),
        saves="save_nav2_map",
    ),
)
OF_DYNOBENCH = "is a model or a solution of dynobench, need the problem (environment, robots)"
BELONG: Mapping[str, str] = {  # to a problem that they do not state: files with these keys
    "dynamics": OF_DYNOBENCH,
    "states actions": OF_DYNOBENCH,
    "statistics schedule": "is a solution of CL-CBS, need the problem (agents, map)",
}


def is_road(path: Path) -> bool:
    """Whether a file is one of CommonRoad, by its ending."""
    return path.suffix.lower() == ".xml"


@functools.cache
def from_outside() -> tuple[FileFormat, ...]:
    """The formats that other packages bring, by the names of their entry points."""
    found = []
    for entry in sorted(metadata.entry_points(group=GROUP), key=lambda one: one.name):
        try:
            found.append(entry.load())
        except Exception as error:
            raise InvalidScenario(
                f"format {entry.name!r}: {entry.value} cannot be loaded: {error}"
            ) from error
    return tuple(found)


def format_of(path: Path, document: Document | None = None) -> FileFormat | None:
    """The format of a file, those of other packages first; None of scenarios and the unknown."""
    ending = path.suffix.lower()
    if document is not None and isinstance(document.value, dict) and "schema" in document.value:
        return None
    if document is None and ending in YAML_ENDINGS:
        return None  # not parsed yet
    for one in from_outside():
        if one.recognises(path, document):
            return one
    said = NOT_READ.get(ending)
    if ending == ".xml":
        with contextlib.suppress(OSError, ValueError):  # told by who reads it
            said = NOT_READ[".mprim"] if primitives.is_commonroad_primitives(path) else None
    if said:
        raise InvalidScenario(f"{path}: {said}")
    of_it = [one for one in BUILT_IN if ending in one.endings.split()]
    if document is None and of_it:
        return next((one for one in of_it[:-1] if one.recognises(path, None)), of_it[-1])
    return next((one for one in of_it if one.recognises(path, document)), None)


def reader_of(path: Path) -> Reader | None:
    """What reads a file that is no YAML; None for scenarios and all that is YAML."""
    found = format_of(path)
    return None if found is None else functools.partial(found.read, document=None)


def yaml_statements(document: Document, path: Path) -> tuple[Statement, ...] | None:
    """What a YAML file of another format states; None for a scenario."""
    if (found := format_of(path, document)) is not None:
        return found.read(path, document)
    if said := belongs_to(document):
        raise document.error((), said)
    return None


def belongs_to(document: Document) -> str:
    """Why a YAML file states no problem, if it belongs to one; empty if it does not."""
    return next((said for keys, said in BELONG.items() if _has_keys(document, keys)), "")


def _has_keys(document: Document, *either: str) -> bool:
    """Whether a YAML file is no scenario, and has all keys of one of these lists of words."""
    keys = document.value.keys() if isinstance(document.value, dict) else set()
    return "schema" not in keys and any(set(words.split()) <= keys for words in either)


def map_writer_of(path: Path) -> FileFormat | None:
    """The format in which a map of this name is written; None if there is none."""
    return next((one for one in (*BUILT_IN, *from_outside()) if one.writes(path)), None)


def states_a_problem(path: Path, document: Document | None) -> bool:
    """Whether a file of a folder is a problem by itself; a damaged one is, which then tells why."""
    if path.suffix.lower() in YAML_ENDINGS:
        return document is None or not belongs_to(document)
    try:
        return any(one.recognises(path, None) for one in (*from_outside(), *BUILT_IN))
    except (OSError, InvalidScenario):
        return True


def holds_several(path: Path) -> bool:
    """Whether a file that is no YAML may hold several problems, for one of which --case asks."""
    ending = path.suffix.lower()
    return any(one.several and ending in one.endings.split() for one in BUILT_IN)


def load_map(path: Path | str, *, unknown: Unknown = "blocked") -> OccupancyMap:
    """The occupancy map of a file: of Nav2 and ROS (.yaml beside an image), or MovingAI (.map).

    A picture alone states no size of its pixels: `OccupancyMap.of_picture` takes both.

    Parameters
    ----------
    path : Path or str
        The file.
    unknown : str
        How to read the cells of a Nav2 map of which it knows nothing: "blocked" or "free".

    Raises
    ------
    InvalidScenario
        If the file or its image cannot be used: file, line, field, value, what would be right.
    """
    path = Path(path)
    if unknown not in ("blocked", "free"):
        raise InvalidScenario(f"{path}: unknown: got {unknown!r}, need 'blocked' or 'free'")
    if path.suffix.lower() in YAML_ENDINGS:
        return nav2_map.load_nav2_map(path, unknown=unknown)
    if path.suffix.lower() == ".map":
        return movingai.load_movingai_map(path)
    raise InvalidScenario(
        f"{path}: is no map, need a file of Nav2 ({', '.join(YAML_ENDINGS)}) or MovingAI "
        "(.map); OccupancyMap.of_picture reads an image"
    )
