"""How near the vehicles of a fleet are to each other over time, at samples, by shapely.

These are distances to be looked at. What is proven between the samples is in the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.cast import Actor, rings_with_radius

STEP_S, MOST_STEPS = 0.05, 20_000  # between samples; no more of them, however long it takes
AT_ONCE = 2_000_000  # pairs in memory
Numbers = NDArray[Any]


def distance_times(begin: float, end: float) -> Array:
    """Times (n,) at which distances are measured [s], 0.05 s apart unless it takes long."""
    steps = min(max(1, int(np.ceil((end - begin) / STEP_S))), MOST_STEPS)
    return np.linspace(begin, end, steps + 1)


def nearest_others(actors: Sequence[Actor], times: Array) -> Array:
    """Distance of each vehicle from the nearest other at times (n,) [s]: (n, vehicles) [m].

    It is inf where there is no other. Pairs that a circle around each shows to be further apart
    than another pair are not measured.
    """
    rows = [
        (owner, ring, grown, part.pose_at(times))
        for owner, one in enumerate(actors)
        for part in one.parts
        for ring, grown in rings_with_radius(part.bodies.get("", ()))
    ]
    owners = np.array([owner for owner, *_ in rows])
    seen = [[one.mover.is_there(time) for time in times.tolist()] for one in actors]
    there = np.array(seen)[owners]  # (parts, n)
    heights = np.array([_heights(one, times) for one in actors])[owners]  # (parts, n, 2)
    apart = np.full((len(times), len(actors)), np.inf)
    chunk = max(1, AT_ONCE // len(rows) ** 2)
    for first in range(0, len(times), chunk):
        part = slice(first, first + chunk)
        moved = [(ring, grown, poses[part, :3]) for _, ring, grown, poses in rows]
        nearest = _nearest(moved, owners, there[:, part], heights[:, part])
        for row, owner in enumerate(owners):
            apart[part, owner] = np.minimum(apart[part, owner], nearest[row])
    return apart


def _heights(one: Actor, times: Array) -> Array:
    """Lowest and highest point of a vehicle at times (n,) [s]: (n, 2) [m], infinite if any."""
    low, high = (0.0, 0.0) if one.mover.problem is None else one.mover.problem.body_height
    altitude = one.mover.pose_at(times)[:, 3:].sum(axis=1)  # 0 in the plane
    if one.mover.start.size == 3 and not low < high:
        low, high = -np.inf, np.inf
    return np.column_stack([altitude + low, altitude + high])


def _nearest(
    rows: Sequence[tuple[Array, float, Array]], owners: Numbers, there: Numbers, heights: Array
) -> Array:
    """Distance (parts, n) of each part from the nearest part of another vehicle."""
    import shapely

    middles, radii, placed = [], [], []
    for ring, grown, poses in rows:
        middle = 0.5 * (ring.min(axis=0) + ring.max(axis=0))
        middles.append(SE2(poses).act(middle))
        radii.append(float(np.linalg.norm(ring - middle, axis=1).max()) + grown)
        corners = SE2(poses[:, None]).act(ring)
        one = shapely.points(corners[:, 0]) if len(ring) == 1 else shapely.polygons(corners)
        placed.append(one)
    at, solid = np.array(middles), np.array(placed)
    wide, larger = np.array(radii), np.array([by for _, by, _ in rows])
    low = np.linalg.norm(at[:, None] - at[None], axis=-1) - (wide[:, None] + wide)[..., None]
    above = np.maximum(heights[:, None, :, 0] - heights[None, :, :, 1], 0.0)
    above = np.maximum(above, above.swapaxes(0, 1))
    low = np.where(above > 0.0, np.hypot(np.maximum(low, 0.0), above), low)
    low[owners[:, None] == owners] = np.inf
    low[~(there[:, None] & there[None])] = np.inf

    def measured(one: Numbers, other: Numbers, time: Numbers) -> Array:
        apart = shapely.distance(solid[one, time], solid[other, time])
        aside = np.maximum(apart - larger[one] - larger[other], 0.0)
        return np.asarray(np.hypot(aside, above[one, other, time]))

    parts, steps = np.indices(low.shape[1:])
    likely = low.argmin(axis=1)
    least = measured(parts, likely, steps)
    least[np.isinf(low.min(axis=1))] = np.inf
    one, other, time = np.nonzero(low < least[:, None])
    np.minimum.at(least, (one, time), measured(one, other, time))
    return np.asarray(least)


def thinned(times: Array, values: Array, *, most: int) -> tuple[Array, Array]:
    """At most about so many of the samples, with the least of those between them."""
    width = -(-len(times) // most)
    begins = range(0, len(times), width)
    least = [begin + int(np.argmin(values[begin : begin + width])) for begin in begins]
    kept = np.unique([0, *least, len(times) - 1])
    return times[kept], values[kept]
