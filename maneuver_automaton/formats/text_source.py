"""Files as text, tables and XML: read once, up to a limit, every complaint with its place."""

from __future__ import annotations

import csv
import math
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from maneuver_automaton._files import open_input
from maneuver_automaton._limits import FARTHEST as FARTHEST
from maneuver_automaton.errors import InvalidScenario

MAX_BYTES = 5_000_000  # of a file that people write
MAX_MAP_BYTES = 200_000_000  # of a file that holds a map, cell by cell


def read_bytes(
    path: Path | zipfile.Path, *, most: int = MAX_BYTES, what: str = "a scenario"
) -> bytes:
    """The content of a file, or of one in an archive, of at most `most` bytes: `what`."""
    try:
        with open_input(path) if isinstance(path, Path) else path.open("rb") as stream:
            content = stream.read(most + 1)
    except FileNotFoundError as error:
        raise InvalidScenario(f"{path}: no such file") from error
    except IsADirectoryError as error:
        raise InvalidScenario(f"{path}: is a folder, need a file") from error
    # ValueError: a NUL in the path; the others: an archive that is broken or locked
    except (OSError, ValueError, zipfile.BadZipFile, zlib.error, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InvalidScenario(f"{brief(str(path), 200)}: cannot be read: {reason}") from error
    if len(content) > most:
        raise too_long(str(path), most, what=what)
    return content


def too_long(name: str, most: int, *, what: str) -> InvalidScenario:
    """The error of a file of more than `most` bytes: raise it."""
    return InvalidScenario(f"{name}: is longer than {most // 1_000_000} MB, too long for {what}")


def read_text(path: Path, *, most: int = MAX_BYTES, what: str = "a scenario") -> str:
    """The text of a file in UTF-8 or UTF-16, less its mark; raises InvalidScenario."""
    content = read_bytes(path, most=most, what=what)
    encoding = "utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InvalidScenario(f"{path}:{line}: is not a text file in UTF-8") from error


def lines_of(text: str) -> list[str]:
    r"""Lines of a text from any system; one that is not finished counts."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return lines[:-1] if lines[-1] == "" else lines


def table_of(
    path: Path, names: Sequence[str], *, what: str, most: int = MAX_BYTES
) -> Iterator[tuple[str, dict[str, str]]]:
    """Of each row of a CSV its place, for messages, and its words by the names of their columns."""
    rows = list(csv.reader(lines_of(read_text(path, most=most, what=what))))
    head = [word.strip() for word in rows[0]] if rows else []
    for name in names:
        if name not in head:
            raise InvalidScenario(f"{path}:1: the column {name!r} is missing")
    for line, row in enumerate(rows[1:], start=2):
        if any(word.strip() for word in row):
            check_columns(row, head, at=f"{path}:{line}")
            yield f"{path}:{line}", dict(zip(head, map(str.strip, row), strict=True))


def check_columns(row: Sequence[str], names: Sequence[str], *, at: str) -> None:
    """Refuse a row that has not one word for each name; raises InvalidScenario."""
    if len(row) != len(names):
        raise InvalidScenario(
            f"{at}: got {len(row)} columns, need {len(names)}: {', '.join(names)}"
        )


def finite(token: str, *, at: str) -> float:
    """The number that a word states; `at` is its place, for the message."""
    value = _number(token)
    if not math.isfinite(value):
        raise InvalidScenario(f"{at}: got {_brief(token)}, need a finite number")
    if abs(value) > FARTHEST:
        raise InvalidScenario(f"{at}: got {_brief(token)}, need at most {FARTHEST:g} in size")
    return value


def whole(token: str, *, at: str, least: int = 0) -> int:
    """The whole number that a word states; `at` is its place, for the message."""
    value = _number(token)
    if not (value >= least and value.is_integer() and value < 2**53):
        raise InvalidScenario(f"{at}: got {_brief(token)}, need a whole number of at least {least}")
    return int(value)


def _number(token: str) -> float:
    try:
        return float(token) if "_" not in token else math.nan
    except ValueError:
        return math.nan


def _brief(token: str) -> str:
    word = token.strip()
    return repr(brief(word, 40)) if word else "nothing"


def brief(text: str, most: int) -> str:
    """A text as a message shows it, with at most so many characters."""
    return text if len(text) <= most else text[: most - 3] + "..."


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
        """The first child of the first name, its first of the second, ...; `a|b` is either."""
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
