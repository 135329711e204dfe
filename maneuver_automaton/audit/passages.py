"""Bounds on the distance between a body and edges while both move, over stretches of time.

Two outlines that do not overlap are nearest at a corner of one of them. So the clearance over a
stretch of time is the least distance between the path of a corner of the body and an edge of an
obstacle, or between the path of a corner of an obstacle, seen from the body, and an edge of the
body. A path leaves its chord by at most an eighth of its greatest acceleration times the time
squared (a function f that vanishes at both ends has ``|f| <= max|f''| t^2 / 8``), so the distance
of the chord less that is never too large.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit.arrays import BodyOutline, Outline, Points, Spans
from maneuver_automaton.audit.frames import FrameMotion
from maneuver_automaton.audit.outlines import (
    Surroundings,
    crossed,
    directions,
    point_apart,
    points_of,
    squared,
)

AT_ONCE = 512  # pairs: with more, arrays no longer stay where they are quickly read
ROUNDING = 1e-14  # relative to the coordinates: what a distance may be off


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AuditedBody:
    """What keeps clear: its outline in a frame that moves among edges, counted from the origin."""

    outline: BodyOutline
    frames: FrameMotion
    offset: complex  # x + i y [m] from the origin of the edges to that of the frames
    doubt: float = 0.0  # [m, rad] how far a pose may be off at most
    height: tuple[float, float] = (0.0, 0.0)  # [m] about its altitude
    base: float = 0.0  # [m] altitude of the frames' zero
    clock: float = 0.0  # [s] on the edges' clock, when the frames start

    @property
    def in_space(self) -> bool:
        """Whether it has an altitude."""
        return bool(self.frames.series.shape[2] > 3)


class SpanPlaces(NamedTuple):
    """Where a body is at the begin and the end of stretches of time, and how it leaves chords."""

    spans: Spans  # (s,)
    place: Points  # (2, s) of its frame
    turn: Points  # (2, s) direction of its frame
    altitude: Array | None  # (2, s) [m]; None in the plane
    corners: Points  # (2, n, s)
    lasts: Array  # (s,) [s]
    off: Array  # (s,) [m] how far its frame's origin leaves its chord at most
    off_by_reach: Array  # (s,) what is added for each metre that a point is from there


class EdgePairs(NamedTuple):
    """Stretches of time, each with an edge of an obstacle, and where its frame is at their ends."""

    places: SpanPlaces
    span: IntArray  # (m,) numbers of stretches
    edge: IntArray  # (m,)
    frames: Array | None  # (m, 2, 3) of moving obstacles

    def of(self, rows: Any) -> EdgePairs:
        """Some of them, by number, slice or truth."""
        frames = None if self.frames is None else self.frames[rows]
        return EdgePairs(self.places, self.span[rows], self.edge[rows], frames)


class ClearanceBounds(NamedTuple):
    """What is known of pairs."""

    least: Array  # (m,) [m] the clearance is never less
    at_begin: Array  # (m,) [m] measured
    at_end: Array  # (m,) [m] measured

    @property
    def measured(self) -> Array:
        """The lesser of the two measured (m,) [m]."""
        return np.minimum(self.at_begin, self.at_end)


def places_of(body: AuditedBody, spans: Spans) -> SpanPlaces:
    """Where a body is at the ends of stretches of time, counted as the edges are."""
    frames, element = body.frames, spans.element
    both = np.concatenate([element, element])
    poses = frames.at(both, np.concatenate([spans.begin, spans.end])).reshape(2, element.size, -1)
    place, turn = points_of(poses), directions(poses[..., 2])
    place += body.offset
    begins = frames.times[:-1]
    lasts = (spans.end - spans.begin) * (frames.times[1:] - begins)[element]
    eighth = 0.125 * lasts * lasts
    return SpanPlaces(
        spans=spans,
        place=place,
        turn=turn,
        altitude=poses[..., 3] + body.base if body.in_space else None,
        corners=place[:, None] + turn[:, None] * body.outline.edges.begins[:, None],
        lasts=lasts,
        off=eighth * frames.bend[element],
        off_by_reach=eighth * frames.swerve[element],
    )


def time_of(body: AuditedBody, pairs: EdgePairs, known: ClearanceBounds, row: int) -> float:
    """When [s] since the start the clearance of a pair was measured."""
    spans = pairs.places.spans.of(pairs.span[row : row + 1])
    share = spans.begin if known.at_begin[row] <= known.at_end[row] else spans.end
    return float(body.frames.times_at(spans.element, share)[0])


def bounds_of(
    body: AuditedBody, around: Surroundings, pairs: EdgePairs, *, overlaps: bool = False
) -> ClearanceBounds:
    """What is known of the clearance of a body to edges over stretches of time.

    Outlines that cross are looked for where a chord crosses an edge, where edges may be flown over,
    or everywhere if `overlaps`.
    """
    if pairs.edge.size > AT_ONCE:
        blocks = [slice(k, k + AT_ONCE) for k in range(0, pairs.edge.size, AT_ONCE)]
        parts = [bounds_of(body, around, pairs.of(one), overlaps=overlaps) for one in blocks]
        return ClearanceBounds(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    edges, own, places, span = around.outline, body.outline.edges, pairs.places, pairs.span
    a, b = edges.begins[pairs.edge], edges.ends[pairs.edge]
    n = own.begins.size
    place, turn = places.place.take(span, axis=1), places.turn.take(span, axis=1)
    # Rows: corners of the body as its obstacle sees them, then an end of the edge as the body sees
    # it, against each side of the body.
    paths, sides = np.empty((2, 2, 2 * n, span.size), dtype=np.complex128)
    if pairs.frames is None:
        paths[:, :n], world = places.corners.take(span, axis=2), a
    else:
        frames = np.swapaxes(pairs.frames, 0, 1)
        there, turned = points_of(frames), directions(frames[..., 2])
        paths[:, :n] = (places.corners[..., span] - there[:, None]) * turned[:, None].conj()
        world = there + turned * a
    paths[:, n:] = ((world - place) * turn.conj())[:, None]
    sides[0, :n], sides[1, :n] = a, b
    sides[0, n:], sides[1, n:] = own.begins[:, None], own.ends[:, None]
    off = _off(body, around, pairs, paths, np.abs(a))
    radius = None  # of what comes near (2 n, m) [m]; all have corners
    if around.rounds or body.outline.radius:
        radii = np.concatenate([own.radius] * 2)
        radius = np.asarray(radii[:, None] + around.outline.radius[pairs.edge])
    near = _near(paths, sides, off, radius)
    doubtful = (near[0] <= 0.0) | overlaps
    coordinates = max(np.abs(one.view(np.float64)).max() for one in (place, a))
    near[1] -= body.doubt * (1.0 + body.outline.most_reach) + ROUNDING * coordinates
    if body.in_space:
        doubtful |= np.isfinite(around.heights[pairs.edge]).all(axis=1)
    if doubtful.any():
        rows = np.flatnonzero(doubtful)
        end = b if pairs.frames is None else there + turned * b
        ends = np.broadcast_to((end - place) * turn.conj(), place.shape)
        for k in (0, 1):
            at = paths[k, :n, rows], paths[k, n, rows], ends[k, rows]  # (rows, n) first
            hit = rows[_overlap(own, around, pairs.edge[rows], *at)]
            near[2 + k, hit] = near[1, hit] = 0.0
    apart = np.maximum(near[1:], 0.0)
    if places.altitude is not None:
        heights = around.heights[pairs.edge]
        apart = np.hypot(apart, _apart_in_height(body, pairs, heights, places.altitude))
    return ClearanceBounds(*apart)


def _near(paths: Points, sides: Points, off: Array, radius: Array | None) -> Array:
    """Distances (4, m) of paths (2, n, m) to edges (2, n, m), from the first point to the second.

    Those of the chords, those on the way at least, at the begin, at the end.
    """
    at = point_apart(paths, sides[0], sides[1])
    on = point_apart(sides, paths[0], paths[1])
    ends = np.minimum(at[0], at[1])
    least = np.minimum(ends, np.minimum(on[0], on[1]))
    # Where they cross, an end of the path is within half of its length from the edge.
    some = np.flatnonzero(ends <= 0.25 * squared(paths[1] - paths[0]))
    if some.size:
        flat = paths.reshape(2, -1)[:, some], sides.reshape(2, -1)[:, some]
        least.flat[some[crossed(*flat[0], *flat[1])]] = 0.0
    apart = np.empty((4, *least.shape))
    np.sqrt(least, out=apart[0])
    np.sqrt(at, out=apart[2:])
    if radius is not None:
        apart -= radius
    np.subtract(apart[0], off, out=apart[1])
    return np.asarray(apart.min(axis=1))


def _off(
    body: AuditedBody, around: Surroundings, pairs: EdgePairs, paths: Points, end_reach: Array
) -> Array:
    """How far [m] paths (2, 2 n, m) leave their chords at most: (2 n, m).

    Edges are at distances `end_reach` (m,) from their frames, which run evenly, or on arcs that
    bend no more than is known of their motions.
    """
    places, span, reach = pairs.places, pairs.span, body.outline.reach[:, None]
    element, lasts, n = places.spans.element[span], places.lasts[span], reach.size
    speed = body.frames.speed[element]
    drift = spin = edge_speed = bend = np.zeros(1)
    if pairs.frames is not None:
        change = pairs.frames[:, 1] - pairs.frames[:, 0]
        lasting = np.where(lasts > 0.0, lasts, np.inf)  # rounding alone moves it in no time
        drift = np.hypot(change[:, 0], change[:, 1]) / lasting
        motion = around.motion_of_edge[pairs.edge]
        moves = (motion >= 0) & (lasts > 0.0)
        known = around.movers.speeds, around.movers.bends
        arcs, bend = (np.where(moves, np.append(one, 0.0)[motion], 0.0) for one in known)
        drift = np.maximum(drift, arcs)
        spin = np.abs(change[:, 2]) / lasting
        edge_speed = drift + spin * end_reach
    seen = np.abs(paths[:, n])
    away = np.empty((2 * n, span.size))
    away[:n] = reach
    away[n:] = 0.5 * (seen[0] + seen[1] + (speed + edge_speed) * lasts)
    off = places.off[span] + places.off_by_reach[span] * away
    if pairs.frames is not None:
        eighth, turn = 0.125 * lasts * lasts, body.frames.turn[element]
        off[n:] += eighth * (spin * spin * end_reach + 2.0 * turn * edge_speed + bend)
        approach, seen = speed + turn * reach + drift, np.abs(paths[:, :n])
        far = 0.5 * (seen[0] + seen[1] + approach * lasts)
        off[:n] += eighth * (spin * (2.0 * approach + spin * far) + bend)
    return np.asarray(off)


def _apart_in_height(body: AuditedBody, pairs: EdgePairs, heights: Array, altitude: Array) -> Array:
    """Vertical clearances (3, m): at least on the way, at the begin, at the end."""
    places, span = pairs.places, pairs.span
    rise = body.frames.rise[places.spans.element]
    off = (0.125 * places.lasts**2 * rise + body.doubt)[span]
    ends = altitude[:, span]
    low = np.stack([ends.min(axis=0) - off, *ends]) + body.height[0]
    high = np.stack([ends.max(axis=0) + off, *ends]) + body.height[1]
    bottom, top = heights.T
    return np.asarray(np.maximum(np.maximum(low - top, bottom - high), 0.0))


def _overlap(
    own: Outline, around: Surroundings, edge: IntArray, corners: Points, begin: Points, end: Points
) -> NDArray[np.bool_]:
    """Whether a body and the solid of each edge (m,) overlap: they cross, or one holds the other.

    The body's `corners` (m, n) are seen from the obstacle, the ends of the edge from the body.
    """
    over = crossed(begin[:, None], end[:, None], own.begins, own.ends).any(axis=1)
    over |= own.holds(begin).any(axis=0)
    solids = around.outline.solid[edge]
    for solid in np.unique(solids):
        one = around.outline.of(around.outline.solid == solid)
        rows = np.flatnonzero(solids == solid)
        for first in own.firsts:
            over[rows] |= one.holds(corners[rows, first])[0]
    return np.asarray(over)
