"""JSON as plain values, each of which knows its place for a message."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.text_source import FARTHEST, read_text
from maneuver_automaton.formats.yaml_source import Where, shown, spelled

MOST_BYTES = 50_000_000
KINDS = {
    int: "a whole number",
    float: "a finite number",
    str: "a text",
    bool: "true or false",
    list: "a list",
    dict: "an object",
}


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A value of a document, and the path of keys to it."""

    value: Any
    file: str
    where: Where = ()

    def error(self, said: str) -> InvalidScenario:
        """An error that names file and field: raise it."""
        label = spelled(self.where)
        return InvalidScenario(f"{self.file}: {label + ': ' if label else ''}{said}")

    def get(self, key: str, kind: type[Any]) -> Place:
        """The value of a key of an object, of a kind."""
        if not isinstance(self.value, dict):
            raise self.error(f"got {shown(self.value)}, need an object")
        if key not in self.value:
            raise Place(None, self.file, (*self.where, key)).error(
                f"is missing, need {KINDS[kind]}"
            )
        return Place(self.value[key], self.file, (*self.where, key))._of(kind)

    def item(self, k: int) -> Place:
        """An item of a list."""
        return Place(self.value[k], self.file, (*self.where, k))

    def numbers(self) -> list[float]:
        """A list of finite numbers."""
        self._of(list)
        return [self.item(k)._of(float).value for k in range(len(self.value))]

    def positive(self) -> float:
        """A number above zero."""
        value = float(self._of(float).value)
        if not value > 0.0:
            raise self.error(f"got {value:g}, need a positive number")
        return value

    def _of(self, kind: type[Any]) -> Place:
        value = self.value
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value) if abs(value) < FARTHEST else math.inf
        right = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
        if not right or (kind is float and not abs(value) <= FARTHEST):
            raise self.error(f"got {shown(self.value)}, need {KINDS[kind]}")
        return Place(value, self.file, self.where)


def read_json_document(path: Path, *, what: str) -> Place:
    """What a JSON file holds; `what` it should be, for the message.

    Raises
    ------
    InvalidScenario
        If it cannot be read, is not JSON, or holds no object.
    """
    text = read_text(path, most=MOST_BYTES, what=what)
    try:
        value = json.loads(text)
    except json.JSONDecodeError as error:
        raise InvalidScenario(f"{path}:{error.lineno}: not valid JSON: {error.msg}") from error
    except (RecursionError, ValueError) as error:
        raise InvalidScenario(f"{path}: not valid JSON: {error}") from error
    if not isinstance(value, dict):
        raise InvalidScenario(f"{path}: got {shown(value)}, need an object: {what}")
    return Place(value, str(path))
