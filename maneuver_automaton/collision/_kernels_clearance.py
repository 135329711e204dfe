"""How far a body is from what surrounds it: a lower bound, exact near contact.

A body and what surrounds it are convex polygons with rounded corners: a disc is one corner and a
radius. Their arrays are those of `Solids` and `Body`; rows of `edges` are x, y, normal x, normal y,
offset.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel
from maneuver_automaton.collision._kernels_field import known_distance
from maneuver_automaton.collision.arrays import (
    AboutCenter,
    Buckets,
    Field,
    Place,
    SweptAreas,
    WorldArrays,
)
from maneuver_automaton.collision.body import Body
from maneuver_automaton.collision.convex import Solids

NEAR = 0.1  # share of a body's reach below which solids are looked at one by one
SHARP = 0.3  # share of that below which clearances to sharp corners are made exact
NEGLIGIBLE = 1e-7  # [m] no rounding is as large
LISTED = 1.5  # reaches of the buckets, as far as which they list solids
ROUGH = 1e-6  # share of a radius by which a corner has to be higher to be passed over


@bare_inner_kernel
def rows_from(first: int, end: int) -> range:
    """Rows from one on and to before another, unsigned: no index is asked if it is negative."""
    return range(np.uintp(first), np.uintp(end))


@bare_inner_kernel
def from_segment(x: float, y: float, edges: Array, a: int, b: int) -> tuple[float, float]:
    """Vector to a point from the nearest point of the segment between two rows of `edges`."""
    dx, dy = edges[b, 0] - edges[a, 0], edges[b, 1] - edges[a, 1]
    px, py = x - edges[a, 0], y - edges[a, 1]
    square = dx * dx + dy * dy
    t = (px * dx + py * dy) / square if square > 0.0 else 0.0
    t = min(max(t, 0.0), 1.0)
    return px - t * dx, py - t * dy


@bare_inner_kernel
def separation(
    body: Body | SweptAreas, b: int, place: Place, solids: Solids, p: int, enough: float
) -> tuple[float, float, float]:
    """Largest separation of two convex cores over the normals of their edges, and that normal."""
    # It points to the body; -inf without edges; no search goes on above `enough`.
    # The theorem of the separating axis: two convex polygons with an area are apart exactly if the
    # normal of an edge of one of them parts them. Every such separation is a lower bound of the
    # distance, so the largest is, and a positive one proves that they are apart.
    x, y, c, s = place
    best, axis_x, axis_y = -math.inf, 0.0, 0.0
    b_0, b_1 = body.first[b], body.first[b + 1]
    p_0, p_1 = solids.first[p], solids.first[p + 1]
    if p_1 - p_0 > 1:
        for k in rows_from(p_0, p_1):  # edges of the solid against corners of the body
            n_x, n_y = solids.edges[k, 2], solids.edges[k, 3]
            m_x, m_y = c * n_x + s * n_y, c * n_y - s * n_x  # the normal seen from the body
            least = math.inf
            for j in rows_from(b_0, b_1):
                value = m_x * body.edges[j, 0] + m_y * body.edges[j, 1]
                least = min(least, value)
            apart = least + n_x * x + n_y * y - solids.edges[k, 4]
            if apart > best:
                best, axis_x, axis_y = apart, n_x, n_y
                if best > enough:
                    break
    # The body's own normals only where those of the solid have not shown enough: most solids that
    # are looked at are walls, whose normals decide.
    if b_1 - b_0 > 1 and best <= enough:
        for k in rows_from(b_0, b_1):  # edges of the body against corners of the solid
            n_x = c * body.edges[k, 2] - s * body.edges[k, 3]
            n_y = s * body.edges[k, 2] + c * body.edges[k, 3]
            least = math.inf
            for j in rows_from(p_0, p_1):
                value = n_x * solids.edges[j, 0] + n_y * solids.edges[j, 1]
                least = min(least, value)
            apart = least - n_x * x - n_y * y - body.edges[k, 4]
            if apart > best:
                best, axis_x, axis_y = apart, -n_x, -n_y
                if best > enough:
                    break
    return best, axis_x, axis_y


@bare_inner_kernel
def core_distance(
    body: Body, b: int, place: Place, solids: Solids, p: int, axis: tuple[float, float]
) -> tuple[float, float, float]:
    """Distance of two convex cores that do not overlap, and its direction towards the body."""
    # The direction `axis`, towards the body, parts the two, or is none, (0, 0).
    x, y, c, s = place
    n_x, n_y = axis
    b_0, b_1 = body.first[b], body.first[b + 1]
    p_0, p_1 = solids.first[p], solids.first[p + 1]
    best, axis_x, axis_y = math.inf, 0.0, 0.0
    # Two convex polygons that do not overlap are nearest at a corner of one of them: all corners of
    # the body against all edges of the solid, then the other way round. A single corner is an edge
    # of length zero, so discs need no case of their own. Along the direction that parts them a
    # corner may be farther from all of the other one than the nearest so far: it is passed over.
    top, low = -math.inf, math.inf  # of the solid, and of the body over the pose
    m_x, m_y = c * n_x + s * n_y, c * n_y - s * n_x
    for j in rows_from(p_0, p_1):
        top = max(top, n_x * (solids.edges[j, 0] - x) + n_y * (solids.edges[j, 1] - y))
    for j in rows_from(b_0, b_1):
        height = m_x * body.edges[j, 0] + m_y * body.edges[j, 1]
        low = min(low, height)
        away = max(height - top - NEGLIGIBLE, 0.0)
        if away * away > best:
            continue
        at_x = x + c * body.edges[j, 0] - s * body.edges[j, 1]
        at_y = y + s * body.edges[j, 0] + c * body.edges[j, 1]
        before: Any = np.uintp(p_1 - 1)
        for k in rows_from(p_0, p_1):
            e_x, e_y = from_segment(at_x, at_y, solids.edges, before, k)
            if e_x * e_x + e_y * e_y < best:
                best, axis_x, axis_y = e_x * e_x + e_y * e_y, e_x, e_y
            before = k
    for j in rows_from(p_0, p_1):
        d_x, d_y = solids.edges[j, 0] - x, solids.edges[j, 1] - y
        away = max(low - n_x * d_x - n_y * d_y - NEGLIGIBLE, 0.0)
        if away * away > best:
            continue
        at_x, at_y = c * d_x + s * d_y, c * d_y - s * d_x
        before = np.uintp(b_1 - 1)
        for k in rows_from(b_0, b_1):
            e_x, e_y = from_segment(at_x, at_y, body.edges, before, k)
            # Here the vector leads from the body to the solid, in the body's frame.
            if e_x * e_x + e_y * e_y < best:
                best = e_x * e_x + e_y * e_y
                axis_x, axis_y = s * e_y - c * e_x, -s * e_x - c * e_y
            before = k
    distance = math.sqrt(best)
    if distance > 0.0:
        axis_x, axis_y = axis_x / distance, axis_y / distance
    return distance, axis_x, axis_y


@bare_inner_kernel
def piece_clearance(
    body: Body, b: int, place: Place, solids: Solids, p: int, near: float, enough: float
) -> tuple[float, float, float]:
    """Clearance of one piece of the body to one solid, and its direction."""
    # A lower bound; exact where it is a small share of `near`, at most 0 on contact, rough above
    # `enough`.
    # A rounded polygon is a core that is grown by a radius, so the clearance of two is the distance
    # of their cores less both radii. `enough` is asked of the rounded ones, so the cores are asked
    # for more.
    rounding = body.radius[b] + solids.plates[p, 4]
    distance, axis_x, axis_y = separation(body, b, place, solids, p, enough + rounding)
    # In front of a corner the separation of two cores is less than their distance. For sharp
    # corners that vanishes on contact; rounded cores are a radius apart there, so what they lose
    # does not, and they are made exact from further away.
    exact = near if rounding > 0.0 else SHARP * near
    corners = body.first[b + 1] - body.first[b] + solids.first[p + 1] - solids.first[p]
    # `core_distance` knows no depth, so it is asked only where the cores do not overlap: an axis
    # parts them, or both are points, which have no axis. Of a point and a line it is right in any
    # case, and needed: no normal parts the line from a point beyond its end.
    apart = not -math.inf < distance <= 0.0 or corners <= 3  # two points, or a point and a line
    if apart and distance - rounding <= min(exact, enough):
        distance, axis_x, axis_y = core_distance(body, b, place, solids, p, (axis_x, axis_y))
    return distance - rounding, axis_x, axis_y


@bare_inner_kernel
def field_at(field: Field, body: Body, d: int, place: Place) -> tuple[float, float, float]:
    """The distance stored for the cell that the middle of a disc is in; where it is from there.

    The cell's middle is what the distance is from; (x, y) in cells.
    """
    x, y, c, s = place
    q_x, q_y = body.discs[d, 0], body.discs[d, 1]
    at_x = (x + c * q_x - s * q_y - field.origin_x) / field.cell
    at_y = (y + s * q_x + c * q_y - field.origin_y) / field.cell
    i, j = math.floor(at_x), math.floor(at_y)
    if 0 <= i < field.distance.shape[1] and 0 <= j < field.distance.shape[0]:
        return known_distance(field, int(j), int(i)), at_x - i - 0.5, at_y - j - 0.5
    return field.outside, 0.0, 0.0  # the field reaches that far beyond all solids


@bare_inner_kernel
def field_bound(field: Field, body: Body, place: Place, least: float) -> float:
    """Lower bound of the clearance from the distances stored at cell centres, by discs."""
    # Below `least` it is some bound, and not the best one.
    best = math.inf
    for d in range(body.discs.shape[0]):
        # Distance is 1-Lipschitz: less how far the disc's middle is from that of the cell it is a
        # lower bound at that middle, and less the radius one for all of the disc. The discs cover
        # the body: the least of their bounds holds for all of it.
        known, e_x, e_y = field_at(field, body, d, place)
        away = field.cell * math.sqrt(e_x * e_x + e_y * e_y)
        best = min(best, known - away - body.discs[d, 2])
        if best <= least:
            break
    return best


@bare_inner_kernel
def field_look(field: Field, body: Body, place: Place) -> tuple[float, bool]:
    """`field_bound`, and whether a solid surely reaches into one of the discs inside the body."""
    best, hits = math.inf, False
    for d in range(body.discs.shape[0]):
        # Distances grow no faster than their places move apart, either. Outside of the field they
        # are at least what holds there, more than the radius of any disc inside.
        known, e_x, e_y = field_at(field, body, d, place)
        away = field.cell * math.sqrt(e_x * e_x + e_y * e_y)
        best = min(best, known - away - body.discs[d, 2])
        hits = known + away < body.discs[d, 3]
        if hits:
            break
    return best, hits


@bare_inner_kernel
def bucket_of(buckets: Buckets, x: float, y: float) -> int:
    """The bucket that a place is in; -1 outside of all."""
    i = math.floor((x - buckets.origin_x) / buckets.cell)
    j = math.floor((y - buckets.origin_y) / buckets.cell)
    if not (0 <= i < buckets.columns and 0 <= j < buckets.rows):
        return -1
    return j * buckets.columns + i


@bare_inner_kernel
def square_to_plate(solids: Solids, p: int, x: float, y: float) -> float:
    """Squared distance of a place to the upright box around a solid."""
    d_x = max(max(solids.plates[p, 0] - x, x - solids.plates[p, 2]), 0.0)
    d_y = max(max(solids.plates[p, 1] - y, y - solids.plates[p, 3]), 0.0)
    return d_x * d_x + d_y * d_y


@bare_inner_kernel
def near_clearance(world: WorldArrays, body: Body, place: Place, near: float, most: float) -> float:
    """Clearance to solids near the body, exact below `near`; at most `most`, the buckets' reach."""
    buckets, solids = world.buckets, world.solids
    x, y, c, s = place
    m_x = x + c * body.middle_x - s * body.middle_y
    m_y = y + s * body.middle_x + c * body.middle_y
    # A solid in no list of this cell is at least that far away from a body whose middle is here.
    best = min(buckets.reach, most)
    k = bucket_of(buckets, m_x, m_y)
    if k < 0:
        return best
    for item in rows_from(buckets.start[k], buckets.start[k + 1]):
        p = buckets.items[item]
        # The upright box around a solid against the disc around the body: what cannot be nearer
        # than the nearest so far is passed over before any axis is computed.
        away = best + body.reach
        if square_to_plate(solids, p, m_x, m_y) >= away * away:
            continue
        for b in range(body.first.shape[0] - 1):
            clearance, _, _ = piece_clearance(body, b, place, solids, p, near, best)
            best = min(best, clearance)
            if best <= 0.0:
                return best
    return best


@bare_inner_kernel
def corner_time(a: float, b: float, ahead: float, turn: float, limit: float) -> float:
    """When a corner comes down to `limit` along an axis, driven by a constant twist."""
    # Without `turn` its height is ``a + ahead t``; with it, it is on a circle, (a, b) along the
    # axis and aside from the centre, whose height is `ahead`.
    # The height of a corner that is driven straight is linear; one that does not come down never
    # meets the limit.
    if turn == 0.0:
        return (a - limit) / -ahead if ahead < 0.0 else math.inf
    radius = math.sqrt(a * a + b * b)
    if ahead - radius > limit:
        return math.inf
    # Its height on the circle is ``ahead + radius cos(angle)``: it is at the limit where the cosine
    # is `low`, so it stays above for angles within `reach` of the top.
    low = (limit - ahead) / radius
    if low >= 1.0:
        return 0.0
    reach = math.acos(max(low, -1.0))  # rounding may leave it just below
    now = math.atan2(b, a)
    return max(reach - now if turn > 0.0 else reach + now, 0.0) / abs(turn)


@bare_inner_kernel
def stays_above(a: float, b: float, ahead: float, turn: float, limit: float, most: float) -> bool:
    """Whether a corner on a circle, as in `corner_time`, surely does not meet `limit` by `most`."""
    # Its height after an angle, signed as the turn, is ``ahead + a cos(angle) - b sin(angle)``. The
    # parabola of its height, slope and second derivative now is off by ``radius angle^3 / 6`` at
    # most (Taylor's theorem, Lagrange's form of the remainder).
    angle = turn * most
    size = abs(a) + abs(b)  # not below the radius
    # Where the parabola is convex its chord may lie above it, and its tangent does not.
    falls = -b * angle - 0.5 * max(a, 0.0) * angle * angle
    rest = size * abs(angle) * angle * angle / 6.0
    # Cosines are inverted in `corner_time`, which costs half of the digits.
    return ahead + a + min(falls, 0.0) - rest > limit + ROUGH * size


@bare_inner_kernel
def axis_time(
    body: Body,
    b: int,
    place: Place,
    course: AboutCenter,
    axis: tuple[float, float],
    drop: float,
    lasts: float,
    most: float,
) -> float:
    """How long a piece stays apart along an axis: until nearer by `drop`; in [`lasts`, `most`]."""
    x, y, c, s = place
    center_x, center_y, v_x, v_y, turn = course
    axis_x, axis_y = axis
    lowest = math.inf
    b_0, b_1 = body.first[b], body.first[b + 1]
    m_x, m_y = c * axis_x + s * axis_y, c * axis_y - s * axis_x
    for k in rows_from(b_0, b_1):
        lowest = min(lowest, m_x * body.edges[k, 0] + m_y * body.edges[k, 1])
    # The clearance along a fixed axis is the height of the lowest corner over the solid. As long as
    # no corner is lower by more than `drop` than the lowest is now, the clearance is less than now
    # by `drop` at most.
    limit = lowest - drop  # heights are counted from the pose
    time = math.inf
    for k in rows_from(b_0, b_1):
        u_x = c * body.edges[k, 0] - s * body.edges[k, 1]
        u_y = s * body.edges[k, 0] + c * body.edges[k, 1]
        if turn == 0.0:
            a = axis_x * u_x + axis_y * u_y
            t = corner_time(a, 0.0, axis_x * v_x + axis_y * v_y, 0.0, limit)
        else:
            w_x, w_y = u_x - (center_x - x), u_y - (center_y - y)
            height = axis_x * (center_x - x) + axis_y * (center_y - y)
            a, b_side = axis_x * w_x + axis_y * w_y, axis_x * w_y - axis_y * w_x
            # Most corners are too high to come down in time: a look at how fast each falls says so.
            if stays_above(a, b_side, height, turn, limit, min(most, time)):
                continue
            t = corner_time(a, b_side, height, turn, limit)
        time = min(time, t)
        if time <= lasts:
            break
    return time


@bare_inner_kernel
def near_step(
    world: WorldArrays,
    body: Body,
    place: Place,
    course: AboutCenter,
    speed: float,
    keep: float,
    margin: float,
    near: float,
    most: float,
) -> tuple[float, float]:
    """How long the motion that goes on from here stays free of what is near, at most `most` [s]."""
    # Also a lower bound of the clearance. Every solid keeps apart for its clearance over the speed,
    # or as long as the axis between the two parts them (not asked for if the turn is inf). The time
    # is -1 if a clearance is at most `margin`.
    buckets, solids = world.buckets, world.solids
    x, y, c, s = place
    m_x = x + c * body.middle_x - s * body.middle_y
    m_y = y + s * body.middle_x + c * body.middle_y
    exact = near + keep / SHARP  # clearances are exact where the distance to keep begins
    # Solids that are in no list of this cell are further away than this.
    nearest = buckets.reach - keep
    if nearest <= margin:  # the distance to keep is beyond what the buckets know
        return -1.0, nearest
    speed = max(speed, 1e-12)  # a body at rest
    # The step may at first be longer than the motion, so that solids up to `near` are looked at and
    # the bound of the clearance that is returned means something at the end of a motion, too.
    step = min(max(most, near / speed), nearest / speed)
    k = bucket_of(buckets, m_x, m_y)
    if k < 0:
        return min(step, most), nearest
    for item in rows_from(buckets.start[k], buckets.start[k + 1]):
        p = buckets.items[item]
        # A solid further away than this cannot shorten the step: it is passed over before any axis.
        away = step * speed + keep + body.reach
        if square_to_plate(solids, p, m_x, m_y) >= away * away:
            continue
        for b in range(body.first.shape[0] - 1):
            enough = step * speed + keep
            clearance, axis_x, axis_y = piece_clearance(body, b, place, solids, p, exact, enough)
            clearance -= keep
            nearest = min(nearest, clearance)
            # Too near at this pose: the proof ends here.
            if clearance <= margin:
                return -1.0, clearance
            # The proof of the step. No point of the body is faster than `speed`, so the clearance
            # lasts this long. The axis that parts the two now may part them longer, say along a
            # wall, where the clearance hardly changes: until the lowest corner has come down by
            # the clearance above the margin.
            lasts = clearance / speed
            if lasts < step and course.turn < math.inf:
                along = axis_time(
                    body, b, place, course, (axis_x, axis_y), clearance - margin, lasts, step
                )
                lasts = max(lasts, along)
            step = min(step, lasts)
    # solids that were passed over are further away than any step that was left then
    return min(step, most), min(nearest, step * speed)


@bare_inner_kernel
def static_clearance(world: WorldArrays, body: Body, place: Place) -> float:
    """Lower bound of the clearance to all static obstacles, at most the field's reach."""
    near = max(NEAR * body.reach, 0.25 * world.field.cell)
    bound = field_bound(world.field, body, place, -math.inf)
    if bound <= near:
        exact = near_clearance(world, body, place, near, math.inf)
        bound = exact if exact <= 0.0 else max(bound, exact)
    return bound
