"""Whether a word is free as it is driven, and rests along it so that moving obstacles pass."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.groups import SE2
from maneuver_automaton.groups.se2 import coasted
from maneuver_automaton.search import _kernels_waiting as kernels
from maneuver_automaton.search.arrays import PathArrays, PathSearch
from maneuver_automaton.search.lattice_pass import with_cost
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_task import limits_of
from maneuver_automaton.words.library import SWITCH
from maneuver_automaton.words.word import Word

MOST_PIECES = 60  # joints at which it may wait
MOST_STATES = 4096  # of joints, each for a stretch of time; in long words four a joint
TICK = 0.1  # [s] between departures that are tried
SHORT_TURN = 0.2  # [rad] of the pieces whose bulge is bounded


def with_waits(query: LatticeQuery, word: Word, *, hurried: bool = False) -> Word | None:
    """The word with rests put in so that it is free at the times it is driven; None if none are.

    It arrives as early as rests at the joints of its pieces allow; `hurried` leaves them there
    where that costs nothing, else several are put together. Without a rest in the library the word
    is taken as it is, if it is free.

    Source: Phillips, Likhachev (2011), *SIPP: Safe Interval Path Planning for Dynamic
    Environments*, ICRA, here along one path.
    """
    library = query.library.arrays.library
    still = np.flatnonzero(~library.twists[: library.n_trims].any(axis=1))
    rest = int(still[0]) if still.size else -1
    # An empty word is a body that stands: a piece of no duration, in any trim.
    trims, durations = np.array([max(rest, 0)]), np.zeros(1)
    if len(word.trims):  # cut into pieces of about equal length
        longest = float(word.durations.sum()) / MOST_PIECES
        counts = np.maximum(1, np.ceil(word.durations / longest).astype(int))
        trims = np.repeat(query.library.number_of[word.trims], counts)
        durations = np.repeat(word.durations / counts, counts)
    path = _path_of(query, trims, durations)
    if (state := _arrival(query, path, rest)) < 0:
        return None
    if not len(word.trims):
        return with_cost(word, query)
    ways = [_with_rests(path, state, rest)]
    if not hurried or library.switch > 0.0:
        ways.append(_with_fewer_rests(query, ways[0], rest))
    numbers = query.library.trims
    driven = [[(SWITCH, int(numbers[trim]), t) for trim, t in one] for one in ways]
    words = [with_cost(query.word_of(one, word.goal), query) for one in driven]
    return min(words, key=lambda timed: timed.cost)


def _with_fewer_rests(
    query: LatticeQuery, parts: list[tuple[int, float]], rest: int
) -> list[tuple[int, float]]:
    """The same arrival with rests put together where that is free: it may have fewer switches."""
    at = len(parts) - 1
    while at > 0:
        if parts[at][0] == rest:
            earlier = [k for k in range(at) if parts[k][0] == rest]
            for to in dict.fromkeys([*earlier[-1:], *earlier[:1], 0]):
                moved = [*parts[:at], *parts[at + 1 :]]
                if moved[to][0] == rest:
                    moved[to] = (rest, moved[to][1] + parts[at][1])
                else:
                    moved.insert(to, (rest, parts[at][1]))
                if _drives(query, *(np.array(column) for column in zip(*moved, strict=True))):
                    parts = moved
                    break
        at -= 1
    return parts


def is_free(query: LatticeQuery, word: Word) -> bool:
    """Whether a word without maneuvers stays inside the window, and is proven free as it is.

    Its trims are in the library of the query.
    """
    numbers = query.library.number_of[word.trims]
    twists = query.library.arrays.library.twists[numbers, :3]
    poses = coasted(query.start[:3], twists, word.durations)
    if not _inside(query.window, poses[:-1], twists, word.durations):
        return False
    return _drives(query, np.asarray(numbers, dtype=np.int64), np.array(word.durations))


def _drives(query: LatticeQuery, trims: IntArray, durations: Array) -> bool:
    """Whether a path in pieces is proven free as it is."""
    path = _path_of(query, trims, durations, states=len(trims) + 1)  # each joint at one time
    return _arrival(query, path, -1) >= 0


def _path_of(
    query: LatticeQuery, trims: IntArray, durations: Array, *, states: int = 0
) -> PathArrays:
    """A path in pieces from the start of a query, and room for the states along it."""
    states = states or max(MOST_STATES, 4 * len(trims))
    twists = query.library.arrays.library.twists
    poses = np.zeros((len(trims) + 1, 4))
    poses[:, :3] = coasted(query.start[:3], twists[trims, :3], durations)
    poses[:, 3] = query.start[3] + np.append(0.0, np.cumsum(durations * twists[trims, 3]))
    return PathArrays(
        trims=trims,
        durations=durations,
        poses=poses,
        links=np.empty((states, 2), dtype=np.int64),
        times=np.empty((states, 3)),
        before=np.empty(states, dtype=np.int64),
        latest=np.full(len(trims) + 1, -1, dtype=np.int64),
        last=np.full(len(trims), np.inf),
        keys=np.empty(states),
        items=np.empty(states, dtype=np.int64),
        state=np.zeros(2, dtype=np.int64),
    )


def _arrival(query: LatticeQuery, path: PathArrays, rest: int) -> int:
    """The state in which a path ends first, if it may wait in the trim `rest`; -1 for none."""
    quiet = max(query.world.last_event - query.problem.start_time, 0.0)
    known = query.library.arrays, query.scene(), limits_of(query)
    return int(kernels.earliest_arrival(PathSearch(path, *known, quiet, rest, TICK)))


def _inside(window: Array, poses: Array, twists: Array, durations: Array) -> bool:
    """Whether motions stay inside a window (9,), in short pieces; some near its rim do not."""
    turns = np.abs(twists[:, 2]) * durations
    counts = np.maximum(1, np.ceil(turns / SHORT_TURN).astype(int))
    times, steps = np.repeat(durations / counts, counts), np.repeat(np.arange(len(counts)), counts)
    firsts = np.repeat(np.cumsum(counts) - counts, counts)
    begins = times * (np.arange(len(steps)) - firsts)
    before = SE2(poses[steps]) @ SE2.exp(begins[:, None] * twists[steps])
    after = before @ SE2.exp(times[:, None] * twists[steps])
    lengths = np.hypot(twists[steps, 0], twists[steps, 1]) * times
    bulge = 0.5 * lengths * np.tan(0.25 * np.abs(twists[steps, 2]) * times)  # at most: of chords
    slack = np.tile(window[8] - bulge, 2)
    x, y = (np.concatenate([before.pose, after.pose])[:, :2] - window[4:6]).T
    seen_x, seen_y = window[6] * x - window[7] * y, window[7] * x + window[6] * y
    inside = (seen_x >= window[0] - slack) & (seen_x <= window[2] + slack)
    inside &= (seen_y >= window[1] - slack) & (seen_y <= window[3] + slack)
    return bool(inside.all())


def _with_rests(path: PathArrays, state: int, rest: int) -> list[tuple[int, float]]:
    """Trims and durations of the path with its rests, read backwards from its last state."""
    parts: list[tuple[int, float]] = []
    while (parent := int(path.links[state, kernels.PARENT])) >= 0:
        joint = int(path.links[parent, kernels.JOINT])
        parts.append((int(path.trims[joint]), float(path.durations[joint])))
        waited = float(path.times[state, kernels.DEPARTURE] - path.times[parent, kernels.ARRIVAL])
        if waited > 0.0:
            parts.append((rest, waited))
        state = parent
    return parts[::-1]
