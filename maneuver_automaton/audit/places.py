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
    near = _Distances(bodies, obstacles, body_height, offset)
    lasting = np.diff(drive.frames.times)

    def rates(spans: Spans) -> Array:
        shares = spans.begin[:, None] + (spans.end - spans.begin)[:, None] * SHARES
        elements = np.repeat(spans.element, SHARES.size)
        at = shares.ravel()
        poses = drive.frames.at(elements, at) + offset
        twists = drive.twists_at(elements, at)
        if isinstance(cost, Clearance):
            gap = np.maximum(1.0 - near(elements, at, poses, cost.within) / cost.within, 0.0)
            found = cost.weight * gap**2
        else:
            found = np.asarray(cost.rates(poses, twists), dtype=np.float64)
        if cost.per == "metre":
            found = found * np.sqrt((np.delete(twists, 2, axis=1) ** 2).sum(axis=1))
        return found.reshape(shares.shape)

    spans, _ = drive.between_samples()
    if not len(spans.element):
        return 0.0
    spans = _no_longer(spans, lasting, drive.frames.speed)
    if isinstance(cost, Clearance):
        spans = near.come_near(spans, lasting, cost.within)
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
        offset: Array,
    ) -> None:
        self.bodies, self.height, self.offset = bodies, height, offset
        self.standing = _standing(obstacles)

    def come_near(self, spans: Spans, lasting: Array, within: float) -> Spans:
        """The stretches in which anything may be nearer than `within` [m]."""
        kept = np.zeros(len(spans.element), dtype=np.bool_)
        seconds = lasting[spans.element] * (spans.end - spans.begin)
        for body in self.bodies:
            middles = body.frames.at(spans.element, 0.5 * (spans.begin + spans.end)) + self.offset
            moved = 0.5 * seconds * body.frames.speed[spans.element]
            far = max(map(_reach, body.shapes), default=0.0)
            for one in self.standing:
                kept[one.around(middles, far + within + moved)[0]] = True
        return spans.of(kept)

    def __call__(self, elements: Any, shares: Array, poses: Array, within: float) -> Array:
        """Distances (n,) [m] that are right where they are less than `within`."""
        import shapely

        least = np.full(len(poses), within)
        for body in self.bodies:
            frames = body.frames.at(elements, shares) + self.offset
            for shape in body.shapes or (None,):
                far = 0.0 if shape is None else _reach(shape)
                for one in self.standing:
                    frame, which = one.around(frames, far + within)
                    level = self._meets(one.height, poses)[frame]
                    frame, which = frame[level], which[level]
                    if not frame.size:
                        continue
                    used, row = np.unique(frame, return_inverse=True)
                    cores, radius = _moved(shape, frames[used])
                    if frame.size > MANY * used.size and not one.wide.any():
                        (row, _), apart = one.tree.query_nearest(
                            cores, all_matches=False, return_distance=True
                        )
                        frame = used[row]
                    else:
                        apart = shapely.distance(cores[row], one.cores[which]) - one.wide[which]
                    np.minimum.at(least, frame, np.maximum(apart - radius, 0.0))
        return least

    def _meets(self, height: tuple[float, float] | None, poses: Array) -> NDArray[np.bool_]:
        low, high = self.height
        if height is None or (poses.shape[1] == 3 and (low, high) == (0.0, 0.0)):
            return np.ones(len(poses), dtype=np.bool_)
        z = poses[:, 3] if poses.shape[1] > 3 else np.zeros(len(poses))
        return np.asarray((z + low <= height[1]) & (z + high >= height[0]))


class _Standing(NamedTuple):
    """What stands still, of one height: geometries, each with a radius around it."""

    height: tuple[float, float] | None
    cores: Any  # (m,)
    wide: Array  # (m,) [m]
    tree: Any

    def around(self, frames: Array, reach: Any) -> tuple[IntArray, IntArray]:
        """Frames (n, dof), and what may be nearer to their places than `reach` [m]."""
        import shapely

        x, y, by = frames[:, 0], frames[:, 1], reach + self.wide.max()
        frame, which = self.tree.query(shapely.box(x - by, y - by, x + by, y + by))
        return frame, which


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


def _reach(shape: Shape) -> float:
    """The greatest distance [m] of a point of a shape from its frame."""
    if isinstance(shape, Disc):
        return float(np.hypot(*shape.center)) + shape.radius
    return float(np.hypot(*np.asarray(shape.corners).T).max())


def _moved(shape: Shape | None, frames: Array) -> tuple[Any, float]:
    """A shape of a body, or its point, at frames (n, dof)."""
    import shapely

    if shape is None or isinstance(shape, Disc):
        center = np.zeros(2) if shape is None else shape.center
        points = placed(frames[:, :3], np.append(center, 0.0))[:, :2]
        return shapely.points(points), 0.0 if shape is None else shape.radius
    rings = [shape.corners, *getattr(shape, "holes", ())]
    ways = [
        placed(frames[:, None, :3], np.column_stack([ring, np.zeros(len(ring))]))[..., :2]
        for ring in rings
    ]
    if len(ways) == 1:
        return shapely.polygons(ways[0]), 0.0
    holes: list[Any] = [list(row) for row in zip(*ways[1:], strict=True)]
    bodies = [shapely.Polygon(shell, inner) for shell, inner in zip(ways[0], holes, strict=True)]
    return np.array(bodies, dtype=object), 0.0


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
