"""--model MODULE:OBJECT: a vehicle of the user's own, which no file can name."""

from __future__ import annotations

import difflib
import functools
import importlib
import inspect
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.models import Model

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

    Raises
    ------
    InvalidScenario
        If there is no such module or object, it is no model, needs parameters, or has the name of
        a model of the package.
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
    from maneuver_automaton.models.kinds import KINDS

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
