"""A scene on roads: lanelets, road users, one vehicle's start, and where and when it shall be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, check_fields, freeze, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton._lazy import shapely
from maneuver_automaton.collision import AnyShape, Box, Disc, Obstacle, Polygon, Shape, as_shapes
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads.lanelets import Lanelet, StopLine, rounded

TIME_TOLERANCE = 1e-9  # [s] times closer than this are one
Interval: TypeAlias = tuple[float, float]
EXACT = 1e-9  # [m/s, s, rad] of the ends of intervals, for values that were rounded


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadStart:
    """State of the vehicle at the beginning."""

    middle: Array  # (3,) pose of its middle [m, m, rad]
    speed: float  # [m/s]
    turn_rate: float = 0.0  # [rad/s]
    time: float = 0.0  # [s]

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        freeze(self, "middle", last=3)
        for name in ("speed", "turn_rate", "time"):
            if not math.isfinite(value := getattr(self, name)):
                raise ValueError(f"road start: {name} must be finite, got {value}")


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadBenchmark:
    """What names a scene to CommonRoad, whose solutions say which problem they solve."""

    scenario: str  # DEU_Ffb-1_6_T-1
    version: str  # of the format: 2018b
    problem: int  # id of the planning problem

    __repr__ = brief


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadScene:
    """One problem of driving on roads.

    A moving obstacle is there only as long as its motion was recorded: before the first of its
    times and after the last one it is not on the road. A static obstacle, without motion, stays.

    Examples
    --------
    >>> lane = Lanelet(1, [[0, 2], [90, 2]], [[0, -2], [90, -2]])
    >>> scene = RoadScene(name="lane", lanelets=(lane,), goals=(GoalRegion(time=(1.0, 2.0)),),
    ...                   start=RoadStart(middle=[5.0, 0.0, 0.0], speed=10.0))
    >>> scene.last_time
    2.0
    """

    name: str
    lanelets: tuple[Lanelet, ...]
    start: RoadStart
    goals: tuple[GoalRegion, ...]  # one of them
    traffic: tuple[Obstacle, ...] = ()
    source: str = ""  # author and place of the recording, for pictures
    step: float = 0.1  # [s] of the clock that the scene was recorded with
    benchmark: RoadBenchmark | None = None  # None: it is none of CommonRoad
    stop_lines: tuple[StopLine, ...] = ()
    notes: tuple[str, ...] = ()  # what a file states that is not obeyed, or read otherwise

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        if not self.lanelets:
            raise ValueError(f"road scene {self.name!r}: got no lanelet, need at least one")
        if not self.goals:
            raise ValueError(f"road scene {self.name!r}: got no goal, need at least one")
        check_fields(f"road scene {self.name!r}", self, "step", unit="s")

    @property
    def last_time(self) -> float:
        """End of the last time window [s]."""
        return max(goal.time[1] for goal in self.goals)

    def present(self, time: float) -> list[Obstacle]:
        """Obstacles that are on the road at `time` [s]."""
        there = [(one, *one.lasts(fleeting=True)) for one in self.traffic]
        most = TIME_TOLERANCE
        return [one for one, first, last in there if first - most <= time <= last + most]

    def moved(self, by: SE2, *, digits: int | None = None) -> RoadScene:
        """The scene moved by a planar pose; its numbers rounded to `digits` if given.

        Rounded, a scene and the moved scene are the same to the last bit where they start.
        """
        turn = float(by.pose[2])

        def turned(interval: tuple[float, float] | None) -> tuple[float, float] | None:
            if interval is None:
                return None
            low, high = rounded(np.array(interval) + turn, digits).tolist()
            return low, high

        return replace(
            self,
            lanelets=tuple(one.moved(by, digits=digits) for one in self.lanelets),
            start=replace(self.start, middle=rounded((by @ SE2(self.start.middle)).pose, digits)),
            goals=tuple(
                replace(
                    goal,
                    places=goal.places
                    and tuple(_near_shape(place.moved(by), digits) for place in goal.places),
                    heading=turned(goal.heading),
                )
                for goal in self.goals
            ),
            traffic=tuple(moved_obstacle(one, by, digits=digits) for one in self.traffic),
            stop_lines=tuple(one.moved(by, digits=digits) for one in self.stop_lines),
        )


def _near_shape(shape: Shape, digits: int | None) -> Shape:
    if digits is None:
        return shape
    if isinstance(shape, Disc):
        return Disc(shape.radius, rounded(shape.center, digits))
    if isinstance(shape, Box):
        return Box(shape.size, rounded(shape.center, digits), round(shape.heading, digits))
    rings = [rounded(ring, digits) for ring in (shape.corners, *shape.holes)]
    return Polygon(rings[0], rings[1:])


def moved_obstacle(one: Obstacle, by: SE2, *, digits: int | None = None) -> Obstacle:
    """A road user moved by a planar pose; its numbers rounded to `digits` if given."""
    one = one.moved(by)
    if one.motion is None:
        return replace(one, shape=_near_shape(one.shape, digits))
    return replace(one, motion=replace(one.motion, pose=rounded(one.motion.pose, digits)))


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

    def contains(self, middle: ArrayLike, *, speed: float, time: float) -> bool:
        """Whether a pose (3,) of the middle, a speed [m/s] and a time [s] are within it."""
        x, y, heading = np.asarray(middle, dtype=np.float64).tolist()
        slowest, fastest = self.speed or (-math.inf, math.inf)
        if not (
            self.time[0] - EXACT <= time <= self.time[1] + EXACT
            and slowest - EXACT <= speed <= fastest + EXACT
        ):
            return False
        if self.heading is not None and not turns_within(heading, self.heading, tolerance=EXACT):
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
        apart = (
            float(shapely.distance(geometry_of(one), area))
            - (one.radius if isinstance(one, Disc) else 0.0)
            for one in self.places or ()
        )
        return max(min(apart, default=0.0), 0.0)


def turns_within(heading: float, interval: Interval, *, tolerance: float = 0.0) -> bool:
    """Whether a heading is in an interval, whatever full turns are between."""
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


def geometry_of(place: Shape) -> Any:
    """A shape as a shapely geometry; a disc as its center, to be grown by its radius."""
    if isinstance(place, Disc):
        return shapely.Point(place.center)
    return shapely.Polygon(place.corners, place.holes if isinstance(place, Polygon) else ())
