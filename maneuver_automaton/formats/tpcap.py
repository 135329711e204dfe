"""Cases of the parking competition TPCAP: one flat list of numbers, separated by commas.

Start pose, goal pose, number of obstacles, number of corners of each, then x and y of every
corner. Metres and radians; the pose is that of the rear axle's middle. The polygons may be
concave, and overlap. No boundary is stated, nor the vehicle, which every case shares.

Source: Li et al. (2023), *Online Competition of Trajectory Planning for Automated Parking*, IEEE
Trans. Intelligent Vehicles 8(1), and the files of its benchmark.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import open_input
from maneuver_automaton._limits import MOST_HEADING
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.documents import errors_at
from maneuver_automaton.formats.statement import Statement, simple_polygon
from maneuver_automaton.formats.text_source import finite, lines_of, read_text, whole

FORMAT = "TPCAP"
HEAD = ("x0", "y0", "theta0", "xf", "yf", "thetaf", "n")
_FIRST = re.compile(r"\s*[-+]?[.0-9]")


def is_tpcap(path: Path) -> bool:
    """Whether a file begins like a case: with a number, not with the head of a table."""
    with open_input(path) as stream:
        return bool(_FIRST.match(stream.read(80).decode("utf-8-sig", errors="replace")))


def read_tpcap(path: Path) -> tuple[Statement, ...]:
    """The problem of a case; the vehicle is left to others."""
    values = _values(path)
    if len(values) < len(HEAD):
        raise InvalidScenario(
            f"{path}: got {len(values)} numbers, need at least {len(HEAD)}: {', '.join(HEAD)}"
        )
    poses = np.array([finite(token, at=at) for token, at in values[:6]])
    for k in (2, 5):
        if abs(poses[k]) > MOST_HEADING:
            raise InvalidScenario(
                f"{values[k][1]} ({HEAD[k]}): got {poses[k]:g}, need at most {MOST_HEADING:g} rad"
            )
    token, place = values[6]
    n = whole(token, at=f"{place} (number of obstacles)")
    if n > len(values) - 7:
        raise InvalidScenario(
            f"{place}: got {n} obstacles, but {len(values) - 7} numbers follow; "
            "need the number of corners of each"
        )
    counts = [
        whole(token, at=f"{at} (corners of obstacle {k + 1})", least=3)
        for k, (token, at) in enumerate(values[7 : 7 + n])
    ]
    corners = values[7 + n :]
    if len(corners) != 2 * sum(counts):
        raise InvalidScenario(
            f"{path}: got {len(corners)} numbers after those of corners, need {2 * sum(counts)}: "
            f"x and y of {sum(counts)} corners"
        )
    return (
        Statement(
            format=FORMAT,
            name=path.stem,
            obstacles=tuple(_obstacles(corners, counts)),
            start=poses[:3],
            goal=poses[3:],
        ),
    )


def _values(path: Path) -> list[tuple[str, str]]:
    """All numbers, whatever the rows, and where each is; a comma may stand at the end of each."""
    values: list[tuple[str, str]] = []
    for k, line in enumerate(lines_of(read_text(path, what="a case of TPCAP"))):
        words = line.strip().removesuffix(",").split(",")
        if words == [""]:
            continue
        at = f"{path}:{k + 1}: value"
        values += [(word, f"{at} {len(values) + i + 1}") for i, word in enumerate(words)]
    return values


def _obstacles(corners: list[tuple[str, str]], counts: list[int]) -> list[Obstacle]:
    obstacles, done = [], 0
    for k, count in enumerate(counts):
        part = corners[done : done + 2 * count]
        done += 2 * count
        ring: Array = np.array([finite(token, at=at) for token, at in part]).reshape(-1, 2)
        name = f"obstacle {k + 1}"
        with errors_at(f"{part[0][1]}: {name}"):
            obstacles.append(Obstacle(simple_polygon(ring), name=name))
    return obstacles
