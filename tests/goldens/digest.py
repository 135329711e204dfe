"""What is kept of a document: its keys, its texts, and of numbers how many there are and how large.

A list of mappings is looked at column by column, and by kind where it states one, so that what is
kept stays short; a number that moved shows in the least, the greatest or the sum of its column.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

DIGITS = 10
EQUAL = 1e-6  # share by which numbers may differ: other processors round in other ways
MOST_TEXTS = 40


def digest(value: Any) -> Any:
    """What is kept of a document."""
    if isinstance(value, Mapping):
        return {str(key): digest(one) for key, one in value.items()}
    if not isinstance(value, list | tuple):
        return _rounded(value) if isinstance(value, float) else value
    if value and all(isinstance(one, Mapping) for one in value):
        return {f"{len(part)} x {kind}": _columns(part) for kind, part in _by_kind(value).items()}
    flat = list(_flat(value))
    if flat and all(isinstance(one, int | float) and not isinstance(one, bool) for one in flat):
        known = [float(one) for one in flat if math.isfinite(one)] or [0.0]
        sizes = (min(known), max(known), math.fsum(known))
        return [len(flat), len(known), *map(_rounded, sizes)]
    if flat and all(isinstance(one, Mapping) for one in flat):
        return digest(flat)
    return [len(flat), *dict.fromkeys(flat)][: MOST_TEXTS + 1]


def differences(before: Any, now: Any, at: str = "") -> list[str]:
    """One line for each place at which two digests differ."""
    if isinstance(before, dict) and isinstance(now, dict):
        found = []
        for key in dict.fromkeys([*before, *now]):
            if key not in now:
                found.append(f"{at}/{key}: is gone")
            elif key not in before:
                found.append(f"{at}/{key}: is new")
            else:
                found += differences(before[key], now[key], f"{at}/{key}")
        return found
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        pairs = zip(before, now, strict=True)
        return [line for k, (a, b) in enumerate(pairs) for line in differences(a, b, f"{at}[{k}]")]
    return [] if _same(before, now) else [f"{at}: {now!r}, was {before!r}"]


def _same(before: Any, now: Any) -> bool:
    if isinstance(before, float) and isinstance(now, int | float):
        return math.isclose(before, now, rel_tol=EQUAL, abs_tol=EQUAL)
    return bool(before == now)


def _by_kind(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    """The mappings of a list by what they say that they are."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        inner = row.get("properties")
        kind = row.get("kind") or (inner.get("kind") if isinstance(inner, Mapping) else None)
        found.setdefault(str(kind or "row"), []).append(row)
    return found


def _columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    keys = dict.fromkeys(key for row in rows for key in row)
    return {str(key): digest([row[key] for row in rows if key in row]) for key in keys}


def _flat(value: Any) -> Iterator[Any]:
    if isinstance(value, list | tuple):
        for one in value:
            yield from _flat(one)
    else:
        yield value


def _rounded(number: float) -> float:
    return float(f"{number:.{DIGITS}g}") + 0.0
