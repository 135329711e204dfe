"""What a file of another format says of a problem; the rest is left to a scenario beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import AnyObstacle, OccupancyMap, Shape
from maneuver_automaton.problem import Bounds
from maneuver_automaton.roads import RoadScene

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
    road: RoadScene | None = None  # lanelets, traffic, start and goals of a drive on roads
    fleet: tuple[Statement, ...] = ()  # of several vehicles: what is stated of each, by its name
