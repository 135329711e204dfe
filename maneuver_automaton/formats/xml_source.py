"""XML files as small trees whose elements know their lines."""

from __future__ import annotations

import zipfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from maneuver_automaton._files import open_input
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.text_source import finite, read_bytes, whole

CHUNK = 1 << 16  # bytes that are looked at in one go


@dataclass(slots=True)
class Element:
    """An element of an XML file; grows while it is read."""

    tag: str
    attributes: dict[str, str]
    file: Path | zipfile.Path
    line: int
    text: str = ""
    children: list[Element] = field(default_factory=list)

    @property
    def at(self) -> str:
        """File, line and name, for messages."""
        return f"{self.file}:{self.line}: {self.tag}"

    def all(self, tag: str) -> Iterator[Element]:
        """The children of a name."""
        return (child for child in self.children if child.tag == tag)

    def get(self, *tags: str) -> Element | None:
        """The first child of the first name, its first child of the second, ...; None if missing.

        Names that are joined by ``|`` are alternatives.
        """
        here: Element | None = self
        for tag in tags:
            if here is None:
                return None
            names = tag.split("|")
            here = next((child for child in here.children if child.tag in names), None)
        return here

    def need(self, *tags: str) -> Element:
        """As `get`; raises InvalidScenario if it is missing."""
        here = self
        for tag in tags:
            found = here.get(tag)
            if found is None:
                raise here.error(f"the element {tag.replace('|', ' or ')} is missing")
            here = found
        return here

    def number(self) -> float:
        """The finite number that is its text; raises InvalidScenario."""
        return finite(self.text, at=self.at)

    def attribute(self, name: str) -> str:
        """An attribute; raises InvalidScenario if it is missing."""
        if name not in self.attributes:
            raise self.error(f"the attribute {name!r} is missing")
        return self.attributes[name]

    def whole(self, name: str, *, least: int = 0) -> int:
        """A whole number that is an attribute; raises InvalidScenario."""
        return whole(self.attribute(name), at=f"{self.at}: {name}", least=least)

    def error(self, what: str) -> InvalidScenario:
        """The error of this element: raise it."""
        return InvalidScenario(f"{self.at}: {what}")


def read_xml(path: Path | zipfile.Path, *, what: str, most: int) -> Element:
    """The root element of a file of at most `most` bytes; `what` is what it should hold."""
    parser, begun = expat.ParserCreate(), [Element("", {}, path, 0)]
    parser.buffer_text = True

    def start(tag: str, attributes: dict[str, str]) -> None:
        begun.append(Element(tag, attributes, path, parser.CurrentLineNumber))
        begun[-2].children.append(begun[-1])

    def text(found: str) -> None:
        begun[-1].text += found

    def doctype(*_: object) -> None:
        line = parser.CurrentLineNumber
        raise InvalidScenario(f"{path}:{line}: has a document type, need a file without one")

    parser.StartElementHandler, parser.StartDoctypeDeclHandler = start, doctype
    parser.CharacterDataHandler, parser.EndElementHandler = text, lambda _: begun.pop()
    try:
        parser.Parse(read_bytes(path, most=most, what=what), True)
    except expat.ExpatError as error:
        said = expat.ErrorString(error.code)
        raise InvalidScenario(f"{path}:{error.lineno}: not valid XML: {said}") from error
    except LookupError as error:  # an encoding that Python does not know
        raise InvalidScenario(f"{path}: not valid XML: {error}") from error
    return begun[0].children[0]  # expat accepts no file without an element


def root_tag(path: Path) -> str:
    """Name of the first element of a file, however much stands before it; empty if it is no XML."""
    return next(_tags(path), (0, ""))[1]


def tags_below_root(path: Path) -> Counter[str]:
    """How often each name occurs right below the first element, as far as a file is valid XML."""
    return Counter(tag for depth, tag in _tags(path) if depth == 1)


def _tags(path: Path) -> Iterator[tuple[int, str]]:
    """Depth and name of one element after another, until a fault or a document type."""
    parser, open_tags, met = expat.ParserCreate(), list[str](), list[tuple[int, str]]()

    def start(tag: str, _: dict[str, str]) -> None:
        met.append((len(open_tags), tag))
        open_tags.append(tag)

    def doctype(*_: object) -> None:
        raise LookupError  # nothing of such a file is read

    parser.StartElementHandler, parser.StartDoctypeDeclHandler = start, doctype
    parser.EndElementHandler = lambda _: open_tags.pop()
    with open_input(path) as stream:
        while chunk := stream.read(CHUNK):
            try:
                parser.Parse(chunk, False)
            except (expat.ExpatError, LookupError):
                chunk = b""
            yield from met
            if not chunk:
                return
            met.clear()
