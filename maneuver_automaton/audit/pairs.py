"""Which edges a body may come near to, and when: what bounds are asked for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit.apart import Points, crossed, directions, point_apart, points_of
from maneuver_automaton.audit.frames import Spans
from maneuver_automaton.audit.outlines import Outline
from maneuver_automaton.audit.passages import (
    Body,
    Bounds,
    Pairs,
    Places,
    bounds_of,
    off_chords,
    places_of,
)
from maneuver_automaton.audit.surroundings import Surroundings

CHORD = 0.25  # [rad] of the first stretches
LONGEST = 64.0  # of which the path of a small body has so many
SPARE = 1e-6  # [m] that nothing is left out for rounding
FIRST_WITHIN = 0.1  # of the body's size: how far around it edges are looked for first
FURTHER = 4.0  # times as far, if there is none
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


def overlapped(body: Body, around: Surroundings, places: Places) -> int:
    """An edge of an obstacle that the body overlaps as the first stretch begins; -1 for none.

    In space those that block every altitude; the others are looked for wherever they are near.
    """
    corners, place, turn = places.corners[0, 0], places.place[0, 0], places.turn[0, 0]
    seen = _Seen(corners, place, turn)
    radius = float(body.outline.radius.max())
    x, y = corners.real, corners.imag
    box = np.array([[x.min(), y.min(), x.max(), y.max()]])
    box += radius * np.array([-1.0, -1.0, 1.0, 1.0])
    firsts = corners[body.outline.firsts]
    still = np.concatenate([around.near(box)[1], around.right_of(firsts)])
    if body.in_space:
        still = still[~np.isfinite(around.heights[still]).all(axis=1)]
    if still.size:
        still = np.unique(still)
        edge = _overlapped_edge(body, seen, around.outline.of(still))
        if edge >= 0:
            return int(still[edge])
    if not around.motions:
        return -1
    now = body.clock + body.frames.times_at(places.spans.element[:1], places.spans.begin[:1])
    frames = frames_at(around, now)[:, 0]
    away = np.abs(corners - points_of(frames)[:, None]).min(axis=1)
    for number in np.flatnonzero(away <= around.reaches + 2.0 * _size(body)).tolist():
        first = around.firsts[number]
        if body.in_space and np.isfinite(around.heights[around.moving[first]]).all():
            continue
        there, turned = points_of(frames[number]), directions(frames[number, 2])
        from_there = turned.conj()
        moved = _Seen(
            (corners - there) * from_there, (place - there) * from_there, turn * from_there
        )
        edge = _overlapped_edge(body, moved, around.groups[number])
        if edge >= 0:
            return int(around.moving[first + edge])
    return -1


class _Seen(NamedTuple):
    """A body at a time, as an outline sees it in its frame."""

    corners: Points  # (n,)
    place: Points  # of its frame
    turn: Points  # direction of its frame


def _overlapped_edge(body: Body, seen: _Seen, one: Outline) -> int:
    """An edge of an outline that a body overlaps, or -1."""
    own, back = body.outline, seen.turn.conj()
    held = one.holds(seen.corners[own.firsts]).any(axis=1)[one.solid]
    a, b = ((points_of(ends) - seen.place) * back for ends in (one.begins, one.ends))
    held |= own.holds(a).any(axis=0)
    sides = points_of(own.begins), points_of(own.ends)
    held |= crossed(a[:, None], b[:, None], *sides).any(axis=1)
    return int(np.argmax(held)) if held.any() else -1


def instant(body: Body, around: Surroundings, time: float) -> Pairs:
    """All edges at a time [s] since the start."""
    edge = np.concatenate([around.still, around.moving])
    places = places_of(body, spans_within(body, time, time))
    frames = np.zeros((edge.size, 2, 3))
    if around.motions:
        now = frames_at(around, np.array([body.clock + time]))
        frames[around.still.size :] = now[around.motion_of_edge[around.moving]]
    return Pairs(places, np.zeros_like(edge), edge, frames)


def still_pairs(body: Body, around: Surroundings, places: Places) -> tuple[Pairs, Bounds]:
    """The stretches, each with the still edges that may be the nearest of all, and their bounds.

    Edges are looked for within a distance of where the body passes, and further away until one is
    measured that is no further than that.
    """
    x, y = places.corners.real, places.corners.imag
    pad = float(body.outline.radius.max()) + off_chords(body, places) + SPARE
    low = np.stack([x.min(axis=(0, 2)) - pad, y.min(axis=(0, 2)) - pad], axis=1)
    high = np.stack([x.max(axis=(0, 2)) + pad, y.max(axis=(0, 2)) + pad], axis=1)
    within = FIRST_WITHIN * _size(body) + SPARE
    while True:
        span, edge = around.near(np.hstack([low - within, high + within]))
        if not edge.size:
            within *= FURTHER
            continue
        pairs = Pairs(places, span, edge, None)
        known = bounds_of(body, around, pairs)
        nearest = float(known.measured.min())
        if nearest <= within:
            return pairs, known
        within = nearest


def moving_pairs(body: Body, around: Surroundings, places: Places) -> Iterator[tuple[float, Pairs]]:
    """The stretches, each with all moving edges: a few that are near, then ever more.

    With each a distance [m] that neither they nor what follows comes closer than.
    """
    if not around.motions:
        return
    spans, clock = _cut_where_motions_change(body, around, places.spans)
    places = places_of(body, spans)
    reach = _size(body)
    every = frames_at(around, clock.ravel()).reshape(len(around.motions), 2, -1, 3)
    middles = places.place + places.turn * _middle(body)
    away = middles - points_of(every)
    apart = np.sqrt(point_apart(np.zeros(1), away[:, 0], away[:, 1]))
    bound = apart - reach - around.reaches[:, None] - off_chords(body, places)
    bound = np.maximum(bound, 0.0)
    order = np.argsort(bound, axis=None, kind="stable")
    for chosen in np.split(order, NEAREST * 16 ** np.arange(8)):
        if chosen.size:
            yield float(bound.flat[chosen[0]]), _expanded(around, places, every, chosen)


def _expanded(around: Surroundings, places: Places, frames: Array, chosen: IntArray) -> Pairs:
    """Pairs of all edges of some pairs (k,) of motions and stretches, numbered in that order."""
    number, span = np.divmod(chosen, places.lasts.size)
    firsts = around.firsts
    count = np.diff(firsts)[number]
    rows = np.repeat(np.arange(chosen.size), count)
    place = np.arange(rows.size) - (np.cumsum(count) - count)[rows] + firsts[number][rows]
    number, span = number[rows], span[rows]
    return Pairs(places, span, around.moving[place], frames[number, :, span])


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


def frames_at(around: Surroundings, times: Array) -> Array:
    """Poses (motions, m, 3) of what moves: linear between its times, still before and after."""
    return np.stack(
        [
            np.stack([np.interp(times, motion.time, column) for column in motion.pose.T], axis=1)
            for motion in around.motions
        ]
    )


def _middle(body: Body) -> complex:
    """The middle of the body's outline, in its frame [m]."""
    corners = body.outline.begins
    return complex(*(0.5 * (corners.min(axis=0) + corners.max(axis=0))))


def _size(body: Body) -> float:
    """Radius [m] of a disc around that middle that holds the body."""
    away = np.abs(points_of(body.outline.begins) - _middle(body)) + body.outline.radius
    return float(away.max())
