"""The best coasting times of a fixed word."""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, freeze

RESTARTS = 12  # further starts where the first one fails


class TimesStatus(enum.Enum):
    """How good the times are."""

    OPTIMAL = "optimal"  # first-order conditions hold
    FEASIBLE = "feasible"  # the goal is met, optimality was not reached
    FAILED = "failed"  # no start led to the goal


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SwitchingTimes:
    """Coasting times of a word with their multipliers."""

    status: TimesStatus
    durations: Array  # (n,) [s]; zero where a trim had better not be used
    cost: float
    multipliers: Array  # (3 + m,) prices of x, y, heading and of each linear condition

    def __post_init__(self) -> None:
        freeze(self, "durations")
        freeze(self, "multipliers")


def solve_switching_times(
    twists: ArrayLike,
    rates: ArrayLike,
    goal: ArrayLike,
    *,
    total: float | None = None,
    weights: ArrayLike | None = None,
    guesses: Sequence[ArrayLike] = (),
    gaps: ArrayLike | None = None,
    restarts: int = RESTARTS,
) -> SwitchingTimes:
    """Minimise ``sum rates * times`` such that the word ends at `goal`, all times at least zero.

    Primal-dual Newton with exact derivatives, Levenberg-Marquardt as fall-back, restarts last.
    Words whose twists do not span, and goals that one set of times alone reaches, are solved too.

    Parameters
    ----------
    twists : (n, 3) or (n, 4) array_like
        Body velocity of each trim [m/s, m/s, rad/s(, m/s)].
    rates : (n,) array_like
        Cost per second of each trim.
    goal : (3,) or (4,) array_like
        Pose relative to the start; its heading counts modulo a full turn.
    total : float, optional
        [s] the times must add up to; free if None.
    weights : (n,) array_like, optional
        How each time counts in the total; 1 if omitted.
    guesses : sequence of (n,) array_like
        Times to start from, best first; a second per trim if empty.
    gaps : (n, 4) array_like, optional
        Displacement (x, y, heading, z) of the maneuver after each trim.
    restarts : int
        Further starts, the same in every call, if all guesses fail.

    Returns
    -------
    SwitchingTimes

    Raises
    ------
    ValueError
        If shapes do not match or a number is not finite.

    Examples
    --------
    >>> slow_and_fast = [[1.6, 0, 0], [1.7, 0, 0]]
    >>> best = solve_switching_times(slow_and_fast, [2.56, 2.89], [1.62, 0, 0], total=1.0)
    >>> best.durations.round(6).tolist(), round(best.cost, 6)
    ([0.8, 0.2], 2.626)
    """
    from maneuver_automaton.words import _kernels_solve as kernels

    words = _four_columns("twists", twists)
    n = len(words)
    prices = as_array("rates", rates)
    if prices.shape != (n,):
        raise ValueError(f"rates: got shape {prices.shape}, need ({n},), one per trim")
    end = np.zeros(4)
    pose = as_array("goal", goal, last=(3, 4))
    end[: pose.size] = pose
    rows, targets = [], []
    displaced = np.zeros((n, 4)) if gaps is None else _four_columns("gaps", gaps)
    if words[:, 3].any() or end[3] != 0.0 or displaced[:, 3].any():
        rows.append(words[:, 3])
        targets.append(end[3] - displaced[:, 3].sum())
    if total is not None:
        rows.append(np.ones(n) if weights is None else as_array("weights", weights))
        targets.append(as_array("total", total).item())
    starts = _starts(n, total, guesses, restarts)
    times = np.zeros(n)
    status, cost, multipliers, _slope = kernels.solve_times(
        np.ascontiguousarray(prices),
        words,
        displaced,
        end,
        np.array(rows).reshape(len(rows), n),
        np.array(targets, dtype=np.float64),
        starts,
        times,
    )
    return SwitchingTimes(
        status=list(TimesStatus)[status],
        durations=times,
        cost=float(cost) if math.isfinite(cost) else math.inf,
        multipliers=multipliers,
    )


def _starts(n: int, total: float | None, guesses: Sequence[ArrayLike], restarts: int) -> Array:
    even = np.full(n, 1.0 if total is None else total / n)
    first = [as_array("guesses", guess) for guess in guesses] or [even]
    for guess in first:
        if guess.shape != (n,):
            raise ValueError(f"guesses: got shape {guess.shape}, need ({n},)")
    if restarts == 0:
        return np.vstack([*first, even])
    rng = np.random.default_rng(0)  # restarts: the same in every call
    scales = rng.exponential(1.0, size=(restarts, n))
    if total is not None:
        scales *= total / scales.sum(axis=1, keepdims=True)
    return np.vstack([*first, even, scales])


def _four_columns(name: str, value: ArrayLike) -> Array:
    rows = as_array(name, value, last=(3, 4))
    if rows.ndim != 2:
        raise ValueError(f"{name}: got shape {rows.shape}, need (n, 3) or (n, 4)")
    filled = np.zeros((len(rows), 4))
    filled[:, : rows.shape[1]] = rows
    return filled
