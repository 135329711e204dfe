"""Lattice A* over trims and maneuvers: a first plan soon, then cheaper ones while there is time."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from maneuver_automaton.automaton import Plan
from maneuver_automaton.refinement.improve import Improvement, Patience
from maneuver_automaton.refinement.restarts import FINER, FIRST_CHUNK, as_wide_as_turns
from maneuver_automaton.search.distance_grid import DistanceGrid, distance_grid
from maneuver_automaton.search.lattice import Schedule, first_word
from maneuver_automaton.search.lattice_pass import Pass, pass_of
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_task import Resolution
from maneuver_automaton.search.result import SearchStatus
from maneuver_automaton.search.reversal import forward_word, reversed_query
from maneuver_automaton.words.word import Word, with_price
from maneuver_automaton.words.word import plan_of as plan_of_word

MOST_CHUNK = 16384
FAST_ALONE = 2000  # expansions of a pass as wide as the turns, until others run in turn with it
FIRST: tuple[tuple[int, tuple[Resolution, ...]], ...] = (
    # after so many expansions of all passes together, or when all are exhausted
    (0, (Resolution(),)),
    (300, (Resolution(scale=0.5, durations=0.5), Resolution(durations=0.7))),
    (2000, (Resolution(scale=0.25, durations=0.25), Resolution(scale=0.5, durations=0.7))),
    (2000, (Resolution(backwards=True),)),
    (8000, (Resolution(scale=0.5, durations=0.5, weight=1.5, backwards=True),)),
    (40000, (Resolution(scale=0.25, durations=0.25, margin=0.1),)),
)
TO_THE_END = Patience(passes=2**62)


class Incumbent(NamedTuple):
    """The best word so far, or, without one, how the search ended."""

    word: Word | None
    expansions: int
    status: SearchStatus
    nearest: float = math.inf  # [m] from a goal to the nearest place that was reached


def maneuver_words(
    query: LatticeQuery,
    *,
    deadline: float = math.inf,
    max_expansions: int | None = None,
    better_share: float = 1.0,
    known: Word | None = None,
) -> Iterator[Incumbent]:
    """Words from the start to a goal as they are found, each cheaper than the one before.

    Where cost is time, the first words may last longer than the query admits: what they are
    improved to need not. Passes of greater weight come first; every word is shortened, and later
    passes are pruned by the best. What is found in a number of expansions is the same at every
    call; shortcuts are rounds that are not counted. The last incumbent has no word: it says how
    the search ended.

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
        over = time.monotonic() >= deadline or total >= room
        return SearchStatus.OUT_OF_BUDGET if over else SearchStatus.EXHAUSTED

    grid = _grid(query)
    word, first, nearest = known, 0, 0.0
    if word is None:
        word, first, nearest = _first(query, grid, room=room, deadline=deadline)
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
            grids=lambda: (grid,),
            deadline=deadline,
            patience=TO_THE_END,
            max_expansions=room - first,
            restarts=FINER,
        )
        for better in one.gains():
            yield Incumbent(better, first + one.expansions, SearchStatus.FOUND)
        total = first + one.expansions
    yield Incumbent(None, total, ended(total), nearest)


def _grid(query: LatticeQuery) -> DistanceGrid:
    """Distances in the plane to the goals of a query."""
    return distance_grid(query.plane, query.box, query.goals, query.start)


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
    for incumbent in maneuver_words(quick, deadline=deadline, max_expansions=max_expansions):
        total = incumbent.expansions
        if incumbent.word is not None and incumbent.word.duration <= query.most_time:
            return with_price(query.library.priced, incumbent.word), total
    return None, total


def plan_of(query: LatticeQuery, word: Word) -> Plan:
    """A word as a plan that ends exactly at its goal, in the frame of the query."""
    return plan_of_word(
        query.automaton,
        word,
        query.problem.start,
        goal=query.goal_poses[word.goal],
        start_time=query.start_time,
    )


def _first(
    query: LatticeQuery, grid: DistanceGrid, *, room: int, deadline: float
) -> tuple[Word | None, int, float]:
    """Passes of rising resolution in turn until one connects.

    The word, expansions, and the distance [m] from a goal to the nearest place that was reached.
    """
    weight = query.settings.weight
    found = first_word(
        Schedule(_first_stages(query), FIRST_CHUNK, MOST_CHUNK),
        lambda one: _passes(query, one if weight is None else replace(one, weight=weight), grid),
        room=room,
        deadline=deadline,
    )
    ahead = [one.nearest for one in found.passes if not one.resolution.backwards]
    if found.word is None or found.by is None:
        return None, found.expansions, min(ahead, default=math.inf)
    backwards = found.by.resolution.backwards
    return forward_word(found.word) if backwards else found.word, found.expansions, 0.0


def _first_stages(query: LatticeQuery) -> tuple[tuple[int, tuple[Resolution, ...]], ...]:
    """Which passes begin after how many expansions of all of them together.

    A vehicle that turns widely for its size begins with a pass whose cells and coasts are as wide:
    it decides little from one length of its body to the next.
    """
    fast = as_wide_as_turns(query)
    return ((0, fast), (FAST_ALONE, FIRST[0][1]), *FIRST[1:]) if fast else FIRST


def _passes(query: LatticeQuery, resolution: Resolution, grid: DistanceGrid) -> list[Pass]:
    """Passes that are ready to run; one from the goal only where that can be asked."""
    resolution = replace(resolution, ends_early=True)
    if not resolution.backwards:
        return [pass_of(query, resolution, grid=grid)]
    back = reversed_query(query)
    return [] if back is None else [pass_of(back, resolution, grid=_grid(back))]
