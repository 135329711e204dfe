"""Edges near boxes, and how far a body is from them, in the plane.

Points are complex numbers x + i y [m].
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.audit.arrays import BLOCK, BodyOutline, EdgeBoxes, Outline

LEAST = 1e-300  # a squared length that is none


@inner_kernel
def meeting(
    index: EdgeBoxes, low_x: float, low_y: float, high_x: float, high_y: float, found: IntArray
) -> int:
    """Put the numbers of the edges whose boxes meet a box into `found`; how many they are."""
    count = 0
    for block in range(len(index.blocks)):
        box = index.blocks[block]
        if box[0] <= high_x and box[1] <= high_y and box[2] >= low_x and box[3] >= low_y:
            for k in range(block * BLOCK, min((block + 1) * BLOCK, index.number.size)):
                own = index.boxes[k]
                if own[0] <= high_x and own[1] <= high_y and own[2] >= low_x and own[3] >= low_y:
                    found[count] = index.number[k]
                    count += 1
    return count


@kernel
def edges_near(index: EdgeBoxes, boxes: Array) -> tuple[IntArray, IntArray]:
    """Which boxes (m, 4) meet the boxes of which edges."""
    found = np.empty(index.number.size, dtype=np.int64)
    which, edges = [0][:0], [0][:0]
    for k in range(len(boxes)):
        box = boxes[k]
        for n in range(meeting(index, box[0], box[1], box[2], box[3], found)):
            which.append(k)
            edges.append(found[n])
    return np.array(which, dtype=np.int64), np.array(edges, dtype=np.int64)


@inner_kernel
def point_apart(point: complex, a: complex, b: complex) -> float:
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
def crosses(p: complex, q: complex, a: complex, b: complex) -> bool:
    """Whether the segments from p to q and from a to b cross."""
    return _side(p, q, a) * _side(p, q, b) < 0.0 and _side(a, b, p) * _side(a, b, q) < 0.0


@inner_kernel
def path_apart(p: complex, q: complex, a: complex, b: complex) -> tuple[float, float, float]:
    """Squared distances to the segment from a to b: of the chord from p to q, of p, and of q."""
    first, last = point_apart(p, a, b), point_apart(q, a, b)
    ends = min(first, last)
    least = min(ends, min(point_apart(a, p, q), point_apart(b, p, q)))
    x, y = q.real - p.real, q.imag - p.imag
    # Where they cross, an end of the path is within half of its length from the edge.
    if ends <= 0.25 * (x * x + y * y) and crosses(p, q, a, b):
        least = 0.0
    return least, first, last


@inner_kernel
def turns_about(outline: Outline, edge: int, point: complex) -> int:
    """By how many turns an edge takes part in running around a point."""
    a, b = outline.begins[edge], outline.ends[edge]
    rises = int(b.imag > point.imag) - int(a.imag > point.imag)
    turns = rises if rises * _side(a, b, point) > 0.0 else 0
    radius = outline.radius[edge]
    return turns + int(radius > 0.0 and abs(point - a) <= radius)


@inner_kernel
def place_along(series: Array, element: int, share: float) -> tuple[complex, float, float]:
    """Place, heading and altitude of a frame whose pose is a Legendre series (e, n, dof)."""
    at = 2.0 * share - 1.0
    x, y, heading, z = 0.0, 0.0, 0.0, 0.0
    last, term = 0.0, 1.0
    for k in range(series.shape[1]):
        x += term * series[element, k, 0]
        y += term * series[element, k, 1]
        heading += term * series[element, k, 2]
        if series.shape[2] > 3:
            z += term * series[element, k, 3]
        last, term = term, ((2 * k + 1) * at * term - k * last) / (k + 1)
    return complex(x, y), heading, z


@kernel
def distances(
    body: BodyOutline,
    series: Array,
    elements: IntArray,
    shares: Array,
    offset: complex,
    levels: tuple[float, float],
    edges: Outline,
    heights: Array,
    index: EdgeBoxes,
    within: float,
) -> Array:
    """Distances (m,) [m] of a body to edges, or `within` [m] if they are more.

    Its frame is at shares of elements of a `series`, seen from an `offset` to the origin of the
    edges. Only those count that are no higher and no lower than the body reaches there, `levels`
    about its altitude, as their `heights` (n, 2) say.
    """
    found = np.empty(index.number.size, dtype=np.int64)
    apart = np.empty(len(shares))
    own = body.edges
    for k in range(len(shares)):
        place, heading, z = place_along(series, elements[k], shares[k])
        place, turn = place + offset, complex(math.cos(heading), math.sin(heading))
        middle, least = place + turn * body.middle, within
        x, y, reach = middle.real, middle.imag, body.size + within
        for n in range(meeting(index, x - reach, y - reach, x + reach, y + reach, found)):
            edge = found[n]
            if heights[edge, 0] > z + levels[1] or heights[edge, 1] < z + levels[0]:
                continue
            a, b, radius = edges.begins[edge], edges.ends[edge], edges.radius[edge]
            if math.sqrt(point_apart(middle, a, b)) - radius - body.size >= least:
                continue
            for side in range(own.begins.size):
                p, q = place + turn * own.begins[side], place + turn * own.ends[side]
                least = min(least, math.sqrt(path_apart(p, q, a, b)[0]) - radius - own.radius[side])
        apart[k] = max(least, 0.0)
    return apart
