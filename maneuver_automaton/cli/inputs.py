"""Files and a model named on the command line: what to load of them, and where results go."""

from __future__ import annotations

import contextlib
import difflib
import functools
import importlib
import inspect
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from maneuver_automaton import exports
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import load_library
from maneuver_automaton.cli.guard import complain
from maneuver_automaton.errors import InvalidScenario, ManeuverAutomatonError
from maneuver_automaton.formats.commonroad import n_problems
from maneuver_automaton.formats.libraries import read_primitives
from maneuver_automaton.models import Model
from maneuver_automaton.models.kinds import KINDS
from maneuver_automaton.scenario import (
    FleetScenario,
    RoadScenario,
    Scenario,
    load_scenario,
    remarks_on,
)

OF_LOOPS = re.compile(r"^(receding horizon: |fleet horizon: |fleet: )+")  # a file says it better


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The options --with, --case and --model: what completes a file, and what it cannot state."""

    beside: Path | None = None
    case: int | None = None
    model: str | None = None  # MODULE:OBJECT


def states_several(path: Path, parts: Parts) -> bool:
    """Whether a file of CommonRoad states several problems, and --case picks none of them."""
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
    with writing(folder):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except ValueError as error:  # a name that no system has
            raise OSError(str(error)) from error


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Tell in one line which file cannot be written: the one that failed, else `path`."""
    try:
        yield
    except OSError as error:
        said = error.strerror or error
        raise InvalidScenario(f"{error.filename or path}: cannot be written: {said}") from error


@contextlib.contextmanager
def naming(path: Path, about: str = "") -> Iterator[None]:
    """Name the file, and the part of it that is meant, where a value of it is refused."""
    try:
        yield
    except ManeuverAutomatonError:
        raise
    except ValueError as error:
        said = OF_LOOPS.sub("", str(error))
        raise InvalidScenario(f"{path}: {about}{said}") from error


def opened(path: Path, parts: Parts) -> exports.ResultFile:
    """A result file of any kind, in the world of --with or that it names itself."""
    own = None if parts.model is None else user_model(parts.model)
    file = exports.open_result(path, beside=parts.beside, case=parts.case, model=own)
    for line in [] if file.scenario is None or file.beside is None else remarks_on(file.beside):
        complain(line)
    return file


NEEDED = (
    "name",
    "group",
    "control_names",
    "reduced_names",
    "control_limits",
    "reduced_limits",
    "part_names",
    "velocity",
    "dynamics",
    "body_velocity",
    "reduced_dynamics",
    "part_poses",
)


@functools.lru_cache(maxsize=8)
def user_model(text: str) -> Model:
    """The model OBJECT of the module MODULE, which is looked for in the current folder first.

    A class or a function that needs no parameters is called.
    """
    module_name, _, name = text.partition(":")
    if not (module_name and name):
        raise _wrong(f"got {text!r}, need MODULE:OBJECT, such as boats:BOAT")
    found = _object(_module(module_name), module_name, name)
    if inspect.isclass(found) or inspect.isroutine(found):
        found = _made(found, text)
    missing = [key for key in NEEDED if not hasattr(found, key)]
    if missing:
        raise _wrong(
            f"{text} is no model, it is of the type {type(found).__name__} and has no "
            f"{', '.join(missing)}; need a maneuver_automaton.UserModel, or all that one has"
        )
    if found.name in KINDS:
        raise _wrong(
            f"{text} is called {found.name!r}, as a model of the package is; need another name"
        )
    model: Model = found
    return model


def _module(name: str) -> Any:
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    importlib.invalidate_caches()
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and f"{name}.".startswith(f"{error.name}."):
            raise _wrong(
                f"there is no module {error.name!r} in {here} or among the installed packages"
            ) from error
        raise _broken(name, error) from error
    except Exception as error:  # whatever the user's code raises
        raise _broken(name, error) from error


def _object(module: Any, module_name: str, name: str) -> Any:
    found = module
    for step in name.split("."):
        if not hasattr(found, step):
            near = difflib.get_close_matches(step, vars(module), n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise _wrong(f"the module {module_name!r} has no {name!r}{hint}")
        found = getattr(found, step)
    return found


def _made(make: Any, text: str) -> Any:
    """What a class or function without parameters returns."""
    try:
        inspect.signature(make).bind()
    except (TypeError, ValueError) as error:
        raise _wrong(
            f"{text} does not fit: it cannot be called without parameters ({error}); need a model "
            "that is made already"
        ) from error
    try:
        return make()
    except Exception as error:
        raise _wrong(f"{text} raises {type(error).__name__}: {error}") from error


def _broken(name: str, error: Exception) -> InvalidScenario:
    return _wrong(f"the module {name!r} cannot be imported: {type(error).__name__}: {error}")


def _wrong(said: str) -> InvalidScenario:
    return InvalidScenario(f"--model: {said}")
