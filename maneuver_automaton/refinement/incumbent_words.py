"""Lattice A* over trims and maneuvers: a first plan soon, then cheaper ones while there is time."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import NamedTuple

from maneuver_automaton._interrupts import clock
from maneuver_automaton.refinement.improve import Improvement, Patience
from maneuver_automaton.refinement.restarts import FINER
from maneuver_automaton.search.lattice import distance_grids, first_plan
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.result import SearchStatus
from maneuver_automaton.words.word import Word, with_price

TO_THE_END = Patience(passes=2**62)


class Incumbent(NamedTuple):
    """The best word so far, or, without one, how the search ended."""

    word: Word | None
    expansions: int
    status: SearchStatus
    nearest: float = math.inf  # [m] from a goal to the nearest place that was reached


def incumbent_words(
    query: LatticeQuery,
    *,
    deadline: float = math.inf,
    max_expansions: int | None = None,
    better_share: float = 1.0,
    known: Word | None = None,
) -> Iterator[Incumbent]:
    """Words from the start to a goal as they are found, each cheaper than the one before.

    Where cost is time, the first words may last longer than the query admits: improved ones need
    not. Passes of greater weight come first; every word is shortened, and later passes are pruned
    by the best. The same number of expansions finds the same words at every call; shortcuts are
    rounds that are not counted. The last incumbent has no word: it says how the search ended.

    Parameters
    ----------
    query : LatticeQuery
    deadline : float
        Of `time.monotonic()` [s].
    max_expansions : int, optional
        Nodes of all passes together.
    better_share : float
        Of the time that is left when the first word is found: so much is for better ones.
    known : Word, optional
        A word that is free, with its cost: better ones are searched at once.
    """
    room = 2**62 if max_expansions is None else max_expansions

    def ended(total: int) -> SearchStatus:
        over = clock() >= deadline or total >= room
        return SearchStatus.OUT_OF_BUDGET if over else SearchStatus.EXHAUSTED

    grids = distance_grids(query)
    word, first, nearest = known, 0, 0.0
    if word is None:
        found = first_plan(query, deadline=deadline, max_expansions=max_expansions, grids=grids)
        word, first, nearest = found.word, found.expansions, found.nearest
    total = first
    if word is not None:
        if known is None:
            yield Incumbent(word, first, SearchStatus.FOUND)
        if better_share < 1.0:
            now = time.monotonic()
            deadline = now + better_share * (deadline - now)
        one = Improvement(
            query,
            word,
            grids=lambda: grids,
            deadline=deadline,
            patience=TO_THE_END,
            max_expansions=room - first,
            restarts=FINER,
        )
        for better in one.gains():
            yield Incumbent(better, first + one.expansions, SearchStatus.FOUND)
        total = first + one.expansions
    yield Incumbent(None, total, ended(total), nearest)


def quick_word(
    query: LatticeQuery,
    quick: LatticeQuery,
    *,
    deadline: float = math.inf,
    max_expansions: int | None = None,
) -> tuple[Word | None, int]:
    """The first word in time for `quick`, the same at the price of time, and expansions.

    Its cost is that at the prices of `query`. Where coasting costs next to nothing, a search by
    cost alone looks everywhere.
    """
    total = 0
    for incumbent in incumbent_words(quick, deadline=deadline, max_expansions=max_expansions):
        total = incumbent.expansions
        if incumbent.word is not None and incumbent.word.duration <= query.most_time:
            return with_price(query.library.priced, incumbent.word), total
    return None, total
