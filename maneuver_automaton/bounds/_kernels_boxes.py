"""Boxes of poses: those that collide in all their poses, and those that are free in all."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.bounds.arrays import PoseArrays

BLOCKED, UNKNOWN, FREE = 0, 1, 2  # states of a box


@bare_inner_kernel
def greatest_turned(along: float, across: float, c: float, s: float) -> float:
    """Upper bound of a component of a vector that turns by at most an angle to either side.

    `along` is the component, `across` the one at a right angle, `c` and `s` the cosine and the sine
    of the angle, which is at most a quarter turn. By ``along cos(a) + across sin(a)``.
    """
    return max(along, along * c) + abs(across) * s


@bare_inner_kernel
def least_turned(along: float, across: float, c: float, s: float) -> float:
    """Lower bound of the component, as in `greatest_turned`."""
    return min(along, along * c) - abs(across) * s


@bare_inner_kernel
def pair_state(
    scene: PoseArrays,
    part: int,
    piece: int,
    pose: tuple[float, float, float, float],
    half: tuple[float, float, float, float],
    give: float,
) -> int:
    """State of a box of poses for one convex part of the body and one convex obstacle.

    `pose` holds x, y, and the cosine and sine of the heading in the middle of the box; `half` its
    half sizes in x and y, and the cosine and sine of its half size in heading.

    At one heading the places that collide are a convex polygon, the obstacle less the body, whose
    sides have exactly the normals of the two. The box collides throughout if at every heading
    every place of it is inside of each side; one side that a box may cross leaves it unknown. It
    is free if all of it is outside of one side.
    """
    x, y, c, s = pose
    half_x, half_y, c_half, s_half = half
    b_0, b_1 = scene.body_first[part], scene.body_first[part + 1]
    o_0, o_1 = scene.first[piece], scene.first[piece + 1]
    apart = scene.body_loose[part] + scene.loose[piece] - give + scene.touching
    deep = give + scene.touching
    hits = b_1 - b_0 + o_1 - o_0 > 3  # a point and a point have no sides
    for k in range(o_0, o_1):  # sides of the obstacle: the body's nearest corner turns
        n_x, n_y, offset = scene.solids[k, 2], scene.solids[k, 3], scene.solids[k, 4]
        if n_x == 0.0 and n_y == 0.0:
            continue
        m_x, m_y = c * n_x + s * n_y, c * n_y - s * n_x  # the normal seen from the body
        most, least = math.inf, math.inf
        for v in range(b_0, b_1):
            v_x, v_y = scene.body[v, 0], scene.body[v, 1]
            along, across = m_x * v_x + m_y * v_y, m_x * v_y - m_y * v_x
            most = min(most, greatest_turned(along, across, c_half, s_half))
            least = min(least, least_turned(along, across, c_half, s_half))
        there = n_x * x + n_y * y - offset
        room = half_x * abs(n_x) + half_y * abs(n_y)
        if there + least - room > apart:
            return FREE
        if there + most + room > -deep:
            hits = False
    # The sides of the body turn, and with them the shift of the box seen along them.
    spread = math.hypot(half_x, half_y)
    for k in range(b_0, b_1):
        m_x, m_y, offset = scene.body[k, 2], scene.body[k, 3], scene.body[k, 4]
        if m_x == 0.0 and m_y == 0.0:
            continue
        n_x, n_y = c * m_x - s * m_y, s * m_x + c * m_y
        most, least = math.inf, math.inf
        for w in range(o_0, o_1):
            w_x, w_y = scene.solids[w, 0] - x, scene.solids[w, 1] - y
            along, across = n_x * w_x + n_y * w_y, n_x * w_y - n_y * w_x
            most = min(most, greatest_turned(along, across, c_half, s_half))
            least = min(least, least_turned(along, across, c_half, s_half))
        turned = half_x * abs(n_x) + half_y * abs(n_y)
        turned += s_half * (half_x * abs(n_y) + half_y * abs(n_x))
        room = min(turned, spread)
        if least - room - offset > apart:
            return FREE
        if most + room - offset > -deep:
            hits = False
    return BLOCKED if hits else UNKNOWN


@bare_inner_kernel
def is_near(scene: PoseArrays, piece: int, x: float, y: float, reach: float) -> bool:
    """Whether a place is within `reach` [m] of the rectangle around an obstacle."""
    d_x = max(max(scene.plates[piece, 0] - x, x - scene.plates[piece, 2]), 0.0)
    d_y = max(max(scene.plates[piece, 1] - y, y - scene.plates[piece, 3]), 0.0)
    return bool(d_x * d_x + d_y * d_y <= reach * reach)


@bare_inner_kernel
def bucket_at(scene: PoseArrays, x: float, y: float) -> int:
    """The bucket a place is in, -1 where there is none, and nothing near."""
    buckets = scene.buckets
    column = math.floor((x - buckets.origin_x) / buckets.cell)
    row = math.floor((y - buckets.origin_y) / buckets.cell)
    if column < 0 or row < 0 or column >= buckets.columns or row >= buckets.rows:
        return -1
    return int(row * buckets.columns + column)


@bare_inner_kernel
def limits_state(scene: PoseArrays, x: float, y: float, half_x: float, half_y: float) -> int:
    """State of a rectangle of places for the bounds of the problem."""
    state = FREE
    for k in range(scene.limits.shape[0]):
        n_x, n_y, offset = scene.limits[k, 0], scene.limits[k, 1], scene.limits[k, 2]
        there = n_x * x + n_y * y - offset
        room = half_x * abs(n_x) + half_y * abs(n_y)
        if there - room > scene.touching:
            return BLOCKED
        if there + room > -scene.touching:
            state = UNKNOWN
    return state


@bare_inner_kernel
def box_state(
    scene: PoseArrays,
    x: float,
    y: float,
    heading: float,
    half_x: float,
    half_y: float,
    half_turn: float,
    give: float,
) -> int:
    """0: every pose of a box collides or is out of bounds, 2: every pose is free, 1: not known.

    The box holds the places (x ± half_x, y ± half_y) with the headings (heading ± half_turn), of
    at most a quarter turn. Obstacles draw back by `give` [m], at least 0: what reaches no deeper
    into one than that does not collide.
    """
    state = limits_state(scene, x, y, half_x, half_y)
    if state == BLOCKED:
        return BLOCKED
    c, s = math.cos(heading), math.sin(heading)
    pose = (x, y, c, s)
    half = (half_x, half_y, math.cos(half_turn), math.sin(half_turn))
    m_x = x + c * scene.middle_x - s * scene.middle_y
    m_y = y + s * scene.middle_x + c * scene.middle_y
    far = math.hypot(scene.middle_x, scene.middle_y)
    moved = math.hypot(half_x, half_y) + 2.0 * math.sin(0.5 * half_turn) * (scene.reach + far)
    # Obstacles that are not in the bucket are further from the body than it moves in the box.
    near = moved + scene.margin + scene.touching < scene.buckets.reach
    bucket = bucket_at(scene, m_x, m_y) if near else 0
    if near and bucket < 0:
        return state
    first = scene.buckets.start[bucket] if near else 0
    last = scene.buckets.start[bucket + 1] if near else scene.plates.shape[0]
    reach = scene.reach + moved + scene.margin + scene.touching
    for n in range(first, last):
        piece = scene.buckets.items[n] if near else n
        if not is_near(scene, piece, m_x, m_y, reach):
            continue
        for part in range(scene.body_first.size - 1):
            one = pair_state(scene, part, piece, pose, half, give)
            if one == BLOCKED:
                return BLOCKED
            if one == UNKNOWN:
                state = UNKNOWN
    return state


@bare_kernel
def box_states(scene: PoseArrays, boxes: Array, give: float, states: NDArray[np.int8]) -> None:
    """Write the state of each box (n, 6): x, y, heading, and half sizes, as in `box_state`."""
    for k in range(boxes.shape[0]):
        x, y, heading = boxes[k, 0], boxes[k, 1], boxes[k, 2]
        half_x, half_y, half_turn = boxes[k, 3], boxes[k, 4], boxes[k, 5]
        states[k] = box_state(scene, x, y, heading, half_x, half_y, half_turn, give)
