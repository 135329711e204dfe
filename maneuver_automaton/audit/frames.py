"""The motion of a frame, as a series over every element, with bounds on how fast it moves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leg2poly, leggauss, legvander

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import by_value


@by_value
class FrameMotion(NamedTuple):
    """Poses (x, y, heading(, altitude)) over time, exact at the nodes and between them.

    What it does at most holds at every instant of an element, not only at the nodes: the terms of
    a Legendre series are at most 1, and their slopes at most k (k + 1) per element.
    """

    times: Array  # (e + 1,) [s] when elements begin, and the end
    series: Array  # (e, n, dof) Legendre series over the share of an element
    nodes: Array  # (e, N, dof) poses at the nodes
    speed: Array  # (e,) [m/s] of the origin at most
    turn: Array  # (e,) [rad/s] at most
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


def placed(frames: Array, seen: Array) -> Array:
    """Poses (..., dof) that are `seen` (..., 3 or more) from frames (..., dof), in the world."""
    cosine, sine = np.cos(frames[..., 2]), np.sin(frames[..., 2])
    x, y = seen[..., 0], seen[..., 1]
    planar = [cosine * x - sine * y, sine * x + cosine * y, seen[..., 2]]
    higher = [seen[..., k] if k < seen.shape[-1] else 0.0 * x for k in range(3, frames.shape[-1])]
    return np.asarray(frames + np.stack(np.broadcast_arrays(*planar, *higher), axis=-1))


N = 12  # nodes: over a radian, a cosine is exact to rounding between them too

_points, _weights = leggauss(N)
_values = legvander(_points, N - 1)  # (node, degree)
_degrees = np.arange(N)

NODES: Array = 0.5 * (1.0 + _points)  # (N,) shares of an element
SERIES: Array = ((2 * _degrees + 1) * _values * (0.5 * _weights)[:, None]).T  # values to series
SLOPES: Array = _degrees * (_degrees + 1.0)  # (N,) greatest slope of each term, per element


_halves = 0.5 / (2 * _degrees + 1)  # series of the integrals from 0 of the terms of a series
_integrals = np.eye(N + 1, N, -1) * _halves - np.eye(N + 1, N, 1) * _halves
_integrals[0, 0] = 0.5
INTEGRAL: Array = _integrals @ SERIES  # values at nodes to the series of their integral
TO_NODES: Array = legvander(_points, N) @ INTEGRAL  # (N, N) to the integral up to each node
TO_END: Array = INTEGRAL.sum(axis=0)  # (N,) to the integral over the element


def _slopes() -> Array:
    """Values at the nodes to the slopes there, per element: (N, N)."""
    slopes = np.zeros((N, N))
    for k in range(1, N):  # P_k' = sum of (2 j + 1) P_j over j = k - 1, k - 3, ...
        for j in range(k - 1, -1, -2):
            slopes[:, k] += 2.0 * (2 * j + 1) * _values[:, j]
    return slopes @ SERIES


SLOPE: Array = _slopes()


class Collocation(NamedTuple):
    """What the kernels take of these."""

    integral: Array
    to_nodes: Array
    series: Array
    slopes: Array


RULES = Collocation(INTEGRAL, TO_NODES, np.ascontiguousarray(SERIES), SLOPES)

# Terms as sums of powers: those of high degree, whose factors are large, are tiny where it counts.
_POWERS: Array = np.array([np.pad(leg2poly([0.0] * k + [1.0]), (0, N - k)) for k in range(N + 1)])


def values_at(series: Array, shares: Array) -> Array:
    """Values (m, d) of series (m, n, d) at shares (m,) of their elements."""
    n = series.shape[1]
    powers = np.empty((n, shares.size))
    powers[0], powers[1:] = 1.0, 2.0 * shares - 1.0
    np.multiply.accumulate(powers, axis=0, out=powers)
    terms = _POWERS[:n, :n] @ powers
    return np.asarray(np.matmul(terms.T[:, None, :], series)[:, 0])
