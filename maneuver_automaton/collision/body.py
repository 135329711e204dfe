"""The body of a vehicle as the kernels know it."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.convex import convex_pieces, pieces_of, solids_of
from maneuver_automaton.collision.motion import point_speeds
from maneuver_automaton.collision.outline import united
from maneuver_automaton.collision.shapes import Disc, Shape

MOST_DISCS = 6  # that cover one piece
ON_EDGE = 1e-9  # [m] a pose so near to the rim of a body is on it


class Body(NamedTuple):
    """Convex pieces in the frame of the vehicle, discs that cover them, and sizes."""

    edges: Array  # (V, 5) as in `Solids`
    first: IntArray  # (P + 1,)
    radius: Array  # (P,)
    discs: Array  # (D, 4) x, y, radius: they cover the body; and that of one inside, 0: none
    middle_x: float  # [m] of a disc that holds the body ...
    middle_y: float
    reach: float  # ... and its radius
    inscribed: float  # [m] radius of the largest disc around the pose inside the body; -inf: none
    half_width: float  # [m] of the widest piece


@functools.lru_cache(maxsize=1024)  # a fleet has as many as it has vehicles
def body_of(footprint: tuple[Shape, ...]) -> Body:
    """Arrays of a footprint; a point if it is empty."""
    pieces = [piece for shape in footprint for piece in convex_pieces(shape)]
    if not pieces:
        pieces = [(np.zeros((1, 2)), 0.0)]
    solids = solids_of(pieces_of(pieces))
    low, high = solids.plates[:, :2].min(axis=0), solids.plates[:, 2:4].max(axis=0)
    middle = 0.5 * (low + high)
    reach = max(float(np.hypot(*(ring - middle).T).max()) + rounding for ring, rounding in pieces)
    covers = [_cover(ring, rounding) for ring, rounding in pieces]
    return Body(
        edges=solids.edges,
        first=solids.first,
        radius=solids.plates[:, 4].copy(),
        discs=np.concatenate([discs for discs, _ in covers]),
        middle_x=float(middle[0]),
        middle_y=float(middle[1]),
        reach=reach,
        inscribed=_inscribed(footprint),
        half_width=max(width for _, width in covers),
    )


def fastest_points(body: Body, twists: Array) -> Array:
    """Greatest speed (m,) [m/s] of any point of the body under each twist (m, 3 or more)."""
    rounding = np.repeat(body.radius, np.diff(body.first))
    speeds = point_speeds(twists, body.edges[:, :2]) + np.abs(twists[:, 2, None]) * rounding
    return np.asarray(speeds.max(axis=1))


def _cover(ring: Array, rounding: float) -> tuple[Array, float]:
    """Discs (n, 4) along the narrowest rectangle around a piece, and half its width."""
    import shapely

    if len(ring) == 1:
        return np.array([[*ring[0], rounding, rounding]]), rounding
    around = shapely.get_coordinates(shapely.MultiPoint(ring).minimum_rotated_rectangle)
    if len(around) < 4:  # all corners on a line
        ends = ring[[np.argmin(ring @ [1.0, 1e-3]), np.argmax(ring @ [1.0, 1e-3])]]
        a, along, across = ends[0], ends[1] - ends[0], np.zeros(2)
    else:
        a, along, across = around[0], around[1] - around[0], around[3] - around[0]
        if np.hypot(*along) < np.hypot(*across):
            along, across = across, along
    length, width = float(np.hypot(*along)), float(np.hypot(*across))
    thick = max(width + 2.0 * rounding, length / MOST_DISCS)
    # More discs stand out less beyond the piece, but each is a look-up in the field at every pose.
    n = min(MOST_DISCS, max(1, math.ceil(1.5 * length / thick)))
    # The corners of a slice are on the rim of its disc: by that share not outside for rounding.
    radius = math.hypot(0.5 * length / n, 0.5 * width) * (1.0 + 1e-12) + rounding
    centers = a + 0.5 * across + np.outer((np.arange(n) + 0.5) / n, along)
    # From each middle to the nearest side, all of which turn left around the piece.
    sides, apart = np.roll(ring, -1, axis=0) - ring, centers[:, None] - ring
    left = sides[:, 0] * apart[..., 1] - sides[:, 1] * apart[..., 0]
    within = np.maximum((left / np.hypot(*sides.T)).min(axis=1), 0.0) + rounding
    return np.column_stack([centers, np.full(n, radius), within]), 0.5 * width + rounding


def _inscribed(footprint: tuple[Shape, ...]) -> float:
    """Radius of the largest disc around the pose inside the body; -inf if the pose is not in it."""
    import shapely

    # A part alone bounds it from below; polygons are united, as the pose may be on a seam.
    discs = [one for one in footprint if isinstance(one, Disc)]
    radii = [one.radius - float(np.hypot(*one.center)) for one in discs]
    parts = [
        shapely.Polygon(ring)
        for shape in footprint
        if not isinstance(shape, Disc)
        for ring, _ in convex_pieces(shape)
        if len(ring) >= 3
    ]
    if parts:
        union, pose = united(parts), shapely.Point(0.0, 0.0)
        edge = float(union.boundary.distance(pose))
        radii.append(edge if union.contains(pose) or edge <= ON_EDGE else -1.0)
    return max(
        (radius for radius in radii if radius >= 0.0), default=-math.inf if footprint else 0.0
    )
