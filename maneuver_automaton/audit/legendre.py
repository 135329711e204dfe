"""Gauss-Legendre collocation on [0, 1]: nodes, and what is read off the values at the nodes.

Source: Hairer, Lubich, Wanner (2006), *Geometric Numerical Integration*, Sec. II.1.3.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.legendre import leg2poly, leggauss, legvander

from maneuver_automaton._arrays import Array

N = 12  # nodes: over a radian, a cosine is exact to rounding between them too

_points, _weights = leggauss(N)
_values = legvander(_points, N - 1)  # (node, degree)
_degrees = np.arange(N)
_unit = [np.eye(N + 1)[k, : k + 1] for k in range(N + 1)]

NODES: Array = 0.5 * (1.0 + _points)  # (N,) shares of an element
SERIES: Array = ((2 * _degrees + 1) * _values * (0.5 * _weights)[:, None]).T  # values to series
SLOPES: Array = _degrees * (_degrees + 1.0)  # (N,) greatest slope of each term, per element


def _integrals() -> Array:
    """Series (N + 1, N) of the integrals from 0 of the terms of a series."""
    rows = np.zeros((N + 1, N))
    rows[:2, 0] = 0.5
    for k in range(1, N):
        rows[k + 1, k], rows[k - 1, k] = 0.5 / (2 * k + 1), -0.5 / (2 * k + 1)
    return rows


INTEGRAL: Array = _integrals() @ SERIES  # values at nodes to the series of their integral
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

# Terms as sums of powers: those of high degree, whose factors are large, are tiny where it counts.
_POWERS: Array = np.array([np.pad(leg2poly(row), (0, N - k)) for k, row in enumerate(_unit)])


def values_at(series: Array, shares: Array) -> Array:
    """Values (m, d) of series (m, n, d) at shares (m,) of their elements.

    Examples
    --------
    >>> line = np.array([[[1.0], [2.0]]])  # 1 + 2 (2 s - 1)
    >>> values_at(line, np.array([0.75])).tolist()
    [[2.0]]
    """
    n = series.shape[1]
    powers = np.empty((n, shares.size))
    powers[0], powers[1:] = 1.0, 2.0 * shares - 1.0
    np.multiply.accumulate(powers, axis=0, out=powers)
    terms = _POWERS[:n, :n] @ powers
    return np.asarray(np.matmul(terms.T[:, None, :], series)[:, 0])
