"""Rests along a path that is free of static obstacles, so that moving obstacles pass."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.groups import SE2
from maneuver_automaton.groups.chain import chained
from maneuver_automaton.search import _kernels_waiting as kernels
from maneuver_automaton.search.lattice_pass import with_cost
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.words.transitions import SWITCH
from maneuver_automaton.words.word import Word

MOST_PIECES = 60  # joints at which it may wait
MOST_TICKS = 300  # of the clock, until nothing moves any more
SHORTEST_TICK = 0.1  # [s]


class PathArrays(NamedTuple):
    """Pieces of a path, as the kernel sees them."""

    trims: IntArray  # (n,)
    durations: Array  # (n,)
    poses: Array  # (n + 1, 3)
    before: NDArray[np.int32]  # (n + 1, ticks, 2) joint and tick of the departure, or a mark


def with_waits(query: LatticeQuery, word: Word) -> Word | None:
    """The word with rests put in so that it is free at the times it is driven; None if none are.

    It arrives as early as rests at the joints of its pieces allow. Without a rest in the library
    the word is taken as it is, if it is free.
    """
    library = query.library.arrays
    if not len(word.trims):
        return with_cost(word, query)
    twists = library.library.twists
    still = np.flatnonzero(~twists[: library.library.n_trims].any(axis=1))
    rest = int(still[0]) if still.size else -1
    trims, durations = _pieces(word, query)
    until = query.world.last_event - query.problem.start_time
    lasting = max(until, 0.0) + 1.0 if math.isfinite(until) else 1.0
    tick = max(SHORTEST_TICK, lasting / MOST_TICKS)
    ticks = math.ceil(lasting / tick) + 2
    steps = SE2.exp(durations[:, None] * twists[trims, :3]).pose
    path = PathArrays(
        trims=trims,
        durations=durations,
        poses=np.ascontiguousarray(chained(query.start[:3], steps)),
        before=np.empty((len(trims) + 1, ticks, 2), dtype=np.int32),
    )
    joint, at, _ = kernels.earliest_arrival(
        library,
        query.scene(),
        (float(query.start_time), float(query.most_time), float(query.stay_until)),
        path,
        rest,
        tick,
    )
    if joint < 0:
        return None
    parts = _with_rests(path, joint, at, rest, tick)
    driven = [(SWITCH, int(query.library.trims[trim]), t) for trim, t in parts]
    return with_cost(query.word_of(driven, word.goal), query)


def _pieces(word: Word, query: LatticeQuery) -> tuple[IntArray, Array]:
    """Trims, as the lattice numbers them, cut into pieces of about equal length."""
    longest = float(word.durations.sum()) / MOST_PIECES
    counts = np.maximum(1, np.ceil(word.durations / longest).astype(int))
    numbers = query.library.number_of[word.trims]
    return np.repeat(numbers, counts), np.repeat(word.durations / counts, counts)


def _with_rests(
    path: PathArrays, joint: int, at: int, rest: int, tick: float
) -> list[tuple[int, float]]:
    """Trims and durations of the path with its rests, read backwards from the last departure."""
    end = len(path.trims)
    parts: list[tuple[int, float]] = []
    while True:
        pieces = list(zip(path.trims[joint:end], path.durations[joint:end], strict=True))
        parts = [(int(trim), float(t)) for trim, t in pieces] + parts
        waited = 0
        while path.before[joint, at, 0] == kernels.WAITED:
            waited, at = waited + 1, at - 1
        if joint == 0 and at == 0:
            return [(rest, waited * tick), *parts] if waited else parts
        before, left = (int(k) for k in path.before[joint, at])
        spent = left * tick + float(path.durations[before:joint].sum())
        parts = [(rest, (at + waited) * tick - spent), *parts]
        end, joint, at = joint, before, left
