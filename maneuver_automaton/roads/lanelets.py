"""Lanelets: pieces of lane, how they follow another, stop lines, and the land beside them all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, check_fields, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton._lazy import shapely
from maneuver_automaton.collision import Obstacle, Polygon
from maneuver_automaton.collision.outline import united
from maneuver_automaton.groups import LieGroup

SAME_TIME = 1e-9  # [s]
ROUNDED = 1e-5  # [m] gaps of less than twice this are what rounding left
TILE = 20.0  # [m] pieces are cut to this size: a search tree, or a bucket, then leaves most out
SEAM = 0.01  # [m] of gaps between lanelets, which a file may have by rounding
SLIVER = 1e-6  # [m^2] smaller pieces are what rounding left between lanelets


@dataclass(frozen=True, slots=True, eq=False)
class Lanelet:
    """A piece of lane; its bounds run in the direction of travel.

    Examples
    --------
    >>> lane = Lanelet(1, [[0, 2], [10, 2]], [[0, -2], [10, -2]])
    >>> lane.center.tolist(), lane.length
    ([[0.0, 0.0], [10.0, 0.0]], 10.0)
    """

    number: int
    left: Array  # (n, 2) [m]
    right: Array  # (n, 2) [m]
    successors: tuple[int, ...] = ()
    beside: tuple[int, ...] = ()  # neighbours in the same direction
    speed_limit: float | None = None  # [m/s]
    against: tuple[int, ...] = ()  # neighbours in the opposite direction

    __repr__ = brief

    if TYPE_CHECKING:

        def __init__(
            self,
            number: int,
            left: ArrayLike,
            right: ArrayLike,
            successors: Sequence[int] = ...,
            beside: Sequence[int] = ...,
            speed_limit: float | None = ...,
            against: Sequence[int] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        freeze(self, "left", last=2)
        freeze(self, "right", last=2)
        for name, bound in (("left", self.left), ("right", self.right)):
            if bound.ndim != 2 or len(bound) < 2:
                raise ValueError(
                    f"lanelet {self.number}: the {name} bound has shape {bound.shape}, need "
                    "(n, 2) with n >= 2"
                )
        for name in ("successors", "beside", "against"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        check_fields(f"lanelet {self.number}", self, "speed_limit", unit="m/s", infinite=True)

    def moved(self, by: LieGroup, *, digits: int | None = None) -> Lanelet:
        """The lanelet moved by a planar pose, its places rounded to `digits` if given."""
        left, right = (rounded(np.asarray(by.act(one)), digits) for one in (self.left, self.right))
        return replace(self, left=left, right=right)

    @property
    def center(self) -> Array:
        """Middle between the bounds (n, 2), corner by corner if they have as many [m]."""
        if len(self.left) == len(self.right):
            return np.asarray(0.5 * (self.left + self.right))
        n = max(len(self.left), len(self.right))
        return 0.5 * (resampled(self.left, n) + resampled(self.right, n))

    @property
    def length(self) -> float:
        """Length of the middle [m]."""
        return float(np.hypot(*np.diff(self.center, axis=0).T).sum())

    @property
    def ring(self) -> Array:
        """Outline (n, 2), counter-clockwise if the left bound is on the left [m]."""
        return np.concatenate([self.right, self.left[::-1]])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StopLine:
    """A line across a lanelet that is not crossed while a light is red, or before standing.

    Examples
    --------
    >>> light = StopLine(name="traffic light 8", line=[[60, 2], [60, -2]], lanelet=1,
    ...                  phases=((10.0, True), (5.0, False)), offset=2.0)
    >>> light.closed(0.0, 20.0)
    [(2.0, 12.0), (17.0, 20.0)]
    """

    name: str  # of the light or sign
    line: Array  # (2, 2) its ends [m]
    lanelet: int  # number of the one that it is across
    onward: tuple[int, ...] | None = None  # successors of the lanelet that it is for; None: all
    # Durations [s] of a light's phases, again and again, and whether the line is closed in each;
    # none for a stop sign, whose line is closed until the vehicle has stood before it.
    phases: tuple[tuple[float, bool], ...] = ()
    offset: float = 0.0  # [s] at which the first phase begins

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "line", last=2)
        if self.line.shape != (2, 2) or not np.ptp(self.line, axis=0).any():
            raise ValueError(f"{self.name}: got the stop line {self.line.tolist()}, need two ends")
        if not all(0.0 < lasts < math.inf for lasts, _ in self.phases):
            raise ValueError(f"{self.name}: got the phases {self.phases}, need positive durations")

    def moved(self, by: LieGroup, *, digits: int | None = None) -> StopLine:
        """The line moved by a planar pose, its ends rounded to `digits` if given."""
        return replace(self, line=rounded(np.asarray(by.act(self.line)), digits))

    def closed(self, begin: float, end: float) -> list[tuple[float, float]]:
        """Times between two [s] in which it is closed; those of a sign are all."""
        if not self.phases:
            return [(begin, end)]
        found: list[tuple[float, float]] = []
        period = math.fsum(lasts for lasts, _ in self.phases)
        time = self.offset + math.floor((begin - self.offset) / period) * period
        while time < end:
            for lasts, red in self.phases:
                low, high = max(time, begin), min(time + lasts, end)
                time += lasts
                if red and low < high:
                    follows = bool(found) and low - found[-1][1] < SAME_TIME
                    found.append((found.pop()[0] if follows else low, high))
        return found


def rounded(values: Array, digits: int | None) -> Array:
    """Numbers rounded to `digits`, if given; no negative zero."""
    return values if digits is None else np.asarray(np.round(values, digits) + 0.0)


def resampled(line: Array, n: int) -> Array:
    """`n` points (n, 2) equally spaced along a line (m, 2)."""
    station = along(line)
    at = np.linspace(0.0, station[-1], n)
    return np.stack([np.interp(at, station, line[:, k]) for k in range(2)], axis=-1)


def along(line: Array) -> Array:
    """Distance (n,) from the first point of a line (n, 2) [m]."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def drivable_area(lanelets: Sequence[Lanelet]) -> Any:
    """The union of all lanelets, a valid shapely polygon or multipolygon.

    Bounds are drawn by hand and miss each other by centimetres. Between lanelets that are stated to
    be neighbours there is road, and up to `SEAM` where corners amid their row and amid the row that
    follows miss each other; any other gap is none, however narrow.
    Source: the road boundary of `commonroad-drivability-checker` (2025.4), which judges solutions:
    it fills every row of neighbours from the first bound to the last, and of the ends of a row it
    looks at the outermost corners only.

    Examples
    --------
    >>> gap = [Lanelet(0, [[0, 1], [9, 1]], [[0, 0], [9, 0]], beside=[1]),
    ...        Lanelet(1, [[0, 2], [9, 2]], [[0, 1.1], [9, 1.1]], beside=[0])]
    >>> round(drivable_area(gap).area, 9)
    18.0
    """
    known = {lanelet.number: lanelet for lanelet in lanelets}
    rings, inner = [lanelet.ring for lanelet in lanelets], set[tuple[int, int]]()
    for lanelet in lanelets:
        for k in filter(known.__contains__, (*lanelet.beside, *lanelet.against)):
            side, ring = _between(lanelet, known[k])
            rings.append(ring)
            inner.add((lanelet.number, side))
    for lanelet in lanelets:
        for k in filter(known.__contains__, lanelet.successors):
            ring = np.stack(
                [lanelet.left[-1], lanelet.right[-1], known[k].right[0], known[k].left[0]]
            )
            amid = [{(lanelet.number, side), (k, side)} <= inner for side in (0, 1)]
            apart = np.hypot(*(ring[:2] - ring[:1:-1]).T)
            if apart.max() > ROUNDED and (apart <= np.where(amid, SEAM, ROUNDED)).all():
                rings.append(ring)
    area = _flat(_flat([shapely.make_valid(shapely.Polygon(ring)) for ring in rings]))
    grown = shapely.buffer(area, ROUNDED, join_style="mitre")
    return _flat(united([area, shapely.buffer(grown, -ROUNDED, join_style="mitre")]))


def _between(one: Lanelet, other: Lanelet) -> tuple[int, Array]:
    """Side of a neighbour, 0 for left, and outline (n, 2) of the gap: two bounds that face."""
    turned = (other.left, other.right), (other.right[::-1], other.left[::-1])
    facing = zip((one.left, one.right), turned[other.number not in one.against], strict=True)
    pairs = [(float(np.hypot(*(a.mean(axis=0) - b.mean(axis=0)))), a, b) for a, b in facing]
    side = int(pairs[1][0] < pairs[0][0])
    return side, np.concatenate(pairs[side][1:])


def _flat(geometries: Any) -> Any:
    """The union of the polygons among geometries and their parts."""
    parts = shapely.get_parts(shapely.get_parts(geometries))
    return united(parts[shapely.get_dimensions(parts) == 2].tolist())


def obstacles_in(land: Any) -> tuple[Obstacle, ...]:
    """A shapely area as static obstacles, cut into tiles."""
    if land.is_empty:
        return ()
    low_x, low_y, high_x, high_y = land.bounds
    x, y = np.meshgrid(np.arange(low_x, high_x, TILE), np.arange(low_y, high_y, TILE))
    tiles = shapely.box(x.ravel(), y.ravel(), x.ravel() + TILE, y.ravel() + TILE)
    shapely.prepare(land)
    pieces = shapely.get_parts(shapely.intersection(land, tiles[shapely.intersects(land, tiles)]))
    return tuple(
        Obstacle(
            Polygon(
                shapely.get_coordinates(piece.exterior)[:-1],
                [shapely.get_coordinates(hole)[:-1] for hole in piece.interiors],
            )
        )
        for piece in pieces
        if piece.geom_type == "Polygon" and piece.area > SLIVER
    )
