"""A whole search over trims and maneuvers in one call, for tests and benchmarks."""

from __future__ import annotations

import time
from dataclasses import dataclass

from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.refinement.improve import WordSchedule, words_of
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.result import SearchStatus
from maneuver_automaton.words.word import Word


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ManeuverResult:
    """Plans of one query, each cheaper than the one before."""

    status: SearchStatus
    words: tuple[Word, ...]  # the last is the best
    found_after: tuple[int, ...] = ()  # expansions until each was found
    found_s: tuple[float, ...] = ()  # [s]
    expansions: int = 0

    @property
    def best(self) -> Word | None:
        """The cheapest word, None if there is none."""
        return self.words[-1] if self.words else None


def search_maneuvers(
    query: LatticeQuery,
    *,
    budget: Budget = UNLIMITED,
    max_expansions: int | None = None,
    first_only: bool = False,
) -> ManeuverResult:
    """Words from the start to a goal, each cheaper than the one before: see `words_of`.

    Returns
    -------
    ManeuverResult
        EXHAUSTED without a word: none at these resolutions, which proves nothing.
    """
    begun = time.monotonic()
    found: list[tuple[Word, int, float]] = []
    search = words_of(
        query, budget=budget._replace(expansions=max_expansions), schedule=WordSchedule()
    )
    for word in search:
        found.append((word, search.expansions, time.monotonic() - begun))
        if first_only:
            break
    status = SearchStatus.OUT_OF_BUDGET if search.is_late else SearchStatus.EXHAUSTED
    return ManeuverResult(
        status=SearchStatus.FOUND if found else status,
        words=tuple(word for word, _, _ in found),
        found_after=tuple(n for _, n, _ in found),
        found_s=tuple(s for _, _, s in found),
        expansions=search.expansions,
    )
