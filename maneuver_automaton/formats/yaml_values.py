"""Values at places of a YAML document, of a kind; what is not tells its place."""

from __future__ import annotations

from typing import Any

from maneuver_automaton.formats.text_source import FARTHEST
from maneuver_automaton.formats.yaml_source import Document, Where, shown


def value_at(document: Document, where: Where, kind: Any, need: str) -> Any:
    """The value at a place, of a kind; raises InvalidScenario."""
    value = document.value
    for step in where:
        held = range(len(value)) if isinstance(value, list) else value
        if not isinstance(held, range | dict) or step not in held:
            raise document.error(where, f"is missing, need {need}")
        value = value[step]
    if not isinstance(value, kind) or isinstance(value, bool):
        raise document.error(where, f"got {shown(value)}, need {need}")
    return value


def number_at(document: Document, where: Where) -> float:
    """The number at a place; raises InvalidScenario."""
    value = value_at(document, where, int | float, "a finite number")
    if not abs(value) <= FARTHEST:
        raise document.error(
            where, f"got {shown(value)}, need a finite number of at most {FARTHEST:g} in size"
        )
    return float(value)


def numbers_at(document: Document, where: Where, n: int, need: str) -> tuple[float, ...]:
    """The list of n numbers at a place; raises InvalidScenario."""
    values = value_at(document, where, list, need)
    if len(values) != n:
        raise document.error(where, f"got {len(values)} numbers, need {n}: {need}")
    return tuple(number_at(document, (*where, k)) for k in range(n))


def sizes_at(document: Document, where: Where) -> tuple[float, ...]:
    """Length and width at a place; raises InvalidScenario."""
    sizes = numbers_at(document, where, 2, "[length, width]")
    if not all(size > 0.0 for size in sizes):
        raise document.error(where, f"got {shown(list(sizes))}, need positive sizes")
    return sizes
