"""Functions on [0, 1] as Legendre series through their values at Gauss points."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre

from maneuver_automaton._arrays import Array

N_NODES = 16


def _integrals(shares: Array) -> Array:
    """Integrals (k, N_NODES) of the Legendre polynomials from 0 to k shares of [0, 1].

    Source: (2 k + 1) P_k = P'_{k+1} - P'_{k-1}, for k = 0 with the constant P_{-1} = -1.
    """
    x = 2.0 * shares - 1.0
    values = legendre.legvander(x, N_NODES)
    before = np.concatenate([-np.ones((*x.shape, 1)), values[..., :-2]], axis=-1)
    return np.asarray(0.5 * (values[..., 1:] - before) / (2.0 * np.arange(N_NODES) + 1.0))


def _tables() -> tuple[Array, Array, Array, Array]:
    x, weights = legendre.leggauss(N_NODES)
    orders = 2.0 * np.arange(N_NODES) + 1.0
    series = 0.5 * orders[:, None] * (legendre.legvander(x, N_NODES - 1) * weights[:, None]).T
    nodes = 0.5 * (x + 1.0)
    return nodes, 0.5 * weights, series, _integrals(nodes) @ series


NODES, WEIGHTS, SERIES, INTEGRALS = _tables()
"""Gauss points (n,) and weights (n,) of [0, 1]; matrices (n, n) from values at the points to the
coefficients of the series, and to its integrals from 0 to each point."""


def integrals_to(shares: Array) -> Array:
    """Matrix (k, n) that takes coefficients of a series to its integrals from 0 to k shares.

    Examples
    --------
    >>> squares = NODES**2
    >>> bool(abs(integrals_to(np.array([0.5]))[0] @ SERIES @ squares - 0.125 / 3) < 1e-15)
    True
    """
    return _integrals(shares)
