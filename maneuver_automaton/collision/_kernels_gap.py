"""How far a body is from what surrounds it: a lower bound, exact near contact.

A body and what surrounds it are convex polygons with rounded corners: a disc is one corner and a
radius. Their arrays are those of `Solids` and `Body`; rows of `edges` are x, y, normal x, normal y,
offset.
"""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, inlined_kernel

NEAR = 0.02  # share of a body's reach below which gaps are made exact


@bare_inner_kernel
def point_to_segment(x, y, ax, ay, bx, by):
    """Squared distance of a point to a segment."""
    dx, dy = bx - ax, by - ay
    px, py = x - ax, y - ay
    square = dx * dx + dy * dy
    t = (px * dx + py * dy) / square if square > 0.0 else 0.0
    t = min(max(t, 0.0), 1.0)
    ex, ey = px - t * dx, py - t * dy
    return ex * ex + ey * ey


@inlined_kernel
def separation(body, b, x, y, c, s, solids, p, enough):
    """Largest separation of two convex cores over the normals of their edges; -inf without edges.

    A lower bound of their distance, and not positive only if they touch. Stops at `enough`.
    """
    best = -math.inf
    b_0, b_1 = body.first[b], body.first[b + 1]
    p_0, p_1 = solids.first[p], solids.first[p + 1]
    if p_1 - p_0 > 1:
        for k in range(p_0, p_1):  # edges of the solid against corners of the body
            n_x, n_y = solids.edges[k, 2], solids.edges[k, 3]
            m_x, m_y = c * n_x + s * n_y, c * n_y - s * n_x  # the normal seen from the body
            least = math.inf
            for j in range(b_0, b_1):
                value = m_x * body.edges[j, 0] + m_y * body.edges[j, 1]
                least = min(least, value)
            gap = least + n_x * x + n_y * y - solids.edges[k, 4]
            if gap > best:
                best = gap
                if best > enough:
                    return best
    if b_1 - b_0 > 1:
        for k in range(b_0, b_1):  # edges of the body against corners of the solid
            n_x = c * body.edges[k, 2] - s * body.edges[k, 3]
            n_y = s * body.edges[k, 2] + c * body.edges[k, 3]
            least = math.inf
            for j in range(p_0, p_1):
                value = n_x * solids.edges[j, 0] + n_y * solids.edges[j, 1]
                least = min(least, value)
            gap = least - n_x * x - n_y * y - body.edges[k, 4]
            if gap > best:
                best = gap
                if best > enough:
                    return best
    return best


@inlined_kernel
def core_distance(body, b, x, y, c, s, solids, p):
    """Distance of two convex cores that do not overlap."""
    b_0, b_1 = body.first[b], body.first[b + 1]
    p_0, p_1 = solids.first[p], solids.first[p + 1]
    best = math.inf
    for j in range(b_0, b_1):
        at_x = x + c * body.edges[j, 0] - s * body.edges[j, 1]
        at_y = y + s * body.edges[j, 0] + c * body.edges[j, 1]
        before = p_1 - 1
        for k in range(p_0, p_1):
            square = point_to_segment(
                at_x,
                at_y,
                solids.edges[before, 0],
                solids.edges[before, 1],
                solids.edges[k, 0],
                solids.edges[k, 1],
            )
            best = min(best, square)
            before = k
    for j in range(p_0, p_1):
        d_x, d_y = solids.edges[j, 0] - x, solids.edges[j, 1] - y
        at_x, at_y = c * d_x + s * d_y, c * d_y - s * d_x
        before = b_1 - 1
        for k in range(b_0, b_1):
            square = point_to_segment(
                at_x,
                at_y,
                body.edges[before, 0],
                body.edges[before, 1],
                body.edges[k, 0],
                body.edges[k, 1],
            )
            best = min(best, square)
            before = k
    return math.sqrt(best)


@inlined_kernel
def piece_gap(body, b, x, y, c, s, solids, p, near, enough):
    """Gap of one piece of the body at (x, y, cos, sin) to one solid: a lower bound.

    Exact where it is below `near`; at most 0 if they touch. Need not be exact above `enough`.
    """
    rounding = body.radius[b] + solids.plates[p, 4]
    gap = separation(body, b, x, y, c, s, solids, p, enough + rounding)
    if -math.inf < gap <= 0.0 or gap - rounding > min(near, enough):
        return gap - rounding
    return core_distance(body, b, x, y, c, s, solids, p) - rounding


@inlined_kernel
def field_bound(field, body, x, y, c, s):
    """Lower bound of the clearance from the distances stored at cell centres, by discs."""
    best = math.inf
    for d in range(body.discs.shape[0]):
        q_x, q_y = body.discs[d, 0], body.discs[d, 1]
        at_x = (x + c * q_x - s * q_y - field.origin_x) / field.cell
        at_y = (y + s * q_x + c * q_y - field.origin_y) / field.cell
        i, j = math.floor(at_x), math.floor(at_y)
        if 0 <= i < field.distance.shape[1] and 0 <= j < field.distance.shape[0]:
            e_x, e_y = at_x - i - 0.5, at_y - j - 0.5
            away = field.cell * math.sqrt(e_x * e_x + e_y * e_y)
            value = field.distance[int(j), int(i)] - away
        else:
            value = field.outside
        best = min(best, value - body.discs[d, 2])
    return best


@bare_inner_kernel
def near_gap(buckets, solids, body, x, y, c, s, near):
    """Gap to the solids near the body, exact below `near`; at most the buckets' reach."""
    m_x = x + c * body.middle_x - s * body.middle_y
    m_y = y + s * body.middle_x + c * body.middle_y
    best = buckets.reach
    i = math.floor((m_x - buckets.origin_x) / buckets.cell)
    j = math.floor((m_y - buckets.origin_y) / buckets.cell)
    if not (0 <= i < buckets.columns and 0 <= j < buckets.rows):
        return best
    k = j * buckets.columns + i
    for item in range(buckets.start[k], buckets.start[k + 1]):
        p = buckets.items[item]
        d_x = max(max(solids.plates[p, 0] - m_x, m_x - solids.plates[p, 2]), 0.0)
        d_y = max(max(solids.plates[p, 1] - m_y, m_y - solids.plates[p, 3]), 0.0)
        away = best + body.reach
        if d_x * d_x + d_y * d_y >= away * away:
            continue
        for b in range(body.first.shape[0] - 1):
            best = min(best, piece_gap(body, b, x, y, c, s, solids, p, near, best))
            if best <= 0.0:
                return best
    return best


@inlined_kernel
def still_gap(world, body, x, y, c, s):
    """Lower bound of the clearance to all that stands still, at most the field's reach."""
    near = NEAR * body.reach
    bound = field_bound(world.field, body, x, y, c, s)
    if bound <= near:
        exact = near_gap(world.buckets, world.solids, body, x, y, c, s, near)
        bound = exact if exact <= 0.0 else max(bound, exact)
    return bound
