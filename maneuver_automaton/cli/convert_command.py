"""`convert`, `plot`, `schema`: from one file to another, without planning."""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.cli.guard import FOUND
from maneuver_automaton.cli.inputs import (
    Parts,
    automaton_of,
    make_folder,
    not_written,
    problem_of,
    scenario_of,
)
from maneuver_automaton.cli.pictures import skip_documentation
from maneuver_automaton.cli.plan_settings import LookOptions
from maneuver_automaton.cli.planned import road_fleet
from maneuver_automaton.cli.tables import console, print_written
from maneuver_automaton.collision import AnyObstacle, OccupancyMap
from maneuver_automaton.errors import InvalidLibrary, InvalidScenario
from maneuver_automaton.formats.libraries import (
    JSON,
    MPRIM,
    NAV2_JSON,
    read_primitives,
    write_again,
    writer_of,
)
from maneuver_automaton.formats.movingai import save_movingai_map
from maneuver_automaton.formats.nav2_map import save_nav2_map
from maneuver_automaton.formats.recognition import YAML_ENDINGS
from maneuver_automaton.formats.statement import MapFile
from maneuver_automaton.scenario import FleetScenario, Scenario, statements_of, to_yaml

if TYPE_CHECKING:
    from maneuver_automaton.fleet import FleetLog, FleetResult
    from maneuver_automaton.planning import PlanResult
    from maneuver_automaton.problem import Problem
    from maneuver_automaton.receding_horizon import ClosedLoop
    from maneuver_automaton.roads import RoadFleetResult

KEEP_MULTIPLIERS = (MPRIM, JSON)  # but Nav2's kind of JSON

MAP_ENDINGS = (".map",)
DRAWN = {  # by their endings
    "picture": (".png", ".pdf", ".svg"),
    "animation": (".gif",),
    "page": (".html",),
}


def convert(source: Path, target: Path, *, parts: Parts) -> int:
    """Write a problem as a scenario, a map or a library of primitives in another format."""
    if (write := writer_of(target)) is not None:
        return _convert_library(source, target, write)
    ending = target.suffix.lower()
    if ending not in YAML_ENDINGS + MAP_ENDINGS:
        raise InvalidScenario(
            f"{target}: is in no format that this version writes, need a scenario or a Nav2 map "
            f"({', '.join(YAML_ENDINGS)}), a MovingAI map ({', '.join(MAP_ENDINGS)}), or "
            "primitives (.json, .nav2.json, .mprim, .xml)"
        )
    try:
        if ending in MAP_ENDINGS:
            cells = _only_map(source, parts)
            make_folder(target.parent)
            save_movingai_map(cells, target)
        elif parts == Parts() and (plain := _plain_map(source)) is not None:
            make_folder(target.parent)
            save_nav2_map(plain, target)
        else:
            _write_scenario(problem_of(source, parts), source, target)
    except OSError as error:
        raise not_written(Path(error.filename or target), error) from error
    print_written(target)
    return FOUND


def _convert_library(source: Path, target: Path, write: Callable[[Automaton, Path], None]) -> int:
    """Write primitives, or the automaton of a scenario; say what is not as the source says."""
    read = read_primitives(source)
    automaton = automaton_of(source) if read is None else read.automaton
    try:
        make_folder(target.parent)
        if read is not None and write_again(read, target):
            print_written(target)
            return FOUND
        write(automaton, target)
    except InvalidLibrary as error:
        raise InvalidLibrary(f"{target}: {error}") from error
    except OSError as error:
        raise not_written(Path(error.filename or target), error) from error
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


def plot(
    file: Path,
    out: Path | None,
    *,
    animate: bool,
    look: LookOptions,
    html: bool = False,
    beside: Path | None = None,
) -> int:
    """Draw a plan.json or closed_loop.json again, still, in motion, or as a page that plays it."""
    if animate and html:
        raise InvalidScenario("--html: writes a page, and --animate an animation; need one of them")
    what = "animation" if animate else "page" if html else "picture"
    path = _picture(file, out, what)
    if (roads := road_fleet(file, Parts(beside=beside), alone=True)) is not None:
        draw = functools.partial(_draw_roads, roads, path, what, look)
    elif (driven := _loop_of_fleet(file)) is not None:
        from maneuver_automaton.cli.planned import fleet_planned
        from maneuver_automaton.formats.fleet_loop_json import load_fleet_loop

        fleet = fleet_planned(file, driven, Parts(beside=beside))
        log = load_fleet_loop(file, fleet.fleet)
        draw = functools.partial(_draw_fleet_loop, log, path, what, look, fleet.name)
    elif (plans := _plans_of_fleet(file)) is not None:
        from maneuver_automaton.cli.planned import fleet_planned
        from maneuver_automaton.formats.fleet_json import load_fleet

        fleet = fleet_planned(file, plans, Parts(beside=beside))
        result = load_fleet(file, fleet.fleet)
        draw = functools.partial(_draw_fleet, result, path, what, look, fleet.name)
    elif beside is None:
        document = _drawn(file)
        draw = functools.partial(_draw_file, document, path, what, look)
    else:
        scenario = scenario_of(beside)
        value = _value_of(file, scenario.problem)
        draw = functools.partial(_draw_value, value, path, what, look, scenario.name)
    make_folder(path.parent)
    skip_documentation()
    try:
        draw()
    except OSError as error:
        raise not_written(path, error) from error
    except (KeyError, ValueError, TypeError, IndexError, AttributeError) as error:
        said = f"misses the key {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidScenario(f"{file}: {said}") from error
    print_written(path)
    return FOUND


def _plans_of_fleet(file: Path) -> dict[str, Any] | None:
    """The content of a plan.json of several vehicles; None of anything else."""
    from maneuver_automaton.formats.plan_json import read_fleet_document

    try:
        return read_fleet_document(file)
    except InvalidScenario:  # told by who reads the plan of one vehicle
        return None


def _loop_of_fleet(file: Path) -> dict[str, Any] | None:
    """The content of a closed_loop.json of several vehicles; None of anything else."""
    from maneuver_automaton.formats.fleet_loop_json import read_fleet_loop_document

    return read_fleet_loop_document(file)


def _draw_roads(result: RoadFleetResult, path: Path, what: str, look: LookOptions) -> None:
    """Draw plans and loops on roads, of one vehicle or several, as `plan` and `mpc` do."""
    from maneuver_automaton import plotting

    vehicle = next(iter(result.results.values())).planner.vehicle
    if what == "picture":
        plotting.save_road_fleet_figure(result, vehicle, path, look=look.look(result.name))
    elif what == "page":
        result.player(title=look.title or result.name).save(path)
    else:
        plotting.save_road_fleet_animation(result, vehicle, path, look=look.look(result.name))


def _draw_fleet_loop(log: FleetLog, path: Path, what: str, look: LookOptions, name: str) -> None:
    """Draw the closed loop of several vehicles as `mpc` does."""
    from maneuver_automaton import plotting

    if what == "picture":
        plotting.save_fleet_loop_figure(log, path, look=look.look(name))
    elif what == "page":
        log.player(title=look.title or name).save(path)
    else:
        plotting.animate_fleet_loop(log, path)


def _draw_fleet(result: FleetResult, path: Path, what: str, look: LookOptions, name: str) -> None:
    """Draw plans of several vehicles as `plan` does."""
    from maneuver_automaton import plotting

    if what == "picture":
        plotting.save_fleet_figure(result, path, look=look.look(name))
    elif what == "page":
        result.player(title=look.title or name).save(path)
    elif not result.plans:
        raise ValueError(f"holds no plan, its status is {result.status.value!r}")
    else:
        plotting.animate_fleet(result, path)


def _draw_file(document: dict[str, Any], path: Path, what: str, look: LookOptions) -> None:
    """Draw what a file states: the motion, without body and obstacles."""
    from maneuver_automaton import plotting
    from maneuver_automaton.formats.plan_json import plan_of_document

    name = str(document.get("name") or "")
    if what == "picture":
        plotting.save_plan_file_figure(document, path, look=look.look(name))
        return
    if document["status"] != "found":
        raise ValueError(f"holds no plan, its status is {document['status']!r}")
    plan = plan_of_document(document)
    if what == "animation":
        plotting.save_plan_animation(plan, path)
        return
    title = look.title or name or path.stem
    plotting.player_of_file(document, plan, title=title).save(path)


def _draw_value(
    value: PlanResult | ClosedLoop, path: Path, what: str, look: LookOptions, name: str
) -> None:
    """Draw a plan or a closed loop as `plan` and `mpc` do."""
    from maneuver_automaton import plotting
    from maneuver_automaton.receding_horizon import ClosedLoop

    if what == "page":
        value.player(title=look.title or name).save(path)
    elif isinstance(value, ClosedLoop):
        if what == "animation":
            plotting.save_closed_loop_animation(value, path)
        else:
            plotting.save_closed_loop_figure(value, path, look=look.look(name))
    elif what == "picture":
        plotting.save_plan_figure(value, path, look=look.look(name))
    elif value.plan is None:
        raise ValueError(f"holds no plan, its status is {value.status.value!r}")
    else:
        plotting.save_plan_animation(value.plan, path, problem=value.problem)


def _picture(file: Path, out: Path | None, what: str) -> Path:
    """Where the picture goes: beside the file, into a folder, or to the file given."""
    endings = DRAWN[what]
    path = file.with_suffix(endings[0]) if out is None else out
    if path.is_dir():
        path = path / file.with_suffix(endings[0]).name
    if path.suffix.lower() not in endings:
        raise InvalidScenario(
            f"{path}: is no {what} that this version draws, need an ending of {', '.join(endings)}"
        )
    return path


def _value_of(file: Path, problem: Problem) -> PlanResult | ClosedLoop:
    """The plan or closed loop of a file, in the world that it was made for."""
    from maneuver_automaton.formats.closed_loop_json import (
        load_closed_loop,
        read_closed_loop_document,
    )
    from maneuver_automaton.formats.plan_json import load_result

    if read_closed_loop_document(file) is None:
        return load_result(file, problem)
    return load_closed_loop(file, problem)


def _drawn(file: Path) -> dict[str, Any]:
    """What to draw of a plan.json, or of a closed_loop.json, whose drive is drawn as a plan."""
    from maneuver_automaton.formats.closed_loop_json import (
        driven_document,
        read_closed_loop_document,
    )
    from maneuver_automaton.formats.plan_json import read_plan_document

    loop = read_closed_loop_document(file)
    if loop is None:
        return read_plan_document(file)
    try:
        return driven_document(loop)
    except (KeyError, ValueError, TypeError, IndexError, AttributeError) as error:
        said = f"misses the key {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidScenario(f"{file}: {said}") from error


def print_schema(document: str | None = None) -> int:
    """Print the JSON Schema of scenario files, or of a kind of document."""
    from maneuver_automaton.formats.documents import KINDS, schema_of
    from maneuver_automaton.scenario import json_schema

    if document is not None and document not in KINDS:
        raise InvalidScenario(f"--document: got {document!r}, need {', '.join(KINDS)}")
    schema = json_schema() if document is None else schema_of(document)
    sys.stdout.write(json.dumps(schema, indent=2) + "\n")
    return FOUND
