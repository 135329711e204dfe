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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit.apart import (
    Points,
    crossed,
    directions,
    point_apart,
    points_of,
    squared,
)
from maneuver_automaton.audit.frames import Frames, Spans
from maneuver_automaton.audit.outlines import Outline
from maneuver_automaton.audit.surroundings import Surroundings

ROUNDING = 1e-14  # relative to the coordinates: what a distance may be off


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Body:
    """What keeps clear: its outline in a frame that moves among edges, counted from the origin."""

    outline: Outline
    frames: Frames
    offset: Array  # (2,) [m] from the origin of the edges to that of the frames
    height: tuple[float, float] = (0.0, 0.0)  # [m] about its altitude
    base: float = 0.0  # [m] altitude of the frames' zero
    clock: float = 0.0  # [s] on the edges' clock, when the frames start

    @property
    def in_space(self) -> bool:
        """Whether it has an altitude."""
        return self.frames.series.shape[2] > 3


class Places(NamedTuple):
    """Where a body is at the begin and the end of stretches of time, and how it leaves chords."""

    spans: Spans  # (s,)
    place: Points  # (2, s) of its frame
    turn: Points  # (2, s) direction of its frame
    altitude: Array | None  # (2, s) [m]; None in the plane
    corners: Points  # (2, s, n)
    lasts: Array  # (s,) [s]
    off: Array  # (s,) [m] how far its frame's origin leaves its chord at most
    off_by_reach: Array  # (s,) what is added for each metre that a point is from there


class Pairs(NamedTuple):
    """Stretches of time, each with an edge of an obstacle, and where its frame is at their ends."""

    places: Places
    span: IntArray  # (m,) numbers of stretches
    edge: IntArray  # (m,)
    frames: Array | None  # (m, 2, 3) of moving obstacles


class Bounds(NamedTuple):
    """What is known of pairs."""

    least: Array  # (m,) [m] the clearance is never less
    measured: Array  # (m,) [m] at the begin or the end
    time: Array  # (m,) [s] since the start, when that was


def places_of(body: Body, spans: Spans) -> Places:
    """Where a body is at the ends of stretches of time, counted as the edges are."""
    frames, element = body.frames, spans.element
    both = np.concatenate([element, element])
    poses = frames.at(both, np.concatenate([spans.begin, spans.end]))
    poses[:, :2] += body.offset
    poses = poses.reshape(2, element.size, -1)
    place, turn = points_of(poses), directions(poses[..., 2])
    begins = frames.times[:-1]
    lasts = (spans.end - spans.begin) * (frames.times[1:] - begins)[element]
    eighth, rate = 0.125 * lasts * lasts, frames.turn[element]
    return Places(
        spans=spans,
        place=place,
        turn=turn,
        altitude=poses[..., 3] + body.base if body.in_space else None,
        corners=place[..., None] + turn[..., None] * points_of(body.outline.begins),
        lasts=lasts,
        off=eighth * (frames.pull[element] + rate * frames.speed[element]),
        off_by_reach=eighth * (frames.swerve[element] + rate * rate),
    )


def off_chords(body: Body, places: Places) -> Array:
    """How far [m] points of the body leave their chords at most over stretches: (s,)."""
    reach = np.sqrt(squared(points_of(body.outline.begins)).max())
    return np.asarray(places.off + places.off_by_reach * reach)


def bounds_of(body: Body, around: Surroundings, pairs: Pairs, *, overlaps: bool = False) -> Bounds:
    """What is known of the clearance of a body to edges over stretches of time.

    Outlines that cross are looked for where a chord crosses an edge, where edges may be flown over,
    or everywhere if `overlaps`.
    """
    edges, outline, places, span = around.outline, body.outline, pairs.places, pairs.span
    a, b = points_of(edges.begins[pairs.edge])[:, None], points_of(edges.ends[pairs.edge])[:, None]
    own = points_of(outline.begins), points_of(outline.ends)
    n = own[0].size
    place, turn = places.place[:, span, None], places.turn[:, span, None]
    # Columns: corners of the body as its obstacle sees them, then an end of the edge as the body
    # sees it, against each side of the body.
    paths, sides = (np.empty((2, span.size, 2 * n), dtype=np.complex128) for _ in "ab")
    if pairs.frames is None:
        paths[..., :n], world = places.corners[:, span], a
    else:
        frames = np.swapaxes(pairs.frames, 0, 1)[:, :, None]
        there, turned = points_of(frames), directions(frames[..., 2])
        paths[..., :n] = (places.corners[:, span] - there) * turned.conj()
        world = there + turned * a
    paths[..., n:] = (world - place) * turn.conj()
    sides[0, :, :n], sides[1, :, :n] = a, b
    sides[0, :, n:], sides[1, :, n:] = own
    radius = outline.radius
    if radius.any() or edges.radius.any():
        radius = np.concatenate([radius, radius]) + edges.radius[pairs.edge][:, None]
    else:
        radius = np.zeros(1)
    near = _near(paths, sides, radius, _off(body, pairs, paths, np.abs(own[0]), np.abs(a)))
    touched = near[0] <= 0.0
    coordinates = max(np.abs(one.view(np.float64)).max() for one in (place, a))
    lever = 1.0 + np.abs(own[0]).max()
    near[1] -= body.frames.doubt * lever + ROUNDING * coordinates
    doubtful = touched | overlaps
    if body.in_space:
        doubtful |= np.isfinite(around.heights[pairs.edge]).all(axis=1)
    if doubtful.any():
        rows = np.flatnonzero(doubtful)
        end = b if pairs.frames is None else there + turned * b
        ends = np.broadcast_to((end - place) * turn.conj(), place.shape)
        for k in (0, 1):
            at = paths[k, rows, :n], paths[k, rows, n], ends[k, rows, 0]
            hit = _overlap(body, around, pairs.edge[rows], *at)
            near[2 + k, rows[hit]] = 0.0
            near[1, rows[hit]] = 0.0
    apart = np.maximum(near[1:], 0.0)
    if places.altitude is not None:
        heights = around.heights[pairs.edge]
        apart = np.hypot(apart, _apart_in_height(body, pairs, heights, places.altitude))
    sooner = apart[1] <= apart[2]
    share = np.where(sooner, places.spans.begin[span], places.spans.end[span])
    time = body.frames.times_at(places.spans.element[span], share)
    return Bounds(apart[0], np.where(sooner, apart[1], apart[2]), time)


def _near(paths: Points, sides: Points, radius: Array, off: Array) -> Array:
    """Distances (4, m) of paths (2, m, n) to edges (2, m, n), from the first point to the second.

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
    apart -= radius
    np.subtract(apart[0], off, out=apart[1])
    return np.asarray(apart.min(axis=-1))


def _off(body: Body, pairs: Pairs, paths: Points, reach: Array, end_reach: Array) -> Array:
    """How far [m] paths (2, m, 2 n) leave their chords at most: (m, 2 n).

    Corners of the body are at distances `reach` (n,) from its frame, edges at `end_reach` (m, 1)
    from theirs, which run evenly.
    """
    element, n = pairs.places.spans.element[pairs.span], reach.size
    lasts = pairs.places.lasts[pairs.span, None]
    speed = body.frames.speed[element, None]
    drift = spin = np.zeros(1)
    if pairs.frames is not None:
        change = pairs.frames[:, 1] - pairs.frames[:, 0]
        lasting = np.where(lasts > 0.0, lasts, np.inf)  # rounding alone moves it in no time
        drift = np.hypot(change[:, 0], change[:, 1])[:, None] / lasting
        spin = np.abs(change[:, 2])[:, None] / lasting
    edge_speed = drift + spin * end_reach
    half_way = 0.5 * np.abs(paths[:, :, n : n + 1]).sum(axis=0)
    away = half_way + 0.5 * (speed + edge_speed) * lasts
    every = np.empty((lasts.size, 2 * n))
    every[:, :n], every[:, n:] = reach, away
    off = pairs.places.off[pairs.span, None] + pairs.places.off_by_reach[pairs.span, None] * every
    if pairs.frames is None:
        return np.asarray(off)
    eighth, turn = 0.125 * lasts * lasts, body.frames.turn[element, None]
    off[:, n:] += eighth * (spin * spin * end_reach + 2.0 * turn * edge_speed)
    approach = speed + turn * reach + drift
    far = 0.5 * (np.abs(paths[0, :, :n]) + np.abs(paths[1, :, :n]) + approach * lasts)
    off[:, :n] += eighth * spin * (2.0 * approach + spin * far)
    return np.asarray(off)


def _apart_in_height(body: Body, pairs: Pairs, heights: Array, altitude: Array) -> Array:
    """Vertical clearances (3, m): at least on the way, at the begin, at the end."""
    places, span = pairs.places, pairs.span
    rise = body.frames.rise[places.spans.element]
    off = (0.125 * places.lasts**2 * rise + body.frames.doubt)[span]
    ends = altitude[:, span]
    low = np.stack([ends.min(axis=0) - off, *ends]) + body.height[0]
    high = np.stack([ends.max(axis=0) + off, *ends]) + body.height[1]
    bottom, top = heights.T
    return np.asarray(np.maximum(np.maximum(low - top, bottom - high), 0.0))


def _overlap(
    body: Body,
    around: Surroundings,
    edge: IntArray,
    corners: Points,
    begin: Points,
    end: Points,
) -> NDArray[np.bool_]:
    """Whether a body and the solid of each edge (m,) overlap: they cross, or one holds the other.

    The body's `corners` (m, n) are seen from the obstacle, the ends of the edge from the body.
    """
    outline = body.outline
    side = points_of(outline.begins), points_of(outline.ends)
    over = crossed(begin[:, None], end[:, None], *side).any(axis=1)
    over |= outline.holds(begin).any(axis=0)
    solids = around.outline.solid[edge]
    for solid in np.unique(solids):
        ring, rows = around.outline.solid == solid, np.flatnonzero(solids == solid)
        one = around.outline.of(ring)
        for first in outline.firsts:
            over[rows] |= one.holds(corners[rows, first])[0]
    return np.asarray(over)
