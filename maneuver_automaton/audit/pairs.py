"""Which edges a body may come near to, and when: what bounds are asked for."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit.apart import crossed, point_apart
from maneuver_automaton.audit.frames import Spans
from maneuver_automaton.audit.outlines import Outline
from maneuver_automaton.audit.passages import (
    Body,
    Pairs,
    bounds_of,
    corners_of,
    off_chords,
    placed_at,
    poses_of,
    seen_from,
)
from maneuver_automaton.audit.surroundings import Surroundings
from maneuver_automaton.collision.shapes import Motion

CHORD = 0.25  # [rad] of the first stretches
LONGEST = 64.0  # of which the path of a small body has so many
_ZERO: Array = np.zeros(1)
SPARE = 1e-6  # [m] that nothing is left out for rounding
GUESSES = 16  # places where an edge is looked for that is near
NEAREST = 64  # pairs with moving obstacles that are looked at first


def spans_within(body: Body, first: float, last: float) -> Spans:
    """Stretches that turn little, and are about as long as the body, between two times [s]."""
    frames, times = body.frames, body.frames.times
    lengths = np.diff(times)
    steps = max(frames.length / LONGEST, _size(body), 1e-9)
    count = np.ceil(np.maximum(frames.turn / CHORD, frames.speed / steps) * lengths)
    count = np.maximum(count, 1.0).astype(np.int64)
    element = np.repeat(np.arange(lengths.size), count)
    number = np.arange(element.size) - (np.cumsum(count) - count)[element]
    low, high = (np.clip((at - times[:-1]) / lengths, 0.0, 1.0) for at in (first, last))
    begin = np.maximum(number / count[element], low[element])
    end = np.minimum((number + 1) / count[element], high[element])
    kept = begin < end
    if not kept.any():  # an instant
        here = np.clip(np.searchsorted(times, first, "right") - 1, 0, lengths.size - 1)
        share = np.array([low[here]])
        return Spans(np.array([here]), share, share)
    return Spans(element[kept], begin[kept], end[kept])


def overlapped(body: Body, around: Surroundings, spans: Spans) -> int:
    """An edge of an obstacle that the body overlaps as the first stretch begins; -1 for none."""
    first = spans.of(slice(1))
    pose = poses_of(body, first)[0]
    now = body.clock + body.frames.times_at(first.element, first.begin)
    x, y = corners_of(body, pose)
    radius = float(body.outline.radius.max())
    low, high = np.array([x.min(), y.min()]) - radius, np.array([x.max(), y.max()]) + radius
    firsts = np.unique(body.outline.solid, return_index=True)[1]
    still = around.about(low, high, np.stack([x[0, firsts], y[0, firsts]], axis=1))
    edge = _overlapped_edge(body, pose, around.outline.of(still), np.zeros((1, 3)))
    if edge >= 0:
        return int(still[edge])
    for number, one in enumerate(around.groups):
        frame = motion_at(around.motions[number], now)
        away = np.hypot(x - frame[0, 0], y - frame[0, 1]).min()
        if away <= around.reaches[number] + 2.0 * _size(body):
            edge = _overlapped_edge(body, pose, one, frame)
            if edge >= 0:
                return int(around.moving[around.firsts[number] + edge])
    return -1


def _overlapped_edge(body: Body, pose: Array, one: Outline, frame: Array) -> int:
    """An edge of an outline in a frame (1, 3) that the body at a pose (1, dof) overlaps, or -1."""
    own = body.outline
    x, y = seen_from(frame, corners_of(body, pose))
    firsts = np.unique(own.solid, return_index=True)[1]
    held = one.holds(np.stack([x[0, firsts], y[0, firsts]], axis=1)).any(axis=1)[one.solid]
    a, b = (seen_from(pose, placed_at(frame, (*ends.T,))) for ends in (one.begins, one.ends))
    held |= own.holds(np.stack([a[0][0], a[1][0]], axis=1)).any(axis=0)
    side = ((*own.begins.T,), (*own.ends.T,))
    held |= crossed((a[0].T, a[1].T), (b[0].T, b[1].T), *side).any(axis=1)
    return int(np.argmax(held)) if held.any() else -1


def instant(body: Body, around: Surroundings, time: float) -> Pairs:
    """All edges at a time [s] since the start."""
    edge = np.concatenate([around.still, around.moving])
    spans = spans_within(body, time, time)
    frames = np.zeros((edge.size, 2, 3))
    for number, motion in enumerate(around.motions):
        frames[around.motion_of_edge[edge] == number] = motion_at(
            motion, np.array([body.clock + time])
        )
    return Pairs(spans, np.zeros_like(edge), edge, frames)


def still_pairs(body: Body, around: Surroundings, spans: Spans) -> Iterator[tuple[float, Pairs]]:
    """The stretches, each with the still edges that may be the nearest of all; they may be at 0."""
    if not around.still.size:
        return
    poses = poses_of(body, spans)
    x, y = corners_of(body, poses.reshape(-1, poses.shape[2]))
    x, y = x.reshape(2, spans.element.size, -1), y.reshape(2, spans.element.size, -1)
    middles = _middles(body, poses)
    some = np.unique(np.linspace(0, spans.element.size - 1, GUESSES).astype(np.int64))
    guess = Pairs(spans, some, around.nearest(middles[0, some]), None)
    nearest = float(bounds_of(body, around, guess).measured.min()) + SPARE
    off = off_chords(body, spans)
    reach = nearest + float(body.outline.radius.max()) + off
    boxes = np.stack(
        [
            x.min(axis=(0, 2)) - reach,
            y.min(axis=(0, 2)) - reach,
            x.max(axis=(0, 2)) + reach,
            y.max(axis=(0, 2)) + reach,
        ],
        axis=1,
    )
    which, edge = around.near(boxes)
    first, last = ((middles[k, which, 0], middles[k, which, 1]) for k in (0, 1))
    a, b = (tuple(ends[edge].T) for ends in (around.outline.begins, around.outline.ends))
    apart = point_apart(first, a, b)
    for one in (point_apart(last, a, b), point_apart(a, first, last), point_apart(b, first, last)):
        apart = np.minimum(apart, one)
    far = nearest + _size(body) + off[which] + around.outline.radius[edge]
    chord = np.hypot(last[0] - first[0], last[1] - first[1])
    # The middle may be off by what its chord is, and where both cross no end need be near.
    kept = np.sqrt(apart) <= np.maximum(far, 0.5 * chord)
    kept |= np.isfinite(around.heights[edge]).all(axis=1)  # they may be flown over
    yield 0.0, Pairs(spans, which[kept], edge[kept], None)


def moving_pairs(body: Body, around: Surroundings, spans: Spans) -> Iterator[tuple[float, Pairs]]:
    """The stretches, each with all moving edges: a few that are near, then ever more.

    With each a distance [m] that neither they nor what follows comes closer than.
    """
    if not around.motions:
        return
    spans, clock = _cut_where_motions_change(body, around, spans)
    poses = poses_of(body, spans)
    reach = _size(body)
    both = np.concatenate([clock[0], clock[1]])
    at = np.stack([motion_at(motion, both) for motion in around.motions])
    every = at.reshape(len(around.motions), 2, -1, 3)
    away = _middles(body, poses) - every[..., :2]
    apart = np.sqrt(
        point_apart(
            (_ZERO, _ZERO),
            (away[:, 0, :, 0], away[:, 0, :, 1]),
            (away[:, 1, :, 0], away[:, 1, :, 1]),
        )
    )
    bound = np.maximum(apart - reach - around.reaches[:, None] - off_chords(body, spans), 0.0)
    order = np.argsort(bound, axis=None, kind="stable")
    for chosen in np.split(order, NEAREST * 16 ** np.arange(8)):
        if chosen.size:
            yield float(bound.flat[chosen[0]]), _expanded(around, spans, every, chosen)


def _expanded(around: Surroundings, spans: Spans, frames: Array, chosen: IntArray) -> Pairs:
    """Pairs of all edges of some pairs (k,) of motions and stretches, numbered in that order."""
    number, span = np.divmod(chosen, spans.element.size)
    firsts = around.firsts
    count = np.diff(firsts)[number]
    rows = np.repeat(np.arange(chosen.size), count)
    place = np.arange(rows.size) - (np.cumsum(count) - count)[rows] + firsts[number][rows]
    number, span = number[rows], span[rows]
    return Pairs(spans, span, around.moving[place], frames[number, :, span])


def _cut_where_motions_change(
    body: Body, around: Surroundings, spans: Spans
) -> tuple[Spans, Array]:
    """Stretches within which every obstacle runs evenly, and their ends (2, m) on the clock [s]."""
    begin = body.frames.times_at(spans.element, spans.begin)
    end = body.frames.times_at(spans.element, spans.end)
    knots = np.unique(np.concatenate([motion.time for motion in around.motions])) - body.clock
    inside = knots[(knots > begin[0]) & (knots < end[-1])]
    times = np.unique(np.concatenate([begin, end, inside]))
    if times.size == 1:
        return spans, body.clock + np.stack([times, times])
    of = np.searchsorted(begin, 0.5 * (times[1:] + times[:-1]), side="right") - 1
    element = spans.element[of]
    lengths = np.diff(body.frames.times)[element]
    shares = [
        np.clip((one - body.frames.times[element]) / lengths, spans.begin[of], spans.end[of])
        for one in (times[:-1], times[1:])
    ]
    return Spans(element, *shares), body.clock + np.stack([times[:-1], times[1:]])


def motion_at(motion: Motion, times: Array) -> Array:
    """Poses (m, 3) of a motion: linear between its times, still before and after."""
    columns = [np.interp(times, motion.time, column) for column in motion.pose.T]
    return np.stack(columns, axis=1)


def _middle(body: Body) -> Array:
    """The middle (2,) of the body's outline, in its frame [m]."""
    corners = body.outline.begins
    return np.asarray(0.5 * (corners.min(axis=0) + corners.max(axis=0)))


def _size(body: Body) -> float:
    """Radius [m] of a disc around that middle that holds the body."""
    away = np.hypot(*(body.outline.begins - _middle(body)).T) + body.outline.radius
    return float(away.max())


def _middles(body: Body, poses: Array) -> Array:
    """Places (..., 2) of that middle, the body's frame at poses (..., dof)."""
    x, y = _middle(body)
    cosine, sine = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    turned = np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)
    return np.asarray(poses[..., :2] + turned)
