"""Which fixed horizon makes the closed loop stable.

The index of suboptimality says how much of the stage cost a horizon without terminal cost recovers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, as_number, freeze
from maneuver_automaton.analysis.growth import GrowthBound

POSITIVE = 1e-9  # an index up to this is rounding: where resting is best it is exactly zero


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CertifiedHorizon:
    """The least horizon whose suboptimality index is positive, as far as the growth bound holds.

    Resting alone gives the growth B(t) = t, and with it an index of zero for every horizon: the
    index is positive as soon as no pose in question is so bad that resting is best.

    With a finite library the bound holds down to some distance from the goal only, and so does the
    stability that follows: it is practical. Plans end nearer the goal than they begin, so the
    samples have to reach below the neighbourhood in question: where this was measured, down to a
    tenth of its cost per second was enough, down to its edge was not. A growth bound proves
    nothing between its samples.
    """

    horizon: float | None  # least of `horizons` with a positive index, None if there is none
    horizons: Array  # (n,) [s]
    indices: Array  # (n,) suboptimality index alpha of each
    growth: GrowthBound

    def __post_init__(self) -> None:
        freeze(self, "horizons")
        indices = np.array(self.indices, dtype=np.float64)  # -inf where nothing can be said
        indices.setflags(write=False)
        object.__setattr__(self, "indices", indices)

    def index_at(self, horizon: float) -> float:
        """Index of the longest of `horizons` that is at most `horizon`; -inf below all of them."""
        row = int(np.searchsorted(self.horizons, horizon * (1.0 + 1e-12), side="right")) - 1
        return float(self.indices[row]) if row >= 0 else -np.inf


def certified_horizon(growth: GrowthBound, *, step: float) -> CertifiedHorizon:
    """The least of the growth bound's times [s] with a positive index, `step` seconds being driven.

    Source: Reble, Allgöwer (2012); Worthmann et al. (2014); see `continuous_index`.

    Raises
    ------
    ValueError
        If no time of the growth bound is longer than the step.

    Examples
    --------
    >>> times = np.arange(1.0, 7.0)
    >>> growth = GrowthBound(
    ...     times=times, bounds=np.minimum(times, 2.0), worst=np.ones((6, 3)), samples=1
    ... )
    >>> certified_horizon(growth, step=1.0).horizon
    3.0
    """
    step = as_number("step", step)
    horizons = growth.times[growth.times > step]
    if not (step > 0.0 and horizons.size):
        raise ValueError(
            f"step: got {step} s, need a positive time below the last one of the growth bound, "
            f"{growth.times[-1]:.6g} s"
        )
    indices = np.array(
        [
            continuous_index(growth.times, growth.bounds, horizon=horizon, step=step)
            for horizon in horizons.tolist()
        ]
    )
    good = np.flatnonzero(indices > POSITIVE)
    return CertifiedHorizon(
        horizon=float(horizons[good[0]]) if good.size else None,
        horizons=horizons,
        indices=indices,
        growth=growth,
    )


def continuous_index(times: ArrayLike, growth: ArrayLike, *, horizon: float, step: float) -> float:
    """The index alpha in continuous time, for ``V_t(x) <= B(t) min_u l(x, u)``.

    ``alpha = 1 - a b / ((1 - a) (1 - b))`` with a, b the exponentials of minus the integral of
    1 / B over [step, horizon] and over [horizon - step, horizon]. Between two `times` B is taken
    at the later one, so the index errs to the safe side.

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
    if first >= 1.0 or last >= 1.0:
        return -math.inf
    return float(1.0 - first * last / ((1.0 - first) * (1.0 - last)))


def _integral(times: Array, growth: Array, low: float, high: float) -> float:
    """Integral of 1 / B, B a staircase that has its right value on each interval."""
    edges = np.concatenate([[0.0], times])
    overlap = np.minimum(edges[1:], high) - np.maximum(edges[:-1], low)
    return float(np.sum(np.maximum(overlap, 0.0) / growth))
