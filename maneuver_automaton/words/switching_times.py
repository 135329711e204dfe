"""The best coasting times of a fixed word of trims and maneuvers.

A word with maneuvers is a word without them: with D_i the product of all displacements before trim
i, ``prod exp(tau_i xi_i) d_i = prod exp(tau_i Ad(D_i) xi_i) D_n``. So the trims are seen from
where their maneuvers have led, the goal from before all of them, and what solves words of kinematic
vehicles solves this one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.groups import group_of
from maneuver_automaton.groups.chain import chained
from maneuver_automaton.words.closing import MET, EndConditions, closest_times
from maneuver_automaton.words.solve import (
    RESTARTS,
    SwitchingTimes,
    TimesStatus,
    solve_switching_times,
)

TURNS = (0.5, 2.0 * math.pi - 0.5)  # [rad] of a free heading that iterations start with


def conjugated(twists: Array, steps: Array) -> tuple[Array, Array]:
    """Twists (n, dof) seen from before all displacements `steps`, and the product of these.

    `steps` are (n - 1, dof), one between each two trims, or (n, dof), one after each.

    Source: ``D exp(xi) = exp(Ad(D) xi) D``; Solà, Deray, Atchuthan (2018), Eq. (30).

    Examples
    --------
    >>> quarter = np.array([[1.0, 0.0, np.pi / 2]])
    >>> seen, product = conjugated(np.array([[1.0, 0, 0], [1.0, 0, 0]]), quarter)
    >>> seen.round(9).tolist(), product.round(3).tolist()
    ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [1.0, 0.0, 1.571])
    """
    n, dof = twists.shape
    before = chained(np.zeros(dof), steps)
    adjoints = group_of(dof)(before[:n]).adjoint()
    return np.asarray((adjoints @ twists[:, :, None])[:, :, 0]), before[-1]


def solve_times_with_maneuvers(
    twists: ArrayLike,
    rates: ArrayLike,
    goal: ArrayLike,
    *,
    displacements: ArrayLike,
    total: float | None = None,
    free_heading: bool = False,
    least: ArrayLike | None = None,
    longest: ArrayLike | None = None,
    guesses: Sequence[ArrayLike] = (),
    restarts: int = RESTARTS,
) -> SwitchingTimes:
    """Minimise ``sum rates * times`` such that trims with maneuvers between them end at `goal`.

    Parameters
    ----------
    twists : (n, dof) array_like
        Body velocity of each trim [m/s, m/s, rad/s(, m/s)].
    rates : (n,) array_like
        Cost per second of each trim; what maneuvers cost is added by the caller.
    goal : (dof,) array_like
        Pose relative to the start; its heading counts modulo a full turn.
    displacements : (n - 1, dof) or (n, dof) array_like
        Of the maneuver between each two trims, and after the last; zero where there is none.
    total : float, optional
        [s] the coasting times must add up to: what is given less what the maneuvers take.
    free_heading : bool
        Whether any heading will do at the goal.
    least, longest : (n,) array_like, optional
        [s] each trim lasts at least and at most. A longest time that the best times exceed is
        taken as fixed, one after the other: they are then feasible, but there may be better ones.
    guesses : sequence of (n,) array_like
        Times to start from, best first.
    restarts : int
        Further starts, the same in every call, if all guesses fail.

    Returns
    -------
    SwitchingTimes
        The multipliers are those of the conjugated word: momenta in the frame of the start.

    Raises
    ------
    ValueError
        If shapes do not match or a number is not finite.

    Examples
    --------
    A metre ahead, a stroke that turns by a quarter, and as far as it takes:

    >>> ahead = [1.0, 0.0, 0.0]
    >>> stroke = [[0.5, 0.5, np.pi / 2]]
    >>> goal = [1.5, 2.5, np.pi / 2]
    >>> best = solve_times_with_maneuvers([ahead, ahead], [1, 1], goal, displacements=stroke)
    >>> best.durations.round(9).tolist()
    [1.0, 2.0]
    """
    rows = as_array("twists", twists, last=(3, 4))
    n, dof = rows.shape
    steps = as_array("displacements", displacements).reshape(-1, dof)
    if len(steps) not in (n - 1, n):
        raise ValueError(f"displacements: got {len(steps)}, need {n - 1}, one between each two")
    prices = as_array("rates", rates)
    if prices.shape != (n,):
        raise ValueError(f"rates: got shape {prices.shape}, need ({n},), one per trim")
    end = as_array("goal", goal, last=dof)
    floors = np.zeros(n) if least is None else np.array(as_array("least", least))
    limits = np.full(n, math.inf) if longest is None else np.asarray(longest, dtype=np.float64)
    if (floors > limits).any():
        return _failed(n)
    starts = [as_array("guesses", guess) for guess in guesses]
    free = np.ones(n, dtype=np.bool_)
    while True:
        word = _Word(rows, steps, floors, end, free_heading)
        solved = word.solved(prices, free, total, starts, restarts)
        late = free & (solved.durations > limits)
        if solved.status is TimesStatus.FAILED or not late.any():
            return solved
        over = np.where(late, solved.durations - limits, -math.inf)
        worst = int(np.argmax(over))
        floors[worst], free[worst] = limits[worst], False


def close_times_with_maneuvers(
    start: Array,
    twists: Array,
    durations: Array,
    goal: Array,
    *,
    displacements: Array,
    free_heading: bool = False,
) -> Array:
    """Durations (n,) near `durations` with which a word with maneuvers ends at `goal`.

    The smallest change; as good as it gets where the word cannot meet the goal.

    Examples
    --------
    >>> ahead, stroke = [1.0, 0.0, 0.0], [[0.5, 0.5, np.pi / 2]]
    >>> goal = np.array([1.5, 2.5, np.pi / 2])
    >>> close_times_with_maneuvers(np.zeros(3), np.array([ahead, ahead]), np.array([0.99, 2.02]),
    ...                            goal, displacements=np.array(stroke)).round(9).tolist()
    [1.0, 2.0]
    """
    n, dof = twists.shape
    if not n:
        return np.array(durations)
    seen, product = conjugated(twists, displacements)
    before, times = _goal_before(goal, product), np.array(durations)
    if free_heading:  # any turn in place at the end
        seen = np.vstack([seen, conjugated_turn(product)])
        times = np.append(times, 0.0)
        group = group_of(dof)
        end = chained(start, group.exp(times[:, None] * seen).pose)[-1]
        times[-1] = math.remainder(float(before[2] - end[2]), 2.0 * math.pi) % (2.0 * math.pi)
    conditions = EndConditions(start=start, twists=seen, goal=before)
    best, missed = closest_times(conditions, times)
    return best[:n] if missed < MET else np.array(durations)


def conjugated_turn(product: Array) -> Array:
    """Twist (dof,) of a turn in place after all displacements, seen from before them."""
    turn = np.zeros(product.size)
    turn[2] = 1.0
    return np.asarray(group_of(product.size)(product).adjoint() @ turn)


def _goal_before(goal: Array, product: Array) -> Array:
    group = group_of(goal.size)
    return (group(goal) @ group(product).inverse()).pose


class _Word:
    """Trims and displacements with least times: what is coasted beyond them is solved for."""

    def __init__(
        self, twists: Array, steps: Array, floors: Array, goal: Array, free_heading: bool
    ) -> None:
        group = group_of(goal.size)
        least = group.exp(floors[:, None] * twists)
        after = steps if len(steps) == len(twists) else np.vstack([steps, np.zeros(goal.size)])
        self.floors = floors
        self.twists, product = conjugated(twists, (least @ group(after)).pose)
        self.goal = _goal_before(goal, product)
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
        ways = [_Ending(self.turn[:0], 0.0), *(_Ending(self.turn, turn) for turn in TURNS)]
        solved = min(
            (
                solve_switching_times(
                    np.vstack([self.twists[chosen], way.turn]),
                    np.append(rates[chosen], 0.0 * way.first),
                    self.goal,
                    total=beyond,
                    weights=np.append(np.ones(chosen.size), 0.0 * way.first),
                    guesses=[np.append(self._beside(one)[chosen], way.first) for one in guesses],
                    restarts=restarts,
                )
                for way in (ways[:1] if not len(self.turn) else ways[int(not chosen.size) :])
            ),
            key=lambda one: one.cost,
        )
        if solved.status is TimesStatus.FAILED:
            return _failed(n)
        times = self.floors.copy()
        times[chosen] += np.maximum(solved.durations[: chosen.size], 0.0)
        return replace(solved, durations=times, cost=float(rates @ times))

    def _beside(self, times: Array) -> Array:
        """What times (n,) are beyond the least ones."""
        return np.maximum(times - self.floors, 0.0)

    def _as_it_is(self, rates: Array, beyond: float | None) -> SwitchingTimes:
        """No time is free: the word meets the goal or it does not."""
        met = float(np.abs(_wrapped(self.goal)).max()) < MET
        if not met or (beyond is not None and beyond > MET):
            return _failed(len(rates))
        return SwitchingTimes(
            status=TimesStatus.OPTIMAL,
            durations=self.floors.copy(),
            cost=float(rates @ self.floors),
            multipliers=np.zeros(3),
        )


class _Ending:
    """A turn in place at the end (1, dof), or none (0, dof), and where iterations begin [rad]."""

    def __init__(self, turn: Array, first: float) -> None:
        self.turn = turn
        self.first = np.full(len(turn), first)


def _wrapped(pose: Array) -> Array:
    """The pose with a heading between minus half a turn and half a turn."""
    near = np.array(pose)
    near[2] = math.remainder(float(near[2]), 2.0 * math.pi)
    return near


def _failed(n: int) -> SwitchingTimes:
    return SwitchingTimes(
        status=TimesStatus.FAILED,
        durations=np.zeros(n),
        cost=math.inf,
        multipliers=np.zeros(3),
    )
