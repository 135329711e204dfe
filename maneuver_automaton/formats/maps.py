"""Occupancy maps of every format that is one map, told apart by their endings."""

from __future__ import annotations

from pathlib import Path

from maneuver_automaton.collision import OccupancyMap
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.movingai import load_movingai_map
from maneuver_automaton.formats.nav2_map import load_nav2_map
from maneuver_automaton.formats.statement import Unknown

NAV2_ENDINGS, MOVINGAI_ENDING = (".yaml", ".yml"), ".map"


def load_map(path: Path | str, *, unknown: Unknown = "blocked") -> OccupancyMap:
    """The occupancy map of a file: of Nav2 and ROS (.yaml beside an image), or MovingAI (.map).

    A picture alone states no size of its pixels: `OccupancyMap.of_picture` takes both.

    Parameters
    ----------
    path : Path or str
        The file.
    unknown : str
        How to read the cells of a Nav2 map of which it knows nothing: "blocked" or "free".

    Raises
    ------
    InvalidScenario
        If the file or its image cannot be used: file, line, field, value, what would be right.
    """
    path = Path(path)
    if unknown not in ("blocked", "free"):
        raise InvalidScenario(f"{path}: unknown: got {unknown!r}, need 'blocked' or 'free'")
    if path.suffix.lower() in NAV2_ENDINGS:
        return load_nav2_map(path, unknown=unknown)
    if path.suffix.lower() == MOVINGAI_ENDING:
        return load_movingai_map(path)
    raise InvalidScenario(
        f"{path}: is no map, need a file of Nav2 ({', '.join(NAV2_ENDINGS)}) or MovingAI "
        f"({MOVINGAI_ENDING}); OccupancyMap.of_picture reads an image"
    )
