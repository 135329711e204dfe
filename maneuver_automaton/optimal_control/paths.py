"""Paths of the corners of a moving body between nodes, in symbols."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from maneuver_automaton._arrays import Array
from maneuver_automaton.optimal_control.separation import BodyPart


class Paths(NamedTuple):
    """Control points of the paths of m corners: first all begins, all ends, then those between."""

    x: Any  # (4 m, n - 1)
    y: Any  # (4 m, n - 1)


class Frames(NamedTuple):
    """Where the vehicle is and how it moves, in symbols: at one node of each interval."""

    pose: Any  # (dof, n - 1)
    twist: Sequence[Any]  # dof rows (1, n - 1)
    reduced: Any  # (n_z, n - 1)
    reduced_rates: Any  # (n_z, n - 1)


def paths(
    casadi: Any, parts: Sequence[BodyPart], begin: Frames, end: Frames, *, step: Any
) -> list[Paths]:
    """Control points of every solid's corners in every interval, in symbols.

    Source: Farin (2002), *Curves and Surfaces for CAGD*, Sec. 7.5 (cubic Hermite interpolation in
    Bernstein form).

    Parameters
    ----------
    casadi : module
    parts : sequence of BodyPart
    begin, end : Frames
        At the begin and at the end of each interval, with the control of the interval.
    step : (1, n - 1) symbols
        Duration of each interval [s].
    """
    found = []
    for part in parts:
        for corners, _ in part.solids:
            x_0, y_0, v_0, w_0 = _corners(casadi, part, corners, begin)
            x_1, y_1, v_1, w_1 = _corners(casadi, part, corners, end)
            third = casadi.repmat(step / 3.0, len(corners), 1)
            x = casadi.vertcat(x_0, x_1, x_0 + third * v_0, x_1 - third * v_1)
            y = casadi.vertcat(y_0, y_1, y_0 + third * w_0, y_1 - third * w_1)
            found.append(Paths(x, y))
    return found


def _corners(casadi: Any, part: BodyPart, corners: Array, at: Frames) -> tuple[Any, ...]:
    """Places x, y and velocities (m, n - 1) of the corners of a part."""
    count = at.pose.shape[1]
    ones = casadi.SX.ones(1, count)
    along, aside = casadi.DM(corners[:, 0]), casadi.DM(corners[:, 1])
    if part.pose is None:
        x, y = along @ ones, aside @ ones
        v = w = casadi.SX.zeros(len(corners), count)
    else:
        place = part.pose(casadi.vertsplit(at.reduced))
        p_x, p_y, turn = (casadi.SX(value) * ones for value in place)
        every = casadi.SX.ones(len(corners), 1)
        x = every @ p_x + along @ casadi.cos(turn) - aside @ casadi.sin(turn)
        y = every @ p_y + along @ casadi.sin(turn) + aside @ casadi.cos(turn)
        v = casadi.jtimes(x, at.reduced, at.reduced_rates)
        w = casadi.jtimes(y, at.reduced, at.reduced_rates)
    ahead, sideways, turning = (
        casadi.repmat(casadi.SX(at.twist[k]) * ones, len(corners), 1) for k in range(3)
    )
    v, w = ahead - turning * y + v, sideways + turning * x + w
    cosine, sine, p_x, p_y = (
        casadi.repmat(row, len(corners), 1)
        for row in (casadi.cos(at.pose[2, :]), casadi.sin(at.pose[2, :]), at.pose[0, :],
                    at.pose[1, :])
    )  # fmt: skip
    return (
        p_x + cosine * x - sine * y,
        p_y + sine * x + cosine * y,
        cosine * v - sine * w,
        sine * v + cosine * w,
    )
