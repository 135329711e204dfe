"""Which fixed horizon makes the closed loop stable, and whether a closed loop did as foretold.

The index of suboptimality says how much of the stage cost a horizon without terminal cost recovers.
"""

from __future__ import annotations

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
        freeze(self, "indices")

    def index_at(self, horizon: float) -> float:
        """Index of the longest of `horizons` that is at most `horizon`; -inf below all of them."""
        row = int(np.searchsorted(self.horizons, horizon * (1.0 + 1e-12), side="right")) - 1
        return float(self.indices[row]) if row >= 0 else -np.inf


def certified_horizon(growth: GrowthBound, *, step: float) -> CertifiedHorizon:
    """The least of the growth bound's times [s] with a positive index, `step` seconds being driven.

    With ``V_t(x) <= B(t) min_u l(x, u)`` the index is ``alpha = 1 - a b / ((1 - a) (1 - b))``, a
    and b the exponentials of minus the integral of 1 / B over [step, horizon] and over
    [horizon - step, horizon]. Between two times B is taken at the later one, so the index errs to
    the safe side.

    Source: Reble, Allgöwer (2012), *Unconstrained model predictive control and suboptimality
    estimates for nonlinear continuous-time systems*; Worthmann, Reble, Grüne, Allgöwer (2014),
    *The role of sampling for stability and performance in unconstrained nonlinear model
    predictive control*.

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
    ends = np.concatenate([[0.0], growth.times])
    integral = np.concatenate([[0.0], np.cumsum(np.diff(ends) / growth.bounds)])  # of 1 / B
    whole, begin, end = (
        np.interp(times, ends, integral) for times in (horizons, step, horizons - step)
    )
    first, last = np.exp(begin - whole), np.exp(end - whole)
    indices = 1.0 - first * last / ((1.0 - first) * (1.0 - last))
    good = np.flatnonzero(indices > POSITIVE)
    return CertifiedHorizon(
        horizon=float(horizons[good[0]]) if good.size else None,
        horizons=horizons,
        indices=indices,
        growth=growth,
    )


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
