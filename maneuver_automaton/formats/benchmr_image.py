"""Image worlds of Bench-MR: a picture whose dark pixels are blocked, a pixel a cell of 1 m.

The lower left corner of the picture is the origin. Dark is a shade below one half.
"""

from __future__ import annotations

from pathlib import Path

from maneuver_automaton.collision import OccupancyMap
from maneuver_automaton.formats.cells import bounds_around
from maneuver_automaton.formats.grey_image import read_grey_image
from maneuver_automaton.formats.statement import Statement

DARK = 0.5


def read_benchmr_image(path: Path) -> tuple[Statement, ...]:
    """A world with one map, and bounds around it; the rest is left to others.

    Raises
    ------
    InvalidScenario
        If the picture cannot be read.
    """
    dark = read_grey_image(path).shade < DARK
    cells = OccupancyMap(dark[::-1], resolution=1.0, name=path.name)
    return (
        Statement(
            format="Bench-MR image",
            name=path.stem,
            obstacles=(cells,),
            bounds=bounds_around(cells),
        ),
    )
