"""Planar group formulas that several kernels need, on plain numbers."""

from __future__ import annotations

import math

from maneuver_automaton._compile import inner_kernel


@inner_kernel
def coast(v_x: float, v_y: float, turn_rate: float, duration: float) -> tuple[float, float, float]:
    """Pose (x, y, heading) reached from the identity by a constant twist.

    Source: Solà, Deray, Atchuthan (2018), Eqs. (156), (158), in half-angle form.
    """
    turn = turn_rate * duration
    # The chord of the arc, in half the angle: no digit is lost near zero, where the difference ``1
    # - cos(turn)`` would lose all of them, and no series is needed.
    half = 0.5 * turn
    scale = duration if half == 0.0 else duration * (math.sin(half) / half)
    ahead = scale * math.cos(half)
    aside = scale * math.sin(half)
    return ahead * v_x - aside * v_y, aside * v_x + ahead * v_y, turn


@inner_kernel
def compose(
    x: float, y: float, heading: float, dx: float, dy: float, turn: float
) -> tuple[float, float, float]:
    """Do the motion (dx, dy, turn) in the frame of (x, y, heading)."""
    c, s = math.cos(heading), math.sin(heading)
    return x + c * dx - s * dy, y + s * dx + c * dy, heading + turn


@inner_kernel
def back_from(
    x: float, y: float, heading: float, d_x: float, d_y: float, turn: float
) -> tuple[float, float, float]:
    """Pose from which the motion (d_x, d_y, turn) leads to (x, y, heading)."""
    before = heading - turn
    c, s = math.cos(before), math.sin(before)
    return x - c * d_x + s * d_y, y - s * d_x - c * d_y, before


@inner_kernel
def nearest_turn(angle: float) -> float:
    """Angle modulo a full turn, in [-pi, pi]."""
    return angle - 2.0 * math.pi * round(angle / (2.0 * math.pi))
