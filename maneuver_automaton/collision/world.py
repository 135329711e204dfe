"""Obstacles around one body, prepared once: solids, buckets, a field of distances.

Everything is seen from a frame that moves with the obstacles, so that a moved world is the same
world to the last bit (coordinates are rounded to 1e-9 m, far below every proven margin).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from maneuver_automaton._arrays import FEW, Array, wrapped
from maneuver_automaton.collision import _kernels_field, _kernels_slabs
from maneuver_automaton.collision._kernels_clearance import LISTED
from maneuver_automaton.collision.arrays import (
    Buckets,
    Field,
    MovingObstacles,
    Place,
    Slabs,
    WorldArrays,
)
from maneuver_automaton.collision.body import Body, body_of
from maneuver_automaton.collision.convex import (
    DIGITS,
    NO_PIECES,
    ConvexPieces,
    Solids,
    convex_pieces,
    joined,
    pieces_of,
    pieces_seen_from,
    seen_from,
    solids_of,
)
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.collision.outline import blocked_rectangles
from maneuver_automaton.collision.shapes import (
    AnyObstacle,
    Box,
    Disc,
    Obstacle,
    OccupancyMap,
    Shape,
    by_kind,
)
from maneuver_automaton.groups import SE2

MOST_FIELD_CELLS = 60_000
MOST_MAP_CELLS = 250_000  # of the field over an occupancy map, where a cell costs less
MOST_BUCKETS = 100_000
ALONG = 0.5  # [rad] of an arc between the places that say where a moving obstacle goes
SHARE = 10.0**DIGITS  # of a metre or radian that a coordinate is rounded to
HALF_TURN = float(np.round(np.pi, DIGITS))


@dataclass(frozen=True, eq=False, kw_only=True)
class World:
    """Obstacles around one body, seen from `frame`."""

    frame: Array  # (3,) pose of the world's own frame in the coordinates of the problem
    body: Body
    arrays: WorldArrays
    followed: tuple[_Moving, ...]  # what moves
    last_event: float  # [s] after it no obstacle moves

    @functools.cached_property
    def box(self) -> Array:
        """(4,) [low x, low y, high x, high y] of static obstacles, and where moving ones go."""
        return _box(self.arrays.solids.plates[:, :4], self.followed, self.frame)

    def into(self, pose: Array) -> Array:
        """A pose (..., 3) seen from the world's frame: places first, so that no digit is lost."""
        poses = np.asarray(pose, dtype=np.float64)
        if poses.size <= FEW:
            to_x, to_y, turn = self.frame.tolist()
            c, s = float(np.cos(-turn)), float(np.sin(-turn))
            rows = poses.reshape(-1, 3).tolist()
            seen = [_one_into(x - to_x, y - to_y, heading - turn, c, s) for x, y, heading in rows]
            return np.array(seen).reshape(poses.shape)
        found: Array = np.round(self.seen(poses), DIGITS)
        half = found[..., 2] <= -HALF_TURN  # half a turn to either side is one pose
        found[..., 2] = np.where(half, -found[..., 2], found[..., 2])
        return found

    def seen(self, poses: Array) -> Array:
        """The same of poses (..., 3), not rounded: distances there have slopes."""
        x, y = poses[..., 0] - self.frame[0], poses[..., 1] - self.frame[1]
        c, s = np.cos(-self.frame[2]), np.sin(-self.frame[2])
        turned = wrapped(poses[..., 2] - self.frame[2])
        return np.stack([c * x - s * y, s * x + c * y, turned], -1)


def _one_into(x: float, y: float, turn: float, c: float, s: float) -> tuple[float, float, float]:
    """The same for one pose, in numbers: some arrays take longer than a first plan may."""
    seen = rounded((turn + math.pi) % (2.0 * math.pi) - math.pi)
    return rounded(c * x - s * y), rounded(s * x + c * y), -seen if seen <= -HALF_TURN else seen


def rounded(value: float) -> float:
    """A number as `numpy.round` rounds it to `DIGITS` decimals."""
    return math.copysign(round(value * SHARE) / SHARE, value)


@functools.lru_cache(maxsize=64)
def world_of(
    obstacles: tuple[AnyObstacle, ...],
    footprint: tuple[Shape, ...],
    frame: tuple[float, ...],
    *,
    keep: float = 0.0,
    present: tuple[tuple[float, float], ...] | None = None,
) -> World:
    """The world of obstacles around a footprint, seen from the pose `frame`.

    A distance `keep` [m] to everything can be asked for later, up to the one given here. Moving
    obstacles are there as long as they say, or from and until times `present` [s], one pair each.

    Examples
    --------
    >>> world = world_of((Obstacle(Box([1.0, 1.0])),), (Disc(0.5),), (0.0, 0.0, 0.0))
    >>> len(world.arrays.solids.plates), world.arrays.moving.speed.size
    (1, 0)
    """
    body = body_of(footprint)
    pose = np.array(frame)
    pose.setflags(write=False)
    moving = [o for o in obstacles if isinstance(o, Obstacle) and o.motion is not None]
    static = tuple([o for o in obstacles if isinstance(o, OccupancyMap) or o.motion is None])
    solids, buckets, field = _static_arrays(static, footprint, frame, keep)
    followed = tuple(_moving_of(obstacle) for obstacle in moving)
    where = followed, pose, present or tuple(one.presence for one in moving), body.reach
    moving_arrays = _moving_obstacles(*where) if followed else NOTHING_MOVES
    times = np.concatenate([moving_arrays.time, moving_arrays.present.ravel()])
    return World(
        frame=pose,
        body=body,
        arrays=WorldArrays(solids=solids, buckets=buckets, field=field, moving=moving_arrays),
        followed=followed,
        last_event=float(times[np.isfinite(times)].max(initial=-math.inf)),
    )


@functools.lru_cache(maxsize=64)
def _static_arrays(
    static: tuple[AnyObstacle, ...],
    footprint: tuple[Shape, ...],
    frame: tuple[float, ...],
    keep: float,
) -> tuple[Solids, Buckets, Field]:
    """The static obstacles around a footprint: the same beside any moving ones."""
    body, pose = body_of(footprint), np.array(frame)
    maps = unmoved = [one for _, one in by_kind(static).maps]
    if maps:
        place, turn = SE2(np.array([-pose[0], -pose[1], 0.0])), SE2(np.array([0, 0, -pose[2]]))
        maps = [one.moved(place).moved(turn) for one in maps]
    pieces = pieces_seen_from(static, pose)
    apart = solids = solids_of(pieces)
    if maps:
        # Rectangles of maps come last: near contact they are solids as others, but the field takes
        # maps by a transform of their cells.
        rings = np.concatenate([_cells(one, pose) for one in unmoved])
        solids = solids_of(joined([pieces, pieces_of((ring, 0.0) for ring in rings)]))
    if not len(solids.plates):
        return NOTHING_STANDS
    low, high = solids.plates.min(axis=0).tolist(), solids.plates.max(axis=0).tolist()
    extent = (*low[:2], *high[2:4])
    field = _field(solids, extent, body, keep, most=MOST_MAP_CELLS if maps else MOST_FIELD_CELLS)
    if maps:
        field.distance[:] = field.outside
        _kernels_field.write_all(field._replace(solids=apart))
        field = field._replace(solids=NOTHING)
    for one in maps:
        x, y, heading = one.origin.tolist()
        there = Place(x, y, math.cos(heading), math.sin(heading))
        cells = np.broadcast_to(one.blocked, one.blocked.shape)  # read-only, wherever it is from
        _kernels_field.write_map(field, cells, one.resolution, there)
    return solids, _buckets(solids.plates, extent, body, keep), field


def own_frame(obstacles: tuple[AnyObstacle, ...], otherwise: Array) -> tuple[float, ...]:
    """A pose that moves with the obstacles: at the first static one that has a direction.

    Two discs have one, from the first to the next that stands clear of its centre. The pose
    `otherwise` (3,) where there is none.
    """
    return frame_at_first(obstacles) or tuple(otherwise[:3].tolist())


@functools.lru_cache(maxsize=64)
def frame_at_first(obstacles: tuple[AnyObstacle, ...]) -> tuple[float, ...]:
    """The pose of `own_frame`; empty where there is none."""
    first: Disc | None = None
    for obstacle in obstacles:
        if isinstance(obstacle, OccupancyMap):
            return tuple(obstacle.origin.tolist())
        if obstacle.motion is not None:
            continue
        if isinstance(obstacle.shape, Disc):
            first = first or obstacle.shape
            ahead, aside = (obstacle.shape.center - first.center).tolist()
            if math.hypot(ahead, aside) > first.radius:
                return (*first.center.tolist(), math.atan2(aside, ahead))
            continue
        if isinstance(obstacle.shape, Box):
            return (*obstacle.shape.center.tolist(), obstacle.shape.heading)
        ring = obstacle.shape.corners.tolist()
        edges = [(b[0] - a[0], b[1] - a[1]) for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]
        lengths = [math.hypot(*edge) for edge in edges]
        if (most := max(lengths)) > 0.0:  # rounded, so that a moved ring has the same longest edge
            ahead, aside = edges[[round(one / most, 6) for one in lengths].index(1.0)]
            return (*ring[0], math.atan2(aside, ahead))
    return ()


def _cells(one: OccupancyMap, frame: Array) -> Array:
    """Corners (n, 4, 2) of the blocked rectangles of a map, seen from a frame."""
    boxes = one.resolution * blocked_rectangles(one.blocked).astype(np.float64)
    rings = boxes[:, [[0, 1], [2, 1], [2, 3], [0, 3]]]
    c, s = math.cos(one.origin[2]), math.sin(one.origin[2])
    turned = rings @ np.array([[c, s], [-s, c]])
    shift = one.origin[:2] - frame[:2]  # places first, so that no digit is lost
    return seen_from(turned + shift, np.array([0.0, 0.0, frame[2]]))


def _box(boxes: Array, moving: tuple[_Moving, ...], frame: Array) -> Array:
    low, high = boxes[:, :2], boxes[:, 2:]
    if moving:
        back = SE2(frame).inverse()
        ways = np.asarray(back.act(np.concatenate([one.way for one in moving])))
        reaches = np.concatenate([np.full((len(one.way), 1), one.reach) for one in moving])
        low, high = np.vstack([low, ways - reaches]), np.vstack([high, ways + reaches])
    if not len(low):
        return np.array([math.inf, math.inf, -math.inf, -math.inf])
    return np.concatenate([low.min(axis=0), high.max(axis=0)])


_Extent: TypeAlias = tuple[float, float, float, float]  # lowest x and y, highest x and y


def _field(solids: Solids, extent: _Extent, body: Body, keep: float, *, most: int) -> Field:
    """A field for solids, of at most so many cells; nothing of it is written yet."""
    left, below, right, above = extent
    width, height = right - left, above - below
    # Cells that are small against the body, so that the field decides most poses by itself; larger
    # ones where the map would need too many.
    scale = body.half_width or 0.25 * float(np.median(solids.plates[:, 2:4] - solids.plates[:, :2]))
    pad = 2.0 * (keep + 4.0 * body.half_width)
    area, longest = max((width + pad) * (height + pad), 1e-12), max(width, height) + pad
    cell = max(0.25 * scale, math.sqrt(area / most), longest / most)
    # Where all is further away than the cap, a step is as long as the cap allows. The inscribed
    # disc is told by the field, so the cap is no less.
    cap = keep + max(4.0 * body.half_width, body.inscribed, 8.0 * cell)
    columns, rows = math.ceil((width + 2.0 * cap) / cell), math.ceil((height + 2.0 * cap) / cell)
    return Field(np.zeros((rows, columns)), left - cap, below - cap, cell, cap, solids)


def _buckets(plates: Array, extent: _Extent, body: Body, keep: float) -> Buckets:
    reach = keep + (0.4 * body.reach if body.reach else 0.25)
    around = body.reach + LISTED * reach
    left, below, right, above = extent
    low_x, low_y = left - around, below - around
    width, height = right + around - low_x, above + around - low_y
    cell = max(0.35 * around, math.sqrt(width * height / MOST_BUCKETS))
    columns, rows = math.ceil(width / cell), math.ceil(height / cell)
    start = np.zeros(rows * columns + 1, dtype=np.int64)
    buckets = Buckets(start, start[:0], low_x, low_y, cell, columns, rows, reach)
    return buckets._replace(items=_kernels_field.fill_buckets(buckets, plates, around))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Moving:
    """What a moving obstacle is in every world, whatever its frame and whatever is beside it."""

    pieces: ConvexPieces
    motion: Motion
    rate: Array  # (n, 3) twists of what coasts on arcs; else 0, as its poses tell all
    speed: float
    middle: Array
    reach: float

    @functools.cached_property
    def way(self) -> Array:
        """Places (m, 2) of the middle along its motion."""
        times = self.motion.times_for_lines(ALONG)
        return np.asarray(SE2(self.motion.at(times)).act(self.middle))


def _moving_obstacles(
    every: tuple[_Moving, ...], frame: Array, present: tuple[tuple[float, float], ...], reach: float
) -> MovingObstacles:
    """All moving obstacles, for a body of some reach [m]."""
    knots = [one.motion.time.size for one in every]
    poses = np.concatenate([np.zeros((0, 3)), *(one.motion.pose for one in every)])
    # Poses (n, 3) from a frame, their headings going on as they do.
    there = SE2(np.array([-frame[0], -frame[1], 0.0])) @ SE2(poses)
    turned = SE2(np.array([0.0, 0.0, -frame[2]])) @ there
    found = MovingObstacles(
        solids=solids_of(joined([one.pieces for one in every])),
        first_piece=np.cumsum([0, *(one.pieces.counts.size for one in every)], dtype=np.int64),
        first_knot=np.cumsum([0, *knots], dtype=np.int64),
        time=np.concatenate([np.zeros(0), *(one.motion.time for one in every)]),
        pose=np.asarray(np.round(turned.pose, DIGITS)),
        speed=np.array([one.speed for one in every], dtype=np.float64),
        middle=np.array([one.middle for one in every], dtype=np.float64).reshape(-1, 2),
        reach=np.array([one.reach for one in every], dtype=np.float64),
        present=np.array(present, dtype=np.float64).reshape(-1, 2),
        rate=np.concatenate([np.zeros((0, 3)), *(one.rate for one in every)]),
        arcs=np.array([one.motion.twist is not None for one in every], dtype=np.bool_),
        slabs=NO_SLABS,
    )
    return found._replace(slabs=slabs_of(found, reach))


@functools.lru_cache(maxsize=4096)
def _moving_of(obstacle: Obstacle) -> _Moving:
    """A moving obstacle as all worlds see it."""
    motion = obstacle.motion
    assert motion is not None
    own = convex_pieces(obstacle.shape)
    low = np.min([ring.min(axis=0) - r for ring, r in own], axis=0)
    high = np.max([ring.max(axis=0) + r for ring, r in own], axis=0)
    middle = 0.5 * (low + high)
    far = max(float(np.hypot(*ring.T).max()) + r for ring, r in own)
    rate = np.zeros((motion.time.size, 3))
    if motion.twist is not None:
        rate[:-1] = motion.twist
    return _Moving(
        pieces=pieces_of(own),
        motion=motion,
        rate=rate,
        speed=motion.fastest(far),
        middle=middle,
        reach=max(float(np.hypot(*(ring - middle).T).max()) + r for ring, r in own),
    )


FEW_MOVING = 4  # obstacles that are followed one by one sooner than looked up
MOST_SLABS = 128  # of the shortest; a power of two
OWN_SIZES = 2.0  # that an obstacle may cover in one of them


NO_SLABS = Slabs(0.0, 1.0, 0, 0, np.zeros((0, 4)))


def slabs_of(moving: MovingObstacles, reach: float) -> Slabs:
    """The slabs of moving obstacles for a body of some reach [m]; none where there are few.

    The shortest are about as long as an obstacle takes to cover its own size and the body's.
    """
    n = moving.speed.size
    if n < FEW_MOVING:
        return NO_SLABS
    events = np.concatenate([moving.time, moving.present.ravel()])
    events = events[np.isfinite(events)]
    begin, span = float(events.min()), float(np.ptp(events))
    covered = float(np.median(moving.speed * span / (moving.reach + reach))) / OWN_SIZES
    leaves = 1 << math.ceil(math.log2(min(max(covered, 1.0), MOST_SLABS)))
    width = span / leaves if span > 0.0 else 1.0
    box = np.empty((2 * leaves * n, 4))
    _kernels_slabs.write_slabs(moving, begin, width, leaves, box)
    return Slabs(begin, width, leaves, 0, box)


NONE, NOTHING = np.zeros(1, dtype=np.int64), solids_of(NO_PIECES)
NOTHING_STANDS = (
    NOTHING,
    Buckets(NONE, NONE[:0], 0.0, 0.0, 1.0, 0, 0, math.inf),
    Field(np.zeros((0, 0)), 0.0, 0.0, 1.0, math.inf, NOTHING),
)
NOTHING_MOVES = _moving_obstacles((), np.zeros(3), (), 0.0)
