"""Paths of an SVG drawing as points, each with the line it stands in.

Straight lines only (commands m, l, h, v, z and their capitals), and of transformations only
translations, which add up over the groups around a path.

Source: W3C (2011), *Scalable Vector Graphics 1.1*, Sec. 8.3.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.text_source import finite, read_bytes
from maneuver_automaton.formats.xml_source import parse

_TOKEN = re.compile(r"\s*,?\s*(?:([A-Za-z])|([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?))")
_TRANSLATE = re.compile(r"\s*translate\s*\(\s*([^\s,()]+)\s*(?:[\s,]\s*([^\s,()]+)\s*)?\)\s*")
PER_POINT = {"m": 2, "l": 2, "h": 1, "v": 1}  # numbers that a command takes again and again


@dataclass(frozen=True, slots=True, eq=False)
class DrawnPath:
    """Where a pen goes."""

    points: Array  # (n, 2), y downwards as in the drawing, translations added
    line: int


class _Reader:
    """Collect the paths of a drawing: one use."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.shifts = [np.zeros(2)]  # of the elements around the current one
        self.drawn: list[DrawnPath] = []
        self.hidden = 0  # how deep inside definitions, which are not drawn
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.StartDoctypeDeclHandler = self._doctype

    def read(self, content: bytes) -> list[DrawnPath]:
        parse(self.parser, content, self.path)
        return self.drawn

    @property
    def at(self) -> str:
        return f"{self.path}:{self.parser.CurrentLineNumber}"

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        name = tag.rpartition(":")[2]
        if name == "defs" or self.hidden:
            self.hidden += 1
            return
        shift = self.shifts[-1]
        if "transform" in attributes:
            shift = shift + _translation(attributes["transform"], self.at)
        self.shifts.append(shift)
        if name == "path":
            points = _points(attributes.get("d", ""), self.at)
            self.drawn.append(DrawnPath(points + shift, self.parser.CurrentLineNumber))

    def _end(self, tag: str) -> None:
        if self.hidden:
            self.hidden -= 1
        else:
            self.shifts.pop()

    def _doctype(self, *_: object) -> None:
        raise InvalidScenario(f"{self.at}: has a document type, need a drawing without one")


def read_svg_paths(path: Path) -> tuple[DrawnPath, ...]:
    """The paths of a drawing, in their order.

    Raises
    ------
    InvalidScenario
        If it is no XML, holds no path, or one that is not made of straight lines.
    """
    drawn = _Reader(path).read(read_bytes(path, what="a drawing"))
    if not drawn:
        raise InvalidScenario(f"{path}: holds no path, need at least one")
    return tuple(drawn)


def _translation(text: str, at: str) -> Array:
    match = _TRANSLATE.fullmatch(text)
    if match is None:
        raise InvalidScenario(f"{at}: transform: got {text[:60]!r}, need translate(x, y)")
    return np.array([finite(word or "0", at=f"{at}: transform") for word in match.groups()])


def _points(text: str, at: str) -> Array:
    """Where the pen of a path goes, (n, 2)."""
    tokens = _tokens(text.strip(), at)
    points: list[Array] = []
    pen, begin, command = np.zeros(2), np.zeros(2), ""
    k = 0
    while k < len(tokens):
        if tokens[k].isalpha():
            command, k = tokens[k], k + 1
            if command in "zZ":
                pen = begin
                continue
        n = PER_POINT.get(command.lower(), 0)
        if not n or (not points and command not in "mM"):
            need = "m, l, h, v or z" if points else "m first"
            raise InvalidScenario(f"{at}: d: got the command {command!r}, need {need}")
        words = [word for word in tokens[k : k + n] if not word.isalpha()]
        if len(words) < n:
            raise InvalidScenario(f"{at}: d: the command {command!r} misses a number")
        pen = _moved(pen, command, [finite(word, at=f"{at}: d") for word in words])
        points.append(pen)
        k += n
        if command in "mM":  # more numbers are lines
            begin, command = pen, "l" if command == "m" else "L"
    return np.array(points).reshape(-1, 2)


def _tokens(text: str, at: str) -> list[str]:
    """Letters and numbers of a path."""
    tokens, place = [], 0
    while place < len(text):
        match = _TOKEN.match(text, place)
        if match is None:
            raise InvalidScenario(f"{at}: d: got {text[place : place + 20]!r}, need a number")
        tokens.append(match.group(1) or match.group(2))
        place = match.end()
    return tokens


def _moved(pen: Array, command: str, numbers: list[float]) -> Array:
    """Where the pen is after one command."""
    axes = {"h": [0], "v": [1]}.get(command.lower(), [0, 1])
    after = pen.copy()
    after[axes] = np.array(numbers) + (pen[axes] if command.islower() else 0.0)
    return after
