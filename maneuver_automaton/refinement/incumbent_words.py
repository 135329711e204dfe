"""Lattice A* over trims and maneuvers: a first plan soon, then cheaper ones while there is time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.refinement.improve import FINER, Improvement, Patience
from maneuver_automaton.search.lattice import distance_grids, first_plan
from maneuver_automaton.search.lattice_pass import with_cost
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.result import SearchStatus
from maneuver_automaton.words.word import Word

TO_THE_END = Patience(passes=2**62)


class Incumbent(NamedTuple):
    """The best word so far, or, without one, how the search ended."""

    word: Word | None
    expansions: int
    status: SearchStatus


def incumbent_words(
    query: LatticeQuery,
    *,
    budget: Budget = UNLIMITED,
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
    budget : Budget
        Its expansions are those of all passes together.
    better_share : float
        Of the time that is left when the first word is found: so much is for better ones.
    known : Word, optional
        A word that is free, with its cost: better ones are searched at once.
    """
    room = 2**62 if budget.expansions is None else budget.expansions

    def ended(total: int) -> SearchStatus:
        over = budget.is_over or total >= room
        return SearchStatus.OUT_OF_BUDGET if over else SearchStatus.EXHAUSTED

    grids = distance_grids(query)
    word, first = known, 0
    if word is None:
        found = first_plan(query, budget=budget, grids=grids)
        word, first = found.word, found.expansions
    total = first
    if word is not None:
        if known is None:
            yield Incumbent(word, first, SearchStatus.FOUND)
        if better_share < 1.0:
            budget = replace(budget, deadline=budget.part(better_share).deadline)
        one = Improvement(
            query,
            word,
            grids=lambda: grids,
            budget=replace(budget, expansions=room - first),
            patience=TO_THE_END,
            restarts=FINER,
        )
        for better in one.gains():
            yield Incumbent(better, first + one.expansions, SearchStatus.FOUND)
        total = first + one.expansions
    yield Incumbent(None, total, ended(total))


def quick_word(
    query: LatticeQuery,
    quick: LatticeQuery,
    *,
    budget: Budget = UNLIMITED,
) -> tuple[Word | None, int]:
    """The first word in time for `quick`, the same at the price of time, and expansions.

    Its cost is that at the prices of `query`. Where coasting costs next to nothing, a search by
    cost alone looks everywhere.
    """
    total = 0
    for incumbent in incumbent_words(quick, budget=budget):
        total = incumbent.expansions
        if incumbent.word is not None and incumbent.word.duration <= query.most_time:
            return with_cost(incumbent.word, query), total
    return None, total
