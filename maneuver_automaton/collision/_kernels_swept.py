"""What a body covers along a motion, as convex polygons, and whether solids keep out of it.

One test of a polygon that holds the whole motion spares the tests of the poses along it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, inner_kernel, kernel
from maneuver_automaton.collision._kernels_clearance import (
    LISTED,
    bucket_of,
    rows_from,
    separation,
    square_to_plate,
)
from maneuver_automaton.collision.arrays import Place, SweptAreas, WorldArrays
from maneuver_automaton.collision.body import Body
from maneuver_automaton.groups._kernels import coast, compose

WIDEST = 0.5 * math.pi  # [rad] of a turn whose tangents hold it closely
SHORT = 1e-9  # [m] of an edge without a normal
MOST_TURN = 0.25  # [rad] of one slice
LEAST_TURN = 1e-300  # [rad/s] so that times of turns are numbers
STANDING = 1e-12  # [m] a body that moves no point further is taken to stand
FREE, UNKNOWN = -1, -2  # in place of the solid that is not parted from a motion


@inner_kernel
def hull_of(points: Array, n: int, hull: Array) -> int:
    """Corners of the convex hull of `n` points, counter-clockwise; how many. Sorts the points."""
    # `hull` has room for twice as many. Andrew (1979), *Another efficient algorithm for convex
    # hulls in two dimensions*.
    for k in range(1, n):
        x, y = points[k, 0], points[k, 1]
        j = k
        while j > 0 and (points[j - 1, 0] > x or (points[j - 1, 0] == x and points[j - 1, 1] > y)):
            points[j, 0], points[j, 1] = points[j - 1, 0], points[j - 1, 1]
            j -= 1
        points[j, 0], points[j, 1] = x, y
    # From left to right along the lower side, then back along the upper one: a corner that does not
    # turn left between its neighbours is none.
    m, base = 0, 2
    for step in range(2 * n - 1):
        k = step if step < n else 2 * n - 2 - step
        if step == n:
            base = m + 1
        x, y = points[k, 0], points[k, 1]
        if m > 0 and hull[m - 1, 0] == x and hull[m - 1, 1] == y:
            continue
        while m >= base:
            a_x, a_y = hull[m - 2, 0], hull[m - 2, 1]
            b_x, b_y = hull[m - 1, 0], hull[m - 1, 1]
            if (b_x - a_x) * (y - a_y) - (b_y - a_y) * (x - a_x) > 0.0:
                break
            m -= 1
        hull[m, 0], hull[m, 1] = x, y
        m += 1
    return max(m - 1, 1)  # the last one is the first


@kernel
def sweep(
    edges: Array, first: IntArray, radius: Array, twists: Array, durations: Array
) -> tuple[Array, IntArray, Array]:
    """The rows of `SweptAreas` for every twist (m, 3 or more) and signed duration (m, k)."""
    # A corner that turns is between the chord of its arc and the tangents at both ends and in the
    # middle, so what these corners span holds all that the body covers.
    n_pieces = first.shape[0] - 1
    n_motions = durations.shape[0] * durations.shape[1]
    most = 4 * edges.shape[0]
    rows = np.empty((n_motions * most, 5))
    starts = np.zeros(n_motions * n_pieces + 1, dtype=np.int64)
    places = np.empty((n_motions, 5))
    points, hull = np.empty((most, 2)), np.empty((2 * most, 2))
    used = 0
    for motion in range(n_motions):
        trim, q = motion // durations.shape[1], motion % durations.shape[1]
        v_x, v_y, turn_rate = twists[trim, 0], twists[trim, 1], twists[trim, 2]
        t = durations[trim, q]
        turn = turn_rate * t
        c, s = math.cos(turn), math.sin(turn)
        # Half of the chord, and how far the tangents reach, without a quotient of zeros.
        half, quarter = 0.5 * turn, 0.25 * turn
        scale = t if half == 0.0 else t * (math.sin(half) / half)
        ahead, aside = scale * math.cos(half), scale * math.sin(half)
        d_x, d_y = ahead * v_x - aside * v_y, aside * v_x + ahead * v_y
        along = 0.25 * t if quarter == 0.0 else 0.25 * t * (math.tan(quarter) / quarter)
        begin = used
        for b in range(n_pieces):
            n = 0
            for j in range(first[b], first[b + 1]):
                x, y = edges[j, 0], edges[j, 1]
                e_x, e_y = d_x + c * x - s * y, d_y + s * x + c * y
                u_x, u_y = along * (v_x - turn_rate * y), along * (v_y + turn_rate * x)
                points[n, 0], points[n, 1] = x, y
                points[n + 1, 0], points[n + 1, 1] = x + u_x, y + u_y
                points[n + 2, 0] = e_x - c * u_x + s * u_y
                points[n + 2, 1] = e_y - s * u_x - c * u_y
                points[n + 3, 0], points[n + 3, 1] = e_x, e_y
                n += 4
            m = hull_of(points, n, hull)
            for k in range(m):
                before = k - 1 if k > 0 else m - 1
                n_x, n_y = hull[k, 1] - hull[before, 1], hull[before, 0] - hull[k, 0]
                length = math.sqrt(n_x * n_x + n_y * n_y)
                # An edge that is all rounding has no normal: it parts the area from nothing.
                n_x = n_x / length if length > SHORT else 0.0
                n_y = n_y / length if length > SHORT else 0.0
                # The offset holds all points, also where rounding has bent a normal.
                offset = -math.inf
                for j in range(n):
                    offset = max(offset, n_x * points[j, 0] + n_y * points[j, 1])
                rows[used, 0], rows[used, 1] = hull[k, 0], hull[k, 1]
                rows[used, 2], rows[used, 3], rows[used, 4] = n_x, n_y, offset
                used += 1
            starts[motion * n_pieces + b + 1] = used
        # The middle of the two corners that are farthest apart: of what is long, the disc around it
        # is hardly larger than the least one.
        m_x, m_y, widest = rows[begin, 0], rows[begin, 1], 0.0
        for j in range(begin, used):
            for k in range(begin, j):
                e_x, e_y = rows[j, 0] - rows[k, 0], rows[j, 1] - rows[k, 1]
                if e_x * e_x + e_y * e_y > widest:
                    widest = e_x * e_x + e_y * e_y
                    m_x, m_y = 0.5 * (rows[j, 0] + rows[k, 0]), 0.5 * (rows[j, 1] + rows[k, 1])
        reach = 0.0
        for b in range(n_pieces):
            for j in range(starts[motion * n_pieces + b], starts[motion * n_pieces + b + 1]):
                e_x, e_y = rows[j, 0] - m_x, rows[j, 1] - m_y
                reach = max(reach, math.sqrt(e_x * e_x + e_y * e_y) + radius[b])
        places[motion, 0], places[motion, 1] = m_x, m_y
        places[motion, 2] = reach if abs(turn) <= WIDEST else math.inf
        places[motion, 3], places[motion, 4] = c, s
    return rows[:used].copy(), starts, places


@bare_inner_kernel
def not_parted(
    world: WorldArrays, body: Body, swept: SweptAreas, motion: int, place: Place, enough: float
) -> int:
    """A solid not parted by more than `enough` from all that a motion covers; FREE, or UNKNOWN."""
    x, y, c, s = place
    # FREE is a proof for the whole motion: its polygons hold all that the body covers, the lists of
    # the buckets all solids within `reach`, and along an axis each is farther than `enough`.
    buckets, solids = world.buckets, world.solids
    reach = swept.places[motion, 2] + enough
    m_x = x + c * swept.places[motion, 0] - s * swept.places[motion, 1]
    m_y = y + s * swept.places[motion, 0] + c * swept.places[motion, 1]
    if reach > body.reach + LISTED * buckets.reach:
        return UNKNOWN
    k = bucket_of(buckets, m_x, m_y)
    if k < 0:
        return FREE
    # The upright box around all that the motion covers and what is near: of solids that only a disc
    # around it meets, half are outside of the box, which costs a tenth of the axes.
    n_pieces = body.first.shape[0] - 1
    low_x, low_y, high_x, high_y = math.inf, math.inf, -math.inf, -math.inf
    for b in range(n_pieces):
        piece, grown = motion * n_pieces + b, enough + body.radius[b]
        for j in rows_from(swept.first[piece], swept.first[piece + 1]):
            e_x = x + c * swept.edges[j, 0] - s * swept.edges[j, 1]
            e_y = y + s * swept.edges[j, 0] + c * swept.edges[j, 1]
            low_x, high_x = min(low_x, e_x - grown), max(high_x, e_x + grown)
            low_y, high_y = min(low_y, e_y - grown), max(high_y, e_y + grown)
    for item in rows_from(buckets.start[k], buckets.start[k + 1]):
        p = buckets.items[item]
        if solids.plates[p, 0] > high_x or solids.plates[p, 2] < low_x:
            continue
        if solids.plates[p, 1] > high_y or solids.plates[p, 3] < low_y:
            continue
        if square_to_plate(solids, p, m_x, m_y) >= reach * reach:
            continue
        for b in range(n_pieces):
            wanted = enough + body.radius[b] + solids.plates[p, 4]
            piece = motion * n_pieces + b
            apart, _, _ = separation(swept, piece, place, solids, p, wanted)
            if not apart > wanted:
                return int(p)
    return FREE


@bare_inner_kernel
def overlaps(world: WorldArrays, body: Body, place: Place, p: int) -> bool:
    """Whether the core of the body surely overlaps that of one solid."""
    n_corners = world.solids.first[p + 1] - world.solids.first[p]
    for b in range(body.first.shape[0] - 1):
        # Normals do not part a point from a line beyond its end, nor two points.
        if body.first[b + 1] - body.first[b] + n_corners > 3:
            apart, _, _ = separation(body, b, place, world.solids, p, 0.0)
            if apart <= 0.0:
                return True
    return False


@kernel
def slices_near(
    starts: Array, twists: Array, durations: Array, around: Array, boxes: Array
) -> tuple[IntArray, IntArray, Array, Array, IntArray, NDArray[np.bool_]]:
    """The fewest slices that cover coasts (n,), once around, of them those near to boxes (k, 4).

    `around` (6,) [m]: middle and half sides of the box of the body, its reach about its frame, and
    how far from a box nothing is near. Of each slice the number of its coast, its level, when it
    begins [s], and the pose there; which coasts stand near a box; which boxes (k,) are met.
    """
    n = durations.size
    levels, counts = np.zeros(n, np.int64), np.zeros(n, np.int64)
    lasting, lengths = np.zeros(n), np.zeros(n)
    for k in range(n):
        rate = max(abs(twists[k, 2]), LEAST_TURN)
        speed = math.hypot(twists[k, 0], twists[k, 1]) + around[4] * rate  # no point's is greater
        if speed * durations[k] > STANDING:
            lasting[k] = min(durations[k], 2.0 * math.pi / rate)
            levels[k] = 1 - math.frexp(min(lasting[k], MOST_TURN / rate))[1]
            lengths[k] = math.ldexp(1.0, -int(levels[k]))
            counts[k] = math.ceil(lasting[k] / lengths[k])
    most, m, stand = counts.sum(), 0, 0
    coasts, level, begins = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most)
    poses, still, met = np.empty((most, 3)), np.empty(n, np.int64), np.zeros(len(boxes), np.bool_)
    for k in range(n):
        v_x, v_y, turn_rate, length = twists[k, 0], twists[k, 1], twists[k, 2], lengths[k]
        place = starts[k, 0], starts[k, 1], starts[k, 2]
        # An arc lies in the triangle of its ends and the point where the tangents there meet.
        turn = abs(turn_rate) * length
        swing = math.hypot(v_x, v_y) * length + around[4] * turn
        off = 0.5 * swing * math.tan(0.5 * turn) + around[5]
        for i in range(max(counts[k], 1)):
            begin = i * length if i + 1 < counts[k] else lasting[k] - length
            low_x, low_y, high_x, high_y = math.inf, math.inf, -math.inf, -math.inf
            for time in (begin + length, begin):
                d_x, d_y, turned = coast(v_x, v_y, turn_rate, time)
                p_x, p_y, there = compose(*place, d_x, d_y, turned)
                c, s = math.cos(there), math.sin(there)
                m_x, m_y = p_x + c * around[0] - s * around[1], p_y + s * around[0] + c * around[1]
                wide = abs(c) * around[2] + abs(s) * around[3] + off
                high = abs(s) * around[2] + abs(c) * around[3] + off
                low_x, high_x = min(low_x, m_x - wide), max(high_x, m_x + wide)
                low_y, high_y = min(low_y, m_y - high), max(high_y, m_y + high)
            near = False
            for b in range(len(boxes)):
                aside = boxes[b, 0] > high_x or boxes[b, 2] < low_x
                if not (aside or boxes[b, 1] > high_y or boxes[b, 3] < low_y):
                    met[b] = near = True
            if near and counts[k]:
                coasts[m], level[m], begins[m] = k, levels[k], begin
                poses[m, 0], poses[m, 1], poses[m, 2], m = p_x, p_y, there, m + 1
            elif near:
                still[stand], stand = k, stand + 1
    return coasts[:m], level[:m], begins[:m], poses[:m], still[:stand], met
