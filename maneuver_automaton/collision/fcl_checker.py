"""FCL, the authority on static obstacles: every motion of a finished plan is checked here.

A motion is free if the solids its slices sweep are collision-free. Where one is not, the pose in
its middle decides that it is hit, or else halves of it are tried, until they stand out by less than
what counts. Moving obstacles are left to two others: the proof in the search, and the audit.
"""

from __future__ import annotations

import functools
import itertools
import math
import threading
from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, IntArray, as_array, check_range
from maneuver_automaton.collision._kernels_swept import slices_near
from maneuver_automaton.collision.outline import outlines_of
from maneuver_automaton.collision.shapes import AnyObstacle, ByKind, Shape, by_kind
from maneuver_automaton.collision.solids import Skin, body_skin, obstacle_skin
from maneuver_automaton.collision.swept import (
    GrownBody,
    Twist,
    Windows,
    chunks,
    course_boxes,
    cut_where_it_pivots,
    grown_body,
    halves,
    slice_excess,
    swept_hulls,
)
from maneuver_automaton.groups import SE2

CLOSE = 4  # steps of a course at most, around which closer solids than rectangles are laid
ROUNDED = 1e-7  # [m] that a box around a slice may be off
MOST_SORTED = 1000  # obstacles: with more, if all are laid out, to sort out slices takes longer
Ask: TypeAlias = Callable[[], None]  # called again and again; it may raise
_ONE_AT_A_TIME = threading.Lock()  # objects are shared, and moved before they are asked


@dataclass(frozen=True, slots=True, eq=False)
class FclChecker:
    """A body among static obstacles, all of them closed, by the Flexible Collision Library.

    Obstacles that move do not count. A motion that touches another one, or comes closer to it than
    `margin`, is never reported free. One that is reported as hit comes closer than
    ``margin + proven``.

    `footprint`: parts of the body; empty for a point. `obstacles`: obstacles that the body must not
    touch. `margin`: distance to keep [m]. `origin`: where to count from [m]: poses and obstacles
    near it lose no digit. `proven`: greatest distance [m] beyond the margin at which a motion may
    still count as hit. Raises ValueError if a polygon has no area, or a number is out of range.
    """

    footprint: tuple[Shape, ...]
    obstacles: tuple[AnyObstacle, ...]
    margin: float = field(default=0.0, kw_only=True)  # [m]
    origin: tuple[float, float] = field(default=(0.0, 0.0), kw_only=True)  # [m]
    proven: float = field(default=1e-3, kw_only=True)  # [m]
    _body: GrownBody = field(init=False, repr=False)
    _around: Array = field(init=False, repr=False)  # (6,) of `slices_near`
    _ground: _Ground = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_range("margin", self.margin, least=0, unit="m")
        check_range("proven", self.proven, unit="m")
        x, y = as_array("origin", self.origin, last=2).tolist()
        excess = 0.25 * self.proven  # of round corners, on either side; the rest is for slices
        object.__setattr__(self, "footprint", tuple(self.footprint))
        object.__setattr__(self, "obstacles", tuple(self.obstacles))
        object.__setattr__(self, "origin", (x, y))
        body = grown_body(self.footprint, self.margin, excess)
        object.__setattr__(self, "_body", body)
        own = *body.middle, *body.half, float(np.hypot(*body.middle)) + body.reach
        object.__setattr__(self, "_around", np.array([*own, self.proven + ROUNDED]))
        object.__setattr__(self, "_ground", _ground_of(self.obstacles, (x, y), excess))

    def lay_all(self) -> None:
        """Have all obstacles ready, which otherwise are laid out as motions come near them."""
        self._ground.shown(np.ones(len(self._ground.boxes), dtype=np.bool_))

    def pose_hit(self, pose: ArrayLike) -> int | None:
        """Which obstacle the body touches at a pose (3,); None if it is free."""
        here = self._seen("pose", pose)[None]
        hit = self._first_hit(here, np.zeros((1, 3)), np.zeros(1), None, lambda: None)
        return None if hit is None else hit[1]

    def motions_hit(
        self,
        starts: ArrayLike,
        body_velocities: ArrayLike,
        durations: ArrayLike,
        *,
        ask: Ask = lambda: None,
    ) -> tuple[int, int] | None:
        """The first of several motions that touches, and which obstacle; None if all are free.

        Each coasts, ``start @ exp(t * body_velocity)``, from one of `starts` (n, 3) for one of
        `durations` (n,) [s]. `ask` is called again and again, and may raise to give it up.
        """
        here = self._seen("starts", starts)
        twists = as_array("body_velocities", body_velocities, last=3)
        lasting = as_array("durations", durations)
        if lasting.size and not lasting.min() >= 0.0:
            raise ValueError(f"durations: got {lasting.min()} s, need at least 0")
        return self._first_hit(here, twists, lasting, None, ask)

    def courses_hit(
        self, courses: Sequence[Course], *, ask: Ask = lambda: None
    ) -> tuple[int, int] | None:
        """The first of several courses along which the body touches, and which obstacle.

        One rectangle holds the body over many samples; where it touches, halves of it are tried,
        then closer solids, down to single steps.
        """
        if not courses:
            return None
        number = np.repeat(np.arange(len(courses)), [len(one.poses) for one in courses])
        starts = self._seen("start", np.array([one.start for one in courses]))
        every = as_array("poses", np.concatenate([one.poses for one in courses]), last=3)
        seen = (SE2(starts[number]) @ SE2(every)).pose
        rows = np.flatnonzero(number[1:] == number[:-1])
        if not rows.size:
            return None
        poses = np.stack([seen[rows], seen[rows + 1]])
        steps = (SE2(poses[0]).inverse() @ SE2(poses[1])).log()
        reach = self._around[4] + self.proven
        far = np.hypot(steps[:, 0], steps[:, 1])[:, None] + reach
        begins = np.flatnonzero(np.diff(number[rows], prepend=-1))
        low = np.minimum.reduceat(poses[0, :, :2] - far, begins)
        high = np.maximum.reduceat(poses[0, :, :2] + far, begins)
        boxes, low, high = self._ground.boxes, low[:, None], high[:, None]
        meets = ((boxes[:, :2] <= high) & (boxes[:, 2:] >= low)).all(axis=2)
        laid = self._ground.shown(np.asarray(meets.any(axis=0)))
        hit = self._first_step_hit(poses, steps, number[rows], laid, ask)
        return None if hit is None else (int(number[rows[hit[0]]]), hit[1])

    def _seen(self, name: str, poses: ArrayLike) -> Array:
        """Poses counted from the origin; not finite, they would be free in the eyes of FCL."""
        near = np.array(as_array(name, poses, last=3))
        if any(self.origin):
            near[..., :2] -= self.origin
        return near

    def _first_step_hit(
        self, poses: Array, steps: Array, courses: IntArray, laid: _Laid, ask: Ask
    ) -> tuple[int, int] | None:
        """The first of some steps of courses that touches a static obstacle, and which."""
        if laid.static is None:
            return None
        begins = np.append(True, courses[1:] != courses[:-1])
        first, last = chunks(steps, begins)
        close: list[tuple[int, int]] = []
        while first.size:
            ask()
            rings = course_boxes(self._body, poses, steps, first, last)
            lids = [np.column_stack([np.tile(ring, (2, 1)), _LEVELS]) for ring in rings]
            boxes = [_object(Skin(corners, _BOX)) for corners in lids]
            hits = _touching(boxes, np.zeros((first.size, 3)), laid.static)
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
                if hit := self._first_hit(poses[0, one], steps[one], np.ones(1), laid, ask):
                    return begin, hit[1]
                continue
            x, y, turn = steps[begin:end].sum(axis=0).tolist()
            pieces = cut_where_it_pivots(self._body, (x, y, turn))
            whole = np.concatenate([poses[0, begin:end], poses[1, end - 1 : end]])
            solid = _object(body_skin(swept_hulls(pieces, whole, steps[begin:end])))
            if _touching([solid], np.zeros((1, 3)), laid.static):
                middle = (begin + end) // 2
                close += [(middle, end), (begin, middle)]
        return None

    def _first_hit(
        self, starts: Array, twists: Array, durations: Array, laid: _Laid | None, ask: Ask
    ) -> tuple[int, int] | None:
        """The first of some coasts that touches a static obstacle, and which.

        Slices that are near to nothing are not looked at, nor is what is near to none.
        """
        body, kinds = self._body, [(x, y, turn) for x, y, turn in twists.tolist()]
        if laid is None and len(self._ground.boxes) > MOST_SORTED and self._ground.laid.rows.all():
            laid = self._ground.laid
        boxes = self._ground.boxes if laid is None else _EVERYWHERE
        given = starts, np.array(twists), np.array(durations), self._around, boxes
        coasts, levels, begins, poses, still, met = slices_near(*given)
        parts, laid = Windows(coasts, levels, begins), laid or self._ground.shown(met)
        if laid.static is None:
            return None
        first = self._first_pose_hit(starts[still], still, laid)
        if first is not None:
            parts = parts.of(parts.coast < first[0])
        while parts.coast.size:
            ask()
            of = parts.coast
            slices = zip(of.tolist(), parts.level.tolist(), strict=True)
            solids = [_sliced(body, kinds[k], level) for k, level in slices]
            hits = _touching([solid for solid, _ in solids], poses[: of.size], laid.static)
            for row, triangle in hits.items():  # in order: the first is the first coast's
                if solids[row][1] <= 0.5 * self.proven and (not first or of[row] < first[0]):
                    first = int(of[row]), int(laid.owners[triangle])
            sooner = [row for row in hits if not first or of[row] < first[0]]
            if not sooner:
                break
            parts = parts.of(np.array(sooner))
            of, times = parts.coast, (parts.begins + 0.5 * parts.lengths)[:, None]
            poses = (SE2(starts[of]) @ SE2.exp(times * twists[of])).pose
            hit = self._first_pose_hit(poses, of, laid)
            if hit is not None:
                first, parts = hit, parts.of(parts.coast < hit[0])
            parts = halves(parts)
            of, times = parts.coast, parts.begins[:, None]
            poses = (SE2(starts[of]) @ SE2.exp(times * twists[of])).pose
        return first

    def _first_pose_hit(
        self, poses: Array, numbers: IntArray, laid: _Laid
    ) -> tuple[int, int] | None:
        """The number (n,) of the first pose (n, 3) that touches a static obstacle, and which."""
        if laid.static is None or not numbers.size:
            return None
        hits = _touching([_standing(self._body)] * numbers.size, poses, laid.static, most=1)
        return next(((int(numbers[row]), int(laid.owners[at])) for row, at in hits.items()), None)


class Course(NamedTuple):
    """What is driven from a start: poses seen from there, with a constant twist between two."""

    start: Array  # (3,)
    poses: Array  # (n, 3)


class _Laid(NamedTuple):
    """Some static obstacles as FCL sees them."""

    rows: NDArray[np.bool_]  # (n,) which of all
    static: Any  # one object for all of them, None without
    owners: IntArray  # which obstacle each of its triangles belongs to


@dataclass(slots=True, eq=False)
class _Ground:
    """Static obstacles, of which FCL is shown those that something came near to."""

    kinds: ByKind  # they
    numbers: IntArray  # (n,) of these in the scene
    boxes: Array  # (n, 4) [low x, low y, high x, high y] around them
    excess: float  # [m]
    laid: _Laid

    def shown(self, met: NDArray[np.bool_]) -> _Laid:
        """All obstacles that are met (n,), and others."""
        laid = self.laid
        missing = met & ~laid.rows
        if not missing.any():
            return laid
        rows = laid.rows | missing
        if laid.static is not None:  # who comes back is likely to come again: all between as well
            some = self.boxes[met]
            low, high = some[:, :2].min(axis=0), some[:, 2:].max(axis=0)
            rows |= ((self.boxes[:, :2] <= high) & (self.boxes[:, 2:] >= low)).all(axis=1)
        skin, of = obstacle_skin(self.kinds, rows, excess=self.excess)
        static = _object(skin) if of.size else None
        # Other threads may lay out others meanwhile: this call goes on with its own.
        self.laid = laid = _Laid(rows, static, self.numbers[of])
        return laid


_EVERYWHERE = np.array([[-math.inf, -math.inf, math.inf, math.inf]])  # a box
_LEVELS = np.repeat([0.0, 1.0], 4)  # of the corners of a box
_BOX = body_skin([np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])]).triangles


@functools.lru_cache(maxsize=8)
def _ground_of(
    obstacles: tuple[AnyObstacle, ...], origin: tuple[float, float], excess: float
) -> _Ground:
    static = [k for k, one in enumerate(obstacles) if getattr(one, "motion", None) is None]
    seen = tuple([obstacles[k] for k in static])
    if any(origin):
        seen = tuple(one.moved(SE2(np.array([-origin[0], -origin[1], 0.0]))) for one in seen)
    return _Ground(
        kinds=(kinds := by_kind(seen)),
        numbers=np.array(static, dtype=np.int64),
        boxes=_boxes_around(kinds, len(seen)),
        excess=excess,
        laid=_Laid(np.zeros(len(seen), np.bool_), None, np.zeros(0, np.int64)),
    )


def _boxes_around(kinds: ByKind, count: int) -> Array:
    """Boxes (n, 4) [low x, low y, high x, high y] around so many static obstacles."""
    boxes = np.zeros((count, 4))
    for k, disc in kinds.discs:
        boxes[k] = *(disc.center - disc.radius), *(disc.center + disc.radius)
    for k, one in kinds.maps:  # wherever it is turned
        far = np.hypot(*one.extent)
        boxes[k] = *(one.origin[:2] - far), *(one.origin[:2] + far)
    boxes[kinds.quads, :2] = kinds.corners.min(axis=1)
    boxes[kinds.quads, 2:] = kinds.corners.max(axis=1)
    if rings := {k: one.corners for k, one in kinds.others}:
        begins = [0, *itertools.accumulate(map(len, rings.values()))][:-1]
        corners = np.concatenate(list(rings.values()))
        ends = np.minimum.reduceat(corners, begins), np.maximum.reduceat(corners, begins)
        boxes[list(rings)] = np.concatenate(ends, axis=1)
    outlines_of([one for _, one in kinds.others if not one.is_plain])  # refuses one without area
    return boxes


@functools.lru_cache(maxsize=32)
def _standing(body: GrownBody) -> Any:
    """The body at rest."""
    return _object(body_skin(body.pieces))


@functools.lru_cache(maxsize=1024)
def _sliced(body: GrownBody, twist: Twist, level: int) -> tuple[Any, float]:
    """Solid that a body sweeps in one slice, and its excess [m]."""
    duration, pieces = math.ldexp(1.0, -level), cut_where_it_pivots(body, twist)
    step = duration * np.array([twist])
    hulls = swept_hulls(pieces, np.concatenate([np.zeros((1, 3)), SE2.exp(step).pose]), step)
    return _object(body_skin(hulls)), slice_excess(pieces, twist, duration)


def _object(skin: Skin) -> Any:
    """A skin as FCL holds it; it is never empty, and its indices are right."""
    import fcl

    model = fcl.BVHModel()
    model.beginModel(len(skin.triangles), len(skin.vertices))
    model.addSubModel(skin.vertices, skin.triangles.tolist())  # of lists it reads numbers sooner
    model.endModel()
    return fcl.CollisionObject(model)


class _Numbers(array):  # type: ignore[type-arg]
    """What FCL reads as an array of NumPy, without the copy that it makes of one."""

    def astype(self, _kind: type) -> _Numbers:
        """Itself."""
        return self


def _touching(
    ones: Sequence[Any], poses: Array, other: Any, *, most: int | None = None
) -> dict[int, int]:
    """Which of some objects (n) at poses (n, 3) touch another, and which of its triangles."""
    import fcl

    collide, result = fcl.collide, fcl.CollisionResult()
    request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
    x, y, turn = poses.T
    half, place, hits = 0.5 * turn, _Numbers("d", (0.0, 0.0, 0.0)), dict[int, int]()
    # Turns as quaternions in plain numbers: to hand over a matrix takes as long as some answers.
    seen = zip(x.tolist(), y.tolist(), np.cos(half).tolist(), np.sin(half).tolist(), strict=True)
    with _ONE_AT_A_TIME:
        for k, (one, (place[0], place[1], w, z)) in enumerate(zip(ones, seen, strict=True)):
            one.setQuatRotation((w, 0.0, 0.0, z))
            one.setTranslation(place)
            if collide(one, other, request, result):
                hits[k] = result.contacts[0].b2
                if len(hits) == most:
                    break
                result = fcl.CollisionResult()
    return hits
