"""The least clearance along a drive, guaranteed: no instant has less.

A bound holds for every stretch of time and every edge of an obstacle near it (`passages`).
Stretches where it is not sharp enough are cut, all of them at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton.audit._kernels_still import Found, Sides, Ways, nearest_still
from maneuver_automaton.audit.frames import Spans
from maneuver_automaton.audit.outlines import Surroundings
from maneuver_automaton.audit.pairs import StillEdges, bounded, moving_pairs, on_arcs, overlapped
from maneuver_automaton.audit.passages import (
    AuditedBody,
    ClearanceBounds,
    EdgePairs,
    bounds_of,
    places_of,
    time_of,
)

CONTACT = 1e-9  # [m] what is closer touches: places are rounded
SHARP = (1e-3, 0.01)  # [m], and of the distance: by how much less may be reported
PARTS = 4  # into which a stretch that is not sharp enough is cut
ROUNDS = 16  # of cutting at most
MOST = 200_000  # stretches at once; with more, what is known is reported


class Least(NamedTuple):
    """The least clearance of a body."""

    distance: float  # [m] no instant has less
    measured: float  # [m] the least one measured
    time: float  # [s] since the start, when that was
    obstacle: int = -1  # which one is touched, or closer than enough; -1 if none is
    part: str = ""  # what the vehicle carries, that it is of; empty for its own body


NEVER = Least(math.inf, math.inf, 0.0)


def least_clearance(
    body: AuditedBody,
    around: Surroundings,
    spans: Spans,
    *,
    enough: float = 0.0,
    ask: Callable[[], None] = lambda: None,
) -> Least:
    """The least clearance of a body over stretches of time."""
    if not around.owners.size or not spans.element.size:
        return NEVER
    places, least = places_of(body, spans), NEVER
    if overlapped(body, around, places) >= 0:
        start = float(body.frames.times_at(spans.element[:1], spans.begin[:1])[0])
        return Least(0.0, 0.0, start)
    if around.still.size:
        ask()
        edges = StillEdges.near(body, around, places)
        found = None if body.in_space else edges.nearest(partial(_compiled, body, around, enough))
        if found is None or found.touches:
            pairs, known = edges.nearest(partial(bounded, body, around))
            least = _sharpened(body, around, pairs, known, least, enough, ask)
        else:
            element, share = np.array([found.element]), np.array([found.share])
            time = float(body.frames.times_at(element, share)[0])
            least = Least(found.distance, found.measured, time)
    for nearest, some in moving_pairs(body, around, places, least.measured):
        if not nearest < least.measured:
            break
        pairs = some()
        known = bounds_of(body, around, pairs)
        least = _sharpened(body, around, pairs, known, least, enough, ask)
    return least._replace(distance=max(least.distance, 0.0))


def _compiled(
    body: AuditedBody, around: Surroundings, enough: float, pairs: EdgePairs
) -> tuple[float, Found]:
    """The least distance measured [m] over pairs in the plane, and what is known of it."""
    outline, frames, edges, spans = body.outline, body.frames, around.outline, pairs.places.spans
    found = nearest_still(
        Ways(
            frames.series,
            np.diff(frames.times),
            frames.speed,
            frames.bend,
            frames.swerve,
            body.offset,
        ),
        Sides(*outline.edges[:3]),
        outline.reach,
        outline.middle,
        outline.size,
        Sides(*edges[:3]),
        *spans,
        pairs.span,
        pairs.edge,
        body.doubt * (1.0 + outline.most_reach),
        enough,
        CONTACT,
    )
    return -math.inf if found.touches else found.measured, found


def _sharpened(
    body: AuditedBody,
    around: Surroundings,
    pairs: EdgePairs,
    known: ClearanceBounds,
    least: Least,
    enough: float,
    ask: Callable[[], None],
) -> Least:
    """The least clearance over pairs too, their stretches cut until it is sharp."""
    floor = least.distance
    for number in range(ROUNDS):
        ask()
        measured = known.measured
        best = int(np.argmin(measured))
        if measured[best] < least.measured:
            time = time_of(body, pairs, known, best)
            least = Least(floor, float(measured[best]), time)
        sharp = least.measured - max(SHARP[0], SHARP[1] * least.measured)
        undecided = (known.least <= enough) & (enough < least.measured)
        open_ = ((known.least < sharp) | undecided) & (least.measured > CONTACT)
        if number == ROUNDS - 1 or PARTS * int(open_.sum()) > MOST:
            open_[:] = False
        floor = min(floor, float(known.least[~open_].min(initial=math.inf)))
        if not open_.any():
            break
        pairs = _cut(body, around, pairs, open_)
        known = bounds_of(body, around, pairs)
    return least._replace(distance=floor)


def _cut(
    body: AuditedBody, around: Surroundings, pairs: EdgePairs, open_: NDArray[np.bool_]
) -> EdgePairs:
    """Some stretches in `PARTS` each."""
    cut = np.flatnonzero(open_)
    rows, part = np.repeat(cut, PARTS), np.tile(np.arange(PARTS), cut.size)
    kept = np.zeros(pairs.places.lasts.size, dtype=np.bool_)
    kept[pairs.span[cut]] = True
    number = (np.cumsum(kept) - 1)[pairs.span[rows]]
    whole = pairs.places.spans.of(np.flatnonzero(kept))
    shares = np.arange(PARTS + 1) / PARTS
    ends = whole.begin[:, None] + (whole.end - whole.begin)[:, None] * shares
    ends[:, -1] = whole.end
    spans = Spans(np.repeat(whole.element, PARTS), ends[:, :-1].ravel(), ends[:, 1:].ravel())
    span = number * PARTS + part
    places = places_of(body, spans)
    if pairs.frames is None:
        return EdgePairs(places, span, pairs.edge[rows], None)
    first, last = pairs.frames[rows, 0], pairs.frames[rows, 1]
    between = np.stack([part, part + 1], axis=1)[..., None] / PARTS
    frames = first[:, None] + between * (last - first)[:, None]
    on_arcs(frames, body, around, EdgePairs(places, span, pairs.edge[rows], None))
    return EdgePairs(places, span, pairs.edge[rows], frames)
