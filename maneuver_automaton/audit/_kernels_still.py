"""The least clearance of a body in the plane to edges that stand still, bounds cut until sharp.

Scalar twins of `passages.bounds_of`: the same bounds of the same paths, one stretch and edge at a
time, so that a stretch is halved only where it matters. Points are complex numbers x + i y [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.audit._kernels_edges import (
    crosses,
    meeting,
    path_apart,
    place_along,
    point_apart,
    turns_about,
)
from maneuver_automaton.audit.arrays import (
    FIRST_WITHIN,
    FURTHER,
    SPARE,
    BodyOutline,
    EdgeBoxes,
    Outline,
    Spans,
)

ROUNDING = 1e-14  # relative to the coordinates: what a distance may be off
HALVINGS = 32  # of a stretch at most
MOST = 200_000  # halvings in all; with more, what is known is reported


class Ways(NamedTuple):
    """How a body's frame moves over the elements of a drive."""

    series: Array  # (e, n, 3) Legendre series over the share of an element
    lengths: Array  # (e,) [s]
    speed: Array  # (e,) [m/s] of the origin at most
    bend: Array  # (e,) [m/s^2] how fast the velocity changes
    swerve: Array  # (e,) [1/s^2] what is added for each metre from the origin
    offset: complex  # [m] from the origin of the edges to that of the frames


class StillClearance(NamedTuple):
    """The least clearance."""

    distance: float  # [m] no instant has less
    measured: float  # [m] the least one measured
    element: int  # where that was, and at which share of it
    share: float
    touches: bool  # a chord touches an edge: nothing else is known


class _Bounds(NamedTuple):
    """What is known of a stretch and an edge."""

    least: float  # [m] the clearance is never less
    begin: float  # [m] measured
    end: float  # [m]
    chord: float  # [m] from the chords


@inner_kernel
def _place(ways: Ways, element: int, share: float) -> tuple[complex, complex]:
    """Where the body's frame is, and its direction."""
    place, heading, _ = place_along(ways.series, element, share)
    return place + ways.offset, complex(math.cos(heading), math.sin(heading))


@inner_kernel
def _near(
    ways: Ways,
    body: BodyOutline,
    edge: tuple[complex, complex, float],
    stretch: tuple[int, float],
    poses: tuple[complex, complex, complex, complex],
    doubt: float,
) -> _Bounds:
    """What is known of an edge, while the frame moves from a pose to another.

    An `edge` is its ends and its radius, a `stretch` the element that it is part of and how long it
    lasts [s]; `poses` are places and directions.
    """
    a, b, radius = edge
    element, lasting = stretch
    place, turn, then, turned = poses
    eighth = 0.125 * lasting * lasting
    off, off_by_reach = eighth * ways.bend[element], eighth * ways.swerve[element]
    chord, least, begin, end = math.inf, math.inf, math.inf, math.inf
    seen, seen_then = (a - place) * turn.conjugate(), (a - then) * turned.conjugate()
    # How far the end of the edge is from the body's frame at most, on the way.
    away = 0.5 * (abs(seen) + abs(seen_then) + ways.speed[element] * lasting)
    for k in range(body.edges.begins.size):
        round_ = radius + body.edges.radius[k]
        own, after = body.edges.begins[k], body.edges.ends[k]
        # The path of a corner of the body past the edge, that of an end of the edge past a side.
        for which in range(2):
            if which == 0:
                near = path_apart(place + turn * own, then + turned * own, a, b)
                leaves = off + off_by_reach * body.reach[k]
            else:
                near = path_apart(seen, seen_then, own, after)
                leaves = off + off_by_reach * away
            straight = math.sqrt(near[0]) - round_
            chord, least = min(chord, straight), min(least, straight - leaves)
            begin = min(begin, math.sqrt(near[1]) - round_)
            end = min(end, math.sqrt(near[2]) - round_)
    size = max(max(abs(place.real), abs(place.imag)), max(abs(then.real), abs(then.imag)))
    size = max(size, max(abs(a.real), abs(a.imag)))
    least -= doubt + ROUNDING * size
    return _Bounds(max(least, 0.0), max(begin, 0.0), max(end, 0.0), chord)


@inner_kernel
def _nearest(
    ways: Ways,
    body: BodyOutline,
    edges: Outline,
    spans: Spans,
    poses: tuple[NDArray[np.complex128], NDArray[np.complex128]],
    pairs: tuple[IntArray, IntArray],
    limits: tuple[float, float, float],
) -> StillClearance:
    """The least clearance over pairs of stretches and edges, by number.

    Places (2, s) and directions of the body are those as stretches begin and end; `limits` are
    those of `nearest_still`.
    """
    place, turn = poses
    span, edge = pairs
    doubt, enough, contact = limits
    element, begin, end = spans.element, spans.begin, spans.end
    middle = body.middle
    # From discs around the body: the pair that may be the nearest comes first.
    away = np.empty(span.size)
    for k in range(span.size):
        s, j = span[k], edge[k]
        lasting = (end[s] - begin[s]) * ways.lengths[element[s]]
        eighth = 0.125 * lasting * lasting
        first, last = place[0, s] + turn[0, s] * middle, place[1, s] + turn[1, s] * middle
        off = eighth * (ways.bend[element[s]] + ways.swerve[element[s]] * abs(middle))
        half = 0.5 * (first + last)
        apart = math.sqrt(point_apart(half, edges.begins[j], edges.ends[j])) - edges.radius[j]
        away[k] = apart - 0.5 * abs(last - first) - body.size - off - doubt
    floor, measured = math.inf, math.inf
    where, share, halvings = 0, 0.0, 0
    # Stretches that are halved later: where each ends, and how often it was halved.
    ends, levels = np.empty(HALVINGS + 1), np.empty(HALVINGS + 1, dtype=np.int64)
    places = np.empty(HALVINGS + 1, dtype=np.complex128)
    turns = np.empty(HALVINGS + 1, dtype=np.complex128)
    nearest = int(np.argmin(away))
    for number in range(-1, span.size):
        k = nearest if number < 0 else number
        if number == nearest or away[k] > measured:
            continue
        s, j = span[k], edge[k]
        here = element[s]
        one = (edges.begins[j], edges.ends[j], edges.radius[j])
        now, at, towards = begin[s], place[0, s], turn[0, s]
        ends[0], places[0], turns[0], levels[0] = end[s], place[1, s], turn[1, s], 0
        waiting = 1
        while waiting > 0:
            top = waiting - 1
            lasting = (ends[top] - now) * ways.lengths[here]
            passed = (at, towards, places[top], turns[top])
            near = _near(ways, body, one, (here, lasting), passed, doubt)
            if near.begin < measured:
                measured, where, share = near.begin, here, now
            if near.end < measured:
                measured, where, share = near.end, here, ends[top]
            crosses = near.chord <= 0.0  # a chord cuts corners that the body itself may clear
            undecided = crosses or (near.least <= enough and enough < measured)
            sharper = measured > contact and levels[top] < HALVINGS and halvings < MOST
            if crosses and not sharper:
                return StillClearance(0.0, 0.0, here, now, True)
            # A bound need not be sharper than 1 mm or 1 % below the least one measured.
            sharp = measured - max(1e-3, 0.01 * measured)
            if sharper and (near.least < sharp or undecided):
                halvings += 1
                levels[top] += 1
                half = 0.5 * (now + ends[top])
                ends[waiting], levels[waiting] = half, levels[top]
                places[waiting], turns[waiting] = _place(ways, here, half)
                waiting += 1
            else:
                floor = min(floor, near.least)
                now, at, towards = ends[top], places[top], turns[top]
                waiting -= 1
    return StillClearance(min(floor, measured), measured, where, share, False)


@inner_kernel
def _overlaps(
    body: BodyOutline, place: complex, turn: complex, edges: Outline, index: EdgeBoxes
) -> bool:
    """Whether a body overlaps the solid of an edge: they cross, or one holds the other."""
    found = np.empty(index.number.size, dtype=np.int64)
    middle, back, own = place + turn * body.middle, turn.conjugate(), body.edges
    x, y, reach = middle.real, middle.imag, body.size
    for n in range(meeting(index, x - reach, y - reach, x + reach, y + reach, found)):
        edge = found[n]
        a, b = (edges.begins[edge] - place) * back, (edges.ends[edge] - place) * back
        turns = 0
        for k in range(own.begins.size):
            if k > 0 and own.solid[k] != own.solid[k - 1]:
                turns = 0
            turns += turns_about(own, k, a)
            last = k + 1 == own.begins.size or own.solid[k + 1] != own.solid[k]
            if (last and turns != 0) or crosses(a, b, own.begins[k], own.ends[k]):
                return True
    around = np.zeros(edges.solid[-1] + 1, dtype=np.int64)
    for first in body.firsts:
        point = place + turn * first
        # What holds a point has an edge to its right.
        count = meeting(index, point.real, point.imag, math.inf, point.imag, found)
        around[:] = 0
        for n in range(count):
            around[edges.solid[found[n]]] += turns_about(edges, found[n], point)
        if around.any():
            return True
    return False


@inner_kernel
def _grow(box: Array, point: complex, pad: float) -> None:
    """Have a box hold all points that are no further from a point along each axis."""
    box[0], box[1] = min(box[0], point.real - pad), min(box[1], point.imag - pad)
    box[2], box[3] = max(box[2], point.real + pad), max(box[3], point.imag + pad)


@kernel
def nearest_still(
    ways: Ways,
    body: BodyOutline,
    edges: Outline,
    index: EdgeBoxes,
    spans: Spans,
    limits: tuple[float, float, float],
) -> StillClearance:
    """The least clearance of a body over stretches of time to edges, of which there is one.

    Of the limits [m] the first is taken off all bounds, the second is the clearance that decides,
    and what is nearer than the third touches.
    """
    stretches = spans.element.size
    place = np.empty((2, stretches), dtype=np.complex128)
    turn = np.empty((2, stretches), dtype=np.complex128)
    # Boxes around the corners at both ends, and along the axes of the body as a stretch begins.
    boxes, own = np.empty((stretches, 4)), np.empty((stretches, 4))
    boxes[:, :2], own[:, :2] = math.inf, math.inf
    boxes[:, 2:], own[:, 2:] = -math.inf, -math.inf
    for s in range(stretches):
        element = spans.element[s]
        place[0, s], turn[0, s] = _place(ways, element, spans.begin[s])
        place[1, s], turn[1, s] = _place(ways, element, spans.end[s])
        back = turn[0, s].conjugate()
        lasting = (spans.end[s] - spans.begin[s]) * ways.lengths[element]
        leaves = 0.125 * lasting * lasting
        leaves *= ways.bend[element] + ways.swerve[element] * body.most_reach
        pad = body.radius + SPARE + leaves
        for k in range(2):
            for corner in body.edges.begins:
                at = place[k, s] + turn[k, s] * corner
                _grow(boxes[s], at, pad)
                _grow(own[s], (at - place[0, s]) * back, pad)
    if _overlaps(body, place[0, 0], turn[0, 0], edges, index):
        return StillClearance(0.0, 0.0, 0, 0.0, True)
    # Further and further away, until a distance is measured within which none is left out.
    met = np.empty(index.number.size, dtype=np.int64)
    within = FIRST_WITHIN * body.size + SPARE
    while within < math.inf:
        span, edge = [0][:0], [0][:0]
        for s in range(stretches):
            box, seen = boxes[s], own[s]
            count = meeting(
                index, box[0] - within, box[1] - within, box[2] + within, box[3] + within, met
            )
            back = turn[0, s].conjugate()
            for n in range(count):
                a = (edges.begins[met[n]] - place[0, s]) * back
                b = (edges.ends[met[n]] - place[0, s]) * back
                far = edges.radius[met[n]] + within
                if (
                    max(a.real, b.real) + far >= seen[0]
                    and max(a.imag, b.imag) + far >= seen[1]
                    and min(a.real, b.real) - far <= seen[2]
                    and min(a.imag, b.imag) - far <= seen[3]
                ):
                    span.append(s)
                    edge.append(met[n])
        if len(edge) == 0:
            within *= FURTHER
            continue
        pairs = (np.array(span), np.array(edge))
        found = _nearest(ways, body, edges, spans, (place, turn), pairs, limits)
        if found.touches or found.measured <= within:
            return found
        within = found.measured
    return StillClearance(0.0, 0.0, 0, 0.0, True)
