"""Files, a model and options named on the command line: what is loaded, where results go."""

from __future__ import annotations

import contextlib
import difflib
import functools
import importlib
import inspect
import math
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from maneuver_automaton import exports
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import load_library
from maneuver_automaton.cli.guard import complain
from maneuver_automaton.cli.pictures import LookOptions
from maneuver_automaton.errors import InvalidScenario, ManeuverAutomatonError
from maneuver_automaton.formats import commonroad, libraries
from maneuver_automaton.models import Model
from maneuver_automaton.models.kinds import KINDS
from maneuver_automaton.models.model import check_model
from maneuver_automaton.scenario import RoadScenario, Scenario, fleet, load_scenario, remarks_on

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
        return parts.case is None and commonroad.n_problems(path) > 1
    except OSError:
        return False  # told by who reads it


def problem_of(
    path: Path, parts: Parts | None = None, *, remark: bool = True
) -> Scenario | fleet.FleetScenario:
    """The problem or fleet of a file, completed by `parts`; remarks on what is hardly meant."""
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
    """The automaton of a library, of primitives, or of a scenario, which may be a user's own."""
    return named_automaton(path, model)[0]


def named_automaton(path: Path, model: str | None = None) -> tuple[Automaton, str]:
    """The automaton of a file, see `automaton_of`, and the name of the scenario or library."""
    own = None if model is None else user_model(model)
    if (read := libraries.read_primitives(path)) is not None:
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
def printed(written: Path, file: Path, *, as_json: bool) -> Iterator[None]:
    """With --json, print a file once it is written, and nothing else to standard output."""
    if not as_json:
        yield
        return
    if file.is_dir():
        raise InvalidScenario(f"--json: prints the document of one file, and {file} is a folder")
    with contextlib.redirect_stdout(sys.stderr):
        yield
    sys.stdout.write(written.read_text(encoding="utf-8"))


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


@functools.lru_cache(maxsize=8)
def user_model(text: str) -> Model:
    """The model OBJECT, or what it makes, of MODULE, looked for in the current folder first."""
    module_name, _, name = text.partition(":")
    if not (module_name and name):
        raise _wrong(f"got {text!r}, need MODULE:OBJECT, such as boats:BOAT")
    found = _object(_module(module_name), module_name, name)
    if inspect.isclass(found) or inspect.isroutine(found):
        found = _made(found, text)
    try:
        check_model(found)
    except ValueError as error:
        raise _wrong(f"{text}: {error}") from error
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Options of `plan` and `mpc`, the same for every file of a folder."""

    time_limit: float | None = None  # [s] of a plan or a step; None: that of the scenario
    gap: float | None = None  # share of the cost, None: nothing is proven beside the search
    alternatives: int = 0
    steps: int | None = None  # of a loop; None: those of the scenario
    look: LookOptions = field(default_factory=LookOptions)
    quiet: bool = False
    leave: bool = False  # a start in contact is left first
    seed: int | None = None
    seeds: int | None = None  # how many seeds in a row, for statistics
    resume: Path | None = None
    jobs: int = 1  # processes: for the files of a folder, for seeds, or for one fleet
    scheduler: str | None = None  # of Dask, for the same

    def __post_init__(self) -> None:
        if self.time_limit is not None and not 0.0 < self.time_limit < math.inf:
            raise InvalidScenario(
                f"--time-limit: got {self.time_limit}, need a positive number of seconds"
            )
        if self.gap is not None and not 0.0 <= self.gap < 1.0:
            raise InvalidScenario(
                f"--gap: got {self.gap}, need a share of the cost from 0 to below 1, such as 0.05"
            )


ONE = "is for one vehicle, but {path} states several; leave it out"
NO_ROADS = "drives on roads have no such option; leave it out"
NO_MODEL = "is for scenarios and libraries, not for drives on roads"
OF_SEVERAL = "is not for several vehicles on roads; leave it out, or pick one with --case"
LEAVE = "is for one vehicle off the road, but {path} is no such; omit it"
DASK = "{path} is planned in one process, need a folder, or several vehicles"
UNKNOWN: Mapping[tuple[str, str], Mapping[str, str]] = {  # options that a kind of job refuses
    ("plan", "one"): {"--dask": DASK},
    ("plan", "fleet"): {"--leave": LEAVE, "--alternatives": ONE, "--gap": ONE},
    ("plan", "road"): {"--leave": LEAVE, "--dask": DASK, "--model": NO_MODEL},
    ("plan", "roads"): {"--leave": LEAVE, "--dask": DASK, "--model": OF_SEVERAL},
    ("mpc", "one"): {},
    ("mpc", "fleet"): {"--seeds": ONE, "--gap": ONE},
    ("mpc", "road"): {"--seeds": NO_ROADS, "--resume": NO_ROADS, "--model": NO_MODEL},
    ("mpc", "roads"): {"--model": OF_SEVERAL, "--seeds": OF_SEVERAL, "--resume": OF_SEVERAL},
}


def refuse_unknown(path: Path, command: str, kind: str, options: Options, parts: Parts) -> None:
    """Raise where an option is given that a kind of job does not know."""
    given = {
        "--dask": options.scheduler is not None,
        "--leave": options.leave,
        "--alternatives": options.alternatives > 0,
        "--gap": options.gap is not None,
        "--seeds": options.seeds is not None,
        "--resume": options.resume is not None,
        "--model": parts.model is not None,
    }
    for option, said in UNKNOWN[command, kind].items():
        if given[option]:
            raise InvalidScenario(f"{option}: {said.format(path=path)}")
    if given["--seeds"] and given["--resume"]:
        raise InvalidScenario("--resume: goes on with one loop, and --seeds runs many; need one")
