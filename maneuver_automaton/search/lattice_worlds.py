"""The obstacles and zones of a problem around its vehicle, prepared once for a map."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

from maneuver_automaton.collision import AnyObstacle, Obstacle, Shape, Zone
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.collision.heights import Layer
from maneuver_automaton.collision.layers import always, bands_of
from maneuver_automaton.collision.world import World, own_frame, world_of
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.maneuver_motion import Part

_Shapes = tuple[Shape, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Worlds:
    """A map around the largest part of a vehicle, in one frame."""

    whole: World  # all obstacles, whatever their heights
    plane: World  # those in the way at every altitude within the bounds, around the first part
    bands: tuple[Layer, ...]  # obstacles between neighbouring heights, in the problem's altitudes
    between: tuple[World, ...]  # the worlds of these
    zones: tuple[World, ...]  # every zone as if it were an obstacle
    outer: World  # all obstacles and all zones, so that paths lead round them


def world_around(problem: Problem) -> World:
    """The obstacles of a problem around its footprint, prepared once for a map."""
    frame = own_frame(problem.obstacles, problem.goals[0].pose)
    return world_of(problem.obstacles, problem.footprint, frame, keep=problem.margin)


def worlds_around(problem: Problem, parts: tuple[Part, ...]) -> Worlds:
    """The obstacles and zones of a problem around the parts of its vehicle."""
    low, high = problem.bounds.z or (-math.inf, math.inf)
    below, above = problem.body_height
    return _worlds(
        problem.obstacles,
        problem.zones,
        tuple(part.shapes for part in parts),
        own_frame(problem.obstacles, problem.goals[0].pose),
        (low + below, high + above) if problem.start.size > 3 else None,
        keep=problem.margin,
    )


@functools.lru_cache(maxsize=16)
def _worlds(
    obstacles: tuple[AnyObstacle, ...],
    zones: tuple[Zone, ...],
    bodies: tuple[_Shapes, ...],
    frame: tuple[float, ...],
    heights: tuple[float, float] | None,
    *,
    keep: float,
) -> Worlds:
    """`heights` [m]: lowest and highest point of the vehicle within the bounds; None in a plane."""
    largest = max(bodies, key=lambda shapes: body_of(shapes).reach)

    def around(these: tuple[AnyObstacle, ...]) -> World:
        return world_of(these, largest, frame, keep=keep)

    bands = bands_of(obstacles, in_space=heights is not None)
    whole = around(obstacles)
    plane = whole if heights is None else around(always(bands, low=heights[0], high=heights[1]))
    solid = tuple(Obstacle(zone.shape) for zone in zones)
    return Worlds(
        whole=whole,
        plane=replace(plane, body=body_of(bodies[0])),
        bands=bands,
        between=tuple(around(band.obstacles) for band in bands),
        zones=tuple(around((one,)) for one in solid),
        outer=around((*obstacles, *solid)) if solid else whole,
    )
