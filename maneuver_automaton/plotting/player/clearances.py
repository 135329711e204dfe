"""Distance between a body and the nearest obstacle over time, for the curve of a player.

These are distances at samples, to be looked at. What is proven between them is in the audit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import AnyObstacle, Disc, Obstacle, OccupancyMap, Shape
from maneuver_automaton.collision.outline import outlines
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.distances import thinned
from maneuver_automaton.plotting.player.local import POSE_DIGITS, rounded
from maneuver_automaton.plotting.regions import map_paths

MOST_SAMPLES = 400
DISC_SEGMENTS = 32  # of a quarter: a disc of 1 m is off by 0.3 mm


def sample_times(switching_times: Array) -> Array:
    """Times (n,) at which a clearance is measured: evenly, and at every switch."""
    if not switching_times.size:
        return np.zeros(1)
    return np.union1d(
        np.linspace(switching_times[0], switching_times[-1], MOST_SAMPLES), switching_times
    )


def clearance_entry(
    times: Array,
    bodies: Sequence[tuple[Array, Array]],
    obstacles: Sequence[AnyObstacle],
    *,
    heights: Array | None = None,
    leave: bool = False,
) -> dict[str, Any] | None:
    """Least distance at each of the `times` (n,) [s]; None if there is never an obstacle.

    Parameters
    ----------
    times : (n,) array
    bodies : sequence of (ring, poses)
        Outlines (m, 2) and where each is at the times (n, 3); an outline of one corner is a point.
    obstacles : sequence of obstacles
    heights : (n, 2) array, optional
        Altitudes of the lower and the upper side of the body [m].
    leave : bool
        A moving obstacle is there for the time of its motion only.
    """
    if not obstacles:
        return None
    import shapely

    placed = [_placed(ring, poses) for ring, poses in bodies]
    least = np.full(len(times), np.inf)
    flat: list[Any] = []
    for one in obstacles:
        if isinstance(one, OccupancyMap):
            flat += [shapely.Polygon(p) for path in map_paths(one) for p in path.to_polygons()]
        elif one.motion is not None:
            apart = _apart(placed, _moved(one, times))
            least = np.minimum(least, np.where(_there(one, times, leave), apart, np.inf))
        elif heights is not None and one.height is not None:
            below, above = one.height[0] - heights[:, 1], heights[:, 0] - one.height[1]
            rise = np.maximum(np.maximum(below, above), 0.0)
            least = np.minimum(least, np.hypot(_apart(placed, _solid(one.shape)), rise))
        else:
            flat += list(_solid(one.shape))
    if flat:
        tree = shapely.STRtree(flat)
        for body in placed:
            (asked, _), found = tree.query_nearest(body, return_distance=True, all_matches=False)
            least[asked] = np.minimum(least[asked], found)
    known = np.isfinite(least)
    if not known.any():
        return None
    return {"t": rounded(times[known], POSE_DIGITS), "v": rounded(least[known], 4)}


def _placed(ring: Array, poses: Array) -> Any:
    """A shapely geometry (n,) for the outline at each pose."""
    import shapely

    corners = SE2(poses[:, None, :3]).act(ring)
    return shapely.points(corners[:, 0]) if len(ring) == 1 else shapely.polygons(corners)


def _apart(placed: Sequence[Any], geometries: Sequence[Any]) -> Array:
    """Least distance (n,) between any of the bodies and any of the geometries, each one or (n,)."""
    import shapely

    each = [shapely.distance(body, one) for body in placed for one in geometries]
    return np.asarray(np.min(each, axis=0))


def _solid(shape: Shape) -> list[Any]:
    import shapely

    if isinstance(shape, Disc):
        return [shapely.Point(shape.center).buffer(shape.radius, quad_segs=DISC_SEGMENTS)]
    return outlines(shape)


def _moved(one: Obstacle, times: Array) -> list[Any]:
    """Parts of a moving obstacle, each as a geometry (n,) at the times."""
    import shapely

    assert one.motion is not None
    frames = SE2(one.motion.at(times)[:, None])
    return [
        shapely.polygons(frames.act(shapely.get_coordinates(part.exterior)))
        for part in _solid(one.shape)
    ]


def _there(one: Obstacle, times: Array, leave: bool) -> Any:
    from_s, until_s = one.presence
    there = (times >= from_s) & (times <= until_s)
    if not leave or one.motion is None:
        return there
    first, last = one.motion.time[[0, -1]]
    return there & (times >= first) & (times <= last)


def distance_curve(times: Array, distances: Array) -> dict[str, Any] | None:
    """Least distances over time; None if there never is another."""
    known = np.isfinite(distances)
    if not known.any():
        return None
    at, least = thinned(times[known], distances[known], most=MOST_SAMPLES)
    return {"t": rounded(at, POSE_DIGITS), "v": rounded(least, 4)}
