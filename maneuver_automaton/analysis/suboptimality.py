"""The suboptimality index: how much of the stage cost a horizon without terminal cost recovers."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, as_number, as_whole


def discrete_index(growth: ArrayLike, *, applied: int = 1) -> float:
    """The index alpha of a horizon of N steps: ``V_N(x) - V_N(x+) >= alpha`` x the cost driven.

    `growth` holds the least numbers with ``V_k(x) <= growth[k - 1] min_u l(x, u)`` for k = 1 .. N;
    the first `applied` steps of a plan are driven. It may be negative, and is -inf where nothing
    can be said. A positive index makes the closed loop stable where the growth holds, at most
    1 / alpha times as costly as the best.

    Source: Grüne, Pannek, Seehafer, Worthmann (2010), *Analysis of unconstrained nonlinear MPC
    schemes with time varying control horizon*, Theorem 5.4.

    Parameters
    ----------
    growth : (N,) array_like
        Growth of the value over the horizon, in units of the least stage cost; rises.
    applied : int
        Steps driven before the next search, less than N.

    Raises
    ------
    ValueError
        If the growth is not positive and rising, or `applied` is not from 1 to N - 1.

    Examples
    --------
    >>> discrete_index([1.0, 2.0, 2.0])
    0.6666666666666667
    >>> discrete_index([1.0, 2.0])
    0.0
    """
    gamma = as_array("growth", growth)
    if gamma.ndim != 1 or not (gamma > 0.0).all() or (np.diff(gamma) < 0.0).any():
        raise ValueError(f"growth: got {gamma.tolist()}, need positive numbers that rise")
    applied = as_whole("applied", applied)
    if not 1 <= applied < gamma.size:
        raise ValueError(f"applied: got {applied}, need 1 to {gamma.size - 1} for this horizon")
    shares = np.maximum(gamma - 1.0, 0.0) / gamma  # below 1 it holds with 1 as well
    return _index(float(np.prod(shares[applied:])), float(np.prod(shares[gamma.size - applied :])))


def continuous_index(times: ArrayLike, growth: ArrayLike, *, horizon: float, step: float) -> float:
    """The index alpha in continuous time, for ``V_t(x) <= B(t) min_u l(x, u)``.

    ``alpha = 1 - a b / ((1 - a) (1 - b))`` with a, b the exponentials of minus the integral of
    1 / B over [step, horizon] and over [horizon - step, horizon]. It is the limit of
    `discrete_index` for growth B(i h) / h as h goes to zero, step / h steps being driven. Between
    two `times` B is taken at the later one, so the index errs to the safe side.

    Source: Reble, Allgöwer (2012), *Unconstrained model predictive control and suboptimality
    estimates for nonlinear continuous-time systems*; Worthmann, Reble, Grüne, Allgöwer (2014),
    *The role of sampling for stability and performance in unconstrained nonlinear model
    predictive control*.

    Parameters
    ----------
    times : (n,) array_like
        Rising times [s], the last one at least the horizon.
    growth : (n,) array_like
        B there [s]; rises.
    horizon, step : float
        Length of the horizon, and of what is driven before the next search [s].

    Raises
    ------
    ValueError
        If times or growth do not rise, or not ``0 < step < horizon <= times[-1]``.

    Examples
    --------
    >>> import math
    >>> index = continuous_index([1.0, 4.0], [1.0, 1.0], horizon=4.0, step=2.0)
    >>> math.isclose(index, 1.0 - 1.0 / (math.exp(2.0) - 1.0) ** 2)
    True
    """
    t, b = as_array("times", times), as_array("growth", growth)
    if t.ndim != 1 or t.shape != b.shape or (np.diff(t) <= 0.0).any() or not t[0] > 0.0:
        raise ValueError("times: need one axis of rising positive times, with one growth each")
    if not (b > 0.0).all() or (np.diff(b) < 0.0).any():
        raise ValueError(f"growth: got {b.tolist()}, need positive numbers that rise")
    horizon, step = as_number("horizon", horizon), as_number("step", step)
    if not 0.0 < step < horizon <= t[-1] * (1.0 + 1e-12):
        raise ValueError(
            f"horizon: got step {step} s and horizon {horizon} s, need 0 < step < horizon and a "
            f"horizon of at most {t[-1]:.6g} s"
        )
    first = math.exp(-_integral(t, b, step, horizon))
    last = math.exp(-_integral(t, b, horizon - step, horizon))
    return _index(first, last)


def _index(first: float, last: float) -> float:
    """``1 - a b / ((1 - a) (1 - b))``."""
    if first >= 1.0 or last >= 1.0:
        return -math.inf
    return float(1.0 - first * last / ((1.0 - first) * (1.0 - last)))


def _integral(times: Array, growth: Array, low: float, high: float) -> float:
    """Integral of 1 / B, B a staircase that has its right value on each interval."""
    edges = np.concatenate([[0.0], times])
    overlap = np.minimum(edges[1:], high) - np.maximum(edges[:-1], low)
    return float(np.sum(np.maximum(overlap, 0.0) / growth))
