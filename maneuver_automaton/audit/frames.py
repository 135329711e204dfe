"""The motion of a frame, as a series over every element, with bounds on how fast it moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit.legendre import (
    INTEGRAL,
    SERIES,
    SLOPE,
    SLOPES,
    TO_END,
    TO_NODES,
    values_at,
)


class Spans(NamedTuple):
    """Stretches of time, in order, each within an element."""

    element: IntArray  # (m,)
    begin: Array  # (m,) share of the element
    end: Array  # (m,)

    def of(self, rows: Any) -> Spans:
        """Some of them, by number, slice or truth."""
        return Spans(self.element[rows], self.begin[rows], self.end[rows])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Frames:
    """Poses (x, y, heading(, altitude)) over time, exact at the nodes and between them.

    What it does at most holds at every instant of an element, not only at the nodes: the terms of
    a Legendre series are at most 1, and their slopes at most k (k + 1) per element.
    """

    times: Array  # (e + 1,) [s] when elements begin, and the end
    series: Array  # (e, n, dof) Legendre series over the share of an element
    nodes: Array  # (e, N, dof) poses at the nodes
    speed: Array  # (e,) [m/s] of the origin at most
    turn: Array  # (e,) [rad/s]
    bend: Array  # (e,) [m/s^2] how fast the velocity changes
    swerve: Array  # (e,) [1/s^2] what is added for each metre from the origin
    rise: Array  # (e,) [m/s^2] how fast the climb rate changes
    error: Array  # (e,) [m, rad] of one element, as far as its last terms show
    length: float  # [m] of the path at most

    def at(self, elements: IntArray, shares: Array) -> Array:
        """Poses (m, dof) at shares of elements, (m,) each."""
        return values_at(self.series[elements], shares)

    def times_at(self, elements: IntArray, shares: Array) -> Array:
        """Times (m,) [s] at shares of elements, (m,) each."""
        begins = self.times[elements]
        return np.asarray(begins + shares * (self.times[elements + 1] - begins))

    def doubt(self) -> float:
        """How far [m, rad] a pose may be off at most: errors add up, and headings have levers."""
        return float(self.error.sum()) * (1.0 + self.length)


def frames_along(start: Array, twists: Array, lengths: Array) -> Frames:
    """From a pose (dof,), under twists (e, N, dof) at the nodes of elements of lengths (e,) [s].

    The heading is the integral of the turn rate, the place that of the velocity seen with it.
    """
    h = lengths[:, None]
    heading = start[2] + _before(h[:, 0] * (twists[..., 2] @ TO_END))[:-1, None]
    heading = heading + h * (twists[..., 2] @ TO_NODES.T)
    cosine, sine = np.cos(heading), np.sin(heading)
    rates = twists.copy()
    rates[..., 0] = cosine * twists[..., 0] - sine * twists[..., 1]
    rates[..., 1] = sine * twists[..., 0] + cosine * twists[..., 1]
    series = h[..., None] * (INTEGRAL @ rates)
    begins = start + _before(series.sum(axis=1))
    series[:, 0] += begins[:-1]
    nodes = begins[:-1, None] + h[..., None] * (TO_NODES @ rates)
    last = np.abs(SERIES[-2:] @ rates).max(axis=(1, 2)) * lengths
    return _bounded(lengths, series, nodes, twists, last)


def frames_through(poses: Array, like: Frames) -> Frames:
    """Of what is at poses (e, N, dof) at the nodes of the elements of other frames."""
    poses[..., 2] = np.unwrap(poses[..., 2], axis=1)
    series = SERIES @ poses
    lengths = np.diff(like.times)
    rates = SLOPE @ poses / lengths[:, None, None]
    cosine, sine = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    twists = rates.copy()
    twists[..., 0] = cosine * rates[..., 0] + sine * rates[..., 1]
    twists[..., 1] = cosine * rates[..., 1] - sine * rates[..., 0]
    last = like.error + np.abs(series[:, -2:]).max(axis=(1, 2))
    return _bounded(lengths, series, poses, twists, last)


def _bounded(lengths: Array, series: Array, nodes: Array, twists: Array, error: Array) -> Frames:
    terms = np.abs(SERIES @ twists)  # (e, N, dof)
    most = terms.sum(axis=1)
    change = SLOPES @ terms / lengths[:, None]
    speed, turn = np.hypot(most[:, 0], most[:, 1]), most[:, 2]
    return Frames(
        times=_before(lengths),
        series=series,
        nodes=nodes,
        speed=speed,
        turn=turn,
        bend=np.hypot(change[:, 0], change[:, 1]) + turn * speed,
        swerve=change[:, 2] + turn * turn,
        rise=change[:, 3:].sum(axis=1),
        error=error,
        length=float(speed @ lengths),
    )


def _before(steps: Array) -> Array:
    """Sums (n + 1, ...) of the steps before each, and of all."""
    sums = np.zeros((len(steps) + 1, *steps.shape[1:]))
    np.cumsum(steps, axis=0, out=sums[1:])
    return sums
