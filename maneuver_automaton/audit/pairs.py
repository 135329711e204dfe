"""Which edges a body may come near to, and when: what bounds are asked for."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit._kernels_drive import evenly
from maneuver_automaton.audit._kernels_edges import edges_near
from maneuver_automaton.audit.arrays import FIRST_WITHIN, FURTHER, SPARE, Outline, Points, Spans
from maneuver_automaton.audit.outlines import (
    Surroundings,
    crossed,
    directions,
    point_apart,
    points_of,
)
from maneuver_automaton.audit.passages import (
    AuditedBody,
    ClearanceBounds,
    EdgePairs,
    SpanPlaces,
    bounds_of,
    places_of,
)

CHORD = 0.25  # [rad] of the first stretches
LONGEST = 64.0  # of which the path of a small body has so many
NEAREST = 64  # pairs that are looked at first
ROUNDED = 1e-14  # of a time, by which it may be outside of a span whose end it is
MANY = 256  # pairs at least, of which those that are far are left out first


def spans_within(body: AuditedBody, first: float, last: float) -> Spans:
    """Stretches that turn little, and are about as long as the body, between two times [s]."""
    frames, times = body.frames, body.frames.times
    lengths = times[1:] - times[:-1]
    steps = max(frames.length / LONGEST, body.outline.size, 1e-9)
    every = evenly(np.maximum(frames.turn / CHORD, frames.speed / steps) * lengths)
    if first <= 0.0 and last >= times[-1]:
        return every
    element, begin, end = every
    low, high = (np.clip((at - times[:-1]) / lengths, 0.0, 1.0) for at in (first, last))
    begin, end = np.maximum(begin, low[element]), np.minimum(end, high[element])
    kept = begin < end
    if not kept.any():  # an instant
        here = np.clip(np.searchsorted(times, first, "right") - 1, 0, lengths.size - 1)
        share = np.array([low[here]])
        return Spans(np.array([here]), share, share)
    return Spans(element[kept], begin[kept], end[kept])


def overlapped(body: AuditedBody, around: Surroundings, places: SpanPlaces) -> int:
    """An edge of an obstacle that the body overlaps as the first stretch begins; -1 for none.

    In space those that block every altitude; the others are looked for wherever they are near.
    """
    corners, place, turn = places.corners[0, :, 0], places.place[0, 0], places.turn[0, 0]
    here = _Here(corners, place + turn * body.outline.firsts, place, turn)
    edge = _overlapped_still(body, around, here)
    if edge >= 0 or not around.movers.motions:
        return edge
    now = body.clock + body.frames.times_at(places.spans.element[:1], places.spans.begin[:1])
    frames = frames_at(around, now)[:, 0]
    away = np.abs(corners - points_of(frames)[:, None]).min(axis=1)
    away[(now < around.movers.present[:, 0]) | (now > around.movers.present[:, 1])] = np.inf
    for number in np.flatnonzero(away <= around.movers.reaches + 2.0 * body.outline.size).tolist():
        first = around.movers.firsts[number]
        if body.in_space and np.isfinite(around.heights[around.movers.edges[first]]).all():
            continue
        seen = here.seen_from(points_of(frames[number]), directions(frames[number, 2]))
        held = _held(body, seen, around.movers.groups[number])
        if held.any():
            return int(around.movers.edges[first + np.argmax(held)])
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


def _overlapped_still(body: AuditedBody, around: Surroundings, here: _Here) -> int:
    """A still edge whose obstacle the body overlaps, or -1."""
    x, y, radius = here.corners.real, here.corners.imag, body.outline.radius
    boxes = [(x.min() - radius, y.min() - radius, x.max() + radius, y.max() + radius)]
    # What holds a point has an edge to its right.
    firsts = here.firsts.tolist()
    boxes += [(at.real, at.imag, math.inf, at.imag) for at in firsts]
    which, still = edges_near(around.index, np.array(boxes))
    if body.in_space:
        tall = ~np.isfinite(around.heights[still]).all(axis=1)
        which, still = which[tall], still[tall]
    near, edges = still[which == 0], around.outline
    over = near.size > 0 and bool(_crosses(body, here, edges.at(near)).any())
    for number, point in enumerate(here.firsts[:, None]):
        right = edges.at(still[which == 1 + number])
        turns = right.turns_about(point)[:, 0]
        over = over or bool(np.bincount(right.solid, weights=turns).any())
    if not over:
        return -1
    every = np.unique(still)
    return int(every[np.argmax(_held(body, here, edges.of(every)))])


def _held(body: AuditedBody, here: _Here, one: Outline) -> NDArray[np.bool_]:
    """Which edges (n,) of whole solids cross those of a body, or are of one that holds it."""
    return np.asarray(one.holds(here.firsts).any(axis=1)[one.solid] | _crosses(body, here, one))


def _crosses(body: AuditedBody, here: _Here, one: Outline) -> NDArray[np.bool_]:
    """Which edges (n,) cross those of a body, or begin inside it."""
    own, back = body.outline.edges, here.turn.conj()
    a, b = (one.begins - here.place) * back, (one.ends - here.place) * back
    crosses = crossed(a[:, None], b[:, None], own.begins, own.ends).any(axis=1)
    return np.asarray(crosses | own.holds(a).any(axis=0))


def instant(body: AuditedBody, around: Surroundings, time: float) -> EdgePairs:
    """All edges that are there at a time [s] since the start, but for rounding."""
    first, last = around.movers.present.T - body.clock
    late = ROUNDED * (1.0 + abs(time) + abs(body.clock))
    there = ((first - late <= time) & (time <= last + late))[
        around.motion_of_edge[around.movers.edges]
    ]
    moving = around.movers.edges[there]
    edge = np.concatenate([around.still, moving])
    places = places_of(body, spans_within(body, time, time))
    frames = np.zeros((edge.size, 2, 3))
    if around.movers.motions:
        now = frames_at(around, np.array([body.clock + time]))
        frames[around.still.size :] = now[around.motion_of_edge[moving]]
    return EdgePairs(places, np.zeros_like(edge), edge, frames)


def nearest_still_pairs(
    body: AuditedBody, around: Surroundings, places: SpanPlaces
) -> tuple[EdgePairs, ClearanceBounds]:
    """Pairs of stretches and still edges among which the nearest of all is, with bounds.

    They are looked for further and further away, until a distance is measured within which none is
    left out.
    """
    pad = (body.outline.radius + SPARE + _off_chords(body, places))[:, None]
    boxes = _boxes(places.corners)
    # Those along the axes of the body as a stretch begins are closer to it.
    own = _boxes(np.asarray((places.corners - places.place[0]) * places.turn[0].conj()))
    within = FIRST_WITHIN * body.outline.size + SPARE
    while True:
        grown = (pad + within) * np.array([-1.0, -1.0, 1.0, 1.0])
        span, edge = edges_near(around.index, boxes + grown)
        kept = _meets(around, places, own + grown, span, edge)
        pairs = EdgePairs(places, span[kept], edge[kept], None)
        if not pairs.edge.size:
            within *= FURTHER
            continue
        if pairs.edge.size > MANY:
            pairs = _nearest_pairs(body, around, pairs)
        known = bounds_of(body, around, pairs)
        if (nearest := float(known.measured.min())) <= within:
            return pairs, known
        within = nearest


def _nearest_pairs(body: AuditedBody, around: Surroundings, pairs: EdgePairs) -> EdgePairs:
    """Those of many pairs that may be the nearest of all, by discs around the body's way."""
    places, span, edge = pairs.places, pairs.span, pairs.edge
    first, last = (places.place + places.turn * body.outline.middle)[:, span]
    a, b = around.outline.begins[edge], around.outline.ends[edge]
    apart = np.sqrt(point_apart(0.5 * (first + last), a, b)) - around.outline.radius[edge]
    off = 0.5 * np.abs(last - first) + _off_chords(body, places)[span]
    least = apart - body.outline.size - off - SPARE
    some = np.argpartition(least, NEAREST)[:NEAREST]
    nearest = float(bounds_of(body, around, pairs.of(some)).measured.min())
    kept = least <= nearest
    if body.in_space:  # what may be flown over may be near where its edges are far
        kept |= np.isfinite(around.heights[edge]).all(axis=1)
    return pairs.of(kept)


def _boxes(points: Points) -> Array:
    """Boxes (s, 4) [low x, low y, high x, high y] along the axes around points (2, n, s) [m]."""
    x, y = (one.reshape(-1, points.shape[2]) for one in (points.real, points.imag))
    return np.stack([x.min(axis=0), y.min(axis=0), x.max(axis=0), y.max(axis=0)], axis=1)


def _meets(
    around: Surroundings, places: SpanPlaces, boxes: Array, span: IntArray, edge: IntArray
) -> NDArray[np.bool_]:
    """Whether the boxes around edges meet those of stretches, both along the body's axes.

    Edges with a height stay: the tree holds boxes of theirs, inside which they may be flown over.
    """
    place, back = places.place[0, span], places.turn[0, span].conj()
    a = (around.outline.begins[edge] - place) * back
    b = (around.outline.ends[edge] - place) * back
    (low_x, low_y, high_x, high_y), radius = boxes[span].T, around.outline.radius[edge]
    kept = np.maximum(a.real, b.real) + radius >= low_x
    kept &= np.minimum(a.real, b.real) - radius <= high_x
    kept &= np.maximum(a.imag, b.imag) + radius >= low_y
    kept &= np.minimum(a.imag, b.imag) - radius <= high_y
    if places.altitude is not None:
        kept |= np.isfinite(around.heights[edge]).all(axis=1)
    return np.asarray(kept)


def _off_chords(body: AuditedBody, places: SpanPlaces) -> Array:
    """How far [m] points of the body leave their chords at most over stretches: (s,)."""
    return places.off + places.off_by_reach * body.outline.most_reach


def moving_pairs(
    body: AuditedBody, around: Surroundings, places: SpanPlaces, known: float
) -> Iterator[tuple[float, Callable[[], EdgePairs]]]:
    """The stretches, each with all moving edges: a few that are near, then ever more.

    With each a distance [m] that neither they nor what follows comes closer than. What is never as
    near as a distance that is `known` [m], or as another one is, is left out.
    """
    near = _near_motions(body, around, places, known)
    if not near.size:
        return
    spans, clock = _cut_where_motions_change(body, around, near, places.spans)
    places = places_of(body, spans)
    every = around.movers.knots.at(near[:, None], clock.ravel()).reshape(near.size, 2, -1, 3)
    middles = places.place + places.turn * body.outline.middle
    away = middles - points_of(every)
    apart = np.sqrt(point_apart(np.zeros(1), away[:, 0], away[:, 1]))
    reach = body.outline.size + around.movers.reaches[near, None]
    bound = apart - reach - _off_chords(body, places)
    bound -= 0.125 * places.lasts**2 * around.movers.bends[near, None]
    bound = np.maximum(bound, 0.0)
    middle, present = 0.5 * (clock[0] + clock[1]), around.movers.present[near]
    bound[(middle < present[:, :1]) | (middle > present[:, 1:])] = np.inf
    order = np.argsort(bound, axis=None, kind="stable")
    order = order[np.isfinite(bound.flat[order])]
    for chosen in np.split(order, NEAREST * 16 ** np.arange(8)):
        if chosen.size:
            pairs = partial(_expanded, around, places, near, every, chosen)
            yield float(bound.flat[chosen[0]]), pairs


def _near_motions(
    body: AuditedBody, around: Surroundings, places: SpanPlaces, known: float
) -> IntArray:
    """Motions, by number, that may come nearer than a distance known [m], and than others do."""
    if not around.movers.motions:
        return np.zeros(0, dtype=np.int64)
    spans = places.spans
    ends = body.clock + np.stack(
        [body.frames.times_at(spans.element, share) for share in (spans.begin, spans.end)]
    )
    frames = frames_at(around, ends.ravel()).reshape(-1, 2, ends.shape[1], 3)
    middles = places.place + places.turn * body.outline.middle
    apart = np.abs(middles - points_of(frames))
    sizes = body.outline.size + around.movers.reaches[:, None]
    first, last = around.movers.present[:, :, None].swapaxes(0, 1)
    if not body.in_space:  # what flies may be far above
        there = (first[:, None] <= ends) & (ends <= last[:, None])
        known = min(known, float((apart + sizes[:, None])[there].min(initial=np.inf)))
    # The middles come nearer until the half of a stretch at most.
    element = spans.element
    own = body.frames.speed[element] + abs(body.outline.middle) * body.frames.turn[element]
    closer = 0.5 * places.lasts * (own + around.movers.fastest[:, None])
    least = apart.min(axis=1) - closer - sizes - SPARE
    least[(ends[1] < first) | (ends[0] > last)] = np.inf
    return np.flatnonzero(least.min(axis=1) <= known)


def _expanded(
    around: Surroundings, places: SpanPlaces, near: IntArray, frames: Array, chosen: IntArray
) -> EdgePairs:
    """Pairs of all edges of some pairs (k,) of motions and stretches, numbered in that order."""
    number, span = np.divmod(chosen, places.lasts.size)
    first = around.movers.firsts[near[number]]
    count = around.movers.firsts[near[number] + 1] - first
    rows = np.repeat(np.arange(chosen.size), count)
    place = np.arange(rows.size) - (np.cumsum(count) - count - first)[rows]
    return EdgePairs(places, span[rows], around.movers.edges[place], frames[number, :, span][rows])


def _cut_where_motions_change(
    body: AuditedBody, around: Surroundings, near: IntArray, spans: Spans
) -> tuple[Spans, Array]:
    """Stretches within which some motions run evenly, and their ends (2, m) on the clock [s]."""
    begin = body.frames.times_at(spans.element, spans.begin)
    end = body.frames.times_at(spans.element, spans.end)
    present = around.movers.present[near]
    changes = [
        *(around.movers.motions[k].time for k in near.tolist()),
        present[np.isfinite(present)],
    ]
    knots = np.unique(np.concatenate(changes)) - body.clock
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
    """Poses (motions, m, 3) of all that moves at times (m,)."""
    return around.movers.knots.at(np.arange(len(around.movers.motions))[:, None], times)


def on_arcs(frames: Array, body: AuditedBody, around: Surroundings, pairs: EdgePairs) -> None:
    """Put frames (m, 2, 3) of pairs where they are, for motions that do not run evenly."""
    motion = around.motion_of_edge[pairs.edge]
    rows = np.flatnonzero(around.movers.knots.arcs[motion])
    spans = pairs.places.spans.of(pairs.span[rows])
    for k, share in enumerate((spans.begin, spans.end)):
        now = body.clock + body.frames.times_at(spans.element, share)
        frames[rows, k] = around.movers.knots.at(motion[rows], now)
