"""A whole search over trims and maneuvers in one call, for tests and benchmarks."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._compile import bare_kernel
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.refinement.improve import WordSchedule, words_of
from maneuver_automaton.search._kernels_coast import coast_free, coast_inside, coasted
from maneuver_automaton.search._kernels_connection import edge_end, edge_free
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.result import SearchStatus
from maneuver_automaton.words.library import SWITCH
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
        query, budget=replace(budget, expansions=max_expansions), schedule=WordSchedule()
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


def word_is_free(query: LatticeQuery, word: Word) -> bool:
    """Whether a word is proven free all the way, at the times when it is where."""
    library = query.library
    edges = np.full(len(word.trims), -1)
    led = np.flatnonzero(word.transitions != SWITCH)
    edges[led + 1] = library.edges_of(word.transitions[led])
    return bool(
        word_free(
            query.scene(),
            library.arrays,
            np.array(query.start),
            edges,
            library.number_of[word.trims],
            np.array(word.durations),
            float(query.problem.start_time),
        )
    )


@bare_kernel
def word_free(scene, lib, start, edges, trims, durations, clock):
    """Whether a whole word from `start` (4,) is free: each trim, and the edge to it, or -1."""
    pose = (start[0], start[1], start[2], start[3])
    for k in range(edges.shape[0]):
        if edges[k] >= 0:
            if not edge_free(scene, lib, edges[k], pose, clock):
                return False
            pose = edge_end(lib, edges[k], pose)
            clock += lib.edges.time[edges[k]]
        if durations[k] > 0.0:
            trim, t = trims[k], durations[k]
            if not coast_inside(scene, lib, trim, pose, t):
                return False
            if not coast_free(scene, lib, trim, pose, t, clock):
                return False
            pose = coasted(lib, trim, pose, t)
            clock += t
    return True
