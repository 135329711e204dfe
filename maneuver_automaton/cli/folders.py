"""The files of a folder that state a problem, and what completes each."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from maneuver_automaton.cli.inputs import Parts
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats import (
    benchmr_svg,
    cl_cbs,
    commonroad,
    dynobench,
    movingai,
    nav2_map,
    sbpl_cfg,
    tpcap,
)
from maneuver_automaton.formats.recognition import SBPL_ENDINGS, YAML_ENDINGS
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import Document, parse


def problems_in(folder: Path, parts: Parts) -> list[tuple[Path, Parts]]:
    """Every file of a folder that states a problem, with the parts that it has a use for.

    Left out is what belongs to another file: images, maps that a scenario or a list of queries
    names, models, outlines of robots, the scenario of --with. A scenario states all of its
    problem, and only formats with several problems need to know which one.

    Raises
    ------
    InvalidScenario
        If there is none, or two have one name.
    """
    documents = {path: _document(path) for path in _files(folder) if _ending(path) in YAML_ENDINGS}
    used = set(_used(folder, documents))
    if parts.beside is not None:
        used.add(parts.beside.resolve())
    found = [
        (path, _parts_for(path, documents.get(path), parts))
        for path in _files(folder)
        if path.resolve() not in used and _states_a_problem(path, documents.get(path))
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


def _ending(path: Path) -> str:
    return path.suffix.lower()


def _document(path: Path) -> Document | None:
    """Document of a YAML file; None if it cannot be read, which is told when it is planned."""
    try:
        return parse(read_text(path), name=str(path))
    except InvalidScenario:
        return None


def _states_a_problem(path: Path, document: Document | None) -> bool:
    ending = _ending(path)
    if ending in YAML_ENDINGS:
        return document is None or not (
            dynobench.belongs_to_dynobench(document) or cl_cbs.belongs_to_cl_cbs(document)
        )
    try:
        if ending == ".csv":
            return tpcap.is_tpcap(path)
        if ending == ".svg":
            return benchmr_svg.n_queries(path) > 0
        if ending in SBPL_ENDINGS:
            return sbpl_cfg.is_sbpl(path)
        if ending == ".xml":
            return commonroad.is_commonroad(path)
    except (OSError, InvalidScenario):
        return True  # errors are told when it is planned
    return ending in (".map", ".scen")


def _used(folder: Path, documents: dict[Path, Document | None]) -> Iterator[Path]:
    """Maps that other files of the folder name."""
    for path in _files(folder):
        if _ending(path) == ".scen":
            with contextlib.suppress(InvalidScenario):  # told when the file is planned
                yield movingai.map_beside(path).resolve()
        document = documents.get(path)
        value = document.value if document is not None else None
        for obstacle in _obstacles(value):
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
    ending, several = _ending(path), False
    if ending in YAML_ENDINGS and not (
        document is not None
        and (
            dynobench.is_dynobench(document)
            or nav2_map.is_nav2_map(document)
            or cl_cbs.is_cl_cbs(document)
        )
    ):
        return Parts(model=parts.model)
    if ending == ".svg":
        with contextlib.suppress(InvalidScenario):
            several = benchmr_svg.n_queries(path) > 1
    return parts if several or ending in (".scen", ".xml") else replace(parts, case=None)
