"""Libraries that come with the package: built once, so that planning with them needs no solver."""

from __future__ import annotations

import difflib
from importlib import resources
from importlib.resources.abc import Traversable

from maneuver_automaton.automaton.automaton import Automaton
from maneuver_automaton.automaton.library import load_library
from maneuver_automaton.errors import InvalidLibrary


def stock_libraries() -> tuple[str, ...]:
    """Names of the libraries that come with the package, in order.

    Examples
    --------
    >>> "second_order_car" in stock_libraries()
    True
    """
    names = (entry.name for entry in _folder().iterdir())
    return tuple(sorted(name.removesuffix(".json") for name in names if name.endswith(".json")))


def load_stock_library(name: str) -> Automaton:
    """The automaton of a library that comes with the package.

    Beside each library lies the build file it is made of, with the vehicle's parameters.

    Raises
    ------
    InvalidLibrary
        If there is none of that name.

    Examples
    --------
    >>> car = load_stock_library("second_order_car")
    >>> len(car) >= 40, len(car.maneuvers) >= 300
    (True, True)
    """
    known = stock_libraries()
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise InvalidLibrary(f"no stock library {name!r} among {', '.join(known)}{hint}")
    with resources.as_file(_folder() / f"{name}.json") as path:
        return load_library(path)


def _folder() -> Traversable:
    return resources.files("maneuver_automaton") / "libraries"
