"""FCL, the authority: every motion of a finished plan is checked here.

A motion is free if the solids its slices sweep are collision-free. Where one is not, the pose in
its middle decides that it is hit, or else halves of it are tried, until they stand out by less than
what counts.
"""

from __future__ import annotations

import functools
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, IntArray, as_array
from maneuver_automaton.collision.approach import least_over_poses, travel
from maneuver_automaton.collision.shapes import AnyObstacle, Motion, Obstacle, Shape
from maneuver_automaton.collision.solids import (
    Region,
    Skin,
    body_skin,
    obstacle_region,
    obstacle_skin,
)
from maneuver_automaton.collision.spacetime import CoastingBody, MovingBody, may_meet, meet
from maneuver_automaton.collision.swept import (
    STANDING,
    GrownBody,
    Twist,
    Windows,
    along,
    box_around,
    chunks,
    course_hulls,
    fastest,
    grown_body,
    halves,
    slice_excess,
    slice_hulls,
    windows,
)
from maneuver_automaton.groups import SE2

_ONE_AT_A_TIME = threading.Lock()  # objects are shared, and moved before they are asked


@dataclass(frozen=True, slots=True, eq=False)
class FclChecker:
    """A body among obstacles, by the Flexible Collision Library; a `CollisionChecker`.

    A motion that touches an obstacle, or comes closer to it than `margin`, is never reported free.
    One that is reported as hit comes closer than ``margin + proven``.

    Parameters
    ----------
    footprint : tuple of Shape
        Parts of the body; empty for a point.
    obstacles : tuple of Obstacle or OccupancyMap
        Obstacles that the body must not touch.
    margin : float
        Distance to keep [m].
    origin : (2,) sequence
        Where to count from [m]: poses and obstacles near it lose no digit.
    proven : float
        Greatest distance [m] beyond the margin at which a motion may still count as hit.

    Raises
    ------
    ValueError
        If a polygon has no area, or a number is out of range.

    Examples
    --------
    >>> from maneuver_automaton.collision import Box
    >>> wall = Obstacle(Box([0.1, 8.0], center=[5.0, 0.0]))
    >>> checker = FclChecker((Box([4.0, 2.0]),), (wall,))
    >>> checker.pose_hit([2.0, 0.0, 0.0]), checker.pose_hit([4.0, 0.0, 0.0])
    (None, 0)
    >>> checker.motion_hit([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 2.9)
    >>> checker.motion_hit([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 12.0)
    0
    >>> round(checker.clearance([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), 9)
    0.95
    """

    footprint: tuple[Shape, ...]
    obstacles: tuple[AnyObstacle, ...]
    margin: float = field(default=0.0, kw_only=True)  # [m]
    origin: tuple[float, float] = field(default=(0.0, 0.0), kw_only=True)  # [m]
    proven: float = field(default=1e-3, kw_only=True)  # [m]
    _body: GrownBody = field(init=False, repr=False)
    _bare: GrownBody = field(init=False, repr=False)
    _covers: tuple[GrownBody, ...] = field(init=False, repr=False)  # from few corners to all
    _ground: _Ground = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.margin) and self.margin >= 0.0):
            raise ValueError(f"margin must be a number of at least 0, got {self.margin} m")
        if not (math.isfinite(self.proven) and self.proven > 0.0):
            raise ValueError(f"proven must be a positive number, got {self.proven} m")
        x, y = as_array("origin", self.origin, last=2).tolist()
        excess = 0.25 * self.proven  # of round corners, on either side; the rest is for slices
        object.__setattr__(self, "footprint", tuple(self.footprint))
        object.__setattr__(self, "obstacles", tuple(self.obstacles))
        object.__setattr__(self, "origin", (x, y))
        object.__setattr__(self, "_body", grown_body(self.footprint, self.margin, excess))
        object.__setattr__(self, "_bare", grown_body(self.footprint, 0.0, excess))
        around = box_around(self._body)
        few = sum(map(len, self._body.pieces)) <= len(around.pieces[0])
        object.__setattr__(self, "_covers", (self._body,) if few else (around, self._body))
        object.__setattr__(self, "_ground", _ground_of(self.obstacles, (x, y), excess))

    def pose_hit(self, pose: ArrayLike, *, time: float = 0.0) -> int | None:
        """Which obstacle the body touches at a pose (3,) and a time [s]; None if it is free."""
        here = self._seen("pose", pose)
        hit = self._static_hit(here[None])
        if hit is not None:
            return hit
        for one in self._ground.moving:
            there = one.path.at(time)
            if _touching(_standing(self._body), here[None], one.object, there=there):
                return one.owner
        return None

    def motion_hit(
        self,
        start: ArrayLike,
        body_velocity: ArrayLike,
        duration: float,
        *,
        start_time: float = 0.0,
    ) -> int | None:
        """Which obstacle the body touches while it coasts from a pose; None if the path is free.

        Coasting is ``start @ exp(t * body_velocity)`` for t from 0 to `duration` [s]; it begins at
        `start_time` [s] of the world's clock.

        Raises
        ------
        ValueError
            If a number is not finite, or the duration negative.
        """
        here = self._seen("start", start)
        v_x, v_y, turn_rate = as_array("body_velocity", body_velocity, last=3).tolist()
        if not (math.isfinite(duration) and duration >= 0.0):
            raise ValueError(f"duration must be a number of at least 0, got {duration} s")
        twist = (v_x, v_y, turn_rate)
        hit = self._static_hit_along(here, twist, duration)
        if hit is not None or not self._ground.moving:
            return hit
        return self._moving_hit_along(here, twist, duration, start_time)

    def course_hit(
        self,
        start: ArrayLike,
        poses: ArrayLike,
        times: ArrayLike,
        *,
        start_time: float = 0.0,
        ask: Callable[[], None] = lambda: None,
    ) -> int | None:
        """Which obstacle the body touches along a course; None if the path is free.

        The course is sampled at `poses` (n, 3), seen from `start`, and `times` (n,) [s] since its
        begin, and runs with a constant twist from sample to sample. One solid serves several
        samples; where it touches, halves of it are tried, down to single ones. `ask` is called
        before each, and may raise to give it up.

        Raises
        ------
        ValueError
            If a number is not finite.
        """
        frame = SE2(self._seen("start", start))
        seen = (frame @ SE2(as_array("poses", poses, last=3))).pose
        clock = as_array("times", times) + start_time
        spans = np.diff(clock)
        steps = (SE2(seen[:-1]).inverse() @ SE2(seen[1:])).log()
        twists = steps / np.maximum(spans, 1e-300)[:, None]
        if self._may_come_near(seen, steps):
            todo = chunks(steps)[::-1]
            while todo:
                ask()
                first, last = todo.pop()
                if last - first == 1:
                    twist = (*steps[first].tolist(),)
                    hit = self._static_hit_along(seen[first], (twist[0], twist[1], twist[2]), 1.0)
                    if hit is not None:
                        return hit
                    continue
                # The rectangle around the body first: its few corners make a hull quickly, and
                # mostly do.
                if all(
                    self._sweep_hits(body, seen[first : last + 1], steps[first:last])
                    for body in self._covers
                ):
                    middle = (first + last) // 2
                    todo += [(middle, last), (first, middle)]
        if self._ground.moving:
            for k in self._near_moving(seen, steps, clock).tolist():
                ask()
                v_x, v_y, turn_rate = twists[k].tolist()
                span, time = float(spans[k]), float(clock[k])
                hit = self._moving_hit_along(seen[k], (v_x, v_y, turn_rate), span, time)
                if hit is not None:
                    return hit
        return None

    def clearance(self, poses: ArrayLike, *, times: ArrayLike | None = None) -> float:
        """Least distance [m] to any obstacle at poses (n, 3) and times (n,) [s], 0 if none given.

        The margin is not taken off. Zero on contact, infinite without obstacles; round shapes
        may be taken for larger by a quarter of `proven` each.
        """
        seen = np.atleast_2d(self._seen("poses", poses))
        clock = np.broadcast_to(0.0 if times is None else as_array("times", times), len(seen))
        moving = self._ground.moving
        if self._ground.static is not None:
            moving = (_Moving(self._ground.static, _AT_REST, -1), *moving)
        least = math.inf
        moved = travel(seen, self._bare.middle, self._bare.reach)
        for one in moving:
            others = one.path.at(clock)
            both = moved + travel(others, np.zeros(2), one.path.reach)
            distance = functools.partial(_distance, _standing(self._bare), one.object)
            least = least_over_poses(distance, seen, others, moved=both, least=least)
        return least

    def _seen(self, name: str, poses: ArrayLike) -> Array:
        """Poses counted from the origin; not finite, they would be free in the eyes of FCL."""
        near = np.array(as_array(name, poses, last=3))
        near[..., :2] -= self.origin
        return near

    def _may_come_near(self, poses: Array, steps: Array) -> bool:
        """Whether the rectangles around a course and around the static obstacles meet."""
        far = float(np.hypot(*self._body.middle)) + self._body.reach
        swings = np.linalg.norm(steps[:, :2], axis=1) + far * np.abs(steps[:, 2])
        pad = far + float(swings.max(initial=0.0))
        low, high = poses[:, :2].min(axis=0) - pad, poses[:, :2].max(axis=0) + pad
        return bool((low <= self._ground.high).all() and (high >= self._ground.low).all())

    def _sweep_hits(self, body: GrownBody, poses: Array, steps: Array) -> bool:
        """Whether one solid around a body along a course touches a static obstacle."""
        skin = body_skin(course_hulls(body, poses, steps))
        return bool(_touching(_object(skin), np.zeros((1, 3)), self._ground.static, most=1))

    def _static_hit(self, poses: Array) -> int | None:
        """A static obstacle that is touched at one of the poses (n, 3)."""
        if self._ground.static is None:
            return None
        hits = _touching(_standing(self._body), poses, self._ground.static, most=1)
        return self._ground.owner_of(hits)

    def _static_hit_along(self, start: Array, twist: Twist, duration: float) -> int | None:
        """A static obstacle that is touched along a coast."""
        if self._ground.static is None:
            return None
        if fastest(self._body, twist) * duration <= STANDING:
            return self._static_hit(start[None])
        once = 2.0 * math.pi / abs(twist[2]) if twist[2] else math.inf  # then it is where it began
        parts = windows(twist, min(duration, once))
        while True:
            solid = _sliced(self._body, twist, parts.level)
            hits = _touching(solid.object, along(start, twist, parts.begins), self._ground.static)
            if not hits or solid.excess <= 0.5 * self.proven:
                return self._ground.owner_of(hits)
            parts = Windows(parts.level, parts.begins[list(hits)])
            middles = along(start, twist, parts.begins + 0.5 * parts.length)
            hit = self._static_hit(middles)
            if hit is not None:
                return hit
            parts = halves(parts)

    def _near_moving(self, seen: Array, steps: Array, clock: Array) -> IntArray:
        """Numbers of the steps between samples on which a moving obstacle may be met."""
        body, spans = self._body, np.diff(clock)
        x, y = body.middle
        middles = (SE2(seen[:-1]) @ SE2.exp(0.5 * steps)).act(body.middle)
        covered = 0.5 * np.hypot(steps[:, 0] - steps[:, 2] * y, steps[:, 1] + steps[:, 2] * x)
        near = np.zeros(len(steps), dtype=np.bool_)
        for one in self._ground.moving:
            apart = np.hypot(*(middles - one.path.centers(clock[:-1] + 0.5 * spans)).T)
            most = covered + 0.5 * spans * one.path.fastest_middle
            near |= apart <= most + body.reach + one.path.radius
        return np.flatnonzero(near)

    def _moving_hit_along(
        self, start: Array, twist: Twist, duration: float, time: float
    ) -> int | None:
        """A moving obstacle that is touched along a coast."""
        body = self._body
        coasting = CoastingBody(start, twist, complex(*body.middle), body.reach)
        center = coasting.center(coasting.at(0.5 * duration))
        for one in self._ground.moving:
            path = one.path.from_time(time)
            distance = functools.partial(_distance, _standing(body), one.object)
            if may_meet(coasting, path, duration=duration, center=center) and meet(
                coasting, path, duration=duration, distance=distance, contact=0.5 * self.proven
            ):
                return one.owner
        return None


class _Moving(NamedTuple):
    """A moving obstacle."""

    object: Any
    path: MovingBody
    owner: int


class _Ground(NamedTuple):
    """Obstacles as FCL sees them."""

    static: Any  # one object for all static obstacles, None without
    low: Array  # (2,) corners of the rectangle around it
    high: Array
    owners: IntArray  # which obstacle each of its triangles belongs to
    moving: tuple[_Moving, ...]

    def owner_of(self, hits: dict[int, int]) -> int | None:
        """Which obstacle the first of the triangles hit belongs to."""
        return int(self.owners[next(iter(hits.values()))]) if hits else None


class _Sliced(NamedTuple):
    """Solid that a body sweeps in one slice."""

    object: Any
    excess: float  # [m]


_AT_REST = MovingBody.of(Motion([0.0], [[0.0, 0.0, 0.0]]), 0.0)


@functools.lru_cache(maxsize=8)
def _ground_of(
    obstacles: tuple[AnyObstacle, ...], origin: tuple[float, float], excess: float
) -> _Ground:
    to_origin = SE2(np.array([-origin[0], -origin[1], 0.0]))
    regions: list[Region] = []
    owners: list[int] = []
    moving: list[_Moving] = []
    for index, far in enumerate(obstacles):
        obstacle = far.moved(to_origin) if any(origin) else far
        region = obstacle_region(obstacle, excess=excess)
        if isinstance(obstacle, Obstacle) and obstacle.motion is not None:
            points = region.cover.reshape(-1, 2)
            middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
            path = MovingBody.of(
                obstacle.motion,
                float(np.hypot(*points.T).max()),
                middle=complex(*middle),
                radius=float(np.hypot(*(points - middle).T).max()),
            )
            skin, _ = obstacle_skin([region])
            moving.append(_Moving(_object(skin), path, index))
        elif len(region.cover):
            regions.append(region)
            owners.append(index)
    if not regions:
        nowhere = np.full(2, np.inf)
        return _Ground(None, nowhere, -nowhere, np.zeros(0, dtype=np.int64), tuple(moving))
    skin, which = obstacle_skin(regions)
    corners = skin.vertices[:, :2]
    return _Ground(
        _object(skin),
        corners.min(axis=0),
        corners.max(axis=0),
        np.array(owners)[which],
        tuple(moving),
    )


@functools.lru_cache(maxsize=32)
def _standing(body: GrownBody) -> Any:
    """The body at rest."""
    return _object(body_skin(body.pieces))


@functools.lru_cache(maxsize=1024)
def _sliced(body: GrownBody, twist: Twist, level: int) -> _Sliced:
    duration = math.ldexp(1.0, -level)
    hulls = slice_hulls(body, twist, duration)
    return _Sliced(_object(body_skin(hulls)), slice_excess(body, twist, duration))


def _object(skin: Skin) -> Any:
    """A skin as FCL holds it; it is never empty, and its indices are right."""
    import fcl

    model = fcl.BVHModel()
    model.beginModel(len(skin.triangles), len(skin.vertices))
    model.addSubModel(skin.vertices, skin.triangles)
    model.endModel()
    return fcl.CollisionObject(model)


def _turns(poses: Array) -> Array:
    """Rotation matrices (n, 3, 3) about the vertical."""
    turns = np.zeros((len(poses), 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(poses[:, 2])
    turns[:, 1, 0] = np.sin(poses[:, 2])
    turns[:, 0, 1] = -turns[:, 1, 0]
    turns[:, 2, 2] = 1.0
    return turns


def _place(one: Any, pose: Array) -> None:
    """Put an object at a pose (3,)."""
    one.setRotation(_turns(pose[None])[0])
    one.setTranslation(np.array([pose[0], pose[1], 0.0]))


def _touching(
    one: Any, poses: Array, other: Any, *, there: Array | None = None, most: int | None = None
) -> dict[int, int]:
    """At which of the poses (n, 3) an object touches another, and which of its triangles."""
    import fcl

    request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
    places = np.column_stack([poses[:, :2], np.zeros(len(poses))])
    hits: dict[int, int] = {}
    with _ONE_AT_A_TIME:
        if there is not None:
            _place(other, there)
        for k, (turn, place) in enumerate(zip(_turns(poses), places, strict=True)):
            one.setRotation(turn)
            one.setTranslation(place)
            result = fcl.CollisionResult()
            if fcl.collide(one, other, request, result):
                hits[k] = result.contacts[0].b2
                if len(hits) == most:
                    break
    return hits


def _distance(one: Any, other: Any, here: Array, there: Array) -> float:
    """Distance [m] of two objects at two poses (3,), zero on contact."""
    import fcl

    with _ONE_AT_A_TIME:
        _place(one, here)
        _place(other, there)
        away = fcl.distance(one, other, fcl.DistanceRequest(), fcl.DistanceResult())
    return max(0.0, float(away))
