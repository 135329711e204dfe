"""How values show themselves: in a few lines, however much they hold."""

from __future__ import annotations

import dataclasses
import enum
import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np

WIDTH, MOST_LINES = 100, 10
MOST_NUMBERS = 12  # of an array that is written out
MOST_ITEMS = 3  # of a sequence or mapping that is written out
MOST_CHARACTERS = 60  # of a text, or of another object
DEEPEST = 2  # dataclasses within dataclasses


def brief(self: Any) -> str:
    """Text of a dataclass for `__repr__`: at most ten lines; fields at their defaults left out."""
    lines = textwrap.wrap(
        _fields(self, 0),
        WIDTH,
        subsequent_indent="  ",
        max_lines=MOST_LINES,
        placeholder=" ...",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "\n".join(lines)


def _fields(value: Any, depth: int) -> str:
    shown = [
        f"{one.name}={_shown(getattr(value, one.name, None), depth + 1)}"
        for one in dataclasses.fields(value)
        if one.repr and not _is_default(getattr(value, one.name, None), one)
    ]
    return f"{type(value).__name__}({', '.join(shown)})"


def _is_default(value: Any, one: dataclasses.Field[Any]) -> bool:
    if one.default_factory is dataclasses.MISSING:
        plain = isinstance(value, str | float | int | tuple)
        return value is one.default or (plain and value == one.default)
    default = one.default_factory()
    return type(value) is type(default) and _shown(value, 1) == _shown(default, 1)


def _shown(value: Any, depth: int) -> str:
    if isinstance(value, np.ndarray):
        return str(value.tolist()) if value.size <= MOST_NUMBERS else f"<{value.shape} array>"
    if isinstance(value, np.generic):
        return repr(value.item())
    if isinstance(value, enum.Enum):
        return f"{type(value).__name__}.{value.name}"
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        named = any(one.name == "name" for one in dataclasses.fields(value))
        if named and (name := getattr(value, "name", "")):
            return f"<{type(value).__name__} {name!r}>"
        return _fields(value, depth) if depth < DEEPEST else f"<{type(value).__name__}>"
    if isinstance(value, Mapping):
        pairs = [f"{k!r}: {_shown(one, depth)}" for k, one in list(value.items())[:MOST_ITEMS]]
        return f"{{{_joined(pairs, len(value))}}}"
    if isinstance(value, tuple | list) and not hasattr(value, "_fields"):
        items = [_shown(one, depth) for one in value[:MOST_ITEMS]]
        left, right = "()" if isinstance(value, tuple) else "[]"
        comma = "," if isinstance(value, tuple) and len(value) == 1 else ""
        return f"{left}{_joined(items, len(value))}{comma}{right}"
    text = repr(value)
    if isinstance(value, str) and len(text) > MOST_CHARACTERS:
        return f"{text[: MOST_CHARACTERS - 4]}...{text[-1]}"
    short = len(text) <= MOST_CHARACTERS and "\n" not in text
    return text if short else f"<{type(value).__name__}>"


def _joined(items: list[str], n: int) -> str:
    return ", ".join(items + [f"... {n} in all"] * (n > len(items)))
