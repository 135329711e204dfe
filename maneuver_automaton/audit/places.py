"""What places cost along a plan that was driven again: another integration, of other distances."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit.drive import DrivenPlan
from maneuver_automaton.audit.frames import FrameMotion, Spans, placed
from maneuver_automaton.collision.shapes import AnyObstacle, Disc, Obstacle, OccupancyMap, Shape
from maneuver_automaton.places import Clearance, PlaceCost

AGREED = 1e-3  # of the plan's whole cost, by which two integrations may differ
CLOSE = 5e-5  # of that cost: stretches are halved until what is still open is less
LONGEST = 0.25  # [s] of a stretch, before any is halved
MOST_ROUNDS = 22
# Lobatto's rule with four points: ends count, so that no jump of a rate hides beyond the last one
SHARES = 0.5 + 0.5 * np.array([-1.0, -math.sqrt(0.2), math.sqrt(0.2), 1.0])
WEIGHTS = np.array([1.0, 5.0, 5.0, 1.0]) / 12.0


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

    By Lobatto's rule on each stretch, against the same on its halves.
    """
    near = _Distances(bodies, obstacles, body_height, offset)

    def rates(spans: Spans) -> Array:
        lengths = spans.end - spans.begin
        shares = spans.begin[:, None] + lengths[:, None] * SHARES
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
        seconds = np.diff(drive.frames.times)[spans.element] * lengths
        return np.asarray(found.reshape(shares.shape) @ WEIGHTS * seconds)

    spans, _ = drive.between_samples()
    if not len(spans.element):
        return 0.0
    spans = _no_longer(spans, np.diff(drive.frames.times), drive.frames.speed)
    done, now = 0.0, rates(spans)
    for _ in range(MOST_ROUNDS):
        middle = 0.5 * (spans.begin + spans.end)
        halves = Spans(
            np.repeat(spans.element, 2),
            np.stack([spans.begin, middle], axis=1).ravel(),
            np.stack([middle, spans.end], axis=1).ravel(),
        )
        finer = rates(halves)
        sums = finer.reshape(-1, 2).sum(axis=1)
        off = np.abs(sums - now)
        if off.sum() <= CLOSE * whole:
            return done + float(sums.sum())
        again = off > 0.25 * CLOSE * whole / len(off)
        done += float(sums[~again].sum())
        rows = np.repeat(again, 2)
        spans, now = halves.of(rows), finer[rows]
    return done + float(now.sum())


def _no_longer(spans: Spans, lasting: Array, speeds: Array) -> Spans:
    """The stretches cut to a quarter second, and to a quarter metre."""
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
        self.obstacles = _standing(obstacles)

    def __call__(self, elements: Any, shares: Array, poses: Array, within: float) -> Array:
        """Distances (n,) [m] that are right where they are less than `within`."""
        import shapely

        least = np.full(len(poses), within)
        for body in self.bodies:
            frames = body.frames.at(elements, shares) + self.offset
            for shape in body.shapes or (None,):
                far = 0.0 if shape is None else _reach(shape)
                near = [
                    self._meets(height, poses) & (_from_box(frames, one) < far + wide + within)
                    for height, one, wide in self.obstacles
                ]
                used = np.flatnonzero(np.any(near, axis=0)) if near else np.zeros(0, dtype=np.int64)
                cores, radius = _moved(shape, frames[used])
                for rows, (_, obstacle, wide) in zip(near, self.obstacles, strict=True):
                    some = np.flatnonzero(rows[used])
                    apart = shapely.distance(cores[some], obstacle) - radius - wide
                    here = used[some]
                    least[here] = np.minimum(least[here], np.maximum(apart, 0.0))
        return least

    def _meets(self, height: tuple[float, float] | None, poses: Array) -> NDArray[np.bool_]:
        low, high = self.height
        if height is None or (poses.shape[1] == 3 and (low, high) == (0.0, 0.0)):
            return np.ones(len(poses), dtype=np.bool_)
        z = poses[:, 3] if poses.shape[1] > 3 else np.zeros(len(poses))
        return np.asarray((z + low <= height[1]) & (z + high >= height[0]))


@functools.lru_cache(maxsize=8)
def _standing(
    obstacles: tuple[AnyObstacle, ...],
) -> list[tuple[tuple[float, float] | None, Any, float]]:
    """What stands still: its heights, its geometry and a radius around it; of the last maps."""
    import shapely

    found: list[tuple[tuple[float, float] | None, Any, float]] = []
    for one in obstacles:
        if isinstance(one, OccupancyMap):
            found.append((None, _blocked(one), 0.0))
        elif isinstance(one, Obstacle) and one.motion is None:
            found.append((one.height, *_core(one.shape)))
    for _, core, _ in found:
        shapely.prepare(core)
    return found


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


def _from_box(frames: Array, obstacle: Any) -> Array:
    """Distances (n,) [m] of frames from the box around an obstacle."""
    low_x, low_y, high_x, high_y = obstacle.bounds
    x, y = frames[:, 0], frames[:, 1]
    d_x = np.maximum(np.maximum(low_x - x, x - high_x), 0.0)
    d_y = np.maximum(np.maximum(low_y - y, y - high_y), 0.0)
    return np.asarray(np.hypot(d_x, d_y))


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
    """The blocked cells of a map as one geometry."""
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
    return shapely.multipolygons(shapely.polygons(placed_corners))  # a union may lose some
