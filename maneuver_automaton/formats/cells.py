"""What all formats with cells share: a limit on their number, and where their world ends."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import OccupancyMap
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds

MAX_CELLS = 50_000_000
SMALLEST, LARGEST = 1e-6, 1e6  # of a cell [m]


def check_size(columns: int, rows: int, *, at: str) -> None:
    """Refuse a map without cells, and one with more than the memory of a laptop bears.

    Raises
    ------
    InvalidScenario
        With `at`, the place of the size, in front.
    """
    if not (columns > 0 and rows > 0):
        raise InvalidScenario(f"{at}: got {columns} x {rows} cells, need at least one")
    if columns * rows > MAX_CELLS:
        raise InvalidScenario(
            f"{at}: got {columns} x {rows} cells, need at most {MAX_CELLS // 1_000_000} million"
        )


def check_cell(size: float, *, at: str) -> None:
    """Refuse a size of cells [m] that no map has.

    Raises
    ------
    InvalidScenario
        With `at`, the place of the size, in front.
    """
    if not SMALLEST <= size <= LARGEST:
        raise InvalidScenario(f"{at}: got {size:g} m, need a size of {SMALLEST:g} to {LARGEST:g} m")


def bounds_around(cells: OccupancyMap) -> Bounds:
    """The upright rectangle around a map: a planner has no business where nothing is known.

    Examples
    --------
    >>> around = bounds_around(OccupancyMap([[0, 0]], resolution=0.5, origin=[2.0, 0.0, 0.0]))
    >>> around.x, around.y
    ((2.0, 3.0), (0.0, 0.5))
    """
    width, height = cells.extent
    corners = SE2(cells.origin).act(
        np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    )
    (left, low), (right, high) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return Bounds(x=(left, right), y=(low, high))


def drawn_headings(case: int) -> Array:
    """Headings (2,) of start and goal [rad], where a file states none: the same at every call.

    Examples
    --------
    >>> drawn_headings(3).tolist() == drawn_headings(3).tolist()
    True
    """
    return np.random.default_rng(case).uniform(-np.pi, np.pi, 2)
