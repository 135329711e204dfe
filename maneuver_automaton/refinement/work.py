"""One word as arrays that kernels improve: its contents, its points, and its limits."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.budget import UNLIMITED, Budget, Pace
from maneuver_automaton.refinement._kernels_points import begin_program, join_points, take_program
from maneuver_automaton.refinement._kernels_word import AT_WILL, GAIN, LENGTH
from maneuver_automaton.refinement.arrays import ImproveTask, Work
from maneuver_automaton.search.lattice_pass import with_cost
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_task import TRIES
from maneuver_automaton.words.library import scratch_of
from maneuver_automaton.words.transitions import SWITCH
from maneuver_automaton.words.word import Word, word_of_steps

POINTS = 40  # of the dynamic program, at equal times
VIA = 0.6  # share of attempts with a via-point
SNAP = 0.25  # chance of an end to snap to a switch
TIMELY_WORDS = 200_000  # words of connections between two looks at the clock


def shortcut(
    query: LatticeQuery, word: Word, *, n_words: int, cut: float, budget: Budget = UNLIMITED
) -> Word:
    """The word after one round of the dynamic program over its points."""
    times = point_times(query, word, cut)
    points = len(times)
    if points < 2:
        return word
    work, state = work_of(query, word, points=points)
    task, scene, arrays = improve_task(query, word), query.scene(), query.library.arrays
    cost = begin_program(arrays, work, state, times)
    most = max(1, TIMELY_WORDS // (n_words * points))  # the last points have the most connections
    pace, first = Pace(budget, steps=most, most=most), 1
    while part := pace.take(points - first):
        join_points(arrays, task, scene, work, first, first + part, n_words, GAIN * cost)
        first += part
    if first < points:
        return word
    take_program(arrays, task, scene, work, state, cost)
    return word_of(work, state, word, query)


def point_times(query: LatticeQuery, word: Word, cut: float) -> Array:
    """Times at which a word is cut: equally apart within coasts, and at both ends of maneuvers.

    All but the ends lie earlier by the share `cut` of the time between two.
    """
    edges = _edges_of(query, word)
    lasting = np.where(edges >= 0, np.append(query.library.arrays.edge_time, 0.0)[edges], 0.0)
    steps = np.cumsum(np.column_stack([lasting, word.durations]).ravel())
    begins, ends = steps[0::2], steps[1::2]
    if not len(ends):
        return np.zeros(0)
    even = ends[-1] * (np.arange(POINTS) - cut) / (POINTS - 1)
    even = np.append(np.clip(even, 0.0, ends[-1])[:-1], ends[-1])  # whatever rounding says
    inside = even <= ends[np.searchsorted(begins, even, side="right") - 1]
    led = np.flatnonzero(edges >= 0)
    return np.unique(np.concatenate([[0.0], even[inside], ends[led - 1], begins[led]]))


def _edges_of(query: LatticeQuery, word: Word) -> IntArray:
    """The edge (n,) that leads to each trim of a word, -1 for a switch, and to the first."""
    edges = np.full(len(word.trims), AT_WILL)
    led = np.flatnonzero(word.transitions != SWITCH)
    edges[led + 1] = query.library.edges_of(word.transitions[led])
    return edges


def work_of(query: LatticeQuery, word: Word, *, points: int = 0) -> tuple[Work, IntArray]:
    """Arrays that hold a word, with room for so many points, and its state."""
    library, used = query.library, len(word.trims)
    n = max(256, 4 * used + 64)
    work = Work(
        start=np.array(query.start),
        trims=np.zeros(n, dtype=np.int64),
        durations=np.zeros(n),
        edges=np.full(n, AT_WILL),
        poses=np.zeros((n, 4)),
        times=np.zeros(n + 1),
        ends=np.zeros(n),
        new_trims=np.zeros(n, dtype=np.int64),
        new_durations=np.zeros(n),
        new_edges=np.zeros(n, dtype=np.int64),
        middle_trims=np.zeros(9, dtype=np.int64),
        middle_durations=np.zeros(9),
        one=scratch_of(library.arrays.library),
        two=scratch_of(library.arrays.library),
        at=np.zeros((points, 5)),
        owners=np.zeros(points, dtype=np.int64),
        best=np.zeros(points),
        spent=np.zeros(points),
        back=np.zeros(points, dtype=np.int64),
        by_trims=np.zeros((points, 4), dtype=np.int64),
        by_durations=np.zeros((points, 4)),
        legs=np.zeros(points, dtype=np.int64),
    )
    work.trims[:used] = library.number_of[word.trims]
    work.durations[:used] = word.durations
    work.edges[:used] = _edges_of(query, word)
    return work, np.array([used], dtype=np.int64)


def word_of(work: Work, state: IntArray, word: Word, query: LatticeQuery) -> Word:
    """The word that arrays hold."""
    n, library = int(state[LENGTH]), query.library
    maneuvers = np.append(library.edge_maneuver, SWITCH)[work.edges[:n]]
    steps = zip(
        maneuvers.tolist(),
        library.trims[work.trims[:n]].tolist(),
        work.durations[:n].tolist(),
        strict=True,
    )
    return with_cost(word_of_steps(steps, goal=word.goal), query)


def improve_task(query: LatticeQuery, word: Word) -> ImproveTask:
    """Limits and sizes of improving a word."""
    library = query.library
    twists = library.arrays.library.twists
    speed = float(np.hypot(twists[:, 0], twists[:, 1]).max())
    steps = np.hypot(library.arrays.edge_displacement[:, 0], library.arrays.edge_displacement[:, 1])
    covers = steps > 0.0  # a maneuver may cover ground for less than any trim
    least = float((library.arrays.edge_cost[covers] / steps[covers]).min(initial=math.inf))
    return ImproveTask(
        tries=TRIES,
        clock=float(query.start_time),
        most_time=float(query.most_time),
        stay_until=float(query.stay_until),
        most_trims=int(query.most_trims),
        least_coast=float(query.least_coast),
        given_ends=query.start_trim >= 0,
        per_metre=min(float(library.per_metre), least),
        radius=float(library.radius),
        shortest_span=float(0.25 * library.radius / max(speed, 1e-9)),
        snap=SNAP,
        via=VIA,
        spread=float(0.25 * library.radius),
        free_heading=bool(query.free_heading[word.goal]),
    )
