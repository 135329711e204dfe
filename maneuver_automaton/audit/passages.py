"""Bounds on the distance between a body and edges while both move, over stretches of time.

Two outlines that do not overlap are nearest at a corner of one of them. So the clearance over a
stretch of time is the least distance between the path of a corner of the body and an edge of an
obstacle, or between the path of a corner of an obstacle, seen from the body, and an edge of the
body. A path leaves its chord by at most an eighth of its greatest acceleration times the time
squared (a function f that vanishes at both ends has ``|f| <= max|f''| t^2 / 8``), so the distance
of the chord less that is never too large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit.apart import Points, crossed, point_apart
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


class Pairs(NamedTuple):
    """Stretches of time, each with an edge of an obstacle, and where its frame is at their ends."""

    spans: Spans
    span: IntArray  # (m,) numbers of stretches
    edge: IntArray  # (m,)
    frames: Array | None  # (m, 2, 3) of moving obstacles


class Bounds(NamedTuple):
    """What is known of pairs."""

    least: Array  # (m,) [m] the clearance is never less
    measured: Array  # (m,) [m] at the begin or the end
    time: Array  # (m,) [s] since the start, when that was


class _Rates(NamedTuple):
    """What frames do at most over stretches of time, (m,) each."""

    time: Array  # [s] how long
    speed: Array  # of the body's frame [m/s]
    turn: Array  # [rad/s]
    pull: Array  # [m/s^2]
    swerve: Array  # [rad/s^2]
    drift: Array  # [m/s] of the obstacle's frame
    spin: Array  # [rad/s]


def poses_of(body: Body, spans: Spans) -> Array:
    """Poses (2, m, dof) of a body's frame at begin and end of stretches, where the edges are."""
    count = spans.element.size
    both = np.concatenate([spans.element, spans.element])
    poses = body.frames.at(both, np.concatenate([spans.begin, spans.end]))
    poses[:, :2] += body.offset
    return poses.reshape(2, count, -1)


def corners_of(body: Body, poses: Array) -> Points:
    """Corners (..., n) of the body's outline, its frame at poses (..., dof)."""
    cosine, sine = np.cos(poses[..., 2, None]), np.sin(poses[..., 2, None])
    x, y = body.outline.begins.T
    return (
        poses[..., 0, None] + cosine * x - sine * y,
        poses[..., 1, None] + sine * x + cosine * y,
    )


def seen_from(frames: Array, points: Points) -> Points:
    """Points (m, n) in the world, from frames (m, 3 or more)."""
    cosine, sine = np.cos(frames[:, 2, None]), np.sin(frames[:, 2, None])
    x, y = points[0] - frames[:, 0, None], points[1] - frames[:, 1, None]
    return cosine * x + sine * y, cosine * y - sine * x


def rates_of(body: Body, pairs: Pairs) -> _Rates:
    """What a body does at most over stretches, and the frame of an obstacle, which runs evenly."""
    of, element = body.frames, pairs.spans.element[pairs.span]
    time = (pairs.spans.end - pairs.spans.begin)[pairs.span] * np.diff(of.times)[element]
    drift = spin = np.zeros(time.size)
    if pairs.frames is not None:
        change = pairs.frames[:, 1] - pairs.frames[:, 0]
        lasting = np.where(time > 0.0, time, np.inf)  # rounding alone moves it in no time
        drift, spin = np.hypot(change[:, 0], change[:, 1]) / lasting, np.abs(change[:, 2]) / lasting
    rows = (of.speed[element], of.turn[element], of.pull[element], of.swerve[element])
    return _Rates(*(one[:, None] for one in (time, *rows, drift, spin)))


def off_chords(body: Body, spans: Spans) -> Array:
    """How far [m] points of the body leave their chords at most over stretches: (m,)."""
    reach = np.hypot(*body.outline.begins.T).max()
    every = np.arange(spans.element.size)
    rates = rates_of(body, Pairs(spans, every, every, None))
    return _off_by_body(rates, reach, ())[:, 0]


def bounds_of(body: Body, around: Surroundings, pairs: Pairs, *, overlaps: bool = False) -> Bounds:
    """What is known of the clearance of a body to edges over stretches of time.

    Outlines that cross are looked for where a bound lets them, or everywhere if `overlaps`.
    """
    edges, outline = around.outline, body.outline
    poses, rates = poses_of(body, pairs.spans), rates_of(body, pairs)
    inside = corners_of(body, poses)  # (2, spans, n) each: at begin and end
    poses = poses[:, pairs.span]
    a, b = _columns(edges.begins[pairs.edge]), _columns(edges.ends[pairs.edge])
    ours, begins, ends = [], [], []  # at begin and end
    for k, pose in enumerate(poses):
        corners, edge = (inside[0][k, pairs.span], inside[1][k, pairs.span]), (a, b)
        if pairs.frames is not None:
            frame = pairs.frames[:, k]
            corners, edge = seen_from(frame, corners), (placed_at(frame, a), placed_at(frame, b))
        ours.append(corners)
        begins.append(seen_from(pose, edge[0]))
        ends.append(seen_from(pose, edge[1]))
    side = (tuple(outline.begins.T), tuple(outline.ends.T))
    radius = outline.radius + edges.radius[pairs.edge][:, None]
    near = np.minimum(
        _near(ours, (a, b), radius, _off_by_body(rates, np.hypot(*side[0]), ours)),
        _near(begins, side, radius, _off_by_edge(rates, np.hypot(*a), begins)),
    )
    coordinates = max(float(np.abs(poses[..., :2]).max()), float(np.abs(a).max()))
    lever = 1.0 + float(np.hypot(*side[0]).max())
    near[0] -= body.frames.doubt * lever + ROUNDING * coordinates
    above = _apart_in_height(body, around, pairs, poses, rates)
    doubtful = overlaps | (near[0] <= 0.0) | np.isfinite(around.heights[pairs.edge]).all(axis=1)
    if doubtful.any():
        rows = np.flatnonzero(doubtful)
        for k in (0, 1):
            at = [(x[rows], y[rows]) for x, y in (ours[k], begins[k], ends[k])]
            hit = _overlap(body, around, pairs.edge[rows], *at)
            near[1 + k, rows[hit]] = 0.0
            near[0, rows[hit]] = 0.0
    apart = np.hypot(np.maximum(near, 0.0), above)
    sooner = apart[1] <= apart[2]
    spans = pairs.spans.of(pairs.span)
    share = np.where(sooner, spans.begin, spans.end)
    time = body.frames.times_at(spans.element, share)
    return Bounds(apart[0], np.where(sooner, apart[1], apart[2]), time)


def _columns(points: Array) -> Points:
    """Points (m, 2) as columns (m, 1), so that rows of others broadcast."""
    return points[:, 0, None], points[:, 1, None]


def placed_at(frames: Array, points: Points) -> Points:
    """Points (m, n) or (n,) seen from frames (m, 3 or more), in the world."""
    cosine, sine = np.cos(frames[:, 2, None]), np.sin(frames[:, 2, None])
    x, y = points
    return frames[:, 0, None] + cosine * x - sine * y, frames[:, 1, None] + sine * x + cosine * y


def _near(path: Sequence[Points], edge: tuple[Points, Points], radius: Array, off: Array) -> Array:
    """Distances (3, m): at least on the way, at the begin, at the end of paths to edges."""
    first, last = path
    at = [point_apart(first, *edge), point_apart(last, *edge)]
    least = np.minimum(point_apart(edge[0], first, last), point_apart(edge[1], first, last))
    least = np.minimum(np.minimum(*at), least)
    # Where they cross, an end of the path is within half of its length from the edge.
    length = (last[0] - first[0]) ** 2 + (last[1] - first[1]) ** 2
    rows = np.flatnonzero((np.minimum(*at) <= 0.25 * length).any(axis=1))
    if rows.size:
        some = [(_rows(x, rows), _rows(y, rows)) for x, y in (first, last, *edge)]
        least[rows] = np.where(crossed(*some), 0.0, least[rows])
    near = np.sqrt([least, *at]) - radius
    near[0] -= off
    return np.asarray(near.min(axis=-1))


def _rows(values: Array, rows: IntArray) -> Array:
    """Some rows of values (m, n); values (n,) are the same for all."""
    return values[rows] if values.ndim > 1 else values


def _off_by_body(rates: _Rates, reach: Array, seen: Sequence[Points]) -> Array:
    """How far [m] the path of a corner of the body, seen from the obstacle, leaves its chord."""
    speed = rates.speed + rates.turn * reach
    pull = rates.pull + rates.swerve * reach + rates.turn * speed
    if rates.spin.any():
        approach = speed + rates.drift
        pull = pull + rates.spin * (2.0 * approach + rates.spin * _away(seen, approach, rates))
    return np.asarray(0.125 * rates.time**2 * pull)


def _off_by_edge(rates: _Rates, reach: Array, seen: Sequence[Points]) -> Array:
    """How far [m] the path of a corner of the obstacle, seen from the body, leaves its chord."""
    speed = rates.drift + rates.spin * reach
    away = _away(seen, rates.speed + speed, rates)
    pull = rates.spin**2 * reach + rates.pull + rates.swerve * away
    pull = pull + rates.turn * (2.0 * speed + rates.speed + rates.turn * away)
    return np.asarray(0.125 * rates.time**2 * pull)


def _away(seen: Sequence[Points], approach: Array, rates: _Rates) -> Array:
    """How far [m] a point is from the frame that sees it at most, on its way."""
    return np.asarray(0.5 * (np.hypot(*seen[0]) + np.hypot(*seen[1]) + approach * rates.time))


def _apart_in_height(
    body: Body, around: Surroundings, pairs: Pairs, poses: Array, rates: _Rates
) -> Array:
    """Vertical clearances (3, m): at least on the way, at the begin, at the end; 0 in the plane."""
    if poses.shape[2] == 3:
        return np.zeros((3, 1))
    altitude = poses[..., 3] + body.base
    off = 0.125 * rates.time[:, 0] ** 2 * body.frames.rise[pairs.spans.element[pairs.span]]
    off = off + body.frames.doubt
    low = np.stack([altitude.min(axis=0) - off, *altitude]) + body.height[0]
    high = np.stack([altitude.max(axis=0) + off, *altitude]) + body.height[1]
    bottom, top = around.heights[pairs.edge].T
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
    side = (tuple(outline.begins.T), tuple(outline.ends.T))
    over = crossed(begin, end, *side).any(axis=1)
    over |= outline.holds(np.column_stack([begin[0], begin[1]])).any(axis=0)
    firsts = np.unique(outline.solid, return_index=True)[1]
    solids = around.outline.solid[edge]
    for solid in np.unique(solids):
        ring, rows = around.outline.solid == solid, np.flatnonzero(solids == solid)
        one = around.outline.of(ring)
        for first in firsts:
            points = np.stack([corners[0][rows, first], corners[1][rows, first]], axis=1)
            over[rows] |= one.holds(points)[0]
    return np.asarray(over)
