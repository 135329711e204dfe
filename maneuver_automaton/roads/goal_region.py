"""Goals of a drive on roads: where, how, and when the vehicle shall be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton.collision import AnyShape, Box, Disc, Polygon, Shape, as_shapes

Interval: TypeAlias = tuple[float, float]
EXACT = 1e-9  # [m/s, s, rad] of the ends of intervals, for values that were rounded


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GoalRegion:
    """Conditions that have to hold at one instant; None where any value will do.

    The position is that of the middle of the vehicle.

    Examples
    --------
    >>> goal = GoalRegion(places=(Box([4.0, 2.0], [10.0, 0.0]),), speed=(5.0, 8.0), time=(2.0, 3.0))
    >>> goal.contains([9.0, 0.5, 0.1], speed=6.0, time=2.5)
    True
    >>> goal.contains([9.0, 0.5, 0.1], speed=6.0, time=3.5)
    False
    """

    places: tuple[Shape, ...] | None = None  # in one of them
    heading: Interval | None = None  # [rad] from the first turning left to the second
    speed: Interval | None = None  # [m/s]
    time: Interval = (0.0, math.inf)  # [s]
    lanelets: tuple[int, ...] = ()  # numbers of those that the places are, if they are lanelets

    __repr__ = brief

    if TYPE_CHECKING:  # geometry of shapely, or lists of corners, will do

        def __init__(
            self,
            *,
            places: AnyShape | Sequence[AnyShape] | None = None,
            heading: Interval | None = None,
            speed: Interval | None = None,
            time: Interval = ...,
            lanelets: tuple[int, ...] = (),
        ) -> None: ...

    def __post_init__(self) -> None:
        if isinstance(self.places, tuple | list) and not self.places:
            raise ValueError("goal region: got no place, need at least one, or None for anywhere")
        if self.places is not None:
            object.__setattr__(self, "places", as_shapes("goal region", self.places))
        for name, interval in (("speed", self.speed), ("time", self.time)):
            if interval is not None and not interval[0] <= interval[1]:
                raise ValueError(f"goal region: {name} must be [low, high], got {interval}")
        if self.heading is not None and not np.isfinite(self.heading).all():
            raise ValueError(f"goal region: headings must be finite, got {self.heading} rad")

    def contains(
        self, middle: ArrayLike, *, speed: float, time: float, tolerance: float = EXACT
    ) -> bool:
        """Whether a pose (3,) of the middle, a speed [m/s] and a time [s] are within it.

        The ends belong to it; `tolerance` [m/s, s, rad] is for values that were rounded.
        """
        import shapely

        x, y, heading = np.asarray(middle, dtype=np.float64).tolist()
        if not self.time[0] - tolerance <= time <= self.time[1] + tolerance:
            return False
        if self.speed is not None and not (
            self.speed[0] - tolerance <= speed <= self.speed[1] + tolerance
        ):
            return False
        if self.heading is not None and not turns_within(
            heading, self.heading, tolerance=tolerance
        ):
            return False
        return self.away_from(shapely.Point(x, y)) <= 0.0

    def off_by(self, middle: ArrayLike, *, speed: float) -> tuple[float, float, float]:
        """How far a pose (3,) of the middle [m, rad] and a speed [m/s] are from it, time apart.

        Zero where a condition holds; the speed is positive where it is too high.

        Examples
        --------
        >>> goal = GoalRegion(places=(Box([4.0, 2.0], [10.0, 0.0]),), speed=(5.0, 8.0))
        >>> goal.off_by([5.0, 0.5, 0.1], speed=4.0)
        (3.0, 0.0, -1.0)
        """
        import shapely

        x, y, heading = np.asarray(middle, dtype=np.float64).tolist()
        away = self.away_from(shapely.Point(x, y))
        turned = 0.0
        if self.heading is not None and not turns_within(heading, self.heading):
            turned = min(abs(math.remainder(heading - end, 2.0 * math.pi)) for end in self.heading)
        low, high = self.speed or (-math.inf, math.inf)
        return away, turned, min(speed - low, 0.0) + max(speed - high, 0.0)

    def away_from(self, area: Any) -> float:
        """Least distance of its places to a shapely geometry [m], 0 where they meet or anywhere is.

        Examples
        --------
        >>> import shapely
        >>> GoalRegion(places=(Disc(1.0, [5.0, 0.0]),)).away_from(shapely.Point(2.0, 0.0))
        2.0
        """
        return min((_away(place, area) for place in self.places or ()), default=0.0)


def turns_within(heading: float, interval: Interval, *, tolerance: float = 0.0) -> bool:
    """Whether a heading is in an interval, whatever full turns are between.

    Examples
    --------
    >>> turns_within(-3.1, (3.0, 3.3)), turns_within(0.0, (3.0, 3.3))
    (True, False)
    """
    low, high = interval[0] - tolerance, interval[1] + tolerance
    if high - low >= 2.0 * math.pi:
        return True
    return math.remainder(heading - low, 2.0 * math.pi) % (2.0 * math.pi) <= high - low


def outlines_of(places: Sequence[Shape]) -> list[Array]:
    """Outer rings (n, 2) of shapes; a disc as a polygon of 64 corners inside it [m]."""
    rings: list[Array] = []
    for place in places:
        if isinstance(place, Disc):
            angles = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
            circle = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
            rings.append(place.center + place.radius * circle)
        else:
            rings.append(np.array(place.corners))
    return rings


def _away(place: Shape, area: Any) -> float:
    """Distance to a place, 0 inside [m]."""
    import shapely

    if isinstance(place, Disc):
        return max(float(shapely.distance(shapely.Point(place.center), area)) - place.radius, 0.0)
    holes = place.holes if isinstance(place, Polygon) else ()
    corners = place.corners if isinstance(place, Box | Polygon) else np.zeros((0, 2))
    return float(shapely.distance(shapely.Polygon(corners, holes), area))
