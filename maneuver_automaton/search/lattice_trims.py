"""Trims and words that a search of the lattice uses, with their costs."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.headings import origin_of
from maneuver_automaton.costs import StageCost
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.trim_choice import coarse_trims
from maneuver_automaton.words.library import (
    NO_TRIM,
    STRAIGHT,
    Library,
    LibraryArrays,
    four_columns,
    library_arrays,
    library_of,
    moving_trims,
)
from maneuver_automaton.words.transitions import identities

MOST_TRIMS = 10  # moving; of a larger library a few stand for all where the lattice is searched
TURN = 4.0  # length scales that a full turn is taken for, whose radius the speed decides
WORDS_AN_EXPANSION = 150.0  # words of a connection that take as long as an expansion
MOST_INTERVAL = 400.0  # expansions between two connections that are tried


class PricedTrims(NamedTuple):
    """Trims with their prices and words, and how they are switched."""

    library: Library
    wide: bool  # whether the vehicle turns by driving circles only, however wide
    per_turn: float | None  # cost of the cheapest full turn; None: it takes length scales
    rest: int | None  # index in the automaton of the cheapest rest
    rest_rate: float  # taken off all rates, since rest pads a fixed time
    interval: tuple[float, float]  # least expansions, for each goal, and most, between connections
    at_will: bool  # whether plans begin and end in any trim


class Chosen(NamedTuple):
    """Trims of a large library that a search uses, by their indices in the automaton."""

    words: tuple[int, ...]  # that words of connections are made of
    others: tuple[int, ...] = ()  # that a known word has beside them


def trims_at_will(
    automaton: Automaton,
    cost: StageCost,
    *,
    fixed_time: bool,
    waits: bool,
    min_coast: float,
    limited: bool = False,
    choice: Chosen | None = None,
) -> PricedTrims:
    """The most useful trims in the plane of a vehicle that switches at will between all.

    `waits`: rest is a trim like any other, since obstacles move; `limited`: so is the time, and
    the fastest trims of a large library are taken. A `choice` says which are taken instead.
    """
    known = moving_trims(automaton, cost)
    pads = fixed_time and known.rest is not None
    rates = known.rates - (known.rest_rate if pads else 0.0)
    if choice is not None:
        chosen = np.flatnonzero(np.isin(known.trims, choice.words + choice.others))
    elif len(known.trims) <= MOST_TRIMS:
        chosen = np.arange(len(known.trims))
    else:
        chosen = coarse_trims(known.twists, np.ones(len(rates)) if limited else rates)
    trims = known.trims[chosen]
    twists, rates = known.twists[chosen, :3], rates[chosen]
    twists[np.abs(twists[:, 2]) < STRAIGHT, 2] = 0.0
    spins = bool((~twists[:, :2].any(axis=1) & (twists[:, 2] != 0.0)).any())
    if waits and known.rest is not None:
        trims = np.append(trims, known.rest)
        twists = np.vstack([twists, np.zeros(3)])
        rates = np.append(rates, 0.0 if pads else known.rest_rate)
    moving, m = np.flatnonzero(twists.any(axis=1)), len(trims)
    if choice is not None:
        moving = moving[np.isin(trims[moving], choice.words)]
    words = _words(moving, twists)
    arrays = library_arrays(four_columns(twists), rates, identities(automaton), trims=trims)
    with np.errstate(divide="ignore", invalid="ignore"):
        per_radian = np.where(twists[:, 2] != 0.0, rates / np.abs(twists[:, 2]), np.inf)
    best = float(per_radian.min())
    return PricedTrims(
        library=Library(
            automaton=automaton,
            trims=np.asarray(trims, dtype=np.int64),
            transitions=identities(automaton),
            maneuver_costs=np.zeros(0),
            arrays=_with_prices(arrays, cost)._replace(
                words=words,
                n_few=len(words),
                free_words=np.array(
                    [(i, j, m) for i, j in itertools.permutations(moving.tolist(), 2)]
                    or [(int(i), int(i), m) for i in moving],
                    dtype=np.int64,
                ).reshape(-1, 3),
                min_coast=float(min_coast),
            ),
        ),
        wide=not spins,
        per_turn=2.0 * math.pi * best if math.isfinite(best) else 0.0,
        rest=known.rest,
        rest_rate=known.rest_rate if pads else 0.0,
        interval=(0.0, math.inf),
        at_will=True,
    )


def stands_for_more(problem: Problem) -> bool:
    """Whether a few trims stand for all where trims are switched at will in the plane."""
    automaton = problem.automaton
    planar = automaton.is_kinematic and automaton.model.group.dof == 3
    return planar and len(moving_trims(automaton, problem.cost).trims) > MOST_TRIMS


def trims_of(library: Library, cost: StageCost) -> PricedTrims:
    """All trims of an automaton, whatever leads from one to the other.

    Where maneuvers do, prices of switches and changes of direction are left to whoever compares
    plans.
    """
    if library.automaton.is_kinematic:
        library = replace(library, arrays=_with_prices(library.arrays, cost))
    return PricedTrims(
        library=library,
        wide=False,
        per_turn=None,
        rest=library.automaton.rest,
        rest_rate=0.0,
        interval=(library.arrays.n_few / WORDS_AN_EXPANSION, MOST_INTERVAL),
        at_will=False,
    )


def _with_prices(arrays: LibraryArrays, cost: StageCost) -> LibraryArrays:
    """The arrays with the prices of a switch and of a change of direction."""
    return arrays._replace(
        switch=float(getattr(cost, "switch", 0.0)),
        direction_change=float(getattr(cost, "direction_change", 0.0)),
    )


def priced_library(automaton: Automaton, cost: StageCost) -> Library:
    """All trims and maneuvers of an automaton, priced by a cost.

    Raises
    ------
    ValueError
        If a maneuver has no course, and so no known cost.
    """
    origin = origin_of(automaton, automaton.trims[0])
    rest = automaton.trims[0].name
    known = Problem(automaton, origin, Goal(pose=origin, trim=rest), start_trim=rest, cost=cost)
    return library_of(
        automaton,
        rates=known.rates,
        maneuver_costs=[known.maneuver_cost(maneuver) for maneuver in automaton.maneuvers],
    )


def is_mirrored(twists: Array, rates: Array) -> bool:
    """Whether trims and their prices are their own mirror image."""
    rows = np.column_stack([twists, rates])
    image = rows * np.array([1.0, -1.0, -1.0, 1.0])
    order = np.lexsort(np.round(rows, 9).T)
    return bool(np.allclose(rows[order], image[np.lexsort(np.round(image + 0.0, 9).T)]))


def _words(moving: IntArray, twists: Array) -> IntArray:
    """Words of three trims whose neighbours differ; of two where none turns, which are enough."""
    every = moving.tolist()
    if len(every) > 1 and not twists[:, 2].any():
        return np.array(
            [(i, j, NO_TRIM) for i, j in itertools.permutations(every, 2)], dtype=np.int64
        )
    words = [(i, j, k) for i, j, k in itertools.product(every, repeat=3) if i != j and j != k] or [
        (i, i, i) for i in every
    ]
    return np.array(words, dtype=np.int64).reshape(-1, 3)
