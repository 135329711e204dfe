"""Whether a body at a place touches something whichever way it looks: proven, not sampled."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision.blocked import CONTACT
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.collision.shapes import AnyObstacle, OccupancyMap, Shape
from maneuver_automaton.collision.surroundings import parts_of, runs_of
from maneuver_automaton.groups import SE2

FIRST = 16  # headings that are looked at first, side by side
MOST = 1024  # headings in all: with more, nothing is proven


def touched_all_round(
    footprint: tuple[Shape, ...],
    obstacles: tuple[AnyObstacle, ...],
    place: Array,
    *,
    margin: float = 0.0,
) -> bool:
    """Whether a footprint whose frame is at a place is too near to obstacles at every heading.

    A point of the body that is deep inside an obstacle stays inside while the body turns a little,
    which proves it for all headings about one. False also where that takes too many headings.
    Obstacles that move do not count.

    Parameters
    ----------
    footprint : tuple of Shape
    obstacles : tuple of obstacles
    place : (2,) array
        Of the footprint's frame [m].
    margin : float
        Nearer than this is too near [m].

    Examples
    --------
    >>> from maneuver_automaton.collision import Box, Disc, Obstacle
    >>> walls = [Obstacle(Box([6.0, 0.2], [0.0, y])) for y in (-1.2, 1.2)]
    >>> touched_all_round((Box([3.0, 2.0]),), tuple(walls), np.zeros(2))
    False
    >>> posts = [Obstacle(Box([0.2, 6.0], [x, 0.0])) for x in (-1.2, 1.2)]
    >>> touched_all_round((Box([3.0, 2.0]),), (*walls, *posts), np.zeros(2))
    True
    """
    import shapely

    known = body_of(footprint)
    reach = math.hypot(known.middle_x, known.middle_y) + known.reach + margin
    solid = _solid_near(obstacles, place, reach)
    if solid.is_empty:
        return False
    body = _joined((part.core, part.radius) for part in parts_of(footprint))
    half = math.pi / FIRST
    waiting = [((2 * k + 1) * half, half) for k in range(FIRST)]
    for _ in range(MOST):
        heading, half = waiting.pop()
        turned = shapely.affinity.rotate(body, heading, origin=(0.0, 0.0), use_radians=True)
        if turned.distance(solid) >= max(margin - CONTACT, CONTACT):
            return False
        if not any(
            lever * half <= depth + margin - 2.0 * CONTACT for lever, depth in _held(turned, solid)
        ):
            waiting += [(heading - 0.5 * half, 0.5 * half), (heading + 0.5 * half, 0.5 * half)]
        if not waiting:
            return True
    return False


def _held(body: Any, solid: Any) -> Iterator[tuple[float, float]]:
    """Points of a body: how far from its frame, and how deep in a solid, or less than 0 beside."""
    import shapely

    both = shapely.intersection(body, solid)
    if both.is_empty or both.area == 0.0:
        (x, y), _ = shapely.get_coordinates(shapely.shortest_line(body, solid))
        yield math.hypot(x, y), -float(shapely.distance(body, solid))
        return
    inside = [shapely.get_coordinates(part.representative_point()) for part in _parts(both)]
    points = np.concatenate([*inside, shapely.get_coordinates(both)])
    depths = shapely.distance(shapely.points(points), shapely.boundary(solid))
    yield from zip(np.hypot(*points.T).tolist(), depths.tolist(), strict=True)


def _parts(whole: Any) -> list[Any]:
    import shapely

    return [one for one in shapely.get_parts(whole) if one.area > 0.0]


def _solid_near(obstacles: tuple[AnyObstacle, ...], place: Array, reach: float) -> Any:
    """Static obstacles within reach of a place, as one geometry counted from it."""
    import shapely

    seen = SE2(np.array([-place[0], -place[1], 0.0]))
    solids: list[tuple[Any, float]] = []
    for far in obstacles:
        obstacle = far.moved(seen)
        if isinstance(obstacle, OccupancyMap):
            solids += [(run, 0.0) for run in runs_of(obstacle)]
        elif obstacle.motion is None:
            solids += [(part.core, part.radius) for part in parts_of((obstacle.shape,))]
    here = shapely.Point(0.0, 0.0)
    return _joined(
        (core, radius) for core, radius in solids if core.distance(here) <= reach + radius
    )


def _joined(solids: Iterable[tuple[Any, float]]) -> Any:
    """One geometry of cores, each grown by its radius [m]; discs as polygons inside them."""
    import shapely

    return shapely.union_all([
        core.buffer(radius, quad_segs=32) if radius else core for core, radius in solids
    ])  # fmt: skip
