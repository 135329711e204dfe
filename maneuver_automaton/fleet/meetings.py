"""Which vehicles come too near to each other if they drive their plans, and which may at all."""

from __future__ import annotations

import functools
import math
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import networkx as nx
import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._lazy import shapely
from maneuver_automaton.collision.body import Body, body_of, fastest_points
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.collision.world import world_of
from maneuver_automaton.fleet import _kernels_meetings as kernels
from maneuver_automaton.fleet.courses import FleetCourse, HeightBand, motion_from, radius_of
from maneuver_automaton.groups import SE2

PROOF = 1e-4  # [m] more than the distance to keep, wherever two bodies are looked at
AFTER = 1.0  # [s] that is looked at once nothing moves any more
SLOT = 1.0  # [s]
FIRST = 32  # slots and rows to begin with
NOWHERE = (math.inf, math.inf, -math.inf, -math.inf)
Frame = tuple[float, float, float]
FAR = 1.0  # [m] beyond the margin: what keeps more is not measured
FINE = 0.02  # [m] to which the distance proven is known


class Meeting(NamedTuple):
    """Two vehicles, by number, and when they first come too near to each other [s]."""

    one: int
    other: int
    time: float

    def other_than(self, number: int) -> int:
        """The one that is not the vehicle of that number."""
        return self.one if self.other == number else self.other


def meetings(
    courses: Mapping[int, FleetCourse],
    *,
    keep: float,
    among: Collection[int] | None = None,
    frame: Frame | None = None,
) -> list[Meeting]:
    """Pairs of vehicles that come closer than a distance [m], the first that does so first.

    Whatever is not among the pairs keeps the distance at all times, also after all have arrived, in
    the plane or in height. Only pairs with one of the vehicles `among`, if these are given. Places
    are counted from a pose `frame` nearby, that of the first vehicle if omitted: with the same one
    all that is prepared for a course is prepared once.
    """
    return Encounters(courses, frame).within(keep, among)


class Encounters:
    """What vehicles drive, prepared once: who meets whom within one distance, and another one."""

    def __init__(self, courses: Mapping[int, FleetCourse], frame: Frame | None = None) -> None:
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
        self._driven: dict[int, list[tuple[Body, HeightBand, Array]]] = {}

    def within(self, keep: float, among: Collection[int] | None = None) -> list[Meeting]:
        """Pairs that come closer than a distance [m]; see `meetings`."""
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
        """When a vehicle first comes within a distance [m] of each body (M,)."""
        heights = self._heights
        least = np.full(len(heights), math.inf)
        for body, band, rows in self._drives(number):
            out = np.empty(len(heights))
            kernels.first_meetings(self._moving, body, rows, keep, PROOF, out)
            apart = np.maximum(heights[:, 0] - band.high, band.low - heights[:, 1])
            out[apart > keep + PROOF] = math.inf
            np.minimum(least, out, out=least)
        return least

    def _drives(self, number: int) -> list[tuple[Body, HeightBand, Array]]:
        """What each body of a vehicle drives in each of its bands, as the kernel has it."""
        known = self._driven.get(number)
        if known is None:
            course, span = self._courses[number], self._span
            known = self._driven[number] = []
            for shapes, motion in zip(course.shapes, course.motions, strict=True):
                body = body_of(shapes)
                for band in course.bands:
                    during = max(span[0], band.begin), min(span[1], band.end)
                    rows = _coasts(motion_from(motion, during[0]), body, self._frame, during)
                    known.append((body, band, rows))
        return known


def _coasts(motion: Motion, body: Body, frame: Frame, span: tuple[float, float]) -> Array:
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


def components(numbers: Sequence[int], found: Sequence[Meeting]) -> list[tuple[int, ...]]:
    """Groups of vehicles that meet, directly or by way of others; the largest first."""
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(numbers)
    graph.add_edges_from((row.one, row.other) for row in found)
    groups = [tuple(sorted(group)) for group in nx.connected_components(graph)]
    return sorted(groups, key=lambda group: (-len(group), group))


@functools.lru_cache(maxsize=8192)
def swept(course: FleetCourse) -> tuple[int, Array, bool]:
    """Boxes around all that a course sweeps in each slot of time, from its begin on.

    The first slot's number, boxes (n, 4) of least x, y, greatest x, y [m], and whether it is gone
    after the last one. Before the first slot it is in its box too, and else it stays in the last.

    Between two times on a path of length L, whose ends are a distance d apart, no point is farther
    than ``sqrt(L^2 - d^2) / 2`` from the box around the ends.
    """
    first = math.floor(min(float(way.time[0]) for way in course.motions) / SLOT)
    count = max(math.ceil(max(float(way.time[-1]) for way in course.motions) / SLOT) - first, 0) + 1
    boxes = np.tile(np.array(NOWHERE), (count, 1))
    for shapes, way in zip(course.shapes, course.motions, strict=True):
        reach = radius_of(shapes)
        own = _boxes(way, first, count)
        own[:, :2] -= reach
        own[:, 2:] += reach
        np.minimum(boxes[:, :2], own[:, :2], out=boxes[:, :2])
        np.maximum(boxes[:, 2:], own[:, 2:], out=boxes[:, 2:])
    return first, boxes, course.until < math.inf


def _boxes(way: Motion, first: int, count: int) -> Array:
    """Boxes around the places of a motion in each slot (count, 4); the last one is for ever."""
    slots = SLOT * (first + np.arange(count + 1.0))
    times = np.union1d(way.time, slots[(slots > way.time[0]) & (slots < way.time[-1])])
    places = _places(way, times)
    boxes = np.tile(np.array(NOWHERE), (count, 1))
    if len(times) > 1:
        middles = 0.5 * (times[1:] + times[:-1])
        piece = np.clip(np.searchsorted(way.time, middles, side="right") - 1, 0, None)
        lengths = np.hypot(*np.asarray(way.rates)[piece, :2].T) * np.diff(times)
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


def near_pairs(
    discs: Sequence[tuple[int, float, float, float]], keep: float
) -> list[tuple[int, int]]:
    """Pairs of owners of discs (owner, x, y, radius) that come within a distance [m]."""
    if len(discs) < 2:
        return []
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
        self._rows: dict[FleetCourse, int] = {}

    def near(
        self, course: FleetCourse, others: Sequence[FleetCourse], *, keep: float
    ) -> list[bool]:
        """Whether each of others may come within a distance [m] of a course; no where it cannot."""
        rows = [self._row(one) for one in others]
        mine = self._padded(course)
        theirs = self._boxes
        apart = theirs[..., 0] > mine[:, 2] + keep
        apart |= theirs[..., 1] > mine[:, 3] + keep
        apart |= theirs[..., 2] < mine[:, 0] - keep
        apart |= theirs[..., 3] < mine[:, 1] - keep
        return [bool(may) for may in ~np.asarray(apart.all(axis=1))[rows]]

    def gaps(self, box: Array, others: Sequence[FleetCourse]) -> Array:
        """How far each of others (n,) is from a box (4,) at least, whenever it is there [m]."""
        boxes = self._boxes[[self._row(one) for one in others]]
        least = boxes[..., :2].min(axis=1)
        most = boxes[..., 2:].max(axis=1)
        beside = np.maximum(np.maximum(least - box[2:], box[:2] - most), 0.0)
        return np.asarray(np.hypot(beside[:, 0], beside[:, 1]))

    def box_of(self, course: FleetCourse) -> Array:
        """The box (4,) around all that a course sweeps from now on."""
        boxes = self._boxes[self._row(course)]
        return np.array([*boxes[:, :2].min(axis=0), *boxes[:, 2:].max(axis=0)])

    def _row(self, course: FleetCourse) -> int:
        row = self._rows.get(course)
        if row is None:
            padded, row = self._padded(course), len(self._rows)
            if row == len(self._boxes):
                self._boxes = np.concatenate([self._boxes, np.full_like(self._boxes, math.nan)])
            self._boxes[row] = padded
            self._rows[course] = row
        return row

    def _padded(self, course: FleetCourse) -> Array:
        """Boxes for all slots: it stands before it begins, and after it has ended, in the last."""
        first, boxes, leaves = swept(course)
        first -= self._origin
        if first < 0:  # what is before is over
            boxes, first = boxes[min(-first, len(boxes) - 1) :], 0
        while first + len(boxes) + 1 > self._boxes.shape[1]:
            last = np.repeat(self._boxes[:, -1:], self._boxes.shape[1], axis=1)
            self._boxes = np.concatenate([self._boxes, last], axis=1)
        after = np.array(NOWHERE) if leaves else boxes[-1]
        rest = np.tile(after, (self._boxes.shape[1] - first - len(boxes), 1))
        return np.concatenate([np.tile(boxes[0], (first, 1)), boxes, rest])


class Gap(NamedTuple):
    """A distance that any two vehicles are proven to keep from a time on, and what shows it."""

    distance: float  # [m]
    nearest: Meeting | None  # that comes within 2 cm more; None: nobody is looked at so far out
    held: Mapping[int, FleetCourse]  # the courses of which it is proven


def gap_between(
    courses: Mapping[int, FleetCourse],
    *,
    keep: float,
    frame: Frame,
    time: float = -math.inf,
    held: Mapping[int, FleetCourse] | None = None,
    last: Gap | None = None,
) -> Gap:
    """A distance [m] that any two vehicles are proven to keep from now on, to within 2 cm.

    At most a metre more than the distance to keep; 0 if not even that is proven. `courses` are what
    is left of those that are `held`. The `last` one, of a step before, still holds if those that
    hold another plan since keep it too, and the two that come nearest have not passed yet.
    """
    held = courses if held is None else held
    if len(courses) < 2:
        return Gap(math.inf, None, held)
    if last is not None and last.nearest is not None and last.nearest.time >= time:
        fresh = {k for k, one in held.items() if last.held.get(k) is not one}
        changed = fresh | (set(last.held) - set(held))
        if not {last.nearest.one, last.nearest.other} & changed and not (
            fresh and meetings(courses, keep=last.distance, among=fresh, frame=frame)
        ):
            return last._replace(held=held)
    low, most, more = keep, keep + FAR, 2.0 * FINE
    rows = meetings(courses, keep=most, frame=frame)
    if not rows:
        return Gap(most, None, held)
    near = sorted({k for row in rows for k in (row.one, row.other)})
    among = {row.one for row in rows}
    met = Encounters({k: courses[k] for k in near}, frame).within
    if met(keep, among):
        return Gap(0.0, None, held)
    nearest, high = rows[0], math.inf
    while high == math.inf:
        wanted = min(low + more, most)
        if wanted >= most:
            high = most
        elif rows := met(wanted, among):
            high, nearest = wanted, rows[0]
        else:
            low, more = wanted, 2.0 * more
    while high - low > FINE:
        middle = 0.5 * (low + high)
        if rows := met(middle, among):
            high, nearest = middle, rows[0]
        else:
            low = middle
    return Gap(low, nearest, held)
