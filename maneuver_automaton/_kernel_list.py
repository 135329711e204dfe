"""Which kernels there are, and for which types they are compiled before anybody waits for them.

The list is `kernels.json`: of every kernel the types of its arguments, as plans use it. A type is
written as ``"float64"``, an array as ``"float64[2C]"`` (two axes, in the order of C), a tuple as a
list, and one with names as ``{"module:name": [types of its fields]}``.
"""

from __future__ import annotations

import functools
import importlib
import json
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

FILE = Path(__file__).with_name("kernels.json")
ARRAY = re.compile(r"(\w+)\[(\d+)([CFA])(, read only)?\]")
NUMBER = re.compile(r"-?\d+")  # that a kernel is handed as it stands
LITERALS = {"True": True, "False": False}

USES = {  # modules of kernels, by what calls them
    "times": ("words._kernels_solve", "search._kernels_price"),
    "words": (
        "words._kernels_closing",
        "words._kernels_shortest",
        "words._kernels_solve",
        "search._kernels_polish",
        "search._kernels_price",
        "search._kernels_words",
    ),
    "linked words": ("words._kernels_candidates", "words._kernels_steering"),
    "insertion": ("search._kernels_insertion",),
    "lattice": (
        "collision._kernels_advancement",
        "collision._kernels_field",
        "collision._kernels_swept",
        "search._kernels_begin",
        "search._kernels_distance",
        "search._kernels_lattice",
        "search._kernels_nodes",
        "search._kernels_waiting",
        "words._kernels_candidates",
        "words._kernels_closing",
        "words._kernels_shortest",
        "words._kernels_solve",
        "words._kernels_steering",
    ),
    "improvement": ("refinement._kernels_improve", "refinement._kernels_points"),
    "state lattice": ("search._kernels_state_lattice", "search._kernels_nodes"),
    "timed lattice": ("search._kernels_state_lattice", "search._kernels_timed_lattice"),
    "fail-safe": ("receding_horizon._kernels_failsafe",),
    "unconstrained loop": ("receding_horizon._kernels_unconstrained",),
    "meetings": ("fleet._kernels_meetings",),
    "separation": ("bounds._kernels_boxes", "bounds._kernels_connectivity"),
    "cells": (
        "bounds._kernels_ascent",
        "bounds._kernels_boxes",
        "bounds._kernels_certificate",
        "bounds._kernels_dual",
    ),
    "roads": (
        "roads._kernels_beam",
        "roads._kernels_costs",
        "roads._kernels_motion",
        "roads._kernels_polish",
    ),
}
NOW = ("times", "linked words", "lattice", "improvement")  # compiled when installed
LATER = tuple(use for use in USES if use not in NOW)  # what it leaves to its first use

Stated = Any  # a type as the list has it

_asked: set[str] = set()  # uses that kernels were loaded for: those that lack are compiled at once


def load_kernels(*uses: str) -> None:
    """Have the kernels for some uses of `USES` loaded, or compiled, before a clock runs."""
    _asked.update(uses)
    for use in uses:
        _load(use, many_calls_are_expected())


def expect_many_calls() -> None:
    """Go over to numba, which tells types of arguments sooner, once and before a clock runs."""
    importlib.import_module("numba")


def many_calls_are_expected() -> bool:
    """Whether what saves a moment of every call is worth to be worked out."""
    return "numba" in sys.modules


def kernel_names() -> list[str]:
    """All kernels, as ``module.name``."""
    return list(_rows())


def module_of(name: str) -> str:
    """The module of a kernel, as `USES` has it."""
    return name.removeprefix(f"{__package__}.").rpartition(".")[0]


def later_uses(name: str) -> frozenset[str]:
    """The uses of `LATER` that a kernel serves; none where an installation compiles it."""
    module = module_of(name)
    uses = frozenset(use for use, modules in USES.items() if module in modules)
    return uses if uses.issubset(LATER) else frozenset()


def compiled_with(name: str) -> list[str]:
    """The kernels to compile where one is missing: of uses asked for, or all of an installation."""
    uses = later_uses(name)
    wanted = _asked if uses & _asked else _asked | uses
    return [one for one in _rows() if (later_uses(one) & wanted if uses else not later_uses(one))]


@functools.cache
def _load(use: str, _numba: bool) -> None:
    for name, rows in _rows().items():
        one: Any = kernel_named(name) if module_of(name) in USES[use] else None
        for n, row in enumerate(rows if hasattr(type(one), "load") else ()):  # or switched off
            if not one.load(",".join(map(stated_kind, row))):
                one.compile(signatures_of(name)[n])


@functools.cache
def _rows() -> dict[str, list[list[Stated]]]:
    known: dict[str, list[list[Stated]]] = json.loads(FILE.read_text())
    return known


@functools.cache
def signatures_of(name: str) -> tuple[tuple[Any, ...], ...]:
    """The types of the arguments of each kind of call that a kernel is compiled for."""
    return tuple(tuple(map(type_of, args)) for args in _rows()[name])


def kernel_named(name: str) -> Callable[..., Any]:
    """A kernel by ``module.name``."""
    module, function = name.rsplit(".", 1)
    found: Callable[..., Any] = getattr(importlib.import_module(module), function)
    return found


def write_list(signatures: dict[str, Iterable[Iterable[Any]]]) -> None:
    """Write the list: the types of the arguments of each kernel."""
    known = {
        name: sorted(([stated(one) for one in args] for args in every), key=json.dumps)
        for name, every in sorted(signatures.items())
    }
    lines = ",\n".join(f"{json.dumps(name)}: [\n{_lines(args)}\n]" for name, args in known.items())
    FILE.write_text(f"{{\n{lines}\n}}\n")


def _lines(signatures: list[list[Stated]]) -> str:
    return ",\n".join(f" {json.dumps(args)}" for args in signatures)


def stated(kind: Any) -> Stated:
    """A type of numba, as the list has it."""
    from numba import types
    from numba.core.types.containers import BaseNamedTuple, BaseTuple
    from numba.core.types.scalars import BooleanLiteral

    if isinstance(kind, BaseNamedTuple):
        place = f"{kind.instance_class.__module__}:{kind.instance_class.__qualname__}"
        return {place: [stated(one) for one in kind.types]}
    if isinstance(kind, BaseTuple):
        return [stated(one) for one in kind.types]
    if isinstance(kind, types.Array) and kind.aligned:
        held = "" if kind.mutable else ", read only"
        return f"{kind.dtype}[{kind.ndim}{kind.layout}{held}]"
    literal = isinstance(kind, BooleanLiteral | types.IntegerLiteral)
    name = str(kind.literal_value) if literal else str(kind)
    if type_of(name) != kind:
        raise ValueError(f"no kernel that is compiled ahead takes {kind}")
    return name


def type_of(name: Stated) -> Any:
    """The type of numba that the list means."""
    from numba import types
    from numba.core.types.containers import BaseTuple
    from numba.core.types.scalars import BooleanLiteral

    if isinstance(name, dict):
        ((place, fields),) = name.items()
        return BaseTuple.from_types(tuple(map(type_of, fields)), resolve_name(place))
    if isinstance(name, list):
        return BaseTuple.from_types(tuple(map(type_of, name)))
    if name in LITERALS:
        return BooleanLiteral(LITERALS[name])
    if NUMBER.fullmatch(name):
        return types.literal(int(name))
    if found := ARRAY.fullmatch(name):
        layout: Any
        dtype, axes, layout, held = found.groups()
        return types.Array(type_of(dtype), int(axes), layout, readonly=bool(held))
    return getattr(types, "boolean" if name == "bool" else name)


def stated_kind(name: Stated) -> str:
    """How names of files have a type of the list."""
    if isinstance(name, dict):
        ((place, name),) = name.items()
        return f"{record_name(resolve_name(place))}({','.join(map(stated_kind, name))})"
    return f"({','.join(map(stated_kind, name))})" if isinstance(name, list) else str(name)


@functools.cache
def record_name(record: Any) -> str:
    """Where a class of tuples is from and what its fields are: compiled code has their order."""
    if record is tuple:
        return ""
    by_value = " by value" if getattr(record, "by_value", False) else ""
    return f"{record.__module__}:{record.__qualname__}{by_value} {' '.join(record._fields)}"
