"""Import what a package names when it is asked for, and no sooner."""

from __future__ import annotations

import contextlib
import importlib
import re
import sys
import threading
from collections.abc import Callable, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

_IMPORT = re.compile(r"^(?:    )?from (\S+) import \(?\s*(\w+) as \2\b", re.MULTILINE)
_ONE_AT_A_TIME = threading.RLock()
UNASKED = {  # of other packages, which import them as modules: texts for `help`, tables, dates
    *("PIL.ExifTags", "fontTools.agl", "matplotlib.category", "matplotlib.dates"),
    *("numpy._core._add_newdocs", "numpy._core._add_newdocs_scalars"),
}


def lazily(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package, by its ``__name__``.

    What it names, and in which modules, stands once, in its block for type checkers, as
    ``from module import name as name``.
    """
    module = sys.modules[package]
    homes = _homes(module)

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return _named(module, homes, name)

    def listed() -> list[str]:
        return sorted(homes.keys() | ({"__version__"} & vars(module).keys()))

    return get, listed


def _homes(package: ModuleType) -> dict[str, str]:
    """The modules that a package imports names from, name by name, as its file states them."""
    assert package.__spec__ is not None
    loader, name = package.__spec__.loader, package.__name__
    if (source := loader.get_source(name)) is None:  # type: ignore[union-attr]
        raise ImportError(f"{name}: installed without its .py files, which say what it names")
    return {name: home for home, name in _IMPORT.findall(source)}


def _named(package: ModuleType, homes: dict[str, str], name: str) -> Any:
    """What a package imports by a name; it has it from now on."""
    within = homes[name] == package.__name__  # a module of its own
    home = importlib.import_module(f"{homes[name]}.{name}" if within else homes[name])
    vars(package)[name] = home if within else getattr(home, name)
    return vars(package)[name]


class LaterFinder:
    """Finds modules, above all of this package, which run when asked for a name, and no sooner.

    So a program does not run what it only might call: ``from package import module`` runs neither;
    ``module.name`` and ``from module import name`` run the module, and no package on the way.
    """

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Where a module is that is put off; None of others."""
        if not name.startswith(f"{__package__}.") and name not in UNASKED:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader_state = spec.loader.exec_module
            spec.loader.exec_module = _put_off  # type: ignore[method-assign]
        return spec


def _put_off(module: ModuleType) -> None:
    assert module.__spec__ is not None
    is_package = module.__spec__.submodule_search_locations is not None
    module.__spec__.loader_state = (
        module.__spec__.loader_state,
        _homes(module) if is_package else {},
    )
    module.__class__ = LaterModule


class LaterModule(ModuleType):
    """A module that has not run to its end; of a package, what it imports by name is there."""

    def __getattr__(self, name: str) -> Any:
        """A name that it imports, a module in it, or what it has once it has run."""
        spec = self.__spec__
        assert spec is not None
        with _ONE_AT_A_TIME:
            if name in vars(self):  # another thread asked for it meanwhile
                return vars(self)[name]
            if name.startswith("__") or spec.loader_state is None:  # it is running
                raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
            run, homes = spec.loader_state
            if name in homes:
                return _named(self, homes, name)
            if spec.submodule_search_locations is not None:
                with contextlib.suppress(ModuleNotFoundError):
                    return importlib.import_module(f"{self.__name__}.{name}")
            spec.loader_state = None
            try:
                run(self)
            except BaseException:
                spec.loader_state = run, homes
                raise
            self.__class__ = ModuleType  # type: ignore[assignment]
        return getattr(self, name)

    def __setattr__(self, name: str, value: Any) -> None:
        """Have no module of a package hide what the package imports by the same name."""
        spec = vars(self)["__spec__"]
        if not (
            isinstance(value, ModuleType) and spec.loader_state and name in spec.loader_state[1]
        ):
            super().__setattr__(name, value)


class Outside(ModuleType):
    """A module of another package, imported when it is asked for a name: many programs never do."""

    def __getattr__(self, name: str) -> Any:
        vars(self)[name] = value = getattr(importlib.import_module(self.__name__), name)
        return value


shapely: Any = Outside("shapely")
