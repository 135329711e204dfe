"""Import what a package names when it is asked for, and no sooner."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Callable
from typing import Any

_IMPORT = re.compile(r"^    from (\S+) import \(?\s*(\w+) as \2\b", re.MULTILINE)


def lazily(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package, by its ``__name__``.

    What it names, and in which modules, stands once, in its block for type checkers, as
    ``from module import name as name``.
    """
    module = sys.modules[package]
    assert module.__spec__ is not None
    loader: Any = module.__spec__.loader
    if (source := loader.get_source(package)) is None:
        raise ImportError(f"{package}: installed without its .py files, which say what it names")
    homes = {name: home for home, name in _IMPORT.findall(source)}

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        within = homes[name] == package  # a module of its own
        home = importlib.import_module(f"{package}.{name}" if within else homes[name])
        value = home if within else getattr(home, name)
        setattr(module, name, value)
        return value

    def listed() -> list[str]:
        return sorted(homes.keys() | ({"__version__"} & vars(module).keys()))

    return get, listed
