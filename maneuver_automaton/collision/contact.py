"""How deep a body is in what it touches at its start, and coasts on which it gets no deeper.

How deep is how far it would have to be pushed at least: the distance of its position from the
border of the Minkowski difference of obstacle and body.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.collision.shapes import AnyObstacle, OccupancyMap, Shape
from maneuver_automaton.collision.surroundings import fastest_point, parts_of, runs_of
from maneuver_automaton.groups import SE2

STEP, SLACK, LEAST = 0.04, 0.01, 1e-3  # of the body's radius: a sample, what it ends clear by; [m]
FARTHEST = 12.0  # body radii that a coast out is long at most
DEEPER, TURNS = 1e-9, 1e-9  # [m] of rounding; [rad/s] that are straight on


class Contact:
    """Bodies that overlap at a start, all seen from there, unturned."""

    def __init__(
        self,
        footprint: tuple[Shape, ...],
        start: Array,
        touched: Iterable[AnyObstacle],
        *,
        margin: float,
    ) -> None:
        import shapely

        self.reach = body_of(footprint).reach
        self.step = max(STEP * self.reach, LEAST)
        self.clear = margin + max(SLACK * self.reach, LEAST)
        self.parts, self.start = parts_of(footprint), start
        self.body = [piece for shape in footprint for piece in convex_pieces(shape)]
        self.body = self.body or [(np.zeros((1, 2)), 0.0)]
        away = SE2(np.array([-start[0], -start[1], 0.0]))
        self.solids = [  # convex pieces (corners, rounding); of a map, its runs of cells
            [(shapely.get_coordinates(run)[:-1], 0.0) for run in runs_of(one)]
            if isinstance(one, OccupancyMap)
            else convex_pieces(one.shape)
            for one in (obstacle.moved(away) for obstacle in touched)
        ]
        self.boxes = [
            np.array([[*(ring.min(axis=0) - r), *(ring.max(axis=0) + r)] for ring, r in pieces])
            for pieces in self.solids
        ]
        self.within = FARTHEST * max(self.reach, self.clear)
        self.depth = margin - float(self.off(self.start, within=self.within).min())

    def off(self, pose: Array, *, within: float) -> Array:
        """Distance to each obstacle, the depth with a minus where it overlaps; clipped [m]."""
        import shapely

        place = pose[:2] - self.start[:2]
        near = within + max(float(np.hypot(*one.middle)) + one.reach for one in self.parts)
        turned = SE2(np.array([0.0, 0.0, pose[2]]))
        found = []
        for pieces, boxes in zip(self.solids, self.boxes, strict=True):
            gaps = np.maximum(np.maximum(boxes[:, :2] - place, place - boxes[:, 2:]), 0.0)
            area = shapely.union_all(
                [
                    shapely.MultiPoint(
                        (pieces[k][0][:, None] - turned.act(ring)).reshape(-1, 2)
                    ).convex_hull.buffer(r + pieces[k][1])
                    for k in np.flatnonzero(np.hypot(*gaps.T) <= near).tolist()
                    for ring, r in self.body
                ]
            )  # where the body overlaps
            point = shapely.Point(place)
            aside = within if area.is_empty else area.distance(point)
            found.append(aside or -float(shapely.distance(area.boundary, point)))
        return np.clip(found, -within, within)

    def coast(
        self, twist: Array, begin: Array, until: float = math.inf
    ) -> Iterator[tuple[float, float, Array, bool]]:
        """Time, way of the fastest point, pose, and whether that is clear: while no deeper."""
        speed = float(fastest_point(self.parts, twist[None])[0])
        turn = abs(float(twist[2]))
        if not speed > 0.0:
            return
        lasting = min(self.within / speed, math.tau / max(turn, TURNS))
        before = self.off(begin, within=self.within)
        samples = int(min(lasting, until) * speed / self.step)
        times = [n * self.step / speed for n in range(1, samples + 1)]
        for after in [*times, until] if until <= lasting else times:
            here = (SE2(begin) @ SE2.exp(after * twist)).pose
            off = self.off(here, within=max(-float(before.min()), self.clear) + self.step)
            if (off < np.minimum(before, self.clear) - DEEPER).any():
                return
            yield after, speed * after, here, bool((off >= self.clear).all())
            before = off
