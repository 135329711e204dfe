"""Which vehicles come too near to each other if they drive their plans, and when."""

from __future__ import annotations

import functools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import networkx as nx
import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision.body import Body, body_of, fastest_points
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.collision.shapes import (
    Box,
    Disc,
    Obstacle,
    Polygon,
    Shape,
)
from maneuver_automaton.collision.world import world_of
from maneuver_automaton.fleet import _kernels_meetings as kernels
from maneuver_automaton.fleet.levels import ALWAYS, Levels, Stage

PROOF = 1e-4  # [m] more than the distance to keep, wherever two bodies are looked at
AFTER = 1.0  # [s] that is looked at once nothing moves any more


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A vehicle's bodies in time: each of its parts with a motion, while it is there."""

    shapes: tuple[tuple[Shape, ...], ...]  # of the vehicle and of what it carries
    motions: tuple[Motion, ...]
    until: float = math.inf  # [s] when it is gone; inf if it stays
    grown: float = 0.0  # [m] by how much larger others see it
    levels: Levels | None = None  # between which heights it is; None: it counts at all of them
    bodies: tuple[Obstacle, ...] = field(init=False)  # as they are
    obstacles: tuple[Obstacle, ...] = field(init=False)  # as others see them

    def __post_init__(self) -> None:
        bodies = tuple(
            _during(stage, shape, motion)
            for shapes, motion in zip(self.shapes, self.motions, strict=True)
            for shape in shapes
            for stage in self.stages
        )
        object.__setattr__(self, "bodies", bodies)
        seen = bodies
        if self.grown > 0.0:
            seen = tuple(_seen_larger(one, self.grown) for one in bodies)
        object.__setattr__(self, "obstacles", seen)

    @property
    def stages(self) -> tuple[Stage, ...]:
        """Stretches of time in which it keeps between two heights, as long as it is there."""
        first = min(float(one.time[0]) for one in self.motions)
        stages = ALWAYS if self.levels is None else self.levels.stages
        there = [one for one in stages if one.begin < self.until and one.end > first] or stages[-1:]
        rows = [one._replace(end=min(one.end, self.until)) for one in there]
        return (rows[0]._replace(begin=-math.inf), *rows[1:])

    @property
    def arrived(self) -> tuple[Obstacle, ...]:
        """What is left of it once it has arrived: where it stands, or nothing if it leaves."""
        if self.until < math.inf:
            return ()
        return tuple(where_it_stays(one) for one in self.obstacles if one.presence[1] == math.inf)

    @property
    def quiet_after(self) -> float:
        """When it has come to rest for good, or is gone [s]."""
        return min(self.until, max(float(one.time[-1]) for one in self.motions))

    def after(self, time: float) -> Course:
        """What is left of it from a time on [s]."""
        if all(time <= float(one.time[0]) for one in self.motions):
            return self
        return replace(self, motions=tuple(_left(one, time) for one in self.motions))


def _during(stage: Stage, shape: Shape, motion: Motion) -> Obstacle:
    """A body that is between the heights of a stage, while that lasts."""
    lasts, there = (stage.begin, stage.end), (stage.low, stage.high)
    return Obstacle(
        shape,
        motion=motion,
        present_s=None if lasts == (-math.inf, math.inf) else lasts,
        height=None if there == (-math.inf, math.inf) else there,
    )


def _seen_larger(body: Obstacle, by: float) -> Obstacle:
    """A body that is larger by a length [m], in its height too."""
    height = None if body.height is None else (body.height[0] - by, body.height[1] + by)
    return replace(body, shape=larger(body.shape, by), height=height)


def where_it_stays(body: Obstacle) -> Obstacle:
    """What stands where a moving body ends.

    Examples
    --------
    >>> way = Motion([0.0, 1.0], [[0, 0, 0], [2, 0, 0]])
    >>> where_it_stays(Obstacle(Disc(0.3), motion=way)).shape.center.tolist()
    [2.0, 0.0]
    """
    assert body.motion is not None
    return Obstacle(body.at(float(body.motion.time[-1])), height=body.height)


def standing_still(body: Obstacle) -> Obstacle:
    """A body that never moves, as what stands there; any other as it is.

    Searches are led round the one, and only past the other.
    """
    motion = body.motion
    if motion is None or len(motion.time) > 1 or body.presence != (-math.inf, math.inf):
        return body
    return where_it_stays(body)


def _left(motion: Motion, time: float) -> Motion:
    """A motion from a time on [s]."""
    if time <= float(motion.time[0]):
        return motion
    first = int(np.searchsorted(motion.time, time, side="right"))
    times = np.concatenate([[time], motion.time[first:]])
    poses = np.concatenate([motion.at(time)[None], motion.pose[first:]])
    return Motion(times, poses, motion.rates[first - 1 :])


def larger(shape: Shape, by: float) -> Shape:
    """A shape that holds all within a length [m] of another, with square corners.

    Examples
    --------
    >>> from maneuver_automaton.collision import Box, Disc
    >>> larger(Disc(1.0), 0.5).radius, larger(Box([2.0, 1.0]), 0.5).size.tolist()
    (1.5, [3.0, 2.0])
    """
    if by <= 0.0:
        return shape
    if isinstance(shape, Disc):
        return Disc(shape.radius + by, shape.center)
    if isinstance(shape, Box):
        return Box(shape.size + 2.0 * by, shape.center, shape.heading)
    import shapely

    whole = shapely.Polygon(shape.corners, shape.holes).buffer(by, join_style="mitre")
    return Polygon(whole)


class Meeting(NamedTuple):
    """Two vehicles, by number, and when they first come too near to each other [s]."""

    one: int
    other: int
    time: float


def meetings(
    courses: Mapping[int, Course],
    *,
    keep: float,
    among: Collection[int] | None = None,
    frame: tuple[float, float, float] | None = None,
) -> list[Meeting]:
    """Pairs of vehicles that come closer than a distance [m], the first that does so first.

    Whatever is not among the pairs keeps the distance at all times, also after all have arrived, in
    the plane or in height.
    Only pairs with one of the vehicles `among`, if these are given. Places are counted from a pose
    `frame` nearby, that of the first vehicle if omitted: with the same one all that is prepared for
    a course is prepared once.
    """
    return Encounters(courses, frame).within(keep, among)


class Encounters:
    """What vehicles drive, prepared once: who meets whom within one distance, and another one."""

    def __init__(
        self, courses: Mapping[int, Course], frame: tuple[float, float, float] | None = None
    ) -> None:
        self.numbers = sorted(courses)
        if len(self.numbers) < 2:
            return
        if frame is None:
            first = courses[self.numbers[0]].motions[0].pose[0]
            frame = (float(first[0]), float(first[1]), 0.0)
        obstacles = [one for number in self.numbers for one in courses[number].bodies]
        self._moving = world_of(tuple(obstacles), (), frame).arrays.moving
        counts = [len(courses[number].bodies) for number in self.numbers]
        self._firsts = np.cumsum([0, *counts[:-1]])  # bodies of each vehicle are side by side
        self._heights = np.array([one.height or (-math.inf, math.inf) for one in obstacles])
        # Who begins later stands at its start until then: all are looked at from the first begin.
        began = min(float(way.time[0]) for one in courses.values() for way in one.motions)
        span = (began - AFTER, max(one.quiet_after for one in courses.values()) + AFTER)
        self._courses, self._frame, self._span = courses, frame, span
        self._driven: dict[int, list[tuple[Body, Stage, Array]]] = {}

    def within(self, keep: float, among: Collection[int] | None = None) -> list[Meeting]:
        """Pairs that come closer than a distance [m], the first that does so first.

        Only those with one of the vehicles `among`, if these are given.
        """
        found: dict[tuple[int, int], float] = {}
        wanted = set(self.numbers if among is None else among)
        for number in self.numbers if len(self.numbers) > 1 else ():
            if number not in wanted:
                continue
            times = np.minimum.reduceat(self._first_meetings(number, keep), self._firsts)
            for other, when in zip(self.numbers, times.tolist(), strict=True):
                if other == number or (other in wanted and other < number):
                    continue
                if when < math.inf:
                    pair = (min(number, other), max(number, other))
                    found[pair] = min(when, found.get(pair, math.inf))
        rows = [Meeting(*pair, when) for pair, when in found.items()]
        return sorted(rows, key=lambda row: (row.time, row.one, row.other))

    def _first_meetings(self, number: int, keep: float) -> Array:
        """When a vehicle first comes within a distance [m] of each body (M,).

        What stands between heights is met at those alone.
        """
        heights = self._heights
        least = np.full(len(heights), math.inf)
        for body, stage, rows in self._drives(number):
            out = np.empty(len(heights))
            kernels.first_meetings(self._moving, body, rows, keep, PROOF, out)
            apart = np.maximum(heights[:, 0] - stage.high, stage.low - heights[:, 1])
            out[apart > keep + PROOF] = math.inf
            np.minimum(least, out, out=least)
        return least

    def _drives(self, number: int) -> list[tuple[Body, Stage, Array]]:
        """What each body of a vehicle drives in each of its stages, as the kernel has it."""
        known = self._driven.get(number)
        if known is None:
            course, span = self._courses[number], self._span
            known = self._driven[number] = []
            for shapes, motion in zip(course.shapes, course.motions, strict=True):
                body = body_of(shapes)
                for stage in course.stages:
                    during = max(span[0], stage.begin), min(span[1], stage.end)
                    rows = _coasts(_left(motion, during[0]), body, self._frame, during)
                    known.append((body, stage, rows))
        return known


def _coasts(
    motion: Motion, body: Body, frame: tuple[float, float, float], span: tuple[float, float]
) -> Array:
    """Rows of `first_meetings`: it stands from a time on, coasts, then stands until a time [s]."""
    poses, times = motion.pose - np.array(frame), motion.time
    before, after = max(times[0] - span[0], 0.0), max(span[1] - times[-1], 0.0)
    begins = np.concatenate([[span[0]], times])
    lasting = np.concatenate([[before], np.diff(times), [after]])
    late = begins + lasting > span[1]
    lasting[late] = np.maximum(span[1] - begins[late], 0.0)
    rows = np.zeros((len(times) + 1, 9))
    rows[:, :3] = poses[np.maximum(np.arange(len(times) + 1) - 1, 0)]
    rows[1:-1, 3:6] = motion.rates  # it coasts, or never moves
    rows[:, 6] = fastest_points(body, rows[:, 3:6])
    rows[:, 7] = lasting
    rows[:, 8] = begins
    return rows


@functools.cache
def load_meetings() -> None:
    """Have the kernel of meetings ready, before a clock runs."""
    stands = [
        Course(((Disc(1.0),),), (Motion([0.0], [[place, 0.0, 0.0]]),)) for place in (0.0, 9.0)
    ]
    meetings(dict(enumerate(stands)), keep=0.0)


def components(numbers: Sequence[int], found: Sequence[Meeting]) -> list[tuple[int, ...]]:
    """Groups of vehicles that meet, directly or by way of others; the largest first.

    Examples
    --------
    >>> components([0, 1, 2, 3], [Meeting(0, 2, 1.0)])
    [(0, 2), (1,), (3,)]
    """
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(numbers)
    graph.add_edges_from((row.one, row.other) for row in found)
    groups = [tuple(sorted(group)) for group in nx.connected_components(graph)]
    return sorted(groups, key=lambda group: (-len(group), group))
