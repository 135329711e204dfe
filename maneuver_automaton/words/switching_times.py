"""The best coasting times of a fixed word, with or without maneuvers between its trims.

A word with maneuvers is a word without them: with D_i the product of all displacements before trim
i, ``prod exp(tau_i xi_i) d_i = prod exp(tau_i Ad(D_i) xi_i) D_n``. So the trims are seen from
where their maneuvers have led, the goal from before all of them, and one solver serves every
vehicle. The least time of a trim gives a displacement like any other.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, as_array, freeze
from maneuver_automaton.groups import group_of
from maneuver_automaton.words import _kernels_solve as kernels
from maneuver_automaton.words._kernels_closing import MET
from maneuver_automaton.words._kernels_times import TimesProblem
from maneuver_automaton.words.closing import conjugated, conjugated_turn, goal_before

RESTARTS = 12  # further starts where the first one fails
TURNS = (0.5, 2.0 * math.pi - 0.5)  # [rad] of a free heading that iterations start with


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
    displacements: ArrayLike | None = None,
    total: float | None = None,
    free_heading: bool = False,
    least: ArrayLike | None = None,
    longest: ArrayLike | None = None,
    guesses: Sequence[ArrayLike] = (),
    restarts: int = RESTARTS,
) -> SwitchingTimes:
    """Minimise ``sum rates * times`` such that the word ends at `goal`, all times at least zero.

    Primal-dual Newton with exact derivatives, Levenberg-Marquardt as fall-back, restarts last.
    Words whose twists do not span, and goals that one set of times alone reaches, are solved too.

    Source: Nocedal, Wright, *Numerical Optimization*, 2nd ed., Sec. 19.3; for the conjugation
    ``D exp(xi) = exp(Ad(D) xi) D``, Solà, Deray, Atchuthan (2018), Eq. (30).

    Parameters
    ----------
    twists : (n, 3) or (n, 4) array_like
        Body velocity of each trim [m/s, m/s, rad/s(, m/s)].
    rates : (n,) array_like
        Cost per second of each trim; the caller adds what maneuvers cost.
    goal : (3,) or (4,) array_like
        Pose relative to the start; its heading counts modulo a full turn.
    displacements : (n - 1, dof) or (n, dof) array_like, optional
        Of the maneuver between each two trims, and after the last; zero for a switch. None if the
        word has no maneuvers.
    total : float, optional
        [s] the coasting times must add up to: what is given less what the maneuvers take.
    free_heading : bool
        Whether the goal admits any heading.
    least, longest : (n,) array_like, optional
        [s] each trim lasts at least and at most. A longest time that the best times exceed is
        taken as fixed, one after the other: the times are then feasible, but there may be better
        ones.
    guesses : sequence of (n,) array_like
        Times to start from, best first; a second per trim if empty.
    restarts : int
        Further starts, the same in every call, if all guesses fail.

    Returns
    -------
    SwitchingTimes
        The multipliers are momenta of the conjugated word, in the frame of the start.

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

    A metre ahead, a stroke that turns by a quarter, and as far as it takes:

    >>> ahead, stroke = [1.0, 0.0, 0.0], [[0.5, 0.5, np.pi / 2]]
    >>> goal = [1.5, 2.5, np.pi / 2]
    >>> best = solve_switching_times([ahead, ahead], [1, 1], goal, displacements=stroke)
    >>> best.durations.round(9).tolist()
    [1.0, 2.0]
    """
    rows = as_array("twists", twists, last=(3, 4))
    if rows.ndim != 2:
        raise ValueError(f"twists: got shape {rows.shape}, need (n, 3) or (n, 4)")
    n = len(rows)
    prices = as_array("rates", rates)
    if prices.shape != (n,):
        raise ValueError(f"rates: got shape {prices.shape}, need ({n},), one per trim")
    end = as_array("goal", goal, last=(3, 4))
    given = None if total is None else as_array("total", total).item()
    starts = [as_array("guesses", guess) for guess in guesses]
    for guess in starts:
        if guess.shape != (n,):
            raise ValueError(f"guesses: got shape {guess.shape}, need ({n},)")
    if displacements is None and least is None and longest is None and not free_heading:
        return _solved(rows, prices, end, given, np.ones(n), starts, restarts)
    dof = max(rows.shape[1], end.size)  # an altitude that is missing is zero
    rows = np.pad(rows, ((0, 0), (0, dof - rows.shape[1])))
    end = np.pad(end, (0, dof - end.size))
    steps = _steps(displacements, n, end.size)
    floors = np.zeros(n) if least is None else np.array(as_array("least", least))
    limits = np.full(n, math.inf) if longest is None else np.asarray(longest, dtype=np.float64)
    if (floors > limits).any():
        return _failed(n)
    free = np.ones(n, dtype=np.bool_)
    while True:  # those that exceed their limits are fixed, one by one
        word = _ConjugatedWord(rows, steps, floors, end, free_heading)
        solved = word.solved(prices, free, given, starts, restarts)
        late = free & (solved.durations > limits)
        if solved.status is TimesStatus.FAILED or not late.any():
            return solved
        over = np.where(late, solved.durations - limits, -math.inf)
        worst = int(np.argmax(over))
        floors[worst], free[worst] = limits[worst], False


class _ConjugatedWord:
    """Trims and displacements with least times: the time beyond them is solved for."""

    def __init__(
        self, twists: Array, steps: Array, floors: Array, goal: Array, free_heading: bool
    ) -> None:
        group = group_of(goal.size)
        least = group.exp(floors[:, None] * twists)
        self.floors = floors
        self.twists, product = conjugated(twists, (least @ group(steps)).pose)
        self.goal = goal_before(goal, product)
        self.turn = conjugated_turn(product)[None] if free_heading else np.zeros((0, goal.size))

    def solved(
        self,
        rates: Array,
        free: NDArray[np.bool_],
        total: float | None,
        guesses: Sequence[Array],
        restarts: int,
    ) -> SwitchingTimes:
        """The best times of the trims that are free."""
        n, chosen = len(rates), np.flatnonzero(free)
        beyond = None if total is None else total - float(self.floors.sum())
        if beyond is not None and beyond < 0.0:
            return _failed(n)
        if not chosen.size and not len(self.turn):
            return self._as_it_is(rates, beyond)
        beyond_least = [np.maximum(one - self.floors, 0.0)[chosen] for one in guesses]
        # without a turn in place at the end, and with one that iterations begin at some angle
        begins = [np.zeros(0), *(np.array([turn]) for turn in TURNS if len(self.turn))]
        solved = min(
            (
                _solved(
                    np.vstack([self.twists[chosen], self.turn[: first.size]]),
                    np.append(rates[chosen], 0.0 * first),
                    self.goal,
                    beyond,
                    np.append(np.ones(chosen.size), 0.0 * first),
                    [np.append(one, first) for one in beyond_least],
                    restarts,
                )
                for first in begins
                if chosen.size or first.size
            ),
            key=lambda one: one.cost,
        )
        if solved.status is TimesStatus.FAILED:
            return _failed(n)
        times = self.floors.copy()
        times[chosen] += np.maximum(solved.durations[: chosen.size], 0.0)
        return replace(solved, durations=times, cost=float(rates @ times))

    def _as_it_is(self, rates: Array, beyond: float | None) -> SwitchingTimes:
        """No time is free: the word meets the goal or it does not."""
        near = np.array(self.goal)
        near[2] = math.remainder(float(near[2]), 2.0 * math.pi)
        if not float(np.abs(near).max()) < MET or (beyond is not None and beyond > MET):
            return _failed(len(rates))
        cost, durations = float(rates @ self.floors), self.floors.copy()
        known = _failed(len(rates))
        return replace(known, status=TimesStatus.OPTIMAL, durations=durations, cost=cost)


def _solved(
    twists: Array,
    rates: Array,
    goal: Array,
    total: float | None,
    weights: Array,
    guesses: Sequence[Array],
    restarts: int,
) -> SwitchingTimes:
    """The best times of a word without displacements; `weights` say what counts in `total`."""
    n = len(twists)
    words, end = np.zeros((n, 4)), np.zeros(4)
    words[:, : twists.shape[1]] = twists
    end[: goal.size] = goal
    met = [(words[:, 3], float(end[3]))] if words[:, 3].any() or end[3] != 0.0 else []
    met += [] if total is None else [(weights, total)]
    times = np.zeros(n)
    status, cost, multipliers, _slope = kernels.solve_times(
        TimesProblem(
            twists=words,
            rates=np.ascontiguousarray(rates),
            rows=np.array([row for row, _ in met]).reshape(len(met), n),
            goal=end,
            targets=np.array([target for _, target in met], dtype=np.float64),
        ),
        _starts(n, total, guesses, restarts),
        times,
    )
    return SwitchingTimes(
        status=list(TimesStatus)[status],
        durations=times,
        cost=float(cost) if math.isfinite(cost) else math.inf,
        multipliers=multipliers,
    )


def _starts(n: int, total: float | None, guesses: Sequence[Array], restarts: int) -> Array:
    even = np.full(n, 1.0 if total is None else total / n)
    first = list(guesses) or [even]
    if restarts == 0:
        return np.vstack([*first, even])
    rng = np.random.default_rng(0)  # restarts: the same in every call
    scales = rng.exponential(1.0, size=(restarts, n))
    if total is not None:
        scales *= total / scales.sum(axis=1, keepdims=True)
    return np.vstack([*first, even, scales])


def _steps(displacements: ArrayLike | None, n: int, dof: int) -> Array:
    """Displacements (n, dof), one after each trim."""
    steps = np.zeros((n, dof))
    if displacements is None:
        return steps
    given = as_array("displacements", displacements)
    if given.size and (given.ndim != 2 or given.shape[1] != dof):
        raise ValueError(f"displacements: got shape {given.shape}, need ({n - 1}, {dof})")
    rows = given.reshape(-1, dof)
    if len(rows) not in (n - 1, n):
        raise ValueError(f"displacements: got {len(rows)}, need {n - 1}, one between each two")
    steps[: len(rows)] = rows
    return steps


def _failed(n: int) -> SwitchingTimes:
    return SwitchingTimes(
        status=TimesStatus.FAILED, durations=np.zeros(n), cost=math.inf, multipliers=np.zeros(3)
    )
