"""The fleet that plans of a file were made for, and drives on roads that a file holds."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maneuver_automaton.cli.inputs import Parts, is_road, problem_of
from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.roads import RoadFleetResult
    from maneuver_automaton.scenario import FleetScenario


def fleet_planned(path: Path, document: Mapping[str, Any], parts: Parts) -> FleetScenario:
    """The scenario of --with, or that which the plans of a file name.

    Raises
    ------
    InvalidScenario
        If they name none, it is not there, or it states one vehicle.
    """
    from maneuver_automaton.scenario import FleetScenario

    file, its = source_of(path, document, parts)
    scenario = problem_of(file, its)
    if not isinstance(scenario, FleetScenario):
        raise InvalidScenario(f"{path}: holds plans of several vehicles, but {file} states one")
    return scenario


def road_fleet(path: Path, parts: Parts, *, alone: bool = False) -> RoadFleetResult | None:
    """Plans or loops of several vehicles on the road of a CommonRoad file; None of any other.

    One `alone` is read, too, where --with names such a file.
    """
    from maneuver_automaton import exports
    from maneuver_automaton.formats.plan_json import read_fleet_document

    try:
        document = read_fleet_document(path)
    except InvalidScenario:
        return None  # told by who reads the plan of one vehicle
    if document is None and not (alone and parts.beside is not None):
        return None
    road, its = source_of(path, document or {}, parts)
    if not is_road(road):
        return None
    return exports.load_road_fleet(path, beside=road, vehicle=its.beside, case=its.case)


def source_of(path: Path, document: Mapping[str, Any], parts: Parts) -> tuple[Path, Parts]:
    """The file that plans were made from, and what completes it: by --with, or as they say."""
    if parts.beside is not None:
        return parts.beside, replace(parts, beside=None)
    said = document.get("source")
    if not isinstance(said, dict) or not isinstance(said.get("file"), str):
        raise InvalidScenario(
            f"{path}: source: is missing, need --with and the file it was planned from"
        )
    beside, case = said.get("with"), said.get("case")
    file = _beside(path, said["file"])
    if not file.is_file():
        raise InvalidScenario(f"{path}: source: there is no {file}, need --with and that file")
    return file, replace(
        parts,
        beside=_beside(path, beside) if isinstance(beside, str) else None,
        case=case if isinstance(case, int) and parts.case is None else parts.case,
    )


def _beside(path: Path, name: str) -> Path:
    """A file as seen from another one: by its name alone, whatever links are on the way."""
    return Path(os.path.normpath(path.parent / name))
