"""Whether a word is free as it is driven, and rests along it so that moving obstacles pass."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.groups import SE2
from maneuver_automaton.groups.chain import chained, coasted
from maneuver_automaton.search import _kernels_waiting as kernels
from maneuver_automaton.search.lattice_pass import with_cost
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.words.transitions import SWITCH
from maneuver_automaton.words.word import Word

MOST_PIECES = 60  # joints at which it may wait
MOST_TICKS = 300  # of the clock, until nothing moves any more
SHORTEST_TICK = 0.1  # [s]
SHORT_TURN = 0.2  # [rad] of the pieces whose bulge is bounded


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


def is_free(query: LatticeQuery, word: Word) -> bool:
    """Whether a word without maneuvers stays inside the window, and is proven free as it is.

    Its trims are in the library of the query.
    """
    library = query.library.arrays
    numbers = query.library.number_of[word.trims]
    twists = library.library.twists[numbers, :3]
    poses = coasted(query.start[:3], twists, word.durations)
    if not _inside(query.window, poses[:-1], twists, word.durations):
        return False
    path = PathArrays(
        trims=np.asarray(numbers, dtype=np.int64),
        durations=np.array(word.durations),
        poses=poses,
        before=np.empty((len(numbers) + 1, 1, 2), dtype=np.int32),
    )
    clocks = (float(query.start_time), float(query.most_time), float(query.stay_until))
    joint, _, _ = kernels.earliest_arrival(library, query.scene(), clocks, path, -1, 1.0)
    return bool(joint >= 0)


def _inside(window: Array, poses: Array, twists: Array, durations: Array) -> bool:
    """Whether motions stay inside a window (9,), as in `_kernels_window`; some near its rim do not.

    They are looked at in short pieces: where both ends are inside by the bulge of the arc between
    them, so is the arc. Without bounds the window is far from everything.
    """
    turns = np.abs(twists[:, 2]) * durations
    counts = np.maximum(1, np.ceil(turns / SHORT_TURN).astype(int))
    times, steps = np.repeat(durations / counts, counts), np.repeat(np.arange(len(counts)), counts)
    firsts = np.repeat(np.cumsum(counts) - counts, counts)
    begins = times * (np.arange(len(steps)) - firsts)
    before = SE2(poses[steps]) @ SE2.exp(begins[:, None] * twists[steps])
    after = before @ SE2.exp(times[:, None] * twists[steps])
    lengths = np.hypot(twists[steps, 0], twists[steps, 1]) * times
    bulge = 0.5 * lengths * np.tan(0.25 * np.abs(twists[steps, 2]) * times)  # at most: of chords
    slack = window[8] - bulge
    for place in (before.pose[:, :2], after.pose[:, :2]):
        x, y = place[:, 0] - window[4], place[:, 1] - window[5]
        seen_x, seen_y = window[6] * x - window[7] * y, window[7] * x + window[6] * y
        inside = (seen_x >= window[0] - slack) & (seen_x <= window[2] + slack)
        inside &= (seen_y >= window[1] - slack) & (seen_y <= window[3] + slack)
        if not inside.all():
            return False
    return True


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
