"""Obstacles as shapely sees them: exact distances, and nothing of what the search uses.

Polygons keep their holes, a disc is a point and a radius, an occupancy map its runs of cells.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.motion import STANDS, Motion, point_speeds
from maneuver_automaton.collision.outline import outlines
from maneuver_automaton.collision.shapes import AnyObstacle, Disc, OccupancyMap, Shape
from maneuver_automaton.groups import SE2


class ShapePart(NamedTuple):
    """A shapely polygon, or a point with a radius."""

    core: Any
    radius: float  # [m]
    middle: Array  # (2,) of a disc around it [m]
    reach: float  # [m] radius of that disc

    def at(self, poses: Array) -> Any:
        """The core at poses (n, 3): shapely geometries (n,)."""
        import shapely

        frame = SE2(poses[:, None])
        if self.core.geom_type == "Point":
            return shapely.points(frame.act(self.middle)[:, 0])
        shells, *holes = (
            shapely.linearrings(frame.act(shapely.get_coordinates(ring)))
            for ring in (self.core.exterior, *self.core.interiors)
        )
        return shapely.polygons(shells, holes=np.stack(holes, axis=1) if holes else None)


class Nearest(NamedTuple):
    """For each pose the nearest obstacle."""

    distance: Array  # (n,) [m], zero on contact, inf without obstacles
    owner: IntArray  # (n,) its index, -1 without


class _Single(NamedTuple):
    """An obstacle that the tree does not hold: a disc, or a part of a moving one."""

    part: ShapePart
    motion: Motion
    owner: int
    present: tuple[float, float] = (-math.inf, math.inf)  # [s]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ObstacleDistances:
    """Obstacles counted from an origin, prepared once for any number of plans."""

    tree: Any  # of the polygons of static obstacles
    owners: IntArray  # which obstacle each belongs to
    singles: tuple[_Single, ...]
    speed: float  # [m/s] no point of an obstacle is faster

    def nearest(
        self, body: Sequence[ShapePart], poses: Array, times: Array, *, within: float = math.inf
    ) -> Nearest:
        """Distance to the nearest obstacle, and which, at poses (n, 3) and times (n,) [s].

        What stands farther away than `within` [m] may be left out: then none is the nearest.
        """
        best = Nearest(np.full(len(poses), math.inf), np.full(len(poses), -1))
        for part in body:
            if len(self.owners):
                best = _nearer(best, self._nearest_in_tree(part, poses, within))
            if self.singles:
                best = self._nearest_single(part, poses, times, best)
        return best

    def _nearest_in_tree(self, part: ShapePart, poses: Array, within: float) -> Nearest:
        limit = None if math.isinf(within) else within + part.radius
        (rows, which), away = self.tree.query_nearest(
            part.at(poses), max_distance=limit, return_distance=True, all_matches=False
        )
        found = Nearest(np.full(len(poses), math.inf), np.full(len(poses), -1))
        found.distance[rows] = np.maximum(away - part.radius, 0.0)
        found.owner[rows] = self.owners[which]
        return found

    def _nearest_single(
        self, part: ShapePart, poses: Array, times: Array, best: Nearest
    ) -> Nearest:
        """Measured only where discs around both do not say that another is nearer."""
        import shapely

        cores, centers = part.at(poses), SE2(poses).act(part.middle)
        frames = [single.motion.at(times) for single in self.singles]
        between = [
            np.where(
                (times < single.present[0]) | (times > single.present[1]),
                math.inf,
                np.hypot(*(SE2(frame).act(single.part.middle) - centers).T),
            )
            for single, frame in zip(self.singles, frames, strict=True)
        ]
        reaches = np.array([part.reach + single.part.reach for single in self.singles])
        limit = np.minimum(best.distance, (np.array(between).T + reaches).min(axis=1))
        for single, frame, middles, far in zip(self.singles, frames, between, reaches, strict=True):
            near = middles - far <= np.minimum(limit, best.distance)
            rows = np.flatnonzero(near & np.isfinite(middles))
            away = np.full(len(poses), math.inf)
            apart = shapely.distance(cores[rows], single.part.at(frame[rows]))
            away[rows] = np.maximum(apart - part.radius - single.part.radius, 0.0)
            best = _nearer(best, Nearest(away, np.full(len(poses), single.owner)))
        return best


@functools.lru_cache(maxsize=4)
def surroundings_of(
    obstacles: tuple[AnyObstacle, ...], origin: tuple[float, float]
) -> ObstacleDistances:
    """As `surroundings_around`; those of the last maps are kept."""
    return surroundings_around(obstacles, origin)


def surroundings_around(
    obstacles: tuple[AnyObstacle, ...], origin: tuple[float, float]
) -> ObstacleDistances:
    """Obstacles counted from an origin [m].

    Raises
    ------
    ValueError
        If a polygon has no area.
    """
    import shapely

    to_origin = SE2(np.array([-origin[0], -origin[1], 0.0]))
    cores, owners, singles = list[Any](), list[int](), list[_Single]()
    for index, far in enumerate(obstacles):
        obstacle = far.moved(to_origin)
        if isinstance(obstacle, OccupancyMap):
            cores += (runs := runs_of(obstacle))
            owners += [index] * len(runs)
            continue
        for part in parts_of((obstacle.shape,)):
            if obstacle.motion is None and not part.radius:
                cores.append(part.core)
                owners.append(index)
            else:
                moves = obstacle.motion or STANDS
                singles.append(_Single(part, moves, index, obstacle.presence))
    speeds = [s.motion.fastest(float(np.hypot(*s.part.middle)) + s.part.reach) for s in singles]
    return ObstacleDistances(
        tree=shapely.STRtree(cores),
        owners=np.array(owners, dtype=np.int64),
        singles=tuple(singles),
        speed=max(speeds, default=0.0),
    )


def parts_of(shapes: tuple[Shape, ...]) -> list[ShapePart]:
    """Shapes as shapely knows them; a point if there is none."""
    import shapely

    if not shapes:
        return [ShapePart(shapely.Point(0.0, 0.0), 0.0, np.zeros(2), 0.0)]
    parts: list[ShapePart] = []
    for shape in shapes:
        if isinstance(shape, Disc):
            core = shapely.Point(shape.center)
            parts.append(ShapePart(core, shape.radius, shape.center, shape.radius))
            continue
        for polygon in outlines(shape):
            low, high = np.array(polygon.bounds).reshape(2, 2)
            reach = 0.5 * float(np.hypot(*(high - low)))
            parts.append(ShapePart(polygon, 0.0, 0.5 * (low + high), reach))
    return parts


def fastest_point(body: Sequence[ShapePart], twists: Array) -> Array:
    """Speeds (n,) [m/s] no point of a body exceeds at twists (n, 3)."""
    middles, reaches = np.array([part.middle for part in body]), [part.reach for part in body]
    speeds = point_speeds(twists, middles) + np.abs(twists[:, 2, None]) * reaches
    return np.asarray(speeds.max(axis=1))


def _nearer(one: Nearest, other: Nearest) -> Nearest:
    closer = other.distance < one.distance
    return Nearest(
        np.where(closer, other.distance, one.distance), np.where(closer, other.owner, one.owner)
    )


def runs_of(one: OccupancyMap) -> list[Any]:
    """Blocked cells of a map, those next to each other in a row as one polygon."""
    import shapely

    step = np.diff(one.blocked.astype(np.int8), axis=1, prepend=0, append=0)
    row, low = np.nonzero(step == 1)
    _, high = np.nonzero(step == -1)
    cells = np.array([[low, row], [high, row], [high, row + 1], [low, row + 1]], dtype=np.float64)
    corners = SE2(one.origin).act(one.resolution * np.moveaxis(cells, -1, 0))
    return list(shapely.polygons(corners))
