"""Which edges a body may come near to, and when: what bounds are asked for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

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
    lengths = times[1:] - times[:-1]
    steps = max(frames.length / LONGEST, body.outline.size, 1e-9)
    count = np.ceil(np.maximum(frames.turn / CHORD, frames.speed / steps) * lengths)
    count = np.maximum(count, 1.0).astype(np.int64)
    element = np.repeat(np.arange(lengths.size), count)
    number = np.arange(element.size) - (np.cumsum(count) - count)[element]
    begin, end = number / count[element], (number + 1) / count[element]
    if first <= 0.0 and last >= times[-1]:
        return Spans(element, begin, end)
    low, high = (np.clip((at - times[:-1]) / lengths, 0.0, 1.0) for at in (first, last))
    begin, end = np.maximum(begin, low[element]), np.minimum(end, high[element])
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
    here = _Here(corners, place + turn * body.outline.firsts, place, turn)
    x, y, radius = corners.real, corners.imag, body.outline.radius
    inside = [(x.min() - radius, y.min() - radius, x.max() + radius, y.max() + radius)]
    # What holds a point has an edge to its right.
    right = [(at.real, at.imag, max(around.right, at.real), at.imag) for at in here.firsts.tolist()]
    still = around.near(np.array(inside + right))[1]
    if body.in_space:
        still = still[~np.isfinite(around.heights[still]).all(axis=1)]
    if still.size:
        still = np.unique(still)
        edge = _overlapped_edge(body, here, around.outline.of(still))
        if edge >= 0:
            return int(still[edge])
    if not around.motions:
        return -1
    now = body.clock + body.frames.times_at(places.spans.element[:1], places.spans.begin[:1])
    frames = frames_at(around, now)[:, 0]
    away = np.abs(corners - points_of(frames)[:, None]).min(axis=1)
    for number in np.flatnonzero(away <= around.reaches + 2.0 * body.outline.size).tolist():
        first = around.firsts[number]
        if body.in_space and np.isfinite(around.heights[around.moving[first]]).all():
            continue
        seen = here.seen_from(points_of(frames[number]), directions(frames[number, 2]))
        edge = _overlapped_edge(body, seen, around.groups[number])
        if edge >= 0:
            return int(around.moving[first + edge])
    return -1


class _Here(NamedTuple):
    """A body at a time, as an outline sees it in its frame."""

    corners: Points  # (n,)
    firsts: Points  # (s,) a corner of each solid
    place: Any  # of its frame
    turn: Any  # direction of its frame

    def seen_from(self, place: Any, turn: Any) -> _Here:
        """The same, from a frame at a place, that is turned."""
        back = turn.conj()
        corners, firsts, own = ((one - place) * back for one in self[:3])
        return _Here(corners, firsts, own, self.turn * back)


def _overlapped_edge(body: Body, here: _Here, one: Outline) -> int:
    """An edge of an outline that a body overlaps, or -1."""
    own, back = body.outline.edges, here.turn.conj()
    held = one.holds(here.firsts).any(axis=1)[one.solid]
    a, b = (one.begins - here.place) * back, (one.ends - here.place) * back
    held |= own.holds(a).any(axis=0)
    held |= crossed(a[:, None], b[:, None], own.begins, own.ends).any(axis=1)
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
    corners = places.corners.view(np.float64).reshape(*places.corners.shape, 2)
    pad = (body.outline.radius + SPARE + _off_chords(body, places))[:, None]
    low, high = corners.min(axis=(0, 2)) - pad, corners.max(axis=(0, 2)) + pad
    within = FIRST_WITHIN * body.outline.size + SPARE
    while True:
        span, edge = around.near(np.concatenate([low - within, high + within], axis=1))
        if not edge.size:
            within *= FURTHER
            continue
        pairs = Pairs(places, span, edge, None)
        known = bounds_of(body, around, pairs)
        nearest = float(known.measured.min())
        if nearest <= within:
            return pairs, known
        within = nearest


def _off_chords(body: Body, places: Places) -> Array:
    """How far [m] points of the body leave their chords at most over stretches: (s,)."""
    return places.off + places.off_by_reach * body.outline.most_reach


def moving_pairs(body: Body, around: Surroundings, places: Places) -> Iterator[tuple[float, Pairs]]:
    """The stretches, each with all moving edges: a few that are near, then ever more.

    With each a distance [m] that neither they nor what follows comes closer than.
    """
    if not around.motions:
        return
    spans, clock = _cut_where_motions_change(body, around, places.spans)
    places = places_of(body, spans)
    every = frames_at(around, clock.ravel()).reshape(len(around.motions), 2, -1, 3)
    middles = places.place + places.turn * body.outline.middle
    away = middles - points_of(every)
    apart = np.sqrt(point_apart(np.zeros(1), away[:, 0], away[:, 1]))
    reach = body.outline.size + around.reaches[:, None]
    bound = apart - reach - _off_chords(body, places)
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
