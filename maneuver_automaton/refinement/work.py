"""One word as arrays that kernels improve: its contents, its points, and its limits."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.budget import UNLIMITED, Budget, Pace
from maneuver_automaton.refinement._kernels_points import begin_program, join_points, take_program
from maneuver_automaton.refinement._kernels_word import AT_WILL, GAIN
from maneuver_automaton.refinement.arrays import (
    ImproveTask,
    Improving,
    PointArrays,
    WordArrays,
    WordSteps,
)
from maneuver_automaton.search.lattice_pass import with_cost
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_task import TRIES, limits_of
from maneuver_automaton.search.lattice_trims import MOST_TRIMS
from maneuver_automaton.words.library import SWITCH, scratch_of
from maneuver_automaton.words.shortest import least_radius
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
    one = improving(query, word, points=points)
    cost = begin_program(one, times)
    most = max(1, TIMELY_WORDS // (n_words * points))  # the last points have the most connections
    pace, first = Pace(budget, steps=most, most=most), 1
    while part := pace.take(points - first):
        join_points(one, first, first + part, n_words, GAIN * cost)
        first += part
    if first < points:
        return word
    take_program(one, cost)
    return word_of(one, word, query)


def point_times(query: LatticeQuery, word: Word, cut: float) -> Array:
    """Times at which a word is cut: equally apart within coasts, and at both ends of maneuvers.

    All but the ends lie earlier by the share `cut` of the time between two.
    """
    edges = query.edges_along(word)
    lasting = np.where(edges >= 0, np.append(query.library.arrays.edges.time, 0.0)[edges], 0.0)
    steps = np.cumsum(np.column_stack([lasting, word.durations]).ravel())
    begins, ends = steps[0::2], steps[1::2]
    if not len(ends):
        return np.zeros(0)
    even = ends[-1] * (np.arange(POINTS) - cut) / (POINTS - 1)
    even = np.append(np.clip(even, 0.0, ends[-1])[:-1], ends[-1])  # whatever rounding says
    inside = even <= ends[np.searchsorted(begins, even, side="right") - 1]
    led = np.flatnonzero(edges >= 0)
    return np.unique(np.concatenate([[0.0], even[inside], ends[led - 1], begins[led]]))


def improving(query: LatticeQuery, word: Word, *, points: int = 0) -> Improving:
    """A word in arrays with room for so many points, and what is asked of it."""
    library, used = query.library, len(word.trims)
    n = max(256, 4 * used + 64)

    def steps() -> WordSteps:
        numbers = np.zeros(n, dtype=np.int64)
        return WordSteps(numbers, np.zeros(n), np.full(n, AT_WILL))

    arrays = WordArrays(
        start=np.array(query.start),
        length=np.array([used], dtype=np.int64),
        now=steps(),
        poses=np.zeros((n, 4)),
        times=np.zeros(n + 1),
        ends=np.zeros(n),
        new=steps(),
        middle_trims=np.zeros(9, dtype=np.int64),
        middle_durations=np.zeros(9),
        one=scratch_of(library.arrays.library),
        two=scratch_of(library.arrays.library),
        points=PointArrays(
            at=np.zeros((points, 5)),
            owners=np.zeros(points, dtype=np.int64),
            best=np.zeros(points),
            spent=np.zeros(points),
            back=np.zeros(points, dtype=np.int64),
            by_trims=np.zeros((points, 4), dtype=np.int64),
            by_durations=np.zeros((points, 4)),
            legs=np.zeros(points, dtype=np.int64),
        ),
    )
    arrays.now.trims[:used] = library.number_of[word.trims]
    arrays.now.durations[:used] = word.durations
    arrays.now.edges[:used] = query.edges_along(word)
    return Improving(arrays, library.arrays, improve_task(query, word), query.scene())


def word_of(one: Improving, word: Word, query: LatticeQuery) -> Word:
    """The word that arrays hold."""
    n, library, now = int(one.word.length[0]), query.library, one.word.now
    maneuvers = np.append(library.arrays.edges.maneuver, SWITCH)[now.edges[:n]]
    trims, durations = library.trims[now.trims[:n]].tolist(), now.durations[:n].tolist()
    steps = zip(maneuvers.tolist(), trims, durations, strict=True)
    return with_cost(word_of_steps(steps, goal=word.goal), query)


def improve_task(query: LatticeQuery, word: Word) -> ImproveTask:
    """Limits and sizes of improving a word."""
    library = query.library
    twists = library.arrays.library.twists
    speed = float(np.hypot(twists[:, 0], twists[:, 1]).max())
    edges = library.arrays.edges
    steps = np.hypot(edges.displacement[:, 0], edges.displacement[:, 1])
    covers = steps > 0.0  # a maneuver may cover ground for less than any trim
    least = float((edges.cost[covers] / steps[covers]).min(initial=math.inf))
    # Of many trims a few of the cheapest words do nearly the same, and meet the same obstacle.
    tried = library.arrays.library.tried
    all_of_them = library.at_will and len(library.trims) > MOST_TRIMS
    return ImproveTask(
        tries=len(tried.words) if all_of_them else TRIES,
        limits=limits_of(query),
        given_ends=query.start_trim >= 0,
        per_metre=min(float(library.per_metre), least),
        radius=float(library.radius),
        least_radius=least_radius(twists[:-1]) if library.at_will else 0.0,
        shortest_span=float(0.25 * library.radius / max(speed, 1e-9)),
        snap=SNAP,
        via=VIA,
        spread=float(0.25 * library.radius),
        free_heading=bool(query.free_heading[word.goal]),
    )
