"""Import what a package names when it is asked for, and no sooner."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any


def homes(names: Mapping[str, str]) -> dict[str, str]:
    """The module of each name, from the names of each module, parted by spaces."""
    return {name: module for module, many in names.items() for name in many.split()}


def lazily(
    package: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package whose names have their homes in its modules.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    homes : mapping
        The module of each name, seen from the package.
    """

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(f"{package}.{homes[name]}"), name)
        setattr(sys.modules[package], name, value)
        return value

    def listed() -> list[str]:
        own = {name for name in vars(sys.modules[package]) if name.startswith("__")}
        return sorted(own | homes.keys())

    return get, listed
