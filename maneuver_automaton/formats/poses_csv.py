"""Tables of poses in time, as trackers and simulators write them: obstacles that move.

A line of names, then a row for each pose: `name,time_s,x_m,y_m,heading_rad,length_m,width_m`. Rows
of one name are one rectangle, in the order of their times; before its first pose and after its last
one it stands there.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from maneuver_automaton._files import open_input
from maneuver_automaton.collision import Box, Motion, Obstacle
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.documents import errors_at
from maneuver_automaton.formats.statement import Statement
from maneuver_automaton.formats.text_source import MAX_MAP_BYTES, finite, table_of

NAMES = ("name", "time_s", "x_m", "y_m", "heading_rad", "length_m", "width_m")


def is_poses(path: Path) -> bool:
    """Whether a file begins with the names of such a table."""
    try:
        with open_input(path) as stream:
            head = stream.read(80).decode("utf-8-sig", errors="replace")
    except OSError:
        return False
    return [one.strip() for one in head.split("\n")[0].split(",")] == list(NAMES)


def read_poses(path: Path) -> tuple[Statement, ...]:
    """The obstacles of a table; the rest of the problem is left to a scenario beside it."""
    rows: dict[str, list[tuple[list[float], str]]] = {}
    for at, row in table_of(path, NAMES, most=MAX_MAP_BYTES, what="a table of poses"):
        numbers = [finite(row[name], at=f"{at}: {name}") for name in NAMES[1:]]
        if not min(numbers[4:]) > 0.0:
            length, width = row["length_m"], row["width_m"]
            raise InvalidScenario(f"{at}: got {length} x {width} m, need positive sizes")
        rows.setdefault(row["name"], []).append((numbers, at))
    if not rows:
        raise InvalidScenario(f"{path}: holds no pose, need a row for each")
    for own in rows.values():
        for (before, _), (now, at) in pairwise(own):
            if not now[0] > before[0]:
                raise InvalidScenario(f"{at}: time_s: got {now[0]:g}, need more than {before[0]:g}")
            if now[4:] != before[4:]:
                raise InvalidScenario(f"{at}: length_m, width_m: changed, need those before")
    with errors_at(path):
        moving = tuple(
            Obstacle(
                Box(own[0][0][4:]),
                motion=Motion([one[0] for one, _ in own], [one[1:4] for one, _ in own]),
            )
            for own in rows.values()
        )
    return (Statement(format="a table of poses", name=path.stem, obstacles=moving),)
