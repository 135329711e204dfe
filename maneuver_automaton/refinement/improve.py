"""Make a free word cheaper until nothing gains any more, or the time is over.

Dynamic programming over the word's points, random shortcuts and via-points, and new searches from
both ends at other resolutions, which find other ways round the obstacles. The sequence is the
same at every call: it is counted in attempts, and a time limit only says where it stops.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.refinement._kernels_improve import attempt_all
from maneuver_automaton.refinement._kernels_points import dynamic_programming
from maneuver_automaton.refinement._kernels_word import LENGTH
from maneuver_automaton.search.cost_to_go import NO_TABLE, CostTable
from maneuver_automaton.search.distance_grid import DistanceGrid
from maneuver_automaton.search.lattice import distance_grids
from maneuver_automaton.search.lattice_memory import SearchArrays, search_arrays
from maneuver_automaton.search.lattice_pass import both_ends, with_cost
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_task import TRIES, Resolution
from maneuver_automaton.words.library import Scratch, scratch_of
from maneuver_automaton.words.word import Word

POINTS = 40  # of the dynamic program
FIRST_GAINS = 4  # new searches after which the first gains are made
SLICE = 400  # attempts
SECOND_SLICE = 2000  # attempts for candidates near the best
NEAR = 1.01  # share of the best cost that is near
PRUNE = 1.08  # of a new search: its raw path is longer than what it becomes
FIRST_CAP = 1500  # expansions of the first new search ...
CAP_GROWTH = 1.35  # ... and how the caps grow
MOST_CAP = 60_000
WEIGHTS = (2.0, 1.5, 1.25, 1.1, 1.0)
VIA = 0.6  # share of attempts with a via-point
SNAP = 0.25  # chance of an end to snap to a switch
SEED = 20_09  # of the random draws
MOST_OTHERS = 50  # words kept beside the best
TIMELY = 400  # attempts between two looks at the clock


class Work(NamedTuple):
    """Arrays of one word that is being improved."""

    start: Array  # (3,)
    trims: IntArray
    durations: Array
    poses: Array  # (n + 1, 3)
    times: Array
    new_trims: IntArray
    new_durations: Array
    middle_trims: IntArray  # (6,)
    middle_durations: Array
    one: Scratch
    two: Scratch
    at: Array  # (points, 4)
    best: Array
    back: IntArray
    by_trims: IntArray  # (points, 3)
    by_durations: Array
    legs: IntArray


class ImproveTask(NamedTuple):
    """Limits and sizes, as the kernels see them."""

    tries: int
    clock: float
    most_time: float
    stay_until: float
    most_trims: int
    per_metre: float
    radius: float
    shortest_span: float  # [s]
    snap: float
    via: float
    spread: float  # [m]
    free_heading: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Improved:
    """What the improvement came to."""

    word: Word
    attempts: int
    expansions: int
    queries: int  # collision queries of the new searches
    passes: int  # new searches
    finished: bool  # nothing gained for as long as the settings ask
    others: tuple[Word, ...] = ()  # what other searches came to, cheapest first


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """When to stop: after so many attempts and new searches in a row that gained nothing."""

    attempts: int = 20_000
    passes: int = 12


Better = Callable[[Word], None]


def improve(
    query: LatticeQuery,
    word: Word,
    *,
    deadline: float,
    patience: Patience,
    floor: float = -math.inf,
    max_expansions: int | None = None,
    table: CostTable = NO_TABLE,
    better: Better = lambda word: None,
    meanwhile: Callable[[], None] = lambda: None,
) -> Improved:
    """The cheapest word found from `word` on, which must be free; `better` hears of each gain.

    It ends when no word can be cheaper than `floor` allows. Once the first gains are made,
    `meanwhile` is called: what has to be prepared, but not at once.
    """
    one = _Improvement(query, word, deadline, patience, floor, max_expansions, table, better)
    return one.run(meanwhile)


@dataclass(slots=True, eq=False)
class _Improvement:
    """The state of one improvement."""

    query: LatticeQuery
    best: Word
    deadline: float
    patience: Patience
    floor: float
    max_expansions: int | None
    table: CostTable
    better: Better
    attempts: int = 0
    expansions: int = 0
    queries: int = 0
    passes: int = 0
    others: list[Word] = field(default_factory=list)

    def run(self, meanwhile: Callable[[], None]) -> Improved:
        rng = np.random.default_rng(SEED)
        query = self.query
        self.best = with_cost(self.best, query)
        self._consider(self._shortened(self.best, rng, SLICE))
        grids = distance_grids(query)
        memory = [search_arrays(query.library.arrays.library)]
        idle_attempts = idle_passes = 0
        step = 0
        slice_ = SLICE
        while not self._over() and (
            idle_attempts < self.patience.attempts or idle_passes < self.patience.passes
        ):
            before = self.best.cost
            candidate = self._searched_again(step, rng, grids, memory)
            if candidate is not None and not self._over():
                candidate = self._shortened(candidate, rng, SLICE)
                if candidate.cost < NEAR * self.best.cost:
                    candidate = self._attempted(candidate, rng, SECOND_SLICE)
                self._consider(candidate)
            idle_passes = 0 if self._gained(before) else idle_passes + 1
            if not self._over():
                before = self.best.cost
                self._consider(self._attempted(self.best, rng, slice_))
                idle_attempts = 0 if self._gained(before) else idle_attempts + slice_
                slice_ = min(int(1.2 * slice_), 8000)
            step += 1
            if step == FIRST_GAINS:
                meanwhile()
        return Improved(
            word=self.best,
            attempts=self.attempts,
            expansions=self.expansions,
            queries=self.queries,
            passes=self.passes,
            finished=not self._late(),
            others=tuple(sorted(self.others, key=lambda other: other.cost)[:MOST_OTHERS]),
        )

    def _gained(self, before: float) -> bool:
        return self.best.cost < before * (1.0 - 1e-4)

    def _over(self) -> bool:
        return self._late() or self.best.cost <= self.floor * (1.0 + 1e-12)

    def _late(self) -> bool:
        if self.max_expansions is not None and self.expansions >= self.max_expansions:
            return True
        return time.monotonic() >= self.deadline

    def _consider(self, candidate: Word) -> None:
        self.others.append(candidate)
        if candidate.cost < self.best.cost:
            self.best = candidate
            self.better(candidate)

    def _searched_again(
        self,
        step: int,
        rng: np.random.Generator,
        grids: tuple[DistanceGrid, DistanceGrid],
        memory: list[SearchArrays],
    ) -> Word | None:
        """A connection found by a new search with other settings; None if there is none."""
        scale, durations = 1.0, 1.0
        weight = WEIGHTS[step // 2] if step < 2 * len(WEIGHTS) else float(rng.uniform(1.0, 2.0))
        if step >= 2:
            scale, durations = (float(value) for value in rng.uniform(0.5, 1.4, 2))
        cap = min(int(FIRST_CAP * CAP_GROWTH ** (step // 2)), MOST_CAP)
        if self.max_expansions is not None:
            cap = min(cap, self.max_expansions - self.expansions)
        tight = bool(step % 5 == 4)
        resolution = Resolution(
            scale=scale,
            durations=durations,
            weight=weight,
            truncated=tight,
            stop=step % 3 == 1,
            layered=step % 4 >= 2,
        )
        sign = -1.0 if step % 2 and not self.query.problem.moves else 1.0
        (one,) = both_ends(
            self.query, resolution, grids=grids, table=self.table, arrays=memory[0], ends=(sign,)
        )
        word = one.run(cap, PRUNE * self.best.cost, deadline=self.deadline)
        memory[0] = one.arrays
        self.expansions += one.expansions
        self.queries += one.queries
        self.passes += 1
        return None if word is None else with_cost(word, self.query)

    def _shortened(self, word: Word, rng: np.random.Generator, attempts: int) -> Word:
        """The word after the dynamic program and some attempts."""
        query = self.query
        work, state = work_of(query, word)
        if not query.problem.moves:
            dynamic_programming(
                query.library.arrays,
                improve_task(query, word),
                query.scene(),
                work,
                state,
                POINTS,
            )
        return self._attempted(word_of(work, state, word, query), rng, attempts)

    def _attempted(self, word: Word, rng: np.random.Generator, attempts: int) -> Word:
        """The word after random shortcuts and via-points."""
        query = self.query
        work, state = work_of(query, word)
        task, scene = improve_task(query, word), query.scene()
        done = 0
        while done < attempts:
            n = min(TIMELY, attempts - done)
            uniform, normal = rng.random((n, 6)), rng.standard_normal((n, 3))
            if time.monotonic() < self.deadline:
                attempt_all(
                    query.library.arrays,
                    task,
                    scene,
                    work,
                    state,
                    uniform,
                    normal,
                )
                self.attempts += n
            done += n
        return word_of(work, state, word, query)


def work_of(query: LatticeQuery, word: Word) -> tuple[Work, IntArray]:
    """Arrays that hold a word, and its state."""
    n = max(256, 4 * len(word.trims) + 64)
    work = Work(
        start=np.array(query.start[:3]),
        trims=np.zeros(n, dtype=np.int64),
        durations=np.zeros(n),
        poses=np.zeros((n + 1, 3)),
        times=np.zeros(n + 1),
        new_trims=np.zeros(n, dtype=np.int64),
        new_durations=np.zeros(n),
        middle_trims=np.zeros(6, dtype=np.int64),
        middle_durations=np.zeros(6),
        one=scratch_of(query.library.arrays.library),
        two=scratch_of(query.library.arrays.library),
        at=np.zeros((POINTS, 4)),
        best=np.zeros(POINTS),
        back=np.zeros(POINTS, dtype=np.int64),
        by_trims=np.zeros((POINTS, 3), dtype=np.int64),
        by_durations=np.zeros((POINTS, 3)),
        legs=np.zeros(POINTS, dtype=np.int64),
    )
    work.trims[: len(word.trims)] = query.library.number_of[word.trims]
    work.durations[: len(word.trims)] = word.durations
    return work, np.array([len(word.trims)], dtype=np.int64)


def word_of(work: Work, state: IntArray, word: Word, query: LatticeQuery) -> Word:
    """The word that arrays hold."""
    n = int(state[LENGTH])
    held = Word(
        trims=query.library.trims[work.trims[:n]],
        durations=work.durations[:n].copy(),
        goal=word.goal,
    )
    return with_cost(held, query)


def improve_task(query: LatticeQuery, word: Word) -> ImproveTask:
    """Limits and sizes of improving a word."""
    library = query.library
    twists = library.arrays.library.twists
    speed = np.hypot(twists[:, 0], twists[:, 1]).max()
    return ImproveTask(
        tries=TRIES,
        clock=float(query.problem.start_time),
        most_time=float(query.most_time),
        stay_until=query.stay_until,
        most_trims=query.most_trims,
        per_metre=float(library.per_metre),
        radius=float(library.radius),
        shortest_span=float(0.25 * library.radius / max(float(speed), 1e-9)),
        snap=SNAP,
        via=VIA,
        spread=float(0.25 * library.radius),
        free_heading=bool(query.free_heading[word.goal]),
    )
