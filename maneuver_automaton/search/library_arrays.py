"""The whole library of a problem as the arrays that insertion and pricing share.

Start and goal seen from each other are the same for a moved problem but for rounding, and rounding
decides where insertion has a choice among equals. So it searches for a goal with fewer digits, and
its times are corrected afterwards until the goal itself is met.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.setup import SearchSetup
from maneuver_automaton.words.closing import MET, EndConditions, closest_times
from maneuver_automaton.words.library import MovingTrims


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LibraryArrays:
    """Moving trims, then rest where it pads a fixed time, then the turn of a free heading."""

    trims: IntArray  # (M,) their indices in the automaton, -1 for the free turn
    number_of: IntArray  # from the automaton's indices to these, -1 where there is none
    twists: Array  # (M, 4)
    rates: Array  # (M,) that of rest taken off where it pads
    rows: Array  # (m, M) altitude, fixed time
    targets: Array  # (m,)
    goal: Array  # (4,)
    rest: int | None  # its number here
    free_heading: bool
    climbs: bool  # whether the first row is altitude
    n_priced: int  # all but the free turn
    fixed_cost: float  # of the whole fixed time at rest

    @property
    def tail(self) -> int:
        """How many turns of a free heading follow every word: 0 or 1."""
        return int(self.free_heading)

    @property
    def scale(self) -> float:
        """Size of a typical rate."""
        return max(1.0, float(np.abs(self.rates).max()))


def library_arrays(problem: Problem, setup: SearchSetup) -> LibraryArrays:
    """Arrays of every trim that can be inserted."""
    limit = problem.horizon.time
    rest = setup.rest if limit is not None else None
    kept = _columns(setup.library, len(problem.automaton), rest, setup.free_heading)
    rows, targets = [], []
    if setup.climbs:
        rows.append(kept.twists[:, 3])
        targets.append(float(setup.goal[3]))
    if limit is not None:
        rows.append(kept.weights)
        targets.append(limit)
    return LibraryArrays(
        trims=kept.trims,
        number_of=kept.number_of,
        twists=kept.twists,
        rates=kept.rates,
        rows=np.array(rows).reshape(len(rows), len(kept.rates)),
        targets=np.array(targets, dtype=np.float64),
        goal=np.array(setup.goal),
        rest=None if rest is None else len(setup.library.trims),
        free_heading=setup.free_heading,
        climbs=setup.climbs,
        n_priced=len(kept.trims) - int(setup.free_heading),
        fixed_cost=setup.rest_rate * limit if rest is not None and limit is not None else 0.0,
    )


class _Columns(NamedTuple):
    """What the arrays of a library have for every start and goal."""

    trims: IntArray
    number_of: IntArray
    twists: Array
    rates: Array
    weights: Array  # (M,) 0 for the free turn, otherwise 1


@kept_by_first
def _columns(library: MovingTrims, n_trims: int, rest: int | None, free_heading: bool) -> _Columns:
    """The moving trims of an automaton of `n_trims`; the `rest` that pads a time; a free turn."""
    trims, twists, rates = library.trims, library.twists, library.rates
    if rest is not None:
        trims = np.append(trims, rest)
        twists = np.vstack([twists, np.zeros(4)])
        rates = np.append(rates - library.rest_rate, 0.0)
    weights = np.ones(len(trims))
    number_of = np.full(n_trims, -1, dtype=np.int64)
    number_of[trims] = np.arange(len(trims))
    if free_heading:
        trims = np.append(trims, -1)
        twists = np.vstack([twists, [0.0, 0.0, 1.0, 0.0]])
        rates = np.append(rates, 0.0)
        weights = np.append(weights, 0.0)
    # kernels are compiled for arrays that can be written
    return _Columns(trims, number_of, np.array(twists, order="C"), np.array(rates), weights)


UNUSED = -1  # stands in `trims` for what is no trim of the automaton


def within_time(library: LibraryArrays, limit: float) -> LibraryArrays:
    """The library with a column for unused time, so that a word may last at most `limit` [s].

    The inequality becomes the equality "coasting times and unused time add up to `limit`". Unused
    time has no twist and no cost; its reduced cost is the price of time, which must be at least 0.
    The library must not have a condition on the time already.
    """
    at = library.n_priced
    weights = np.append(np.ones(at + 1), np.zeros(library.tail))
    return replace(
        library,
        trims=np.insert(library.trims, at, UNUSED),
        twists=np.insert(library.twists, at, 0.0, axis=0),
        rates=np.insert(library.rates, at, 0.0),
        rows=np.vstack([np.insert(library.rows, at, 0.0, axis=1), weights]),
        targets=np.append(library.targets, limit),
        rest=at,
        n_priced=at + 1,
    )


DIGITS = 9  # of the goal that is searched for, after the point [m, rad]
UNUSUAL = 1.7  # keeps steps in the number of digits away from the sizes people choose
TINY = 1e-12  # [m, rad] below this start and goal are one
RANK = 1e-11  # singular values below this, relative, count as none


def with_fewer_digits(setup: SearchSetup) -> SearchSetup:
    """The setup with its goal rounded; as it is where start and goal would become one."""
    x, y, turn, z = setup.goal.tolist()
    size = max(abs(x), abs(y), abs(z), abs(math.remainder(turn, 2.0 * math.pi)), TINY)
    finer = max(0, math.ceil(-math.log10(UNUSUAL * size)))
    goal = setup.goal.round(DIGITS + finer) + 0.0  # no negative zeros
    rounded = replace(setup, goal=goal)
    return setup if rounded.start_is_goal else rounded


def corrected(library: LibraryArrays, word: IntArray, times: Array, goal: Array) -> Array | None:
    """Times (n,) near `times` with which the word ends at `goal`; None if there are none.

    The smallest change: the goal is less than 1e-9 away, and less for small ones.
    """
    others = slice(int(library.climbs), None)  # an end's altitude is a condition anyway
    conditions = EndConditions(
        start=np.zeros(4),
        twists=library.twists[word],
        goal=goal,
        rows=library.rows[others, word],
        targets=library.targets[others],
    )
    best, missing = closest_times(conditions, times, rank=RANK, at_least=-math.inf)
    if not missing < MET or (best < -MET).any():
        return None
    return np.asarray(best.clip(min=0.0))
