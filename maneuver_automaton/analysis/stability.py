"""Which fixed horizon makes the closed loop stable, and whether a closed loop did as foretold.

The index of suboptimality says how much of the stage cost a horizon without terminal cost recovers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, as_number, as_whole, freeze
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
    tenth of its cost per second was enough, down to its edge was not. A growth bound that is
    `sampled` proves nothing between its samples.
    """

    horizon: float | None  # least of `horizons` with a positive index, None if there is none
    horizons: Array  # (n,) in seconds, or in intervals for `certified_intervals`
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
    return _certified(
        growth,
        horizons,
        [
            continuous_index(growth.times, growth.bounds, horizon=horizon, step=step)
            for horizon in horizons.tolist()
        ],
    )


def certified_intervals(growth: GrowthBound, *, applied: int = 1) -> CertifiedHorizon:
    """The least number of intervals with a positive index, of a growth bound counted in intervals.

    Source: Grüne, Pannek, Seehafer, Worthmann (2010); see `discrete_index`.

    Raises
    ------
    ValueError
        If the times of the growth bound are not 1, 2, ..., N, with N above `applied`.

    Examples
    --------
    >>> growth = GrowthBound(
    ...     times=[1, 2, 3], bounds=[1.0, 2.0, 2.0], worst=np.ones((3, 3)), samples=1
    ... )
    >>> certified_intervals(growth).horizon
    3.0
    """
    count, applied = growth.times.size, as_whole("applied", applied)
    if not np.array_equal(growth.times, np.arange(1, count + 1)) or not 1 <= applied < count:
        raise ValueError(
            f"growth bound: got times {growth.times.tolist()} for {applied} applied intervals, "
            "need 1, 2, ..., N with N above that"
        )
    lengths = np.arange(applied + 1, count + 1)
    indices = [discrete_index(growth.bounds[:n], applied=applied) for n in lengths.tolist()]
    return _certified(growth, lengths.astype(np.float64), indices)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedLoopCheck:
    """Whether a closed loop kept the promise of an index."""

    index: float
    steps: int
    least_decrease: float  # of the value per cost driven, in any step
    cost: float  # driven in all
    limit: float  # the promise: first value / index; inf if that is not positive

    @property
    def holds(self) -> bool:
        """Whether every step decreased enough, and with that the cost is below its limit."""
        return self.least_decrease >= self.index and self.cost <= self.limit * (1.0 + 1e-12)


def check_closed_loop(
    values: ArrayLike, stage_costs: ArrayLike, *, index: float
) -> ClosedLoopCheck:
    """Compare values (k + 1,) and costs driven (k,) of a closed loop with what `index` promises.

    The promise is a decrease of ``index`` x the cost driven in every step, and so a total cost of
    at most the first value / index. Give only the steps made where the growth bound holds.

    Raises
    ------
    ValueError
        If there is no step, the numbers do not fit together, or a cost is not positive.

    Examples
    --------
    >>> check = check_closed_loop([3.0, 2.0, 1.2], [1.0, 1.0], index=0.5)
    >>> check.holds, round(check.least_decrease, 3), check.limit
    (True, 0.8, 6.0)
    """
    v, driven = as_array("values", values), as_array("stage_costs", stage_costs)
    if driven.ndim != 1 or not driven.size or v.shape != (driven.size + 1,):
        raise ValueError(
            f"values: got shape {v.shape} for costs of shape {driven.shape}, need one more"
        )
    if not (driven > 0.0).all():
        raise ValueError(f"stage_costs: got {driven.min()}, need positive costs")
    return ClosedLoopCheck(
        index=index,
        steps=driven.size,
        least_decrease=float(np.min((v[:-1] - v[1:]) / driven)),
        cost=float(driven.sum()),
        limit=float(v[0] / index) if index > 0.0 else np.inf,
    )


def _certified(growth: GrowthBound, horizons: Array, indices: list[float]) -> CertifiedHorizon:
    good = np.flatnonzero(np.array(indices) > POSITIVE)
    return CertifiedHorizon(
        horizon=float(horizons[good[0]]) if good.size else None,
        horizons=horizons,
        indices=np.array(indices),
        growth=growth,
    )


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
