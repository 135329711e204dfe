"""`example`: the scenarios that come with the package, listed, or written with their maps."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from pathlib import Path

import maneuver_automaton
from maneuver_automaton._files import write_bytes_atomically
from maneuver_automaton.cli.guard import FOUND
from maneuver_automaton.cli.inputs import make_folder, writing
from maneuver_automaton.cli.terminal import console
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import parse


def scenario_folder() -> Path:
    """Folder of the scenarios: within an installed package, or beside that of a clone."""
    package = Path(maneuver_automaton.__file__).parent
    for folder in (package / "scenarios", package.parent / "scenarios"):
        if folder.is_dir():
            return folder
    raise InvalidScenario(f"example: {package} came without its scenarios; need to install it anew")


def show() -> int:
    """List the scenarios with a line each, and the command that they are for."""
    found = {name: _content(path) for name, path in sorted(_scenarios().items())}
    width = max(map(len, found))
    for name, content in found.items():
        command = "mpc" if "receding_horizon" in content else "plan"
        console().print(
            f"{name:<{width}}  {command:<4}  {content['name']}", soft_wrap=True, markup=False
        )
    return FOUND


def write(name: str, out: Path | None) -> int:
    """Write a scenario, and the files that it names, as NAME.yaml, as the file or into a folder."""
    source = _source(name)
    target = Path() / source.name if out is None else out
    if target.is_dir() or (out is not None and not out.suffix):
        target = target / source.name
    copies = [(source, target)]
    copies += [(source.parent / one, target.parent / one) for one in _named(source)]
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
    console().print(said, soft_wrap=True, markup=False)
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
    """Files of the scenarios by name, those of one vehicle and those of several."""
    folder = scenario_folder()
    return {path.stem: path for path in (*folder.glob("*.yaml"), *folder.glob("fleets/*.yaml"))}


def _content(path: Path) -> dict[str, object]:
    value = parse(read_text(path), name=str(path)).value
    assert isinstance(value, dict)  # it is one of ours
    return value


def _named(source: Path) -> Iterator[Path]:
    """Files that a scenario names, relative to it: maps, and their images."""
    obstacles = _content(source).get("obstacles")
    for obstacle in obstacles if isinstance(obstacles, list) else []:
        if isinstance(name := obstacle.get("map"), str):
            yield Path(name)
            yield Path(name).parent / str(_content(source.parent / name)["image"])
