"""MovingAI: grid maps of characters (.map), and lists of queries on them (.scen).

Row 0 of a map is the top; here y points up, so cell (column, row) of a map of h rows is the square
from (column, h - 1 - row) to (column + 1, h - row). A cell is 1 m. Free are `.` and `G`; all
others block: `@`, `O`, `T`, and the terrains `S` and `W`. Starts and goals are in the middle of
cells. Queries know no heading: it is drawn, from a seed that is the number of the query.

Source: Sturtevant (2012), *Benchmarks for Grid-Based Pathfinding*, IEEE TCIAIG 4(2).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.collision import OccupancyMap
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.statement import (
    Statement,
    bounds_around,
    check_size,
    drawn_headings,
    world_of,
)
from maneuver_automaton.formats.text_source import (
    MAX_MAP_BYTES,
    check_columns,
    finite,
    lines_of,
    read_text,
    whole,
)

FREE, BLOCKED = ".G", "@OTSW"
COLUMNS = (
    *("bucket", "map", "width", "height", "start x", "start y", "goal x", "goal y"),
    "optimal length",
)
_OTHER = re.compile(f"[^{FREE}{BLOCKED}]")


def load_movingai_map(path: Path) -> OccupancyMap:
    """The cells of a .map file, 1 m each, the lower left corner at the origin."""
    lines = lines_of(read_text(path, most=MAX_MAP_BYTES, what="a map"))
    sizes: dict[str, int] = {}
    for k, key in enumerate(("type", "height", "width", "map")):
        words = lines[k].split() if k < len(lines) else []
        need = f"{key} octile" if key == "type" else key if key == "map" else f"{key} N"
        if not words or words[0] != key or len(words) != (1 if key == "map" else 2):
            got = repr(lines[k][:40]) if k < len(lines) else "nothing"
            raise InvalidScenario(f"{path}:{k + 1}: got {got}, need {need!r}")
        if key in ("height", "width"):
            sizes[key] = whole(words[1], at=f"{path}:{k + 1}: {key}", least=1)
    check_size(sizes["width"], sizes["height"], at=str(path))
    rows = lines[4:]
    while rows and not rows[-1].strip():
        rows.pop()
    if len(rows) != sizes["height"]:
        raise InvalidScenario(f"{path}: got {len(rows)} rows, need {sizes['height']}, its height")
    for k, row in enumerate(rows):
        if len(row) != sizes["width"]:
            raise InvalidScenario(
                f"{path}:{k + 5}: got {len(row)} cells, need {sizes['width']}, the width"
            )
        if other := _OTHER.search(row):
            raise InvalidScenario(
                f"{path}:{k + 5}: got the cell {other.group()!r}, need one of {FREE + BLOCKED}"
            )
    codes = np.frombuffer("".join(rows).encode("ascii"), dtype=np.uint8)
    blocked = ~np.isin(codes, np.frombuffer(FREE.encode(), dtype=np.uint8))
    cells: NDArray[np.bool_] = blocked.reshape(sizes["height"], sizes["width"])
    return OccupancyMap(cells[::-1], resolution=1.0, name=path.name)


def save_movingai_map(cells: OccupancyMap, path: Path) -> None:
    """Write the cells as a .map file, which states neither their size nor where they are."""
    rows, columns = cells.blocked.shape
    codes = np.where(cells.blocked[::-1], ord("@"), ord(".")).astype(np.uint8)
    text = "\n".join(row.tobytes().decode("ascii") for row in codes)
    write_text_atomically(path, f"type octile\nheight {rows}\nwidth {columns}\nmap\n{text}\n")


def read_movingai_map(path: Path) -> tuple[Statement, ...]:
    """A world with one map, and bounds around it; the rest is left to others."""
    return (world_of(load_movingai_map(path), path, "MovingAI map"),)


def read_movingai_scenario(path: Path) -> tuple[Statement, ...]:
    """One problem for every query of a .scen file; its map lies beside it."""
    lines = lines_of(read_text(path, most=MAX_MAP_BYTES, what="a list of queries"))
    first = lines[0].split() if lines else []
    if len(first) != 2 or first[0] != "version":
        got = repr(lines[0][:40]) if lines else "nothing"
        raise InvalidScenario(f"{path}:1: got {got}, need 'version 1'")
    finite(first[1], at=f"{path}:1: version")
    beside = map_beside(path)
    cells = load_movingai_map(beside)
    statements: list[Statement] = []
    for at, columns in _queries(path):
        case = len(statements)
        ends, headings = _ends(columns, at, cells, beside), drawn_headings(case)
        statements.append(
            Statement(
                format="MovingAI",
                name=f"{path.stem} case {case}",
                obstacles=(cells,),
                start=np.append(ends[0], headings[0]),
                goal=np.append(ends[1], headings[1]),
                headings=False,
                bounds=bounds_around(cells),
            )
        )
    return tuple(statements)


def map_beside(path: Path) -> Path:
    """The map of a .scen file: the one that its first query names, in the same folder."""
    for at, columns in _queries(path):
        beside = path.parent / _name(columns[1])
        if "\0" in columns[1] or not beside.is_file():
            raise InvalidScenario(f"{at}: map: got {columns[1]!r}, but there is no {beside}")
        return beside
    raise InvalidScenario(f"{path}: holds no query, need at least one")


def _queries(path: Path) -> Iterator[tuple[str, list[str]]]:
    lines = lines_of(read_text(path, most=MAX_MAP_BYTES, what="a list of queries"))
    for k, line in enumerate(lines[1:]):
        if columns := line.strip().split("\t") if "\t" in line.strip() else line.split():
            check_columns(columns, COLUMNS, at=f"{path}:{k + 2}")
            yield f"{path}:{k + 2}", columns


def _name(stated: str) -> str:
    """The name of a map, whatever folder it is stated in."""
    return stated.replace("\\", "/").rpartition("/")[2]


def _ends(columns: list[str], at: str, cells: OccupancyMap, beside: Path) -> Array:
    if _name(columns[1]) != beside.name:
        raise InvalidScenario(f"{at}: map: got {columns[1]!r}, need {beside.name!r} in every line")
    rows, width = cells.blocked.shape
    whole(columns[0], at=f"{at}: bucket")
    for k, size in ((2, width), (3, rows)):
        if whole(columns[k], at=f"{at}: {COLUMNS[k]}") != size:
            raise InvalidScenario(
                f"{at}: {COLUMNS[k]}: got {columns[k]}, need {size}, that of {beside.name}"
            )
    finite(columns[8], at=f"{at}: optimal length")
    numbers = [whole(columns[k], at=f"{at}: {COLUMNS[k]}") for k in range(4, 8)]
    for k, (value, size) in enumerate(zip(numbers, (width, rows) * 2, strict=True)):
        if value >= size:
            raise InvalidScenario(
                f"{at}: {COLUMNS[4 + k]}: got {value}, need 0 to {size - 1}, a cell of the map"
            )
    x, y = np.array(numbers).reshape(2, 2).T
    return np.stack([x + 0.5, rows - 1 - y + 0.5], axis=-1)
