"""The whole library of a problem as the arrays that insertion and pricing share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.setup import SearchSetup
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
