"""Files named on the command line: what to load of them, and where results go."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from maneuver_automaton.cli.guard import complain
from maneuver_automaton.cli.user_model import user_model
from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.automaton import Automaton
    from maneuver_automaton.scenario import FleetScenario, Scenario


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The options --with, --case and --model: what completes a file, and what it cannot state."""

    beside: Path | None = None
    case: int | None = None
    model: str | None = None  # MODULE:OBJECT


def is_road(path: Path) -> bool:
    """Whether a file is one of CommonRoad, by its ending."""
    return path.suffix.lower() == ".xml"


def states_several(path: Path, parts: Parts) -> bool:
    """Whether a file of CommonRoad states several problems, and --case picks none of them."""
    from maneuver_automaton.formats.commonroad import n_problems

    try:
        return parts.case is None and n_problems(path) > 1
    except OSError:
        return False  # told by who reads it


def problem_of(
    path: Path, parts: Parts | None = None, *, remark: bool = True
) -> Scenario | FleetScenario:
    """The problem of a file, or its fleet, completed by `parts`; no drive on roads.

    What is legal in it, but hardly meant, is remarked on.
    """
    from maneuver_automaton.scenario import RoadScenario, load_scenario, remarks_on

    parts = parts or Parts()
    own = None if parts.model is None else user_model(parts.model)
    found = load_scenario(path, beside=parts.beside, case=parts.case, model=own)
    if isinstance(found, RoadScenario):
        raise InvalidScenario(f"{path}: is a drive on roads, which only plan and mpc know")
    for file in (path, parts.beside) if remark else ():
        for line in [] if file is None else remarks_on(file):
            complain(line)
    return found


def scenario_of(path: Path, parts: Parts | None = None) -> Scenario:
    """The problem of a file of one vehicle, completed by `parts`."""
    from maneuver_automaton.scenario import Scenario

    found = problem_of(path, parts)
    if not isinstance(found, Scenario):
        raise InvalidScenario(
            f"{path}: states several vehicles, which only plan, mpc, check and convert know"
        )
    return found


def automaton_of(path: Path, model: str | None = None) -> Automaton:
    """The automaton of a library (.json), of primitives in another format, or of a scenario.

    `model`, MODULE:OBJECT, is the vehicle of a library or scenario for a user's own.
    """
    return named_automaton(path, model)[0]


def named_automaton(path: Path, model: str | None = None) -> tuple[Automaton, str]:
    """The automaton of a file, see `automaton_of`, and the name of the scenario or library."""
    from maneuver_automaton.automaton.library import load_library
    from maneuver_automaton.formats.libraries import read_primitives

    own = None if model is None else user_model(model)
    if (read := read_primitives(path)) is not None:
        if own is not None:
            raise InvalidScenario(
                f"--model: {path} is a file of {read.kind}, which has a vehicle of its own; need a "
                "library or a scenario"
            )
        return read.automaton, read.automaton.name or path.stem
    if path.suffix == ".json":
        library = load_library(path, model=own)
        return library, library.name or path.stem
    scenario = scenario_of(path, Parts(model=model))
    return scenario.problem.automaton, scenario.name or path.stem


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
