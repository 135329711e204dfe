"""Schedules of new searches beside a known word: at which resolutions, how far, in which order."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton.search.lattice_library import LatticeLibrary
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_task import Resolution, as_wide_as_turns

PRUNE = 1.08  # of a new search: its raw path is longer than the improved one
FIRST_CAP = 1500  # expansions of the first new search ...
CAP_GROWTH = 1.35  # ... and how the caps grow
MOST_CAP = 60_000
WEIGHTS = (2.0, 1.5, 1.25, 1.1, 1.0)
FIRST_CHUNK = 128  # expansions
IN_SPACE: tuple[Resolution, ...] = (
    # one more dimension: coarse cells and little greed find the path, fine ones do not end
    Resolution(scale=12.0, durations=4.0, weight=1.0, most=40000),
    Resolution(scale=8.0, durations=3.0, weight=1.0, most=60000),
    Resolution(scale=4.0, durations=2.0, weight=1.2, most=60000),
    Resolution(scale=4.0, durations=2.0, weight=1.1, most=100000),
    Resolution(scale=6.0, durations=2.0, weight=1.0, most=100000),
)
ABOVE: tuple[Resolution, ...] = (
    Resolution(scale=6.0, durations=2.0, weight=1.0, most=100000, straight=True),
    Resolution(weight=1.0, most=60000, straight=True),
)
LATER: tuple[Resolution, ...] = (
    Resolution(weight=1.5),
    Resolution(weight=1.2),
    Resolution(weight=1.0),
    Resolution(scale=0.5, durations=0.5, weight=1.2),
    Resolution(scale=0.5, durations=0.5, weight=1.0),
)


class Restart(NamedTuple):
    """One new search."""

    resolution: Resolution
    chunk: int  # expansions until its word is looked at first
    sign: float = 1.0  # -1: from the goal
    prune: float = 1.0  # children below so many times the cost of the best word are kept
    all_words: bool = True  # of the library, for shortcuts; otherwise those of few trims


@dataclass(frozen=True, slots=True, eq=False)
class Restarts:
    """A schedule, and how many rounds of the dynamic program the words of its searches get."""

    of: Callable[[LatticeQuery, np.random.Generator], Iterator[Restart]]
    rounds: int
    moving_rounds: int  # among moving obstacles: the trims that stay are then driven at other times


def _random(query: LatticeQuery, rng: np.random.Generator) -> Iterator[Restart]:
    """Short searches at other and other resolutions, from both ends in turn, without an end."""
    step = 0
    while True:
        scale, durations = 1.0, 1.0
        weight = WEIGHTS[step // 2] if step < 2 * len(WEIGHTS) else float(rng.uniform(1.0, 2.0))
        if step >= 2:
            scale, durations = (float(value) for value in rng.uniform(0.5, 1.4, 2))
        most = min(int(FIRST_CAP * CAP_GROWTH ** min(step // 2, 100)), MOST_CAP)
        resolution = Resolution(
            scale=scale,
            durations=durations,
            weight=weight,
            truncated=step % 5 == 4,
            stop=step % 3 == 1,
            layered=step % 4 >= 2,
            most=most,
        )
        sign = -1.0 if step % 2 and not query.moves else 1.0
        yield Restart(resolution, most, sign, PRUNE)
        step += 1


def _finer(query: LatticeQuery, rng: np.random.Generator) -> Iterator[Restart]:
    """Searches of falling weight and size, each to its end below the cost of the best word."""
    later = (*as_wide_as_turns(query.library), *LATER)
    rounds: tuple[tuple[tuple[Resolution, ...], bool], ...] = ((later, True),)
    if query.problem.start.size > 3:
        # Above obstacles a path is as short as a straight line. Estimates from cell to cell are
        # longer and end a search early, which is quick; the last ones do without.
        rounds = ((IN_SPACE, False), (later, True), (ABOVE, True))
    for resolutions, all_words in rounds:
        for one in resolutions:
            resolution = replace(one, stop=False, ends_early=True)
            yield Restart(resolution, FIRST_CHUNK, all_words=all_words)


def restarts_of(library: LatticeLibrary) -> Restarts:
    """The schedule for a library: trims that are switched at will in the plane, or others."""
    return RANDOM if library.at_will else FINER


RANDOM = Restarts(_random, rounds=1, moving_rounds=0)
FINER = Restarts(_finer, rounds=8, moving_rounds=8)
