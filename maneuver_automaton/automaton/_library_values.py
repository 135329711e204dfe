"""Checked values of a library file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.errors import InvalidLibrary


def rows_of(document: Mapping[str, Any], key: str) -> list[Any]:
    """The list at a key, empty if there is none."""
    found = document.get(key, [])
    if not isinstance(found, list):
        raise InvalidLibrary(f"{key}: got {found!r:.60}, need a list")
    return found


def check_keys(label: str, entry: Any, *, known: Sequence[str], needed: Sequence[str]) -> None:
    """Refuse an entry that is no object, has an unknown key, or lacks one."""
    if not isinstance(entry, dict):
        raise InvalidLibrary(f"{label}: got {entry!r:.60}, need an object")
    for key in entry:
        if key not in known:
            raise InvalidLibrary(f"{label}: unknown key {key!r}, need {', '.join(known)}")
    for key in needed:
        if key not in entry:
            raise InvalidLibrary(f"{label}: the key {key!r} is missing")


def text_of(label: str, value: Any) -> str:
    """A text."""
    if not isinstance(value, str):
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a text")
    return value


def number_of(label: str, value: Any) -> float:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a number")
    huge = isinstance(value, int) and abs(value) > 2**63
    if huge or not math.isfinite(value):
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a finite number")
    return float(value)


def numbers_of(label: str, value: Any) -> Array:
    """A list of numbers."""
    if not isinstance(value, list):
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a list of numbers")
    return np.array([number_of(label, item) for item in value], dtype=np.float64)


def table_of(label: str, value: Any, *, width: int | None = None) -> Array:
    """Rows (n, width) of numbers, at least one."""
    if not isinstance(value, list) or not value:
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a list of rows of numbers")
    rows = [numbers_of(f"{label}[{k}]", row) for k, row in enumerate(value)]
    width = rows[0].size if width is None else width
    for k, row in enumerate(rows):
        if row.size != width:
            raise InvalidLibrary(f"{label}[{k}]: got {row.size} numbers, need {width}")
    return np.array(rows, dtype=np.float64).reshape(len(rows), width)


def listed(array: Array) -> list[float]:
    """Numbers of an array as a file has them: -0.0 is 0.0."""
    return [value + 0.0 for value in array.tolist()]
