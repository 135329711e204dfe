"""FCL, the authority: every motion of a finished plan is checked here.

A motion is free if the solids its slices sweep are collision-free. Where one is not, the pose in
its middle decides that it is hit, or else halves of it are tried, until they stand out by less than
what counts.
"""

from __future__ import annotations

import functools
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, IntArray, as_array
from maneuver_automaton.collision.approach import least_over_poses, travel
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.collision.shapes import (
    AnyObstacle,
    Obstacle,
    Shape,
)
from maneuver_automaton.collision.solids import (
    Region,
    Skin,
    body_skin,
    obstacle_region,
    obstacle_skin,
)
from maneuver_automaton.collision.spacetime import (
    CoastingBody,
    MovingBodies,
    MovingBody,
    Place,
    may_meet,
    meet,
)
from maneuver_automaton.collision.swept import (
    STANDING,
    GrownBody,
    Twist,
    along,
    chunks,
    course_boxes,
    course_hulls,
    cut_where_it_pivots,
    fastest,
    grown_body,
    halves,
    slice_excess,
    slice_hulls,
    windows,
)
from maneuver_automaton.groups import SE2

CLOSE = 4  # steps of a course at most, around which closer solids than rectangles are laid
PIECE_S = 0.5  # [s] of a coast, that are looked at alone for what moves ...
MOST_PIECES = 256  # ... unless it has more of them
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
        object.__setattr__(self, "_ground", _ground_of(self.obstacles, (x, y), excess))

    def pose_hit(self, pose: ArrayLike, *, time: float = 0.0) -> int | None:
        """Which obstacle the body touches at a pose (3,) and a time [s]; None if it is free."""
        here = self._seen("pose", pose)
        if self._ground.static is not None:
            hit = self._first_pose_hit(here[None], np.zeros(1, dtype=np.int64))
            if hit is not None:
                return hit[1]
        for one in self._ground.moving:
            if not one.path.present[0] <= time <= one.path.present[1]:
                continue
            there = one.path.stretch(time).pose
            if _touching([_standing(self._body)], here[None], one.object, there=there):
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
        here = as_array("start", start, last=3)[None]
        twist = as_array("body_velocity", body_velocity, last=3)[None]
        if not (math.isfinite(duration) and duration >= 0.0):
            raise ValueError(f"duration must be a number of at least 0, got {duration} s")
        hit = self.motions_hit(here, twist, [duration], start_times=start_time)
        return None if hit is None else hit[1]

    def motions_hit(
        self,
        starts: ArrayLike,
        body_velocities: ArrayLike,
        durations: ArrayLike,
        *,
        start_times: ArrayLike = 0.0,
        ask: Callable[[], None] = lambda: None,
    ) -> tuple[int, int] | None:
        """The first of several motions that touches, and which obstacle; None if all are free.

        Each coasts as in `motion_hit`: from one of `starts` (n, 3), for one of `durations` (n,),
        from one of `start_times` (n,) on [s]. `ask` is called again and again, and may raise to
        give it up.

        Raises
        ------
        ValueError
            If a number is not finite, or a duration negative.
        """
        here = self._seen("starts", starts)
        twists = as_array("body_velocities", body_velocities, last=3)
        lasting = as_array("durations", durations)
        if lasting.size and not lasting.min() >= 0.0:
            raise ValueError(f"durations: got {lasting.min()} s, need at least 0")
        hit = self._first_static_hit(here, twists, lasting, ask)
        if not self._ground.moving:
            return hit
        before = slice(len(here) if hit is None else hit[0])  # where it may touch sooner
        clock = np.broadcast_to(as_array("start_times", start_times), lasting.shape)
        sooner = self._first_moving_hit(
            here[before], twists[before], lasting[before], clock[before], ask
        )
        return hit if sooner is None else sooner

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
        begin, and runs with a constant twist from sample to sample. `ask` is called again and
        again, and may raise to give it up.

        Raises
        ------
        ValueError
            If a number is not finite.
        """
        course = Course(start, poses, times, start_time)
        hit = self.courses_hit([course], ask=ask)
        return None if hit is None else hit[1]

    def courses_hit(
        self, courses: Sequence[Course], *, ask: Callable[[], None] = lambda: None
    ) -> tuple[int, int] | None:
        """The first of several courses along which the body touches, and which obstacle.

        One rectangle holds the body over many samples; where it touches, halves of it are tried,
        then closer solids, down to single steps.
        """
        if not courses:
            return None
        counts = [len(np.atleast_2d(one.poses)) for one in courses]
        number = np.repeat(np.arange(len(courses)), counts)
        starts = self._seen("start", np.array([one.start for one in courses]))
        every = as_array("poses", np.concatenate([one.poses for one in courses]), last=3)
        clock = np.concatenate([as_array("times", one.times) + one.start_time for one in courses])
        seen = (SE2(starts[number]) @ SE2(every)).pose
        rows = np.flatnonzero(number[1:] == number[:-1])
        of, spans = number[rows], clock[rows + 1] - clock[rows]
        poses = np.stack([seen[rows], seen[rows + 1]])
        steps = (SE2(poses[0]).inverse() @ SE2(poses[1])).log()
        row = self._first_step_hit(poses, steps, of, ask)
        hit = None if row is None else (int(of[row[0]]), row[1])
        if not self._ground.moving:
            return hit
        sooner = slice(None if hit is None else int(np.searchsorted(of, hit[0])))
        twists = steps[sooner] / np.maximum(spans[sooner], 1e-300)[:, None]
        row = self._first_moving_hit(
            poses[0, sooner], twists, spans[sooner], clock[rows[sooner]], ask
        )
        return hit if row is None else (int(of[row[0]]), row[1])

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
        for one in moving:
            first, last = one.path.present
            there = np.flatnonzero((first <= clock) & (clock <= last))
            if not there.size:
                continue
            others = one.path.motion.at(clock[there])
            moved = travel(seen[there], self._bare.middle, self._bare.reach)
            both = moved + travel(others, np.zeros(2), one.path.reach)
            distance = functools.partial(_distance, _standing(self._bare), one.object)
            least = least_over_poses(distance, seen[there], others, moved=both, least=least)
        return least

    def _seen(self, name: str, poses: ArrayLike) -> Array:
        """Poses counted from the origin; not finite, they would be free in the eyes of FCL."""
        near = np.array(as_array(name, poses, last=3))
        near[..., :2] -= self.origin
        return near

    def _first_step_hit(
        self, poses: Array, steps: Array, courses: IntArray, ask: Callable[[], None]
    ) -> tuple[int, int] | None:
        """The first of some steps of courses that touches a static obstacle, and which."""
        if self._ground.static is None or not len(steps):
            return None
        begins = np.append(True, courses[1:] != courses[:-1])
        first, last = chunks(steps, begins)
        close: list[tuple[int, int]] = []
        while first.size:
            ask()
            rings = course_boxes(self._body, poses, steps, first, last)
            boxes = [_object(_box_skin(ring)) for ring in rings]
            hits = _touching(boxes, np.zeros((first.size, 3)), self._ground.static)
            rows = np.fromiter(hits, dtype=np.int64, count=len(hits))
            first, last = first[rows], last[rows]
            short = last - first <= CLOSE
            close += zip(first[short].tolist(), last[short].tolist(), strict=True)
            ends = np.stack([first, (first + last) // 2, last], axis=1)[~short]
            first, last = ends[:, :2].ravel(), ends[:, 1:].ravel()
        close.sort(reverse=True)
        while close:
            ask()
            begin, end = close.pop()
            if end - begin == 1:
                one = slice(begin, end)
                hit = self._first_static_hit(poses[0, one], steps[one], np.ones(1), ask)
                if hit is not None:
                    return begin, hit[1]
            elif self._sweep_hits(poses[:, begin:end], steps[begin:end]):
                middle = (begin + end) // 2
                close += [(middle, end), (begin, middle)]
        return None

    def _sweep_hits(self, poses: Array, steps: Array) -> bool:
        """Whether one solid around the body along a few steps touches a static obstacle."""
        x, y, turn = steps.sum(axis=0).tolist()
        pieces = cut_where_it_pivots(self._body, (x, y, turn))
        whole = np.concatenate([poses[0], poses[1, -1:]])
        skin = body_skin(course_hulls(pieces, whole, steps))
        return bool(_touching([_object(skin)], np.zeros((1, 3)), self._ground.static))

    def _first_static_hit(
        self, starts: Array, twists: Array, durations: Array, ask: Callable[[], None]
    ) -> tuple[int, int] | None:
        """The first of some coasts that touches a static obstacle, and which."""
        if self._ground.static is None:
            return None
        moving = fastest(self._body, twists) * durations > STANDING
        first = self._first_pose_hit(starts, np.flatnonzero(~moving))
        turning = np.abs(twists[:, 2])
        with np.errstate(divide="ignore", over="ignore"):
            once = 2.0 * math.pi / turning  # then it is where it began
        parts = windows(turning, np.where(moving, np.minimum(durations, once), 0.0))
        if first is not None:
            parts = parts.of(parts.coast < first[0])
        kinds: list[Twist] = [(x, y, turn) for x, y, turn in twists.tolist()]
        while parts.coast.size:
            ask()
            of = parts.coast
            solids = [
                _sliced(self._body, kinds[k], level)
                for k, level in zip(of.tolist(), parts.level.tolist(), strict=True)
            ]
            begins, middles = along(
                starts[of], twists[of], np.stack([parts.begins, parts.begins + 0.5 * parts.lengths])
            )
            objects = [solid.object for solid in solids]
            hits = _touching(objects, begins, self._ground.static)
            if not hits:
                break
            for row, triangle in hits.items():  # in order: the first is the first coast's
                if solids[row].excess <= 0.5 * self.proven and _is_sooner(of[row], first):
                    first = int(of[row]), int(self._ground.owners[triangle])
            rows = np.array([row for row in hits if _is_sooner(of[row], first)], dtype=np.int64)
            hit = self._first_pose_hit(middles, rows)
            if hit is not None:
                first = int(of[hit[0]]), hit[1]
                rows = rows[of[rows] < first[0]]
            parts = halves(parts.of(rows))
        return first

    def _first_pose_hit(self, poses: Array, rows: IntArray) -> tuple[int, int] | None:
        """The first of some rows of poses (n, 3) that touches a static obstacle, and which."""
        body = [_standing(self._body)] * rows.size
        hits = _touching(body, poses[rows], self._ground.static, most=1)
        return next(
            ((int(rows[row]), int(self._ground.owners[at])) for row, at in hits.items()), None
        )

    def _first_moving_hit(
        self,
        starts: Array,
        twists: Array,
        durations: Array,
        clock: Array,
        ask: Callable[[], None],
    ) -> tuple[int, int] | None:
        """The first of some coasts, begun at times on a clock, that meets a moving obstacle."""
        body, others = self._body, self._ground.moving
        (x, y), (half_x, half_y) = body.middle.tolist(), body.half.tolist()
        # A coast is followed only where it may meet something, and only for as long.
        counts = np.clip(np.ceil(durations / PIECE_S), 1.0, MOST_PIECES).astype(np.int64)
        of = np.repeat(np.arange(counts.size), counts)
        lasting = (durations / counts)[of]
        begins = lasting * (np.arange(of.size) - (np.cumsum(counts) - counts)[of])
        middles = begins + 0.5 * lasting
        speeds = np.hypot(twists[:, 0] - twists[:, 2] * y, twists[:, 1] + twists[:, 2] * x)
        near = may_meet(
            self._ground.paths,
            (SE2(starts[of]) @ SE2.exp(middles[:, None] * twists[of])).act(body.middle),
            times=clock[of] + middles,
            halves=0.5 * lasting,
            speeds=speeds[of],
            reach=body.reach + self.proven,
        )
        firsts = np.cumsum(counts) - counts
        for k in np.unique(of[np.any(near, axis=0)]).tolist():
            ask()
            (v_x, v_y, turn), (at_x, at_y, heading) = twists[k].tolist(), starts[k].tolist()
            start, twist = (at_x, at_y, heading), (v_x, v_y, turn)
            coasting = CoastingBody(start, twist, complex(x, y), body.reach, (half_x, half_y))
            pieces = slice(firsts[k], firsts[k] + counts[k])
            for number in np.flatnonzero(near[:, pieces].any(axis=1)).tolist():
                for first, last in _runs(near[number, pieces]):
                    until = float(begins[pieces][last] if last < counts[k] else durations[k])
                    if meet(
                        coasting,
                        others[number].path,
                        since=float(begins[pieces][first]),
                        duration=until,
                        clock=float(clock[k]),
                        distance=functools.partial(
                            _distance, _standing(body), others[number].object
                        ),
                        contact=0.5 * self.proven,
                    ):
                        return k, others[number].owner
        return None


def _runs(near: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Where runs of truths (n,) begin and end."""
    ends = np.flatnonzero(np.diff(near.astype(np.int8), prepend=0, append=0))
    return [(first, last) for first, last in ends.reshape(-1, 2).tolist()]


class Course(NamedTuple):
    """What is driven from a start: poses seen from there, with a constant twist between two."""

    start: ArrayLike  # (3,)
    poses: ArrayLike  # (n, 3)
    times: ArrayLike  # (n,) [s] since its begin
    start_time: float  # [s] of the world's clock


class _Moving(NamedTuple):
    """A moving obstacle."""

    object: Any
    path: MovingBody
    owner: int


class _Ground(NamedTuple):
    """Obstacles as FCL sees them."""

    static: Any  # one object for all static obstacles, None without
    owners: IntArray  # which obstacle each of its triangles belongs to
    moving: tuple[_Moving, ...]
    paths: MovingBodies  # of what moves


class _Sliced(NamedTuple):
    """Solid that a body sweeps in one slice."""

    object: Any
    excess: float  # [m]


_BOX = body_skin([np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])]).triangles
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
            low, high = points.min(axis=0), points.max(axis=0)
            middle, (half_x, half_y) = 0.5 * (low + high), (0.5 * (high - low)).tolist()
            path = MovingBody.of(
                obstacle.motion,
                float(np.hypot(*points.T).max()),
                middle=complex(*middle),
                radius=float(np.hypot(*(points - middle).T).max()),
                half=(half_x, half_y),
                present=obstacle.presence,
            )
            skin, _ = obstacle_skin([region])
            moving.append(_Moving(_object(skin), path, index))
        elif len(region.cover):
            regions.append(region)
            owners.append(index)
    paths = MovingBodies.of([one.path for one in moving])
    if not regions:
        return _Ground(None, np.zeros(0, dtype=np.int64), tuple(moving), paths)
    skin, which = obstacle_skin(regions)
    return _Ground(_object(skin), np.array(owners)[which], tuple(moving), paths)


@functools.lru_cache(maxsize=32)
def _standing(body: GrownBody) -> Any:
    """The body at rest."""
    return _object(body_skin(body.pieces))


@functools.lru_cache(maxsize=1024)
def _sliced(body: GrownBody, twist: Twist, level: int) -> _Sliced:
    duration, pieces = math.ldexp(1.0, -level), cut_where_it_pivots(body, twist)
    hulls = slice_hulls(pieces, twist, duration)
    return _Sliced(_object(body_skin(hulls)), slice_excess(pieces, twist, duration))


def _box_skin(ring: Array) -> Skin:
    """Walls and lid over a rectangle (4, 2), without a search for what they are made of."""
    vertices = np.zeros((8, 3))
    vertices[:4, :2] = vertices[4:, :2] = ring
    vertices[4:, 2] = 1.0
    return Skin(vertices, _BOX)


def _is_sooner(coast: int, hit: tuple[int, int] | None) -> bool:
    """Whether a coast comes before the one that is hit."""
    return hit is None or coast < hit[0]


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


def _place(one: Any, pose: Sequence[float]) -> None:
    """Put an object at a pose."""
    x, y, heading = pose
    cosine, sine = math.cos(heading), math.sin(heading)
    one.setRotation(np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]))
    one.setTranslation(np.array([x, y, 0.0]))


def _touching(
    ones: Sequence[Any],
    poses: Array,
    other: Any,
    *,
    there: Place | None = None,
    most: int | None = None,
) -> dict[int, int]:
    """Which of some objects (n) at poses (n, 3) touch another, and which of its triangles."""
    import fcl

    collide, result_of = fcl.collide, fcl.CollisionResult
    request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
    places = np.zeros((len(poses), 3))
    places[:, :2] = poses[:, :2]
    hits: dict[int, int] = {}
    with _ONE_AT_A_TIME:
        if there is not None:
            _place(other, there)
        for k, (one, turn, place) in enumerate(zip(ones, _turns(poses), places, strict=True)):
            one.setRotation(turn)
            one.setTranslation(place)
            result = result_of()
            if collide(one, other, request, result):
                hits[k] = result.contacts[0].b2
                if len(hits) == most:
                    break
    return hits


def _distance(one: Any, other: Any, here: Sequence[float], there: Sequence[float]) -> float:
    """Distance [m] of two objects at two poses, zero on contact."""
    import fcl

    with _ONE_AT_A_TIME:
        _place(one, here)
        _place(other, there)
        away = fcl.distance(one, other, fcl.DistanceRequest(), fcl.DistanceResult())
    return max(0.0, float(away))
