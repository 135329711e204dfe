"""One damaged file by a random generator: numbers first, then keys, lines, bytes."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import yaml

NUMBER = re.compile(rb"(?<![\w.#-])-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?(?![\w.])")
# fmt: off
ODD = (
    "0", "-0.0", "1", "-1", "2", "0.5", "3", "-3", "7", "1e-9", "1e-300", "5e-324", "1e3", "1e6",
    "1e7", "-1e7", "9.9e8", "1e9", "1.1e9", "-1e10", "1e12", "1e15", "-1e15", "1e16", "1e30",
    "1e153", "1e154", "1e200", "-1e200", "1.7e308", "1e400", "2147483648", "4294967295",
    "9007199254740993", "9223372036854775807", "18446744073709551616",
    "1234567890123456789012345678901234567890", "nan", "inf", "-inf", ".nan", ".inf", "NaN",
    "Infinity", "0x1F", "1_000", "1e", "--1", "",
)
# fmt: on
WORDS = [None, True, False, "", "word", "0", "\u00e9\n\t", "x" * 5000, "../../etc/passwd", "a:b"]
NUMBERS = [0, -1, 1e9, 1e15, 10**40, 7, 3.5]
VALUES: list[Any] = [*WORDS, *NUMBERS, [], {}, [[]], [1], [0.0, 0.0, 0.0], [[0, 0], [1, 1]]]


def mutated(content: bytes, ending: str, rng: np.random.Generator) -> bytes:
    """The content of a file with one to three things changed.

    Examples
    --------
    >>> mutated(b"a: 1.5", ".yaml", np.random.default_rng(0)) != b"a: 1.5"
    True
    """
    for _ in range(rng.integers(1, 4)):
        chance = rng.random()
        if chance < 0.62:
            content = _other_number(content, rng)
        elif chance < 0.84 and ending in (".json", ".yaml"):
            content = _other_tree(content, ending, rng)
        elif chance < 0.95:
            content = _other_line(content, rng)
        else:
            content = _other_bytes(content, rng)
    return content


def _other_number(content: bytes, rng: np.random.Generator) -> bytes:
    """One number, or several in a row, become others."""
    found = list(NUMBER.finditer(content))
    if not found:
        return _other_line(content, rng)
    one = found[rng.integers(len(found))]
    word = one.group()
    kind = rng.integers(6)
    if kind == 0:
        other = word[1:] if word.startswith(b"-") else b"-" + word
    elif kind <= 2:
        power = float(rng.choice([-9, -3, -1, 1, 2, 3, 6, 9, 15]))
        other = repr(float(word) * 10.0**power * rng.uniform(0.5, 2.0)).encode()
    elif kind == 3:
        other = found[rng.integers(len(found))].group()
    else:
        other = str(rng.choice(ODD)).encode()
    return content[: one.start()] + other + content[one.end() :]


def _other_tree(content: bytes, ending: str, rng: np.random.Generator) -> bytes:
    """One value of a JSON or YAML file goes, comes twice, changes places or becomes another."""
    try:
        root = json.loads(content) if ending == ".json" else yaml.safe_load(content)
    except (ValueError, yaml.YAMLError):
        return _other_bytes(content, rng)
    places = list(_places(root))
    if not places:
        return _other_bytes(content, rng)
    inside, key = places[rng.integers(len(places))]
    kind = rng.integers(5)
    if kind == 0:
        del inside[key]
    elif kind == 1 and isinstance(inside, list):
        inside[key:key] = [inside[key]] * int(rng.choice([1, 1, 2, 1000]))
    elif kind == 2:
        other, place = places[rng.integers(len(places))]
        inside[key] = json.loads(json.dumps(other[place], default=str))
    else:
        inside[key] = VALUES[rng.integers(len(VALUES))]
    try:
        text = json.dumps(root) if ending == ".json" else yaml.safe_dump(root, width=100)
    except (ValueError, TypeError, RecursionError):
        return content[: len(content) // 2]
    return text.encode("utf-8", "surrogatepass")


def _places(root: Any) -> Any:
    """Every place of a tree that holds a value."""
    inside = range(len(root)) if isinstance(root, list) else root if isinstance(root, dict) else ()
    for key in list(inside):
        yield root, key
        yield from _places(root[key])


def _other_line(content: bytes, rng: np.random.Generator) -> bytes:
    """A line, or a word of it, goes, comes twice, or changes places with another."""
    mark = b"\n" if content.count(b"\n") > 2 or b"," not in content else b","
    lines = content.split(mark)
    j, k = rng.integers(len(lines), size=2)
    kind = rng.integers(4)
    if kind == 0:
        del lines[j]
    elif kind == 1:
        lines[j:j] = [lines[j]] * int(rng.choice([1, 1, 3]))
    elif kind == 2:
        lines[j], lines[k] = lines[k], lines[j]
    else:
        words = lines[j].split(b" ")
        del words[rng.integers(len(words))]
        lines[j] = b" ".join(words)
    return mark.join(lines)


def _other_bytes(content: bytes, rng: np.random.Generator) -> bytes:
    """The file ends early, or some bytes are others."""
    if rng.random() < 0.5 or not content:
        return content[: rng.integers(len(content) + 1)]
    changed = bytearray(content)
    for _ in range(rng.integers(1, 4)):
        changed[rng.integers(len(changed))] = rng.integers(256)
    return bytes(changed)
