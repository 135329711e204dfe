"""The certificate of a plan: the smallest reduced cost over the whole library and all times.

A trim can be inserted for an instant wherever the vehicle switches to it at will: among trims of
its class. So a word is cut at its maneuvers into stretches, and in each of them the trims of one
class are priced, seen from before all displacements. A word without maneuvers is one stretch.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2, group_of
from maneuver_automaton.groups.se2 import chained, coasted
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search import _kernels_price as kernels
from maneuver_automaton.words._kernels_times import TimesProblem
from maneuver_automaton.words.closing import conjugated, conjugated_turn
from maneuver_automaton.words.library import FULL_TURN, SWITCH, four_columns
from maneuver_automaton.words.word import Word, displacements_of

BINDING = 1e-9  # share of a greatest time [s] that may be left where it binds
CUTS = 60  # rounds of the linear program where multipliers are not unique
NEGLIGIBLE = 1e-9  # relative: reduced costs above minus this count as none


def certificate(problem: Problem, goal: Goal, word: Word) -> float | None:
    """Smallest reduced cost of inserting any trim at any time into a word; None if it is empty.

    At least zero (up to rounding) where Pontryagin's condition holds over all trims that can be
    switched to: a necessary condition for the optimum. Where the multipliers are not unique, those
    are taken that make it largest. With a binding ``max_trims`` it may be negative. What another
    maneuver would bring is no infinitesimal change, and is not priced.
    """
    if not (word.durations > 0.0).any():
        return None
    priced = _priced(problem, goal, word)
    lasting = np.flatnonzero(priced.times > 0.0)
    library = _library(priced.twists, priced.rates, priced.rows)
    p = kernels.multipliers_of_word(library, lasting, priced.times[lasting].copy())
    best, cut = priced.least(p)
    columns, enough = priced.columns(), -NEGLIGIBLE * priced.scale
    if best >= enough or np.linalg.matrix_rank(columns, tol=1e-9) == len(columns):
        return best
    cuts = [cut]
    for _ in range(CUTS):
        solved = _largest_least(columns, priced.rates[lasting], cuts)
        if solved is None:
            return best
        p, bound = solved
        least, cut = priced.least(p)
        best = max(best, least)
        if least >= bound - 0.1 * NEGLIGIBLE * priced.scale or best >= enough:
            return best
        cuts.append(cut)
    return best


class Stretch(NamedTuple):
    """Positions of a word at which the same trims can be inserted."""

    twists: Array  # (k, 4) seen from before all displacements
    rates: Array  # (k,)
    rows: Array  # (m, k) of the linear conditions
    first: int  # position of its first trim in the word
    last: int  # and of the one after its last


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PricedWord:
    """A word seen from before its displacements, with what can be inserted where."""

    twists: Array  # (n, 4)
    rates: Array  # (n,)
    rows: Array  # (m, n)
    times: Array  # (n,) [s]
    stretches: tuple[Stretch, ...]
    scale: float  # size of a typical rate

    def least(self, p: Array) -> tuple[float, tuple[Array, float]]:
        """Smallest reduced cost under multipliers (3 + m,): it, and the column that it belongs to.

        The column says how the end and the conditions move, and comes with the trim's rate.
        """
        best, where = np.inf, (self.stretches[0], 0, 0, 0.0)
        n = self.times.size
        for stretch in self.stretches:
            k = len(stretch.rates)
            value, trim, position, when = kernels.price_word(
                _library(
                    np.vstack([stretch.twists, self.twists]),
                    np.append(stretch.rates, self.rates),
                    np.hstack([stretch.rows, self.rows]),
                ),
                k,
                k + np.arange(n),
                self.times,
                stretch.first,
                stretch.last,
                p,
            )
            if value < best:
                best, where = float(value), (stretch, int(trim), int(position), float(when))
        stretch, trim, position, when = where
        poses = self.poses()
        at = (SE2(poses[position]) @ SE2.exp(when * self.twists[position, :3])).pose
        column = _column(stretch.twists[trim], stretch.rows[:, trim], at, poses[-1])
        return best, (column, float(stretch.rates[trim]))

    def columns(self) -> Array:
        """Derivatives (3 + m, n) of all conditions by the times that are not zero."""
        poses = self.poses()
        lasting = np.flatnonzero(self.times > 0.0)
        end = poses[-1]
        return np.array(
            [_column(self.twists[i], self.rows[:, i], poses[i], end) for i in lasting]
        ).T

    def poses(self) -> Array:
        """Poses (n + 1, 3) at which trims begin, and the end."""
        return coasted(np.zeros(3), self.twists[:, :3], self.times)


def _library(twists: Array, rates: Array, rows: Array) -> TimesProblem:
    """Trims for the kernels that price them: whatever their word ends at."""
    return TimesProblem(twists, rates, rows, np.zeros(4), np.zeros(len(rows)))


def _priced(problem: Problem, goal: Goal, word: Word) -> PricedWord:
    """The word, and in each of its stretches the trims of one class; unused time in the first."""
    automaton = problem.automaton
    own, all_rates = automaton.body_velocities, _rates(problem)
    steps = displacements_of(automaton, word.transitions)
    before = chained(np.zeros(own.shape[1]), steps)
    twists, product = conjugated(own[word.trims], steps)
    times, rates = np.array(word.durations), all_rates[word.trims]
    most = problem.horizon.max_time
    binds = most is not None and word.duration > most - BINDING * (1.0 + most)
    rises = bool(own[:, 3:].any() or twists[:, 3:].any())
    fixed = problem.horizon.time is not None or binds
    stretches = list[Stretch]()
    for first, last in _stretches(word):
        chosen = np.flatnonzero(automaton.trim_classes == automaton.trim_classes[word.trims[first]])
        seen = own[chosen] @ group_of(own.shape[1])(before[first]).adjoint().T
        prices = all_rates[chosen]
        if binds and not stretches:  # time that is left over moves nothing and costs nothing
            seen = np.vstack([seen, np.zeros(own.shape[1])])
            prices = np.append(prices, 0.0)
        rows = _rows(seen, rises=rises, fixed=fixed)
        stretches.append(Stretch(four_columns(seen), prices, rows, first, last))
    rows = _rows(twists, rises=rises, fixed=fixed)
    if goal.free_heading:  # a full turn in place at the end, which costs nothing
        twists = np.vstack([twists, conjugated_turn(product)])
        rows = np.hstack([rows, np.zeros((len(rows), 1))])
        rates, times = np.append(rates, 0.0), np.append(times, FULL_TURN)
    return PricedWord(
        twists=four_columns(twists),
        rates=rates,
        rows=rows,
        times=times,
        stretches=tuple(stretches),
        scale=max(1.0, float(np.abs(all_rates).max())),
    )


def _rates(problem: Problem) -> Array:
    """Cost per second of every trim (m,), less that of the rest that fills a fixed time."""
    rest = problem.automaton.rest
    if problem.horizon.time is None or rest is None:
        return problem.rates
    return np.asarray(problem.rates - problem.rates[rest])


def _stretches(word: Word) -> Iterator[tuple[int, int]]:
    """First trim and the one after the last, of every run of trims without a maneuver."""
    cuts = [0, *(np.flatnonzero(word.transitions != SWITCH) + 1).tolist(), word.trims.size]
    yield from pairwise(cuts)


def _rows(twists: Array, *, rises: bool, fixed: bool) -> Array:
    """Linear conditions (m, n) of trims: altitude where any `rises`, and a fixed time."""
    rows = [twists[:, 3]] if rises else []
    if fixed:
        rows.append(np.ones(len(twists)))
    return np.array(rows).reshape(len(rows), len(twists))


def _column(twist: Array, row: Array, at: Array, end: Array) -> Array:
    """How the end and the linear conditions (3 + m,) move when a trim is inserted at a pose."""
    v, u, w = twist[:3]
    c, s = np.cos(at[2]), np.sin(at[2])
    motion = [c * v - s * u - w * (end[1] - at[1]), s * v + c * u + w * (end[0] - at[0]), w]
    return np.array([*motion, *row])


def _largest_least(
    columns: Array, rates: Array, cuts: list[tuple[Array, float]]
) -> tuple[Array, float] | None:
    """Multipliers that explain the word and make the least reduced cost of the cuts largest."""
    from scipy.optimize import linprog

    n = len(columns)
    objective = np.append(np.zeros(n), -1.0)
    upper = np.array([np.append(-column, 1.0) for column, _ in cuts])
    solved = linprog(
        objective,
        A_ub=upper,
        b_ub=[rate for _, rate in cuts],
        A_eq=np.hstack([columns.T, np.zeros((columns.shape[1], 1))]),
        b_eq=-rates,
        bounds=[(-1e6, 1e6)] * n + [(None, 0.0)],
        method="highs",
    )
    if solved.status != 0 or solved.x is None:
        return None
    return np.asarray(solved.x[:n]), float(solved.x[n])
