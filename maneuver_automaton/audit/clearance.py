"""The least clearance along a drive, guaranteed: no instant has less.

A bound holds for every stretch of time and every edge of an obstacle near it (`passages`).
Stretches where it is not sharp enough are cut, all of them at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton.audit._kernels_still import Ways, nearest_still
from maneuver_automaton.audit.arrays import Spans
from maneuver_automaton.audit.outlines import Surroundings
from maneuver_automaton.audit.pairs import moving_pairs, nearest_still_pairs, on_arcs, overlapped
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
    found, least = None, NEVER
    if around.still.size and not body.in_space:
        ask()
        outline, own = body.outline, body.frames
        lengths = own.times[1:] - own.times[:-1]
        ways = Ways(own.series, lengths, own.speed, own.bend, own.swerve, body.offset)
        doubt = body.doubt * (1.0 + outline.most_reach)
        edges = around.outline, around.index
        found = nearest_still(ways, outline, *edges, spans, (doubt, enough, CONTACT))
        if not found.touches:
            least = _at(body, found.distance, found.measured, found.element, found.share)
            if not around.movers.motions:
                return least
    places = places_of(body, spans)
    if overlapped(body, around, places) >= 0:
        return _at(body, 0.0, 0.0, int(spans.element[0]), float(spans.begin[0]))
    if around.still.size and (found is None or found.touches):
        ask()
        pairs, known = nearest_still_pairs(body, around, places)
        least = _sharpened(body, around, pairs, known, least, enough, ask)
    for nearest, some in moving_pairs(body, around, places, least.measured):
        if not nearest < least.measured:
            break
        pairs = some()
        known = bounds_of(body, around, pairs)
        least = _sharpened(body, around, pairs, known, least, enough, ask)
    return least._replace(distance=max(least.distance, 0.0))


def _at(body: AuditedBody, distance: float, measured: float, element: int, share: float) -> Least:
    """What was found at a share of an element."""
    begin, end = body.frames.times[element : element + 2].tolist()
    return Least(distance, measured, begin + share * (end - begin))


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
