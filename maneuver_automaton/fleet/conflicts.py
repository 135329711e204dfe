"""Which vehicles come too near to each other if they drive their plans, and when."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
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
from maneuver_automaton.collision.world import MovingObstacles, world_of
from maneuver_automaton.fleet import _kernels_meetings as kernels

PROOF = 1e-4  # [m] more than the distance to keep, wherever two bodies are looked at
AFTER = 1.0  # [s] that is looked at once nothing moves any more


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A vehicle's bodies in time: each of its parts with a motion, while it is there."""

    shapes: tuple[tuple[Shape, ...], ...]  # of the vehicle and of what it carries
    motions: tuple[Motion, ...]
    until: float = math.inf  # [s] when it is gone; inf if it stays
    grown: float = 0.0  # [m] by how much larger others see it
    bodies: tuple[Obstacle, ...] = field(init=False)  # as they are
    obstacles: tuple[Obstacle, ...] = field(init=False)  # as others see them

    def __post_init__(self) -> None:
        present = None if self.until == math.inf else (-math.inf, self.until)
        rows = [
            (shape, motion)
            for shapes, motion in zip(self.shapes, self.motions, strict=True)
            for shape in shapes
        ]
        bodies = tuple(Obstacle(shape, motion=way, present_s=present) for shape, way in rows)
        object.__setattr__(self, "bodies", bodies)
        seen = bodies
        if self.grown > 0.0:
            seen = tuple(replace(one, shape=larger(one.shape, self.grown)) for one in bodies)
        object.__setattr__(self, "obstacles", seen)

    @property
    def arrived(self) -> tuple[Obstacle, ...]:
        """What is left of it once it has arrived: where it stands, or nothing if it leaves."""
        if self.until < math.inf:
            return ()
        return tuple(
            Obstacle(one.at(float(one.motion.time[-1])))
            for one in self.obstacles
            if one.motion is not None
        )

    @property
    def quiet_after(self) -> float:
        """When it has come to rest for good, or is gone [s]."""
        return min(self.until, max(float(one.time[-1]) for one in self.motions))

    def after(self, time: float) -> Course:
        """What is left of it from a time on [s]."""
        if all(time <= float(one.time[0]) for one in self.motions):
            return self
        return replace(self, motions=tuple(_left(one, time) for one in self.motions))


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
    among: Sequence[int] | None = None,
    frame: tuple[float, float, float] | None = None,
) -> list[Meeting]:
    """Pairs of vehicles that come closer than a distance [m], the first that does so first.

    Whatever is not among the pairs keeps the distance at all times, also after all have arrived.
    Only pairs with one of the vehicles `among`, if these are given. Places are counted from a pose
    `frame` nearby, that of the first vehicle if omitted: with the same one all that is prepared for
    a course is prepared once.
    """
    numbers = sorted(courses)
    if len(numbers) < 2:
        return []
    if frame is None:
        first = courses[numbers[0]].motions[0].pose[0]
        frame = (float(first[0]), float(first[1]), 0.0)
    owners, obstacles = [], []
    for number in numbers:
        bodies = courses[number].bodies
        owners += [number] * len(bodies)
        obstacles += list(bodies)
    world = world_of(tuple(obstacles), (), frame)
    # Who begins later stands at its start until then: all are looked at from the first begin on.
    began = min(float(way.time[0]) for one in courses.values() for way in one.motions)
    span = (began - AFTER, max(one.quiet_after for one in courses.values()) + AFTER)
    owner = np.array(owners)
    found: dict[tuple[int, int], float] = {}
    wanted = set(numbers if among is None else among)
    for number in numbers:
        if number not in wanted:
            continue
        times = first_meetings(world.arrays.moving, courses[number], frame, span, keep)
        for other in numbers:
            if other == number or (other in wanted and other < number):
                continue
            when = float(times[owner == other].min())
            if when < math.inf:
                pair = (min(number, other), max(number, other))
                found[pair] = min(when, found.get(pair, math.inf))
    rows = [Meeting(*pair, when) for pair, when in found.items()]
    return sorted(rows, key=lambda row: (row.time, row.one, row.other))


def first_meetings(
    moving: MovingObstacles,
    course: Course,
    frame: tuple[float, float, float],
    span: tuple[float, float],
    keep: float,
) -> Array:
    """When a vehicle first comes within a distance [m] of each of what moves (M,) in a span [s]."""
    least = np.full(moving.speed.size, math.inf)
    for shapes, motion in zip(course.shapes, course.motions, strict=True):
        body, out = body_of(shapes), np.empty(moving.speed.size)
        rows = _coasts(motion, body, frame, (span[0], min(span[1], course.until)))
        kernels.first_meetings(moving, body, rows, keep, PROOF, out)
        np.minimum(least, out, out=least)
    return least


def _coasts(
    motion: Motion, body: Body, frame: tuple[float, float, float], span: tuple[float, float]
) -> Array:
    """Rows of `first_meetings`: it stands from a time on, coasts, then stands until a time [s]."""
    poses, times = motion.pose - np.array(frame), motion.time
    before, after = max(times[0] - span[0], 0.0), max(span[1] - times[-1], 0.0)
    lasting = np.concatenate([[before], np.diff(times), [after]])
    rows = np.zeros((len(times) + 1, 9))
    rows[:, :3] = poses[np.maximum(np.arange(len(times) + 1) - 1, 0)]
    rows[1:-1, 3:6] = motion.rates  # it coasts, or never moves
    rows[:, 6] = fastest_points(body, rows[:, 3:6])
    rows[:, 7] = lasting
    rows[:, 8] = np.concatenate([[span[0]], times])
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
