"""A sentence on what a vehicle touches where it stands."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.collision.shapes import AnyObstacle, OccupancyMap, Shape, name_of
from maneuver_automaton.collision.surroundings import Part, parts_of, runs_of, surroundings_of
from maneuver_automaton.groups import SE2

CONTACT = 1e-9  # [m] what is closer touches: places are rounded


def touched(
    footprint: tuple[Shape, ...],
    obstacles: tuple[AnyObstacle, ...],
    pose: ArrayLike,
    *,
    time: float = 0.0,
    margin: float = 0.0,
    origin: tuple[float, float] = (0.0, 0.0),
) -> str:
    """Sentence on the obstacle that a footprint at a pose (3,) and a time [s] touches; else empty.

    Exact, by shapely; obstacles and pose are counted from `origin` [m], so that no digit is lost.

    Raises
    ------
    ValueError
        If a polygon has no area, or the pose is not finite.

    Examples
    --------
    >>> from maneuver_automaton.collision import Box, Disc, Obstacle
    >>> scene = (Obstacle(Disc(1.0), name="pillar"), Obstacle(Box([2.0, 2.0], center=[5.0, 0.0])))
    >>> touched((Disc(0.5),), scene, [1.5, 0.0, 0.0])
    "the vehicle touches obstacle 'pillar'"
    >>> touched((Disc(0.5),), scene, [3.25, 0.0, 0.0], margin=0.5)
    'the vehicle is 0.25 m from obstacle 1 (box near (4, 0)), closer than 0.5 m'
    >>> touched((Disc(0.5),), scene, [2.5, 0.0, 0.0], margin=0.5)
    ''
    """
    here = np.array(as_array("pose", pose, last=3))
    here[:2] -= origin
    return touched_near(footprint, obstacles, here, time=time, margin=margin, origin=origin)


def touched_near(
    footprint: tuple[Shape, ...],
    obstacles: tuple[AnyObstacle, ...],
    here: Array,
    *,
    time: float,
    margin: float,
    origin: tuple[float, float],
) -> str:
    """As `touched`, for a pose (3,) that is counted from the origin already."""
    body = parts_of(footprint)
    found = surroundings_of(obstacles, origin).nearest(body, here[None], np.array([time]))
    distance, index = float(found.distance[0]), int(found.owner[0])
    if distance > too_close(margin):
        return ""
    seen = obstacles[index].moved(SE2(np.array([-origin[0], -origin[1], 0.0])))
    x, y = _point_of(seen, body, here, time) + origin
    name = name_of(obstacles[index], index, f"({x:.10g}, {y:.10g})")
    if distance <= CONTACT:
        return f"the vehicle touches {name}"
    return f"the vehicle is {distance:.6g} m from {name}, closer than {margin:.6g} m"


def too_close(margin: float) -> float:
    """Distance [m] that is not enough where a margin [m] is to be kept; touching never is."""
    return max(CONTACT, margin - CONTACT)


def _point_of(obstacle: AnyObstacle, body: list[Part], here: Array, time: float) -> Array:
    """The point (2,) of an obstacle that is nearest to the body."""
    import shapely

    cores: list[Any]
    if isinstance(obstacle, OccupancyMap):
        cores = runs_of(obstacle)
    else:
        cores = [part.core for part in parts_of((obstacle.at(time),))]
    near = [part.at(here[None])[0] for part in body]
    apart = shapely.distance(np.array(cores)[:, None], np.array(near))
    apart -= [part.radius for part in body]
    which, part = np.unravel_index(int(np.argmin(apart)), apart.shape)
    line = shapely.shortest_line(cores[which], near[part])
    return np.asarray(np.round(shapely.get_coordinates(line)[0], 3) + 0.0)
