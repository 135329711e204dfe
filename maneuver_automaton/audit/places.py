"""What places cost along a plan that was driven again: another integration, of other distances."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit.drive import DrivenPlan
from maneuver_automaton.audit.frames import FrameMotion, Spans, placed
from maneuver_automaton.collision.shapes import AnyObstacle, Disc, Obstacle, OccupancyMap, Shape
from maneuver_automaton.places import Clearance, PlaceCost

AGREED = 1e-3  # of the plan's whole cost, by which two integrations may differ
CLOSE = 1e-4  # of that cost: stretches are halved until what is still open is less
LONGEST = 0.5  # [s], [m] of a stretch, before any is halved
MOST_ROUNDS = 22
NEAREST = np.zeros(0, dtype=np.int64)  # in place of which obstacle it is
MANY = 4  # obstacles near to a shape, from which on a tree finds the nearest sooner
# Lobatto's rule with four points, and Kronrod's seven that contain them: ends count, so that no
# jump of a rate hides beyond the last one. Source: Gander and Gautschi (2000), Adaptive quadrature.
SHARES = 0.5 + 0.5 * np.array(
    [-1.0, -math.sqrt(2.0 / 3.0), -math.sqrt(0.2), 0.0, math.sqrt(0.2), math.sqrt(2.0 / 3.0), 1.0]
)
LOBATTO = np.array([1.0, 0.0, 5.0, 0.0, 5.0, 0.0, 1.0]) / 12.0
KRONROD = np.array([77.0, 432.0, 625.0, 672.0, 625.0, 432.0, 77.0]) / 2940.0


class MovingShapes(NamedTuple):
    """Shapes that move with a frame."""

    frames: FrameMotion
    shapes: tuple[Shape, ...]


def price_again(
    cost: PlaceCost,
    drive: DrivenPlan,
    offset: Array,
    *,
    bodies: Sequence[MovingShapes],
    obstacles: tuple[AnyObstacle, ...],
    body_height: tuple[float, float],
    whole: float,
) -> float:
    """The integral of a cost along a drive whose poses are counted from a place (dof,).

    By two rules on each stretch, which is halved where they differ.
    """
    near = _Distances(bodies, obstacles, body_height, drive.frames, offset)
    lasting = np.diff(drive.frames.times)

    def rates(spans: Spans) -> Array:
        found = np.zeros((len(spans.element), SHARES.size))
        used = np.arange(len(found))
        if isinstance(cost, Clearance):
            apart = near(spans, cost.within)
            used = np.flatnonzero((apart < cost.within).any(axis=1))
            found[used] = cost.weight * (1.0 - apart[used] / cost.within) ** 2
        at = _nodes(spans.of(used))
        twists = drive.twists_at(*at).reshape(used.size, SHARES.size, offset.size)
        if not isinstance(cost, Clearance):
            poses = (drive.frames.at(*at) + offset).reshape(twists.shape)
            found = np.asarray(cost.rates(poses, twists), dtype=np.float64)
        if cost.per == "metre":
            found[used] *= np.sqrt((np.delete(twists, 2, axis=2) ** 2).sum(axis=2))
        return found

    spans, _ = drive.between_samples()
    if not len(spans.element):
        return 0.0
    spans = _no_longer(spans, lasting, drive.frames.speed)
    done = 0.0
    for _ in range(MOST_ROUNDS):
        values = rates(spans)
        seconds = lasting[spans.element] * (spans.end - spans.begin)
        fine = values @ KRONROD * seconds
        off = np.abs(fine - values @ LOBATTO * seconds)
        if off.sum() <= CLOSE * whole:
            return done + float(fine.sum())
        again = off > 0.25 * CLOSE * whole / len(off)
        done += float(fine[~again].sum())
        rest, fine = spans.of(again), fine[again]
        middle = 0.5 * (rest.begin + rest.end)
        spans = Spans(
            np.repeat(rest.element, 2),
            np.stack([rest.begin, middle], axis=1).ravel(),
            np.stack([middle, rest.end], axis=1).ravel(),
        )
    return done + float(fine.sum())


def _nodes(spans: Spans) -> tuple[IntArray, Array]:
    """Elements, and shares of them, at all `SHARES` of stretches (n * 7,)."""
    shares = spans.begin[:, None] + (spans.end - spans.begin)[:, None] * SHARES
    return np.repeat(spans.element, SHARES.size), shares.ravel()


def _no_longer(spans: Spans, lasting: Array, speeds: Array) -> Spans:
    """The stretches cut to half a second, and to half a metre."""
    seconds = (spans.end - spans.begin) * lasting[spans.element]
    most = np.maximum(seconds, seconds * speeds[spans.element]) / LONGEST
    parts = np.maximum(np.ceil(most), 1.0).astype(np.int64)
    of = np.repeat(np.arange(parts.size), parts)
    number = np.arange(of.size) - (np.cumsum(parts) - parts)[of]
    step = ((spans.end - spans.begin) / parts)[of]
    begin = spans.begin[of] + number * step
    return Spans(spans.element[of], begin, begin + step)


class _Distances:
    """Distances of bodies to what stands still, each shape of the body held to each obstacle."""

    def __init__(
        self,
        bodies: Sequence[MovingShapes],
        obstacles: tuple[AnyObstacle, ...],
        height: tuple[float, float],
        vehicle: FrameMotion,
        offset: Array,
    ) -> None:
        self.height, self.vehicle, self.offset = height, vehicle, offset
        self.standing = _standing(obstacles)
        self.outlines = [
            (body.frames, _Outline.of(shape)) for body in bodies for shape in body.shapes or (None,)
        ]

    def __call__(self, spans: Spans, within: float) -> Array:
        """Distances (n, 7) at `SHARES` of stretches, or `within` [m] if they are more.

        Obstacles that are too far in the middle of a stretch are so all along.
        """
        least = np.full((len(spans.element), SHARES.size), within)
        for frames, outline in self.outlines:
            seconds = np.diff(frames.times)[spans.element] * (spans.end - spans.begin)
            fastest = (frames.speed + frames.turn * outline.far)[spans.element]
            enough = within + 0.5 * seconds * fastest
            middles = frames.at(spans.element, 0.5 * (spans.begin + spans.end)) + self.offset
            for one in self.standing:
                span, which = one.around(middles, outline.far + enough)
                used: IntArray = np.unique(span)
                if span.size > MANY * used.size and not one.wide.any():
                    span, which = used, NEAREST
                apart = one.apart(outline.at(middles[span]), which) - outline.radius
                near = apart < enough[span]
                span, which = span[near], which[near] if which.size else which
                if not span.size:
                    continue
                at = _nodes(spans.of(span))
                bodies = outline.at(frames.at(*at) + self.offset).reshape(-1, SHARES.size)
                apart = np.maximum(one.apart(bodies, which) - outline.radius, 0.0)
                apart[~self._meets(one.height, *at).reshape(apart.shape)] = within
                np.minimum.at(least, span, apart)
        return least

    def _meets(
        self, height: tuple[float, float] | None, elements: IntArray, shares: Array
    ) -> NDArray[np.bool_]:
        """Where the vehicle is neither above nor below obstacles of a height."""
        (low, high), in_plane = self.height, self.vehicle.nodes.shape[2] == 3
        if height is None or (in_plane and (low, high) == (0.0, 0.0)):
            return np.ones(shares.shape, dtype=np.bool_)
        z = (self.vehicle.at(elements, shares) + self.offset)[:, 3:].sum(axis=1)
        return np.asarray((z + low <= height[1]) & (z + high >= height[0]))


class _Outline(NamedTuple):
    """A shape of a body: a point with a radius, or rings of corners."""

    rings: tuple[Array, ...]  # (n, 3) each
    radius: float  # [m]
    far: float  # [m] of the point that is farthest from the frame

    @classmethod
    def of(cls, shape: Shape | None) -> _Outline:
        """The outline of a shape, or of a point."""
        if shape is None:
            return cls((np.zeros((1, 3)),), 0.0, 0.0)
        if isinstance(shape, Disc):
            far = float(np.hypot(*shape.center)) + shape.radius
            return cls((np.append(shape.center, 0.0)[None],), shape.radius, far)
        rings = [np.asarray(ring) for ring in (shape.corners, *getattr(shape, "holes", ()))]
        far = float(np.hypot(*rings[0].T).max())
        return cls(tuple(np.column_stack([ring, np.zeros(len(ring))]) for ring in rings), 0.0, far)

    def at(self, frames: Array) -> Any:
        """The geometry (n,) at frames (n, dof)."""
        import shapely

        ways = [placed(frames[:, None, :3], ring)[..., :2] for ring in self.rings]
        if len(self.rings[0]) == 1:
            return shapely.points(ways[0][:, 0])
        shells, *holes = (shapely.linearrings(way) for way in ways)
        return shapely.polygons(shells, holes=np.stack(holes, axis=1) if holes else None)


class _Standing(NamedTuple):
    """What stands still, of one height: geometries, each with a radius around it."""

    height: tuple[float, float] | None
    cores: Any  # (m,)
    wide: Array  # (m,) [m]
    tree: Any

    def around(self, frames: Array, reach: Array) -> tuple[IntArray, IntArray]:
        """Frames (n, dof), and what may be nearer to their places than `reach` (n,) [m]."""
        import shapely

        x, y, by = frames[:, 0], frames[:, 1], reach + self.wide.max()
        frame, which = self.tree.query(shapely.box(x - by, y - by, x + by, y + by))
        return frame, which

    def apart(self, bodies: Any, which: IntArray) -> Array:
        """Distances (n, ...) [m] of the cores of bodies from one obstacle each, or the nearest."""
        import shapely

        if which is NEAREST:
            _, away = self.tree.query_nearest(
                bodies.ravel(), all_matches=False, return_distance=True
            )
            return np.asarray(away.reshape(bodies.shape))
        which = which.reshape(-1, *[1] * (bodies.ndim - 1))
        return np.asarray(shapely.distance(bodies, self.cores[which]) - self.wide[which])


@functools.lru_cache(maxsize=8)
def _standing(obstacles: tuple[AnyObstacle, ...]) -> list[_Standing]:
    """What stands still, by heights, round or not; of the last maps."""
    import shapely

    found: dict[Any, list[tuple[Any, float]]] = {}
    for one in obstacles:
        if isinstance(one, OccupancyMap):
            found.setdefault((None, False), []).extend((cell, 0.0) for cell in _blocked(one))
        elif isinstance(one, Obstacle) and one.motion is None:
            core, wide = _core(one.shape)
            found.setdefault((one.height, wide > 0.0), []).append((core, wide))
    return [
        _Standing(
            height,
            cores := np.array([core for core, _ in solids], dtype=object),
            np.array([wide for _, wide in solids]),
            shapely.STRtree(cores),
        )
        for (height, _), solids in found.items()
        if solids
    ]


def _core(shape: Shape) -> tuple[Any, float]:
    """A shape of shapely and a radius around it."""
    import shapely

    if isinstance(shape, Disc):
        return shapely.Point(shape.center), shape.radius
    return shapely.make_valid(shapely.Polygon(shape.corners, getattr(shape, "holes", ()))), 0.0


def _blocked(one: OccupancyMap) -> Any:
    """The blocked cells of a map."""
    import shapely

    row, column = np.nonzero(one.blocked)
    corners = np.stack(
        [
            np.stack([column + i, row + j, 0.0 * row], axis=1) * one.resolution
            for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
        ],
        axis=1,
    )
    placed_corners = placed(np.asarray(one.origin)[None, None, :3], corners)[..., :2]
    return shapely.polygons(placed_corners)
