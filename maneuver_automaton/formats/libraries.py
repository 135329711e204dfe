"""Files of motion primitives in other formats, as automata: which format a file is in, and back."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import save_library
from maneuver_automaton.errors import InvalidLibrary, InvalidScenario
from maneuver_automaton.formats import aroc, commonroad_primitives, nav2_lattice, sbpl_mprim
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.models import AcceleratingCar, Model

MPRIM, XML, JSON, NAV2_JSON = ".mprim", ".xml", ".json", ".nav2.json"
MOST_LIBRARY_BYTES = 500_000_000

File: TypeAlias = (
    sbpl_mprim.MprimFile
    | nav2_lattice.Nav2File
    | commonroad_primitives.RoadPrimitives
    | tuple[aroc.ArocPrimitive, ...]
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PrimitivesRead:
    """A file of primitives, and what it is as an automaton."""

    kind: str  # SBPL, Nav2, CommonRoad, AROC
    file: File  # as it stands there
    automaton: Automaton
    remark: str  # where the automaton is not what the file says; empty if it is


def read_primitives(path: Path, model: Model | None = None) -> PrimitivesRead | None:
    """What a file of primitives holds, or None; a `model` of AROC's kind is taken, not fitted."""
    try:
        return _read(path, model)
    except (InvalidScenario, InvalidLibrary):
        raise
    except ValueError as error:
        raise InvalidLibrary(f"{path}: {error}") from error


def _read(path: Path, model: Model | None) -> PrimitivesRead | None:
    """As `read_primitives`; what makes no motion raises a ValueError."""
    ending, remark = path.suffix.lower(), ""
    file: File
    if aroc.export_at(path) is not None:
        kind, file = "AROC", aroc.read_aroc(path)
        folder = path.parent if path.name == aroc.LIST else path
        own = model if isinstance(model, AcceleratingCar) else None
        automaton = aroc.automaton_of_aroc(file, model=own, name=folder.resolve().stem)
        _, remark = aroc.deviation_of(file, automaton)
    elif path.is_dir() or not path.exists():
        return None
    elif ending == MPRIM:
        kind, file = "SBPL", sbpl_mprim.read_mprim(path)
        position, heading = sbpl_mprim.end_gap(file)
        automaton = sbpl_mprim.automaton_of_mprim(file, name=path.stem)
        remark = (
            f"last poses were moved by up to {position:.2g} m and {heading:.2g} rad onto the "
            "middle of their cells and their headings"
        )
    elif ending == XML and commonroad_primitives.is_commonroad_primitives(path):
        kind, file = "CommonRoad", commonroad_primitives.read_commonroad_primitives(path)
        automaton = commonroad_primitives.automaton_of_commonroad_primitives(file, name=path.stem)
        _, remark = commonroad_primitives.deviation_of(file, automaton)
    elif ending == JSON and _is_nav2(path):
        kind, file = "Nav2", nav2_lattice.read_nav2_lattice(path)
        automaton = nav2_lattice.automaton_of_nav2_lattice(file, name=path.name.split(".json")[0])
    else:
        return None
    return PrimitivesRead(kind=kind, file=file, automaton=automaton, remark=remark)


# Of each ending that is written: the class of its files, what makes one of an automaton, and saves.
WRITTEN: Mapping[str, tuple[type, Callable[[Automaton], Any], Callable[[Any, Path], None]]] = {
    MPRIM: (sbpl_mprim.MprimFile, sbpl_mprim.mprim_of_automaton, sbpl_mprim.save_mprim),
    XML: (
        commonroad_primitives.RoadPrimitives,
        commonroad_primitives.commonroad_primitives_of_automaton,
        commonroad_primitives.save_commonroad_primitives,
    ),
    NAV2_JSON: (dict, nav2_lattice.nav2_lattice_of_automaton, nav2_lattice.save_nav2_lattice),
}


def writer_of(target: Path) -> Callable[[Automaton, Path], None] | None:
    """What writes an automaton to a file with this ending; of any other .json, a library."""
    name = target.name.lower()
    for ending, (_, file_of, save) in WRITTEN.items():
        if name.endswith(ending):
            return lambda automaton, path: save(file_of(automaton), path)
    return save_library if name.endswith(JSON) else None


def write_again(read: PrimitivesRead, target: Path) -> bool:
    """Write a file of primitives in its own format, if `target` asks for that, to the last bit."""
    name = target.name.lower()
    for ending, (kind, _, save) in WRITTEN.items():
        if isinstance(read.file, kind) and name.endswith(ending):
            save(read.file, target)
            return True
    return False


def _is_nav2(path: Path) -> bool:
    """Whether a JSON file is a lattice of Nav2; a text that is no JSON is left to its reader."""
    try:
        document = json.loads(read_text(path, most=MOST_LIBRARY_BYTES, what="a library"))
    except (ValueError, RecursionError, InvalidScenario):
        return False
    return isinstance(document, dict) and "lattice_metadata" in document
