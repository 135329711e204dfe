"""Environments of SBPL: a header of keys, then the costs of all cells (.cfg, .env, .nav3d).

x runs along a row and y along the rows, so the first row is the lowest, and the corner of its first
cell is the origin. Cells of cost `obsthresh` and above are blocked; those between are costly for
SBPL, but free here. With `cellsize(meters)` (nav3d) start and end are poses in metres and radians.
Without it (nav2d) they are cells, of 1 m here: a point starts and ends in the middle of a cell, at
a heading that is drawn from a fixed seed.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import open_input
from maneuver_automaton.collision import OccupancyMap
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.statement import (
    Statement,
    bounds_around,
    check_cell,
    check_size,
    drawn_headings,
)
from maneuver_automaton.formats.text_source import MAX_MAP_BYTES, finite, lines_of, read_text, whole

SIZE, CELL, GRID = "discretization(cells):", "cellsize(meters):", "environment:"
METRES, CELLS = "(meters,rads):", "(cells):"
KEYS: Mapping[str, int] = {  # and how many numbers follow each
    SIZE: 2,
    "NumThetaDirs:": 1,
    "obsthresh:": 1,
    "cost_inscribed_thresh:": 1,
    "cost_possibly_circumscribed_thresh:": 1,
    CELL: 1,
    "nominalvel(mpersecs):": 1,
    "timetoturn45degsinplace(secs):": 1,
    f"start{METRES}": 3,
    f"end{METRES}": 3,
    f"start{CELLS}": 2,
    f"end{CELLS}": 2,
}


_Header: TypeAlias = Mapping[str, list[tuple[str, int]]]  # words after each key, and their lines


def is_sbpl(path: Path) -> bool:
    """Whether a file begins like an environment."""
    with open_input(path) as stream:
        return SIZE.encode() in stream.read(2000)


def read_sbpl(path: Path) -> tuple[Statement, ...]:
    """The problem of an environment; the vehicle is left to others."""
    lines = lines_of(read_text(path, most=MAX_MAP_BYTES, what="an environment"))
    header, begin = _header(path, lines)
    suffix = METRES if CELL in header else CELLS
    for key in (SIZE, "obsthresh:", f"start{suffix}", f"end{suffix}"):
        if key not in header:
            with_size = " beside cellsize(meters)" if CELL in header and suffix in key else ""
            raise InvalidScenario(f"{path}: the key {key[:-1]!r} is missing{with_size}")
    columns, rows = (whole(word, at=f"{path}:{k}: {SIZE[:-1]}") for word, k in header[SIZE])
    check_size(columns, rows, at=f"{path}:{header[SIZE][0][1]}: {SIZE[:-1]}")
    costs = _costs(path, lines, begin, columns * rows)
    numbers = {
        key: [finite(word, at=f"{path}:{k}: {key[:-1]}") for word, k in words]
        for key, words in header.items()
        if key != SIZE
    }
    cell = float(numbers[CELL][0]) if CELL in numbers else 1.0
    if CELL in numbers:
        check_cell(cell, at=f"{path}:{header[CELL][0][1]}: {CELL[:-1]}")
    blocked = costs.reshape(rows, columns) >= numbers["obsthresh:"][0]
    cells = OccupancyMap(blocked, resolution=cell, name=path.name)
    ends = [_end(path, header, numbers, what, cells) for what in ("start", "end")]
    return (
        Statement(
            format="SBPL",
            name=path.stem,
            obstacles=(cells,),
            start=ends[0],
            goal=ends[1],
            headings=CELL in numbers,
            bounds=bounds_around(cells),
        ),
    )


def _header(path: Path, lines: list[str]) -> tuple[_Header, int]:
    """The numbers of each key, and how many lines stand before that of the cells."""
    header: dict[str, list[tuple[str, int]]] = {}
    place = ("", 0)  # the key that is being read, and its line
    for k, line in enumerate(lines):
        for text in line.split():
            key, number = place
            if not text.endswith(":") and key:
                header[key].append((text, k + 1))
                continue
            if key and len(header[key]) != KEYS[key]:
                raise InvalidScenario(
                    f"{path}:{number}: {key[:-1]}: got {len(header[key])} numbers, need {KEYS[key]}"
                )
            if text == GRID:
                return header, k
            if text not in KEYS:
                known = ", ".join(name[:-1] for name in (*KEYS, GRID))
                raise InvalidScenario(f"{path}:{k + 1}: got {text[:40]!r}, need one of {known}")
            if text in header:
                raise InvalidScenario(f"{path}:{k + 1}: {text[:-1]}: the key stands twice")
            place = (text, k + 1)
            header[text] = []
    raise InvalidScenario(f"{path}:{max(len(lines), 1)}: the key {GRID[:-1]!r} is missing")


def _costs(path: Path, lines: list[str], begin: int, n: int) -> Array:
    """Costs (n,) of the cells, row by row; what stands where in a line does not matter."""
    body = [lines[begin].partition(GRID)[2], *lines[begin + 1 :]]
    words = " ".join(body).split()
    if len(words) != n:
        raise InvalidScenario(
            f"{path}:{begin + 1}: {GRID[:-1]}: got {len(words)} cells, need {n}, "
            f"width x height of {SIZE[:-1]}"
        )
    try:
        costs = np.array(words).astype(np.int64)
    except (ValueError, OverflowError):
        costs = np.array([-1])
    if costs.min() < 0:
        for k, line in enumerate(body):
            for word in line.split():
                whole(word, at=f"{path}:{begin + k + 1}: a cell")
        costs = np.array([float(word) for word in words])
    return costs.astype(np.float64)


def _end(
    path: Path, header: _Header, numbers: Mapping[str, list[float]], what: str, cells: OccupancyMap
) -> Array:
    if CELL in numbers:
        return np.array(numbers[f"{what}{METRES}"])
    key = f"{what}{CELLS}"
    rows, columns = cells.blocked.shape
    middle = []
    for (word, line), size in zip(header[key], (columns, rows), strict=True):
        at = f"{path}:{line}: {key[:-1]}"
        value = whole(word, at=at)
        if value >= size:
            raise InvalidScenario(f"{at}: got {value}, need 0 to {size - 1}, a cell of the map")
        middle.append(value + 0.5)
    return np.array([*middle, drawn_headings(0)[0 if what == "start" else 1]])
