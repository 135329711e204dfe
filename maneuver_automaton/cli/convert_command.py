"""`convert` and `schema`: from one file to another, without planning."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.cli.guard import FOUND
from maneuver_automaton.cli.inputs import (
    Parts,
    automaton_of,
    make_folder,
    problem_of,
    writing,
)
from maneuver_automaton.cli.terminal import console, print_written
from maneuver_automaton.collision import AnyObstacle, OccupancyMap
from maneuver_automaton.errors import InvalidLibrary, InvalidScenario
from maneuver_automaton.formats.documents import KINDS, schema_of
from maneuver_automaton.formats.libraries import (
    JSON,
    MPRIM,
    NAV2_JSON,
    read_primitives,
    write_again,
    writer_of,
)
from maneuver_automaton.formats.nav2_map import save_nav2_map
from maneuver_automaton.formats.registry import YAML_ENDINGS, map_writer_of
from maneuver_automaton.formats.statement import MapFile
from maneuver_automaton.scenario import FleetScenario, Scenario, json_schema, statements_of, to_yaml

KEEP_MULTIPLIERS = (MPRIM, JSON)  # but Nav2's kind of JSON


def convert(source: Path, target: Path, *, parts: Parts) -> int:
    """Write a problem as a scenario, a map or a library of primitives in another format."""
    if (write := writer_of(target)) is not None:
        return _convert_library(source, target, write)
    ending, of_maps = target.suffix.lower(), map_writer_of(target)
    if of_maps is None:
        raise InvalidScenario(
            f"{target}: is in no format that this version writes, need a scenario or a Nav2 map "
            f"({', '.join(YAML_ENDINGS)}), a MovingAI map (.map), or "
            "primitives (.json, .nav2.json, .mprim, .xml)"
        )
    with writing(target):
        if ending not in YAML_ENDINGS:
            cells = _only_map(source, parts)
            make_folder(target.parent)
            of_maps.write(cells, target)
        elif parts == Parts() and (plain := _plain_map(source)) is not None:
            make_folder(target.parent)
            save_nav2_map(plain, target)
        else:
            _write_scenario(problem_of(source, parts), source, target)
    print_written(target)
    return FOUND


def _convert_library(source: Path, target: Path, write: Callable[[Automaton, Path], None]) -> int:
    """Write primitives, or the automaton of a scenario; say what is not as the source says."""
    read = read_primitives(source)
    automaton = automaton_of(source) if read is None else read.automaton
    make_folder(target.parent)
    try:
        with writing(target):
            if read is not None and write_again(read, target):
                print_written(target)
                return FOUND
            write(automaton, target)
    except InvalidLibrary as error:
        raise InvalidLibrary(f"{target}: {error}") from error
    print_written(target)
    if read is not None and read.remark:
        console().print(f"{source}: {read.remark}", soft_wrap=True)
    name = target.name.lower()
    kept = name.endswith(KEEP_MULTIPLIERS) and not name.endswith(NAV2_JSON)
    if not kept and any(one.cost_multiplier != 1.0 for one in automaton.maneuvers):
        console().print(f"{target}: cost multipliers are left out", soft_wrap=True)
    return FOUND


def _plain_map(source: Path) -> OccupancyMap | None:
    """The map of a file that states a map, and neither vehicle nor several problems."""
    statements = statements_of(source)
    if statements is None or len(statements) > 1 or statements[0].vehicle is not None:
        return None
    return _one_map(statements[0].obstacles)


def _only_map(source: Path, parts: Parts) -> OccupancyMap:
    """The one map of a file, which may be among other obstacles."""
    statements = statements_of(source)
    obstacles = (
        _obstacles(problem_of(source, parts)) if statements is None else statements[0].obstacles
    )
    cells = _one_map(obstacles)
    if cells is None:
        raise InvalidScenario(f"{source}: states no occupancy map, or several; need one")
    return cells


def _obstacles(scenario: Scenario | FleetScenario) -> tuple[AnyObstacle, ...]:
    """The obstacles of all vehicles, each once."""
    all_of_them = {id(one): one for problem in scenario.problems for one in problem.obstacles}
    return tuple(all_of_them.values())


def _one_map(obstacles: tuple[AnyObstacle, ...]) -> OccupancyMap | None:
    maps = [obstacle for obstacle in obstacles if isinstance(obstacle, OccupancyMap)]
    return maps[0] if len(maps) == 1 else None


def _write_scenario(scenario: Scenario | FleetScenario, source: Path, target: Path) -> None:
    """Write a scenario; a map that no Nav2 file states is written beside it, as one."""
    known = [file.map for file in scenario.maps]
    path = target.with_name(f"{target.stem}_map.yaml")
    new = [
        MapFile(map=obstacle, path=path)
        for obstacle in _obstacles(scenario)
        if isinstance(obstacle, OccupancyMap) and not any(obstacle is cells for cells in known)
    ]
    try:
        stated = replace(scenario, maps=(*scenario.maps, *new))
        text = to_yaml(stated, folder=target.parent)
    except ValueError as error:
        raise InvalidScenario(f"{source}: {str(error).removeprefix(f'{source}: ')}") from error
    make_folder(target.parent)
    for file in new:
        save_nav2_map(file.map, file.path)
    write_text_atomically(target, text)


def print_schema(document: str | None = None) -> int:
    """Print the JSON Schema of scenario files, or of a kind of document."""
    if document is not None and document not in KINDS:
        raise InvalidScenario(f"--document: got {document!r}, need {', '.join(KINDS)}")
    schema = json_schema() if document is None else schema_of(document)
    sys.stdout.write(json.dumps(schema, indent=2) + "\n")
    return FOUND
