"""What a file of another format says of a problem; the rest is left to a scenario beside it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton._lazy import shapely
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import AnyObstacle, OccupancyMap, Polygon, Shape
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.text_source import FARTHEST
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds
from maneuver_automaton.roads import scene

Unknown: TypeAlias = Literal["blocked", "free"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MapFile:
    """An occupancy map and the Nav2 file that states it."""

    map: OccupancyMap
    path: Path  # of the YAML
    unknown: Unknown = "blocked"  # how cells are read of which the file knows nothing


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StatedVehicle:
    """A vehicle that a file names, and its library: controls at their limits, or trims joined."""

    name: str
    automaton: Automaton
    limits: Array  # (n_u, 2) least and greatest controls, where they are narrower than the model's
    footprint: tuple[Shape, ...]
    parts: Mapping[str, tuple[Shape, ...]] = field(default_factory=dict)  # of what it carries


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Statement:
    """One problem, as far as a file states it; None where it says nothing."""

    format: str  # what people call it
    name: str  # of the problem
    obstacles: tuple[AnyObstacle, ...] = ()
    start: Array | None = None  # (3,) [m, m, rad]
    goal: Array | None = None  # (3,) [m, m, rad]
    start_state: Array | None = None  # (n_z,) reduced state there, of the file's vehicle
    goal_state: Array | None = None  # (n_z,)
    headings: bool = True  # whether those of start and goal are stated; else they are drawn
    bounds: Bounds = field(default_factory=Bounds)
    footprint: tuple[Shape, ...] | None = None
    vehicle: StatedVehicle | None = None
    maps: tuple[MapFile, ...] = ()  # those of the obstacles that are in the format of Nav2
    road: scene.RoadScene | None = None  # lanelets, traffic, start and goals of a drive on roads
    fleet: tuple[Statement, ...] = ()  # of several vehicles: what is stated of each, by its name


MAX_CELLS = 50_000_000
SMALLEST, LARGEST = 1e-6, 1e6  # of a cell [m]


def check_size(columns: int, rows: int, *, at: str) -> None:
    """Refuse a map without cells, and one with more than the memory of a laptop bears."""
    if not (columns > 0 and rows > 0):
        raise InvalidScenario(f"{at}: got {columns} x {rows} cells, need at least one")
    if columns * rows > MAX_CELLS:
        raise InvalidScenario(
            f"{at}: got {columns} x {rows} cells, need at most {MAX_CELLS // 1_000_000} million"
        )


def check_cell(size: float, *, at: str) -> None:
    """Refuse a size of cells [m] that no map has."""
    if not SMALLEST <= size <= LARGEST:
        raise InvalidScenario(f"{at}: got {size:g} m, need a size of {SMALLEST:g} to {LARGEST:g} m")


def bounds_around(cells: OccupancyMap) -> Bounds:
    """The upright rectangle around a map: a planner has no business where nothing is known."""
    width, height = cells.extent
    corners = SE2(cells.origin).act(
        np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    )
    (left, low), (right, high) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return Bounds(x=(left, right), y=(low, high))


def world_of(cells: OccupancyMap, path: Path, kind: str, *maps: MapFile) -> Statement:
    """A world with one map, and bounds around it; the rest of the problem is left to others."""
    bounds = bounds_around(cells)
    return Statement(format=kind, name=path.stem, obstacles=(cells,), bounds=bounds, maps=maps)


def drawn_headings(case: int) -> Array:
    """Headings (2,) of start and goal [rad], where a file states none: the same at every call."""
    return np.random.default_rng(case).uniform(-np.pi, np.pi, 2)


FLAT = 1e-14  # width of a ring over its length, below which it is a line
_PLACE = re.compile(r"(.*)\[(\S+) (\S+)\]")


def simple_polygon(corners: ArrayLike, holes: Sequence[ArrayLike] = ()) -> Polygon:
    """A polygon of rings as a file lists them; corners that are listed twice count once."""
    rings = [_ring(corners, "the ring"), *(_ring(hole, "a hole") for hole in holes)]
    polygon = shapely.Polygon(rings[0], rings[1:])
    if not polygon.is_valid:
        raise ValueError(_words(shapely.is_valid_reason(polygon)))
    return Polygon(rings[0], tuple(rings[1:]))


def _ring(corners: ArrayLike, what: str) -> Array:
    ring = as_array(what, corners, last=2)
    ring = np.asarray(ring[(ring != np.roll(ring, -1, axis=0)).any(axis=1)])
    if len(ring) < 3:
        raise ValueError(f"{what} has {len(ring)} different corners, need at least 3")
    if np.abs(ring).max() > FARTHEST:
        raise ValueError(f"{what} has a corner beyond {FARTHEST:g} m, need one that is nearer")
    sides = ring[1:] - ring[0]
    if np.linalg.svd(sides / np.abs(sides).max(), compute_uv=False)[1] < FLAT:
        raise ValueError(f"{what} encloses no area, need corners that are not on one line")
    return ring


def _words(reason: str) -> str:
    """What Shapely says of a polygon, in words that say what would be right."""
    match = _PLACE.fullmatch(reason)
    kind = match.group(1) if match else reason
    at = f" at ({float(match.group(2)):.6g}, {float(match.group(3)):.6g})" if match else ""
    if "Self-intersection" in kind:
        return f"the ring crosses or touches itself{at}, need a simple polygon"
    if "Hole lies outside" in kind:
        return f"a hole lies outside the polygon{at}, need holes inside it"
    if "nested" in kind:
        return f"a hole lies inside another one{at}, need holes apart from each other"
    return f"is no simple polygon: {kind.lower()}{at}"
