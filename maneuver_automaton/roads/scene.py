"""A scene on roads: lanelets, road users, and the start and goals of one vehicle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, freeze, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton.collision import Box, Disc, Obstacle, Polygon, Shape
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads.goal_region import GoalRegion
from maneuver_automaton.roads.lanelets import Lanelet, StopLine

TIME_TOLERANCE = 1e-9  # [s] times closer than this are one


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
        if not 0.0 < self.step < math.inf:
            raise ValueError(
                f"road scene {self.name!r}: the time step must be positive, got {self.step} s"
            )

    @property
    def last_time(self) -> float:
        """End of the last time window [s]."""
        return max(goal.time[1] for goal in self.goals)

    def present(self, time: float) -> list[Obstacle]:
        """Obstacles that are on the road at `time` [s]."""
        times = [presence_of(one) for one in self.traffic]
        return [
            one
            for one, (first, last) in zip(self.traffic, times, strict=True)
            if first - TIME_TOLERANCE <= time <= last + TIME_TOLERANCE
        ]

    def moved(self, by: SE2, *, digits: int | None = None) -> RoadScene:
        """The scene moved by a planar pose; its numbers rounded to `digits` if given.

        Rounded, a scene and the moved scene are the same to the last bit where they start.
        """
        turn = float(by.pose[2])

        def turned(interval: tuple[float, float] | None) -> tuple[float, float] | None:
            if interval is None:
                return None
            low, high = _near(np.array(interval) + turn, digits).tolist()
            return low, high

        return replace(
            self,
            lanelets=tuple(one.moved(by, digits=digits) for one in self.lanelets),
            start=replace(self.start, middle=_near((by @ SE2(self.start.middle)).pose, digits)),
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


def _near(values: Array, digits: int | None) -> Array:
    return values if digits is None else np.asarray(np.round(values, digits) + 0.0)


def _near_shape(shape: Shape, digits: int | None) -> Shape:
    if digits is None:
        return shape
    if isinstance(shape, Disc):
        return Disc(shape.radius, _near(shape.center, digits))
    if isinstance(shape, Box):
        return Box(shape.size, _near(shape.center, digits), round(shape.heading, digits))
    rings = [_near(ring, digits) for ring in (shape.corners, *shape.holes)]
    return Polygon(rings[0], rings[1:])


def moved_obstacle(one: Obstacle, by: SE2, *, digits: int | None = None) -> Obstacle:
    """A road user moved by a planar pose; its numbers rounded to `digits` if given."""
    one = one.moved(by)
    if one.motion is None:
        return replace(one, shape=_near_shape(one.shape, digits))
    return replace(one, motion=replace(one.motion, pose=_near(one.motion.pose, digits)))


def presence_of(one: Obstacle) -> tuple[float, float]:
    """First and last time [s] at which a road user is there: its recorded times, or always.

    Examples
    --------
    >>> presence_of(Obstacle(Box([4.0, 2.0])))
    (-inf, inf)
    """
    if one.motion is None:
        return -math.inf, math.inf
    first, last = one.motion.time[[0, -1]].tolist()
    return first, last


def unwrapped(headings: Sequence[float]) -> Array:
    """Headings (n,) as they were turned through: no jump of more than half a turn [rad].

    Examples
    --------
    >>> unwrapped([3.0, -3.0]).round(3).tolist()
    [3.0, 3.283]
    """
    return np.unwrap(np.asarray(headings, dtype=np.float64))
