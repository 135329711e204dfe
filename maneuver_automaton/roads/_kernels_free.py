"""Proof that a motion on the road is free, tick by tick, and the motion itself.

Within one tick every body is taken to move on straight lines from where it is at its beginning to
where it is at its end. Recorded traffic does; the vehicle leaves that line by at most an eighth of
its acceleration times the square of the tick (9 m/s^2 and 0.1 s: 12 mm), and turning corners leave
theirs by millimetres. The margins are larger than that. Two bodies that one fixed direction
separates at both ends of a straight motion are apart all the way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from maneuver_automaton._compile import inner_kernel, kernel

STEPS = 2  # of the quadrature in one tick
HALVINGS = 2  # how often a tick is cut in two before it counts as hit


class BodyArrays(NamedTuple):
    """The vehicle: a rectangle, and discs along its axis that cover it."""

    half_length: float  # [m]
    half_width: float  # [m]
    ahead: float  # [m] from the rear axle to the middle
    reach: float  # [m] half the diagonal
    discs: np.ndarray  # (n,) [m] from the rear axle
    radius: float  # [m] of the discs
    wheelbase: float  # [m]
    max_steering_rate: float  # [rad/s]
    braking: float  # [m/s^2] when it has to stop


class AreaArrays(NamedTuple):
    """Where one may drive: distances to the edge inside, and the edge near every place."""

    tile: np.ndarray  # (rows, columns) which tile is at a place, -1 where nothing is drivable
    distance: np.ndarray  # (tiles, n + 1, n + 1) [m] at the corners of a tile's cells; zero outside
    bits: int  # a tile has 2 ** bits cells along each side, so that shifts find its number
    cell: float  # [m]
    origin_x: float  # of the first tile
    origin_y: float
    edges: np.ndarray  # (K, 4) segments of the edge
    first: np.ndarray  # (tiles + 1,) where the segments of each tile begin in `items`
    items: np.ndarray  # segments near each tile
    margin: float  # [m] kept from the edge


class TrafficArrays(NamedTuple):
    """Everybody else, at the ticks of the scene's clock."""

    pose: np.ndarray  # (M, T, 3) of the middle of a rectangle around each
    first: np.ndarray  # (M,) first and last tick at which it is there
    last: np.ndarray
    half: np.ndarray  # (M, 2) half length and half width [m]
    reach: np.ndarray  # (M,) half the diagonal [m]
    margin: float  # [m] kept from everybody


class Clearing(NamedTuple):
    """All that a motion has to stay clear of, and the body that moves."""

    body: BodyArrays
    area: AreaArrays
    traffic: TrafficArrays
    tick: float  # [s]


@inner_kernel
def one_tick(wheelbase, tick, x, y, heading, speed, steering, acceleration, rate):
    """State (x, y, heading, speed, steering) a tick later, under constant controls.

    The heading is a quadrature of the turn rate and the position one of the heading, both by
    Simpson's rule and its half; the model is that of `SecondOrderCar`.
    """
    h = tick / STEPS
    for _ in range(STEPS):
        v_m, d_m = speed + 0.5 * h * acceleration, steering + 0.5 * h * rate
        v_e, d_e = speed + h * acceleration, steering + h * rate
        w_0 = speed * math.tan(steering) / wheelbase
        w_m = v_m * math.tan(d_m) / wheelbase
        w_e = v_e * math.tan(d_e) / wheelbase
        turn = h * (w_0 + 4.0 * w_m + w_e) / 6.0
        half = h * (5.0 * w_0 + 8.0 * w_m - w_e) / 24.0
        middle, end = heading + half, heading + turn
        x += (
            h
            * (speed * math.cos(heading) + 4.0 * v_m * math.cos(middle) + v_e * math.cos(end))
            / 6.0
        )
        y += (
            h
            * (speed * math.sin(heading) + 4.0 * v_m * math.sin(middle) + v_e * math.sin(end))
            / 6.0
        )
        heading, speed, steering = end, v_e, d_e
    return x, y, heading, speed, steering


@inner_kernel
def room(area, x, y):
    """Distance to the edge of the area at a place: bilinear between the corners of its cell."""
    u, v = (x - area.origin_x) / area.cell, (y - area.origin_y) / area.cell
    i, j = math.floor(u), math.floor(v)
    column, row = i >> area.bits, j >> area.bits
    if column < 0 or row < 0 or column >= area.tile.shape[1] or row >= area.tile.shape[0]:
        return 0.0
    place = area.tile[row, column]
    if place < 0:
        return 0.0
    a, b = u - i, v - j
    # Neighbouring tiles share their border, so that all four corners are in one of them.
    mask = (1 << area.bits) - 1
    i, j = i & mask, j & mask
    low = (1.0 - a) * area.distance[place, j, i] + a * area.distance[place, j, i + 1]
    high = (1.0 - a) * area.distance[place, j + 1, i] + a * area.distance[place, j + 1, i + 1]
    return (1.0 - b) * low + b * high


@inner_kernel
def well_inside(body, area, x, y, heading):
    """Whether the discs that cover the body are all inside the area: quick, and enough."""
    c, s = math.cos(heading), math.sin(heading)
    for k in range(body.discs.shape[0]):
        if room(area, x + body.discs[k] * c, y + body.discs[k] * s) < body.radius + area.margin:
            return False
    return True


@inner_kernel
def extent(half_length, half_width, turn):
    """Half the width of a rectangle's shadow on an axis that is `turn` from its length."""
    return half_length * abs(math.cos(turn)) + half_width * abs(math.sin(turn))


@inner_kernel
def edge_apart(body, x_0, y_0, h_0, x_1, y_1, h_1, edge, margin):
    """Whether one direction separates the body from a segment at both ends of a motion."""
    middle = 0.5 * (h_0 + h_1)
    along = math.atan2(edge[3] - edge[1], edge[2] - edge[0])
    for k in range(3):
        axis = along + 0.5 * math.pi if k == 0 else (middle if k == 1 else middle + 0.5 * math.pi)
        a_x, a_y = math.cos(axis), math.sin(axis)
        p, q = edge[0] * a_x + edge[1] * a_y, edge[2] * a_x + edge[3] * a_y
        low, high = min(p, q), max(p, q)
        b_0, b_1 = x_0 * a_x + y_0 * a_y, x_1 * a_x + y_1 * a_y
        r_0 = extent(body.half_length, body.half_width, h_0 - axis) + margin
        r_1 = extent(body.half_length, body.half_width, h_1 - axis) + margin
        if (b_0 + r_0 < low and b_1 + r_1 < low) or (b_0 - r_0 > high and b_1 - r_1 > high):
            return True
    return False


@inner_kernel
def within_edges(body, area, x_0, y_0, h_0, x_1, y_1, h_1):
    """Whether the body crosses no edge of the area on the way from one pose to the next.

    Poses are those of the middle.
    """
    m_x, m_y = 0.5 * (x_0 + x_1), 0.5 * (y_0 + y_1)
    if room(area, x_1, y_1) <= 0.0:
        return False
    i = math.floor((m_x - area.origin_x) / area.cell) >> area.bits
    j = math.floor((m_y - area.origin_y) / area.cell) >> area.bits
    if i < 0 or j < 0 or i >= area.tile.shape[1] or j >= area.tile.shape[0]:
        return False
    place = area.tile[j, i]
    if place < 0:  # the middle is off the road between two ticks
        return False
    near = body.reach + area.margin + 0.5 * math.hypot(x_1 - x_0, y_1 - y_0)
    for k in range(area.first[place], area.first[place + 1]):
        edge = area.edges[area.items[k]]
        d_x, d_y = edge[2] - edge[0], edge[3] - edge[1]
        square = d_x * d_x + d_y * d_y
        t = ((m_x - edge[0]) * d_x + (m_y - edge[1]) * d_y) / square
        t = min(max(t, 0.0), 1.0)
        if math.hypot(m_x - edge[0] - t * d_x, m_y - edge[1] - t * d_y) > near:
            continue
        if not edge_apart(body, x_0, y_0, h_0, x_1, y_1, h_1, edge, area.margin):
            return False
    return True


@inner_kernel
def axis_apart(body, x_0, y_0, h_0, x_1, y_1, h_1, p_0, p_1, half, margin):
    """Whether one direction separates two rectangles at both ends of their motions."""
    mine, theirs = 0.5 * (h_0 + h_1), 0.5 * (p_0[2] + p_1[2])
    for k in range(4):
        axis = (mine if k < 2 else theirs) + (k % 2) * 0.5 * math.pi
        a_x, a_y = math.cos(axis), math.sin(axis)
        d_0 = (p_0[0] - x_0) * a_x + (p_0[1] - y_0) * a_y
        d_1 = (p_1[0] - x_1) * a_x + (p_1[1] - y_1) * a_y
        r_0 = extent(body.half_length, body.half_width, h_0 - axis)
        r_0 += extent(half[0], half[1], p_0[2] - axis) + margin
        r_1 = extent(body.half_length, body.half_width, h_1 - axis)
        r_1 += extent(half[0], half[1], p_1[2] - axis) + margin
        if (d_0 > r_0 and d_1 > r_1) or (d_0 < -r_0 and d_1 < -r_1):
            return True
    return False


@inner_kernel
def user_apart(body, x_0, y_0, h_0, x_1, y_1, h_1, p_0, p_1, half, margin):
    """`axis_apart`, cut in two and again where no direction separates the whole tick."""
    parts = 1
    for _ in range(HALVINGS + 1):
        clear = True
        for k in range(parts):
            a, b = k / parts, (k + 1) / parts
            q_0, q_1 = p_0 + a * (p_1 - p_0), p_0 + b * (p_1 - p_0)
            if not axis_apart(
                body,
                x_0 + a * (x_1 - x_0),
                y_0 + a * (y_1 - y_0),
                h_0 + a * (h_1 - h_0),
                x_0 + b * (x_1 - x_0),
                y_0 + b * (y_1 - y_0),
                h_0 + b * (h_1 - h_0),
                q_0,
                q_1,
                half,
                margin,
            ):
                clear = False
                break
        if clear:
            return True
        parts *= 2
    return False


@inner_kernel
def clear_of_traffic(body, traffic, x_0, y_0, h_0, x_1, y_1, h_1, tick):
    """Whether the body meets nobody from `tick` to the next one; poses are those of the middle."""
    last = traffic.pose.shape[1] - 1
    for m in range(traffic.first.shape[0]):
        if tick + 1 < traffic.first[m] or tick > traffic.last[m]:
            continue
        p_0 = traffic.pose[m, min(max(tick, 0), last)]
        p_1 = traffic.pose[m, min(max(tick + 1, 0), last)]
        d_x, d_y = 0.5 * (p_0[0] - x_0 + p_1[0] - x_1), 0.5 * (p_0[1] - y_0 + p_1[1] - y_1)
        swing = 0.5 * math.hypot(p_1[0] - x_1 - p_0[0] + x_0, p_1[1] - y_1 - p_0[1] + y_0)
        if math.hypot(d_x, d_y) - swing > body.reach + traffic.reach[m] + traffic.margin:
            continue
        if not user_apart(
            body, x_0, y_0, h_0, x_1, y_1, h_1, p_0, p_1, traffic.half[m], traffic.margin
        ):
            return False
    return True


@inner_kernel
def free_tick(clearing, x_0, y_0, h_0, x_1, y_1, h_1, tick):
    """Whether the motion between two poses of the rear axle, from `tick` to the next, is free."""
    body = clearing.body
    m_0x, m_0y = x_0 + body.ahead * math.cos(h_0), y_0 + body.ahead * math.sin(h_0)
    m_1x, m_1y = x_1 + body.ahead * math.cos(h_1), y_1 + body.ahead * math.sin(h_1)
    if not clear_of_traffic(body, clearing.traffic, m_0x, m_0y, h_0, m_1x, m_1y, h_1, tick):
        return False
    area = clearing.area
    if well_inside(body, area, x_1, y_1, h_1) and well_inside(body, area, x_0, y_0, h_0):
        return True
    return within_edges(body, area, m_0x, m_0y, h_0, m_1x, m_1y, h_1)


@kernel
def driven(wheelbase, tick, state, controls):
    """States (n + 1, 5) at the ticks under controls (n, 2), from a state (5,)."""
    states = np.empty((controls.shape[0] + 1, 5))
    states[0] = state
    for k in range(controls.shape[0]):
        x, y, heading, speed, steering = one_tick(
            wheelbase,
            tick,
            states[k, 0],
            states[k, 1],
            states[k, 2],
            states[k, 3],
            states[k, 4],
            controls[k, 0],
            controls[k, 1],
        )
        states[k + 1, 0], states[k + 1, 1], states[k + 1, 2] = x, y, heading
        states[k + 1, 3], states[k + 1, 4] = speed, steering
    return states


@kernel
def free_ticks(clearing, states, tick):
    """How many ticks of a motion with states (n + 1, 5) at ticks from `tick` on are free."""
    for k in range(states.shape[0] - 1):
        if not free_tick(
            clearing,
            states[k, 0],
            states[k, 1],
            states[k, 2],
            states[k + 1, 0],
            states[k + 1, 1],
            states[k + 1, 2],
            tick + k,
        ):
            return k
    return states.shape[0] - 1
