"""`cache`, `compile`, `example`, `convert` and `schema`: files, without planning."""

from __future__ import annotations

import contextlib
import difflib
import json
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import maneuver_automaton
from maneuver_automaton._cache_files import files_of
from maneuver_automaton._compile_all import compile_missing
from maneuver_automaton._files import write_bytes_atomically, write_text_atomically
from maneuver_automaton._kernel_folders import (
    KERNELS,
    kernel_base,
    kernel_folder,
    user_cache_folder,
)
from maneuver_automaton._kernel_list import kernel_names
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.cli.guard import BAD_INPUT, FOUND, complain
from maneuver_automaton.cli.inputs import Parts, automaton_of, make_folder, problem_of, writing
from maneuver_automaton.cli.terminal import console, print_written, say, table
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
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import parse
from maneuver_automaton.scenario import FleetScenario, Scenario, json_schema, statements_of, to_yaml
from maneuver_automaton.search.cost_to_go import FOLDER, MOST_BYTES

MEGABYTE = 1e6  # [bytes]
CACHE = "MANEUVER_AUTOMATON_CACHE_DIR"


def show_cache() -> int:
    """List the folders of the cache, with what they hold."""
    now = kernel_folder()
    rows = []
    for folder in _folders():
        files = files_of([folder])
        size = sum(status.st_size for _, status in files) / MEGABYTE
        what = "compiled kernels" if folder == now else "compiled kernels of another version"
        if folder.name == FOLDER:
            what = f"tables of the cost to go, at most {MOST_BYTES / MEGABYTE:g} MB"
        rows.append([what, str(len(files)), f"{size:.1f}", str(folder)])
    console().print(table("", ["", "files", "MB", "folder"], rows, numbers=(1, 2)), soft_wrap=True)
    return FOUND


def clear_cache() -> int:
    """Remove what the cache holds; it is made again when it is needed."""
    folders = _folders()
    size = sum(status.st_size for _, status in files_of(folders)) / MEGABYTE
    for folder in folders:
        with writing(folder):
            shutil.rmtree(folder)
    say(f"{size:.1f} MB removed")
    return FOUND


def _folders() -> list[Path]:
    """What this package made in its cache folders, of this version and of others."""
    found: list[Path] = []
    with contextlib.suppress(OSError, RuntimeError):  # no home folder
        found += sorted(kernel_base().glob(f"{KERNELS}*"))
        if kernel_base() != user_cache_folder():
            found += sorted(user_cache_folder().glob(f"{KERNELS}*"))
        found.append(user_cache_folder() / FOLDER)
    return [folder for folder in found if folder.is_dir() and not folder.is_symlink()]


def compile_all(*, jobs: int | None) -> int:
    """Compile what is missing in the user's cache, and say where it lies."""
    began = time.perf_counter()
    failed = compile_missing(kernel_names(), jobs=jobs)
    if failed is None:
        complain(f"compile: no folder can be written; {CACHE} names another one")
        return BAD_INPUT
    for failure in failed:
        complain(failure)
    took = time.perf_counter() - began
    line = f"{len(kernel_names()) - len(failed)} kernels are compiled, after {took:.1f} s: "
    say(f"{line}{kernel_folder()}")
    return BAD_INPUT if failed else FOUND


def example(name: str | None, out: Path | None) -> int:
    """Write a scenario, and the files that it names, as NAME.yaml, as the file or into a folder.

    Without a name, list the scenarios with a line each, and the command that they are for.
    """
    if name is None:
        found = {name: _content(path) for name, path in sorted(_scenarios().items())}
        for known, content in found.items():
            command = "mpc" if "receding_horizon" in content else "plan"
            say(f"{known:<{max(map(len, found))}}  {command:<4}  {content['name']}")
        return FOUND
    source = _source(name)
    target = Path() / source.name if out is None else out
    if target.is_dir() or (out is not None and not out.suffix):
        target = target / source.name
    copies = [(source, target)]
    obstacles = _content(source).get("obstacles")
    for obstacle in obstacles if isinstance(obstacles, list) else []:
        if isinstance(name := obstacle.get("map"), str):
            image = Path(name).parent / str(_content(source.parent / name)["image"])
            copies += [(source.parent / one, target.parent / one) for one in (name, image)]
    for original, copy in copies:
        if copy.exists() and (copy.is_dir() or copy.read_bytes() != original.read_bytes()):
            raise InvalidScenario(
                f"{copy}: exists already, with other content; need --out with another name"
            )
    for original, copy in copies:
        make_folder(copy.parent)
        with writing(copy):
            write_bytes_atomically(copy, original.read_bytes())
    command = "mpc" if "receding_horizon" in _content(source) else "plan"
    said = f"{target}: {_content(source)['name']}; next: maneuver-automaton {command} {target}"
    say(said)
    return FOUND


def _source(name: str) -> Path:
    known = _scenarios()
    wanted = name.removesuffix(".yaml")
    if wanted in known:
        return known[wanted]
    near = difflib.get_close_matches(wanted, known, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    raise InvalidScenario(
        f"example: no scenario {name!r}; {hint}`maneuver-automaton example` lists them"
    )


def _scenarios() -> dict[str, Path]:
    """Files of the scenarios by name: within an installed package, or beside that of a clone."""
    package = Path(maneuver_automaton.__file__).parent
    for folder in (package / "scenarios", package.parent / "scenarios"):
        if folder.is_dir():
            files = (*folder.glob("*.yaml"), *folder.glob("fleets/*.yaml"))
            return {path.stem: path for path in files}
    raise InvalidScenario(f"example: {package} came without its scenarios; need to install it anew")


def _content(path: Path) -> dict[str, object]:
    value = parse(read_text(path), name=str(path)).value
    assert isinstance(value, dict)  # it is one of ours
    return value


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
            several = statements_of(source)
            cells = _one_map(
                _obstacles(problem_of(source, parts)) if several is None else several[0].obstacles
            )
            if cells is None:
                raise InvalidScenario(f"{source}: states no occupancy map, or several; need one")
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
        say(f"{source}: {read.remark}")
    name = target.name.lower()
    kept = name.endswith(KEEP_MULTIPLIERS) and not name.endswith(NAV2_JSON)
    if not kept and any(one.cost_multiplier != 1.0 for one in automaton.maneuvers):
        say(f"{target}: cost multipliers are left out")
    return FOUND


def _plain_map(source: Path) -> OccupancyMap | None:
    """The map of a file that states a map, and neither vehicle nor several problems."""
    statements = statements_of(source)
    if statements is None or len(statements) > 1 or statements[0].vehicle is not None:
        return None
    return _one_map(statements[0].obstacles)


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
        text = to_yaml(replace(scenario, maps=(*scenario.maps, *new)), folder=target.parent)
    except ValueError as error:
        raise InvalidScenario(f"{source}: {str(error).removeprefix(f'{source}: ')}") from error
    make_folder(target.parent)
    for file in new:
        save_nav2_map(file.map, file.path)
    write_text_atomically(target, text)


def print_schema(document: str | None) -> int:
    """Print the JSON Schema of scenario files, or of a kind of document."""
    if document is not None and document not in KINDS:
        raise InvalidScenario(f"--document: got {document!r}, need {', '.join(KINDS)}")
    schema = json_schema() if document is None else schema_of(document)
    sys.stdout.write(json.dumps(schema, indent=2) + "\n")
    return FOUND
