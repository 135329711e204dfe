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

LEAST = 1e-300  # a squared length that is none
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


class Sides(NamedTuple):
    """Edges of a body in its frame, or of obstacles."""

    begins: NDArray[np.complex128]  # (n,) [m]
    ends: NDArray[np.complex128]  # (n,) [m]
    radius: Array  # (n,) [m]


class Found(NamedTuple):
    """The least clearance."""

    distance: float  # [m] no instant has less
    measured: float  # [m] the least one measured
    element: int  # where that was, and at which share of it
    share: float
    touches: bool  # a chord touches an edge: nothing else is known


class _Near(NamedTuple):
    """What is known of a stretch and an edge."""

    least: float  # [m] the clearance is never less
    begin: float  # [m] measured
    end: float  # [m]
    chord: float  # [m] from the chords


@inner_kernel
def _place(ways: Ways, element: int, share: float) -> tuple[complex, complex]:
    """Where the body's frame is, and its direction."""
    at = 2.0 * share - 1.0
    x, y, heading = 0.0, 0.0, 0.0
    last, term = 0.0, 1.0
    for k in range(ways.series.shape[1]):
        x += term * ways.series[element, k, 0]
        y += term * ways.series[element, k, 1]
        heading += term * ways.series[element, k, 2]
        last, term = term, ((2 * k + 1) * at * term - k * last) / (k + 1)
    return complex(x, y) + ways.offset, complex(math.cos(heading), math.sin(heading))


@inner_kernel
def _apart(point: complex, a: complex, b: complex) -> float:
    """Squared distance of a point to the segment from a to b."""
    x, y = b.real - a.real, b.imag - a.imag
    u, v = point.real - a.real, point.imag - a.imag
    share = (u * x + v * y) / max(x * x + y * y, LEAST)
    share = min(max(share, 0.0), 1.0)
    u, v = u - share * x, v - share * y
    return u * u + v * v


@inner_kernel
def _side(a: complex, b: complex, point: complex) -> float:
    return (b.real - a.real) * (point.imag - a.imag) - (b.imag - a.imag) * (point.real - a.real)


@inner_kernel
def _path_apart(p: complex, q: complex, a: complex, b: complex) -> tuple[float, float, float]:
    """Squared distances to the segment from a to b: of the chord from p to q, of p, and of q."""
    first, last = _apart(p, a, b), _apart(q, a, b)
    ends = min(first, last)
    least = min(ends, min(_apart(a, p, q), _apart(b, p, q)))
    x, y = q.real - p.real, q.imag - p.imag
    # Where they cross, an end of the path is within half of its length from the edge.
    if (
        ends <= 0.25 * (x * x + y * y)
        and _side(p, q, a) * _side(p, q, b) < 0.0
        and _side(a, b, p) * _side(a, b, q) < 0.0
    ):
        least = 0.0
    return least, first, last


@inner_kernel
def _near(
    ways: Ways,
    body: Sides,
    reach: Array,
    a: complex,
    b: complex,
    radius: float,
    element: int,
    lasting: float,
    place: complex,
    turn: complex,
    then: complex,
    turned: complex,
    doubt: float,
) -> _Near:
    """What is known of an edge, while the frame moves from a place to another in `lasting` [s]."""
    eighth = 0.125 * lasting * lasting
    off, off_by_reach = eighth * ways.bend[element], eighth * ways.swerve[element]
    chord, least, begin, end = math.inf, math.inf, math.inf, math.inf
    seen, seen_then = (a - place) * turn.conjugate(), (a - then) * turned.conjugate()
    # How far the end of the edge is from the body's frame at most, on the way.
    away = 0.5 * (abs(seen) + abs(seen_then) + ways.speed[element] * lasting)
    for k in range(body.begins.size):
        round_ = radius + body.radius[k]
        own, after = body.begins[k], body.ends[k]
        # The path of a corner of the body past the edge, that of an end of the edge past a side.
        for which in range(2):
            if which == 0:
                near = _path_apart(place + turn * own, then + turned * own, a, b)
                leaves = off + off_by_reach * reach[k]
            else:
                near = _path_apart(seen, seen_then, own, after)
                leaves = off + off_by_reach * away
            straight = math.sqrt(near[0]) - round_
            chord, least = min(chord, straight), min(least, straight - leaves)
            begin = min(begin, math.sqrt(near[1]) - round_)
            end = min(end, math.sqrt(near[2]) - round_)
    size = max(max(abs(place.real), abs(place.imag)), max(abs(then.real), abs(then.imag)))
    size = max(size, max(abs(a.real), abs(a.imag)))
    least -= doubt + ROUNDING * size
    return _Near(max(least, 0.0), max(begin, 0.0), max(end, 0.0), chord)


@inner_kernel
def _sharp(measured: float) -> float:
    """The least bound that need not be sharper: 1 mm or 1 % below the least one measured."""
    return measured - max(1e-3, 0.01 * measured)


@kernel
def nearest_still(
    ways: Ways,
    body: Sides,
    reach: Array,
    middle: complex,
    size: float,
    edges: Sides,
    element: IntArray,
    begin: Array,
    end: Array,
    span: IntArray,
    edge: IntArray,
    doubt: float,
    enough: float,
    contact: float,
) -> Found:
    """The least clearance over pairs of stretches and edges.

    ``element``, ``begin`` and ``end`` are those of the stretches, as shares; ``span`` and ``edge``
    the pairs. A disc of radius `size` [m] around `middle` holds the body, whose corners are at
    distances `reach` (n,) from its frame. ``doubt`` [m] is taken off all bounds, ``enough`` is the
    clearance that decides, and what is nearer than ``contact`` touches.
    """
    stretches = element.size
    place = np.empty((2, stretches), dtype=np.complex128)
    turn = np.empty((2, stretches), dtype=np.complex128)
    for s in range(stretches):
        place[0, s], turn[0, s] = _place(ways, element[s], begin[s])
        place[1, s], turn[1, s] = _place(ways, element[s], end[s])
    # From discs around the body: the pair that may be the nearest comes first.
    away = np.empty(span.size)
    for k in range(span.size):
        s, j = span[k], edge[k]
        lasting = (end[s] - begin[s]) * ways.lengths[element[s]]
        eighth = 0.125 * lasting * lasting
        first, last = place[0, s] + turn[0, s] * middle, place[1, s] + turn[1, s] * middle
        off = eighth * (ways.bend[element[s]] + ways.swerve[element[s]] * abs(middle))
        half = 0.5 * (first + last)
        apart = math.sqrt(_apart(half, edges.begins[j], edges.ends[j])) - edges.radius[j]
        away[k] = apart - 0.5 * abs(last - first) - size - off - doubt
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
        a, b, radius = edges.begins[j], edges.ends[j], edges.radius[j]
        now, at, towards = begin[s], place[0, s], turn[0, s]
        ends[0], places[0], turns[0], levels[0] = end[s], place[1, s], turn[1, s], 0
        waiting = 1
        while waiting > 0:
            top = waiting - 1
            lasting = (ends[top] - now) * ways.lengths[here]
            near = _near(
                ways, body, reach, a, b, radius, here, lasting,
                at, towards, places[top], turns[top], doubt,
            )  # fmt: skip
            if near.chord <= 0.0:
                return Found(0.0, 0.0, here, now, True)
            if near.begin < measured:
                measured, where, share = near.begin, here, now
            if near.end < measured:
                measured, where, share = near.end, here, ends[top]
            undecided = near.least <= enough and enough < measured
            if (
                (near.least < _sharp(measured) or undecided)
                and measured > contact
                and levels[top] < HALVINGS
                and halvings < MOST
            ):
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
    return Found(min(floor, measured), measured, where, share, False)
