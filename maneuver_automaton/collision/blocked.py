"""A sentence on what a vehicle touches where it stands."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.collision.outline import united
from maneuver_automaton.collision.shapes import AnyObstacle, OccupancyMap, Shape, name_of
from maneuver_automaton.collision.surroundings import (
    ShapePart,
    fastest_point,
    parts_of,
    runs_of,
    surroundings_of,
)
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
    """
    here = np.array(as_array("pose", pose, last=3))
    here[:2] -= origin
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


def _point_of(obstacle: AnyObstacle, body: list[ShapePart], here: Array, time: float) -> Array:
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

    `place`: of the footprint's frame [m]. `margin`: nearer than this is too near [m].
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
        deep = margin - 2.0 * CONTACT
        if not any(lever * half <= depth + deep for lever, depth in _held(turned, solid)):
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
    parts = [one for one in shapely.get_parts(both) if one.area > 0.0]
    inside = [shapely.get_coordinates(part.representative_point()) for part in parts]
    points = np.concatenate([*inside, shapely.get_coordinates(both)])
    depths = shapely.distance(shapely.points(points), shapely.boundary(solid))
    yield from zip(np.hypot(*points.T).tolist(), depths.tolist(), strict=True)


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
    return united([
        core.buffer(radius, quad_segs=32) if radius else core for core, radius in solids
    ])  # fmt: skip


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
        turn = SE2(np.array([0.0, 0.0, pose[2]]))
        body = [(turn.act(ring), r) for ring, r in self.body]
        found = []  # the areas are where the body overlaps
        for pieces, boxes in zip(self.solids, self.boxes, strict=True):
            gaps = np.maximum(np.maximum(boxes[:, :2] - place, place - boxes[:, 2:]), 0.0)
            close = [pieces[k] for k in np.flatnonzero(np.hypot(*gaps.T) <= near).tolist()]
            hulls = [
                shapely.multipoints((corners[:, None] - ring).reshape(-1, 2)).convex_hull
                for corners, _ in close
                for ring, _ in body
            ]
            rounding = np.add.outer([r for _, r in close], [r for _, r in body]).ravel()
            area = united(shapely.buffer(np.array(hulls, dtype=object), rounding, quad_segs=16))
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
