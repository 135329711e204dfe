"""Files named on the command line: which format they are in, and where results go."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.automaton import Automaton
    from maneuver_automaton.scenario import Scenario

SCENARIO_ENDINGS = (".yaml", ".yml")
OTHER_ENDINGS = {
    ".csv": "TPCAP",
    ".xml": "CommonRoad",
    ".mprim": "SBPL",
    ".cfg": "SBPL",
    ".env": "SBPL",
    ".map": "MovingAI",
    ".scen": "MovingAI",
}


def scenario_of(path: Path) -> Scenario:
    """The scenario of a file; InvalidScenario if its ending is that of another format."""
    from maneuver_automaton.scenario import load_scenario

    refuse_other_format(path)
    return load_scenario(path)


def scenarios_in(folder: Path) -> list[Path]:
    """Every scenario of a folder; InvalidScenario if there is none, or two have one name."""
    paths = sorted(path for path in folder.iterdir() if path.suffix in SCENARIO_ENDINGS)
    if not paths:
        raise InvalidScenario(f"{folder}: holds no scenario, need a file ending in .yaml or .yml")
    seen: dict[str, Path] = {}
    for path in paths:
        if path.stem in seen:
            raise InvalidScenario(
                f"{path}: has the same name as {seen[path.stem].name}, need another one"
            )
        seen[path.stem] = path
    return paths


def automaton_of(path: Path) -> Automaton:
    """The automaton of a library (.json) or of a scenario."""
    from maneuver_automaton.automaton.library import load_library

    return load_library(path) if path.suffix == ".json" else scenario_of(path).problem.automaton


def refuse_other_format(path: Path) -> None:
    """Say which format a file is in, if it is one that this version does not read."""
    if known := OTHER_ENDINGS.get(path.suffix.lower()):
        raise InvalidScenario(
            f"{path}: {known} files are not read in this version, only scenario files "
            f"({', '.join(SCENARIO_ENDINGS)})"
        )


def target(out: Path, name: str) -> Path:
    """File to write: `out` itself if it is a file by its ending, else `name` in the folder."""
    return out if out.suffix and not out.is_dir() else out / name


def make_folder(folder: Path) -> None:
    """Make the folder of the results, before work is spent on them."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise not_written(folder, error) from error


def not_written(path: Path, error: Exception) -> InvalidScenario:
    """One line for a file that cannot be written."""
    return InvalidScenario(
        f"{path}: cannot be written: {getattr(error, 'strerror', None) or error}"
    )
