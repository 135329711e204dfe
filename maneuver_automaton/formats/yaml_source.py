"""YAML as plain values, each with the line it stands in.

The numbers and words of YAML 1.2 and JSON: `1e-6` is a number, `no` and `on` are words, there
are no dates. Tags, duplicate keys, and aliases that multiply are errors. Parsing works on
events, without recursion, and stops at the first limit that is exceeded.
"""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import yaml

from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.text_source import FARTHEST, MAX_BYTES, brief, too_long

MAX_DEPTH = 40
NESTED = f"lists and mappings are nested more than {MAX_DEPTH} deep"
TOO_DEEP = "exceeded maximum nesting depth"  # what libyaml says of it
MAX_COPIED = 10_000  # values that aliases may add to those that are written
MAX_SHOWN = 60  # characters of a value that a message shows

Where = tuple[str | int, ...]  # keys and positions from the top of the file to a value

_PARSER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_NOT_TEXT = yaml.reader.Reader.NON_PRINTABLE
_WORDS: Mapping[str, Any] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
    **dict.fromkeys((".inf", ".Inf", ".INF", "+.inf", "+.Inf", "+.INF"), float("inf")),
    **dict.fromkeys(("-.inf", "-.Inf", "-.INF"), float("-inf")),
}
_WHOLE = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")


@dataclass(frozen=True, slots=True, eq=False)
class Document:
    """What a file says, and where."""

    name: str  # what messages call the file
    value: Any
    lines: Mapping[Where, int] = field(repr=False)
    homes: Mapping[Where, Where] = field(default_factory=dict, repr=False)  # of what was moved

    def line_of(self, where: Where) -> int:
        """Line of a value, or of the nearest one around it that is in the file."""
        where = self._in_file(where)
        while where not in self.lines and where:
            where = where[:-1]
        return self.lines.get(where, 1)

    def error(self, where: Where, what: str) -> InvalidScenario:
        """An error that names file, line and field: raise it."""
        label = spelled(self._in_file(where))
        return InvalidScenario(
            f"{self.name}:{self.line_of(where)}: {label + ': ' if label else ''}{what}"
        )

    def _in_file(self, where: Where) -> Where:
        """Where a value stands in the file, if `value` holds it elsewhere."""
        for n in range(len(where), -1, -1) if self.homes else ():
            if where[:n] in self.homes:
                return (*self.homes[where[:n]], *where[n:])
        return where


def spelled(where: Where) -> str:
    """How a message spells a place."""
    return "".join(
        f"[{step}]" if isinstance(step, int) else f".{step}" for step in where
    ).removeprefix(".")


def shown(value: Any) -> str:
    """A value as a message shows it, in the words of YAML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "nothing"
    if isinstance(value, list):
        return brief("[" + ", ".join(shown(item) for item in value[:MAX_SHOWN]) + "]", MAX_SHOWN)
    if isinstance(value, dict):
        items = (f"{key}: {shown(value[key])}" for key in list(value)[:MAX_SHOWN])
        return brief("{" + ", ".join(items) + "}", MAX_SHOWN)
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return brief(repr(value), MAX_SHOWN)


def parse(text: str, *, name: str, what: str = "a scenario") -> Document:
    """Values and lines of a YAML text; `name` is its file's, `what` it should hold."""
    if len(text) > MAX_BYTES:
        raise too_long(name, MAX_BYTES, what=what)
    if bad := _NOT_TEXT.search(text):
        line = text.count("\n", 0, bad.start()) + 1
        raise InvalidScenario(
            f"{name}:{line}: is not a text file: it has the character {bad.group()!r}"
        )
    try:
        return _Builder(name, what).build(yaml.parse(text, Loader=_PARSER))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f":{mark.line + 1}" if mark else ""
        said = _problem(error, text.splitlines()[mark.line :] if mark else [])
        if TOO_DEEP in said:  # more than libyaml itself reads
            raise InvalidScenario(f"{name}{place}: {NESTED}") from error
        raise InvalidScenario(f"{name}{place}: not valid YAML: {said}") from error
    except (yaml.YAMLError, UnicodeEncodeError) as error:
        said = " ".join(str(error).split())
        raise InvalidScenario(f"{name}: not valid YAML: {said}") from error


@dataclass(slots=True)
class _Unfinished:
    """A list or mapping whose end has not been read yet."""

    value: list[Any] | dict[str, Any]
    where: Where
    line: int
    anchor: str | None
    nodes_before: int
    key: str | None = None  # of a mapping: the key whose value comes next


class _Builder:
    """Collect events into values: one use."""

    def __init__(self, name: str, what: str) -> None:
        self.name = name
        self.what = what
        self.lines: dict[Where, int] = {}
        self.stack: list[_Unfinished] = []
        self.anchors: dict[str, tuple[Any, int]] = {}  # value, number of nodes in it
        self.nodes = 0  # read so far, aliases expanded
        self.copied = 0  # of these, added by aliases
        self.roots: list[Any] = []

    def build(self, events: Iterator[Any]) -> Document:
        for event in events:
            self._take(event)
        if not self.roots or self.roots == [None]:
            raise InvalidScenario(f"{self.name}: is empty, need {self.what}")
        return Document(self.name, self.roots[0], self.lines)

    def _take(self, event: Any) -> None:
        line = event.start_mark.line + 1
        if isinstance(event, yaml.DocumentStartEvent):
            if self.roots:
                raise self._error(line, "a second document begins here, need one")
        elif isinstance(event, yaml.ScalarEvent):
            self._refuse_tag(event, line)
            plain = event.style is None or event.style == ""
            self.nodes += 1
            if self._awaits_key():
                self._set_key(event.value, line)
            else:
                self._add(scalar(event.value) if plain else event.value, line, event.anchor, 1)
        elif isinstance(event, yaml.AliasEvent):
            self._expand(str(event.anchor), line)
        elif isinstance(event, yaml.SequenceStartEvent | yaml.MappingStartEvent):
            self._begin(event, line)
        elif isinstance(event, yaml.SequenceEndEvent | yaml.MappingEndEvent):
            done = self.stack.pop()
            self._add(done.value, done.line, done.anchor, self.nodes - done.nodes_before)

    def _begin(self, event: Any, line: int) -> None:
        self._refuse_tag(event, line)
        if self._awaits_key():
            raise self._error(line, "a list or mapping is used as a key, need a word")
        if len(self.stack) >= MAX_DEPTH:
            raise self._error(line, NESTED)
        value: Any = [] if isinstance(event, yaml.SequenceStartEvent) else {}
        self.stack.append(_Unfinished(value, self._next_place(), line, event.anchor, self.nodes))
        self.nodes += 1

    def _expand(self, anchor: str, line: int) -> None:
        if anchor not in self.anchors:
            raise self._error(line, f"the alias *{anchor} stands for nothing that ends before it")
        if self._awaits_key():
            raise self._error(line, "an alias is used as a key, need a word")
        value, nodes = self.anchors[anchor]
        self.nodes += nodes
        self.copied += nodes
        if self.copied > MAX_COPIED:
            raise self._error(line, f"aliases multiply to more than {MAX_COPIED} values")
        self._add(value, line, None, nodes)

    def _add(self, value: Any, line: int, anchor: str | None, nodes: int) -> None:
        self.lines.setdefault(self._next_place(), line)
        if anchor is not None:
            self.anchors[anchor] = (value, nodes)
        if not self.stack:
            self.roots.append(value)
            return
        inside = self.stack[-1]
        if isinstance(inside.value, list):
            inside.value.append(value)
        else:
            assert inside.key is not None
            inside.value[inside.key] = value
            inside.key = None

    def _awaits_key(self) -> bool:
        if not self.stack:
            return False
        return isinstance(self.stack[-1].value, dict) and self.stack[-1].key is None

    def _set_key(self, key: str, line: int) -> None:
        inside = self.stack[-1]
        if key in inside.value:
            place = spelled((*inside.where, key))
            raise self._error(
                line,
                f"{place}: the key stands twice, first in line {self.lines[(*inside.where, key)]}",
            )
        inside.key = key
        self.lines[(*inside.where, key)] = line

    def _next_place(self) -> Where:
        if not self.stack:
            return ()
        inside = self.stack[-1]
        step = len(inside.value) if isinstance(inside.value, list) else inside.key
        assert step is not None
        return (*inside.where, step)

    def _refuse_tag(self, event: Any, line: int) -> None:
        if event.tag is not None:
            raise self._error(line, f"the tag {event.tag!r} is not admitted, need plain values")

    def _error(self, line: int, what: str) -> InvalidScenario:
        return InvalidScenario(f"{self.name}:{line}: {what}")


def scalar(text: str) -> Hashable:
    """A plain scalar by the core rules of YAML 1.2."""
    if text in _WORDS:
        return _WORDS[text]  # type: ignore[no-any-return]
    if _WHOLE.fullmatch(text):
        if len(text) > 200:
            return float("inf")
        base = {"0o": 8, "0x": 16}.get(text[:2], 10)
        value = int(text if base == 10 else text[2:], base)
        return value if abs(value) < 2**63 else float(value)  # which says that it is huge
    if _FLOAT.fullmatch(text):
        return float(text)
    return text


def _problem(error: yaml.MarkedYAMLError, from_there: list[str]) -> str:
    """What YAML complains about, in one line."""
    problem = " ".join((error.problem or error.context or "unreadable").split())
    line = from_there[0] if from_there else ""
    if "cannot start any token" in problem and "\t" in line[: len(line) - len(line.lstrip())]:
        return "a tab stands where only spaces may"
    return problem


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


def positive_at(document: Document, where: Where) -> float:
    """The positive number at a place; raises InvalidScenario."""
    value = number_at(document, where)
    if not value > 0.0:
        raise document.error(where, f"got {value:g}, need a positive number")
    return value


def numbers_at(document: Document, where: Where, n: int, need: str) -> tuple[float, ...]:
    """The list of n numbers at a place; raises InvalidScenario."""
    values = value_at(document, where, list, need)
    if len(values) != n:
        raise document.error(where, f"got {len(values)} numbers, need {n}: {need}")
    return tuple(number_at(document, (*where, k)) for k in range(n))


def check_names(document: Document, key: str, names: Sequence[str]) -> None:
    """Refuse entries of a list of which two have one name; raises InvalidScenario."""
    for k, name in enumerate(names):
        if (first := names.index(name)) < k:
            said = f"the name of {key}[{first}] too, need another one"
            raise document.error((key, k, "name"), f"got {shown(name)}, {said}")


def sizes_at(document: Document, where: Where) -> tuple[float, ...]:
    """Length and width at a place; raises InvalidScenario."""
    sizes = numbers_at(document, where, 2, "[length, width]")
    if not all(size > 0.0 for size in sizes):
        raise document.error(where, f"got {shown(list(sizes))}, need positive sizes")
    return sizes
