"""Which plans may come near each other at all: boxes around what they sweep, second by second."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.fleet.conflicts import Course
from maneuver_automaton.groups import SE2

SLOT = 1.0  # [s]
FIRST = 32  # slots and rows to begin with
Pair = tuple[int, int]
NOWHERE = (math.inf, math.inf, -math.inf, -math.inf)


class Swept(NamedTuple):
    """Boxes that hold a vehicle's bodies, one for each slot of time."""

    first: int  # number of the first slot; before, it is in its box too
    boxes: Array  # (n, 4) least x, y, greatest x, y [m]; it stays in the last one
    leaves: bool  # whether it is gone after the last one


@functools.lru_cache(maxsize=8192)
def swept(course: Course) -> Swept:
    """Boxes around all that a course sweeps in each slot of time, from its begin on.

    Between two times on a path of length L, whose ends are a distance d apart, no point is farther
    than ``sqrt(L^2 - d^2) / 2`` from the box around the ends.

    Examples
    --------
    >>> from maneuver_automaton.collision import Disc
    >>> way = Motion([0.0, 2.0], [[0, 0, 0], [4, 0, 0]], twist=[[2, 0, 0]])
    >>> swept(Course(((Disc(1.0),),), (way,))).boxes.tolist()
    [[-1.0, -1.0, 3.0, 1.0], [1.0, -1.0, 5.0, 1.0], [3.0, -1.0, 5.0, 1.0]]
    """
    begin = min(float(way.time[0]) for way in course.motions)
    first = math.floor(begin / SLOT)
    end = max(float(way.time[-1]) for way in course.motions)
    count = max(math.ceil(end / SLOT) - first, 0) + 1
    boxes = np.tile(np.array(NOWHERE), (count, 1))
    for shapes, way in zip(course.shapes, course.motions, strict=True):
        body = body_of(shapes)
        reach = math.hypot(body.middle_x, body.middle_y) + body.reach
        own = _boxes(way, first, count)
        own[:, :2] -= reach
        own[:, 2:] += reach
        np.minimum(boxes[:, :2], own[:, :2], out=boxes[:, :2])
        np.maximum(boxes[:, 2:], own[:, 2:], out=boxes[:, 2:])
    return Swept(first, boxes, course.until < math.inf)


def _boxes(way: Motion, first: int, count: int) -> Array:
    """Boxes around the places of a motion in each slot (count, 4); the last one is for ever."""
    slots = SLOT * (first + np.arange(count + 1.0))
    times = np.union1d(way.time, slots[(slots > way.time[0]) & (slots < way.time[-1])])
    places = _places(way, times)
    boxes = np.tile(np.array(NOWHERE), (count, 1))
    if len(times) > 1:
        middles = 0.5 * (times[1:] + times[:-1])
        piece = np.clip(np.searchsorted(way.time, middles, side="right") - 1, 0, None)
        speeds = np.hypot(*np.asarray(way.rates)[piece, :2].T)
        lengths = speeds * np.diff(times)
        apart = np.hypot(*np.diff(places, axis=0).T)
        aside = 0.5 * np.sqrt(np.maximum(lengths * lengths - apart * apart, 0.0))[:, None]
        low = np.minimum(places[1:], places[:-1]) - aside
        high = np.maximum(places[1:], places[:-1]) + aside
        slot = np.clip(np.floor(middles / SLOT).astype(np.int64) - first, 0, count - 1)
        np.minimum.at(boxes[:, :2], slot, low)
        np.maximum.at(boxes[:, 2:], slot, high)
    # It stands at its first place before it begins, and at its last one from its end on.
    early, late = slots[:-1] <= way.time[0], slots[1:] >= way.time[-1]
    for place, rows in ((places[0], early), (places[-1], late)):
        boxes[rows, :2] = np.minimum(boxes[rows, :2], place)
        boxes[rows, 2:] = np.maximum(boxes[rows, 2:], place)
    return boxes


def _places(way: Motion, times: Array) -> Array:
    """Where a motion is (n, 2) at times (n,) that it takes."""
    if len(way.time) == 1:
        return np.repeat(way.pose[:1, :2], len(times), axis=0)
    piece = np.clip(np.searchsorted(way.time, times, side="right") - 1, 0, len(way.time) - 2)
    gone = way.rates[piece] * (times - way.time[piece])[:, None]
    if way.twist is None:
        return np.asarray(way.pose[piece, :2] + gone[:, :2])
    return np.asarray((SE2(way.pose[piece]) @ SE2.exp(gone)).pose[:, :2])


def near_pairs(discs: Sequence[tuple[int, float, float, float]], keep: float) -> list[Pair]:
    """Pairs of owners of discs (owner, x, y, radius) that come within a distance [m].

    Examples
    --------
    >>> near_pairs([(4, 0.0, 0.0, 1.0), (2, 2.5, 0.0, 1.0), (7, 9.0, 0.0, 1.0)], 1.0)
    [(2, 4)]
    """
    if len(discs) < 2:
        return []
    import shapely

    owners = [owner for owner, *_ in discs]
    rows = np.array([row for _, *row in discs])
    index = shapely.STRtree(shapely.points(rows[:, :2]))
    most = 2.0 * float(rows[:, 2].max()) + keep
    one, other = index.query(index.geometries, predicate="dwithin", distance=most)
    apart = np.hypot(*(rows[one, :2] - rows[other, :2]).T)
    near = np.flatnonzero((one < other) & (apart <= rows[one, 2] + rows[other, 2] + keep))
    pairs = {
        (min(owners[a], owners[b]), max(owners[a], owners[b]))
        for a, b in zip(one[near].tolist(), other[near].tolist(), strict=True)
        if owners[a] != owners[b]
    }
    return sorted(pairs)


class Nearby:
    """The boxes of many courses from a time on [s], side by side: who may come near whom at all."""

    def __init__(self, since: float) -> None:
        self._origin = math.floor(since / SLOT)
        self._boxes = np.tile(np.array(NOWHERE), (FIRST, FIRST, 1))  # rows, slots
        self._rows: dict[Course, int] = {}

    def near(self, course: Course, others: Sequence[Course], *, keep: float) -> list[bool]:
        """Whether each of others may come within a distance [m] of a course; no where it cannot."""
        rows = [self._row(one) for one in others]
        mine = self._padded(course)
        theirs = self._boxes
        apart = theirs[..., 0] > mine[:, 2] + keep
        apart |= theirs[..., 1] > mine[:, 3] + keep
        apart |= theirs[..., 2] < mine[:, 0] - keep
        apart |= theirs[..., 3] < mine[:, 1] - keep
        return [bool(may) for may in ~np.asarray(apart.all(axis=1))[rows]]

    def gaps(self, box: Array, others: Sequence[Course]) -> Array:
        """How far each of others (n,) is from a box (4,) at least, whenever it is there [m]."""
        rows = [self._row(one) for one in others]
        boxes = self._boxes[rows]
        least = boxes[..., :2].min(axis=1)
        most = boxes[..., 2:].max(axis=1)
        beside = np.maximum(np.maximum(least - box[2:], box[:2] - most), 0.0)
        return np.asarray(np.hypot(beside[:, 0], beside[:, 1]))

    def box_of(self, course: Course) -> Array:
        """The box (4,) around all that a course sweeps from now on."""
        boxes = self._boxes[self._row(course)]
        return np.array([*boxes[:, :2].min(axis=0), *boxes[:, 2:].max(axis=0)])

    def _row(self, course: Course) -> int:
        row = self._rows.get(course)
        if row is None:
            padded, row = self._padded(course), len(self._rows)
            if row == len(self._boxes):
                self._boxes = np.concatenate([self._boxes, np.full_like(self._boxes, math.nan)])
            self._boxes[row] = padded
            self._rows[course] = row
        return row

    def _padded(self, course: Course) -> Array:
        """Boxes for all slots: it stands before it begins, and after it has ended, in the last."""
        first, boxes, leaves = swept(course)
        first -= self._origin
        if first < 0:  # what is before is over
            cut = min(-first, len(boxes) - 1)
            boxes, first = boxes[cut:], 0
        while first + len(boxes) + 1 > self._boxes.shape[1]:
            last = np.repeat(self._boxes[:, -1:], self._boxes.shape[1], axis=1)
            self._boxes = np.concatenate([self._boxes, last], axis=1)
        after = np.array(NOWHERE) if leaves else boxes[-1]
        rest = np.tile(after, (self._boxes.shape[1] - first - len(boxes), 1))
        return np.concatenate([np.tile(boxes[0], (first, 1)), boxes, rest])
