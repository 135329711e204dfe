"""Make a free word cheaper until nothing gains any more, or the time is over: for every vehicle.

Dynamic programming over the word's points, random shortcuts and via-points, and new searches at
other resolutions, which find other paths round the obstacles. The sequence is the same at every
call: it is counted in attempts, and a time limit only says where it stops.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton.budget import UNLIMITED, Budget, Pace
from maneuver_automaton.refinement._kernels_improve import attempt_all
from maneuver_automaton.refinement.clear_insertion import Whole
from maneuver_automaton.refinement.work import improving, shortcut, word_of
from maneuver_automaton.search.arrays import CostTable, DistanceGrid, SearchArrays
from maneuver_automaton.search.cost_to_go import NO_TABLE
from maneuver_automaton.search.lattice import FirstPlan, distance_grids, first_plan
from maneuver_automaton.search.lattice_pass import pass_of, with_cost
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_task import Resolution, as_wide_as_turns
from maneuver_automaton.search.lattice_trims import stands_for_more
from maneuver_automaton.words.word import Word

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
    """New searches, how many rounds their words get, and when it is first looked at the clock."""

    of: Callable[[LatticeQuery, np.random.Generator], Iterator[Restart]]
    rounds: int
    moving_rounds: int  # among moving obstacles: the trims that stay are then driven at other times
    timely: int  # attempts before the first look at the clock: some ms


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


RANDOM = Restarts(_random, rounds=1, moving_rounds=0, timely=100)  # of trims switched at will
FINER = Restarts(_finer, rounds=8, moving_rounds=8, timely=10)


GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)  # of the time between points, by which they move in a round
WORTH = 1e-3  # share that a round has to save for another one of its kind
FIRST_GAINS = 4  # new searches after which the first gains are made
SLICE = 400  # attempts
SECOND_SLICE = 2000  # attempts for candidates near the best
NEAR = 1.01  # share of the best cost that is near
MOST_CHUNK = 16384  # expansions between two looks at the word of a search
SEED = 20_09  # of the random draws
MOST_OTHERS = 50  # words kept beside the best
DRAWN = 400  # attempts whose random numbers are drawn at once


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """When to stop: after so many attempts and new searches in a row that gained nothing."""

    attempts: int = 20_000
    passes: int = 12


TO_THE_END = Patience(passes=2**62)


NO_WORD = Word(trims=np.empty(0, dtype=np.int64), durations=np.empty(0), cost=math.inf)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WordSchedule:
    """How words of a query are looked for: a first one, then better ones."""

    most: int | None = None  # expansions of the first alone, if later ones are not counted
    patience: Patience = TO_THE_END
    floor: float = -math.inf  # it ends when no word can be cheaper than this allows
    table: CostTable = NO_TABLE
    first: Callable[..., FirstPlan] = first_plan  # with what is tried beside its searches
    every_trim: bool = False  # whether to use what the searches leave out of a large library
    meanwhile: Callable[[], None] = lambda: None  # to prepare once the first gains are made


def words_of(
    query: LatticeQuery,
    *,
    budget: Budget = UNLIMITED,
    schedule: WordSchedule,
    known: Word | None = None,
) -> WordSearch:
    """Ever cheaper words of a query, as they are found: the one driver of all that plan in it.

    The first comes from the schedule of resolutions, unless a free word is `known`. Where cost is
    time, it may last longer than the query admits: improved ones need not. The same number of
    expansions finds the same words at every call. What was found and spent is asked afterwards.
    """
    left_out = schedule.every_trim and stands_for_more(query.problem)
    return WordSearch(query, budget, schedule, known or NO_WORD, Whole(query) if left_out else None)


@dataclass(slots=True, eq=False)
class WordSearch:
    """A search for ever cheaper words, and what it has found and spent so far."""

    query: LatticeQuery
    budget: Budget
    schedule: WordSchedule
    best: Word = NO_WORD  # of those whose trims the searches use
    whole: Whole | None = None
    first: FirstPlan | None = None  # of its own, with what it says where there is none
    attempts: int = 0
    expansions: int = 0
    queries: int = 0  # collision queries
    passes: int = 0  # new searches
    words: list[Word] = field(default_factory=list)  # all that the searches have led to
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(SEED))
    arrays: SearchArrays | None = None  # of the last search

    @property
    def word(self) -> Word:
        """The cheapest word so far, whatever trims it has; NO_WORD if there is none."""
        return self.best if self.whole is None else self.whole.cheaper_than(self.best)

    @property
    def restarts(self) -> Restarts:
        """Which new searches suit the library: trims switched at will in the plane, or others."""
        return RANDOM if self.query.library.at_will else FINER

    @property
    def others(self) -> tuple[Word, ...]:
        """Words of the other searches, cheapest first."""
        return tuple(sorted(self.words, key=lambda other: other.cost)[:MOST_OTHERS])

    @property
    def is_late(self) -> bool:
        """Whether the budget is used up, in time or in expansions."""
        if self.budget.expansions is not None and self.expansions >= self.budget.expansions:
            return True
        return self.budget.is_over

    def to_the_end(self) -> WordSearch:
        """Itself, once nothing gains any more, or the budget is used up."""
        for _ in self:
            pass
        return self

    def __iter__(self) -> Iterator[Word]:
        """Words, each cheaper than the one before: a first one, itself shortened, then others."""
        if self.best is NO_WORD:
            most, table = self.schedule.most, self.schedule.table
            counted = self.budget if most is None else self.budget._replace(expansions=most)
            first = self.first = self.schedule.first(self.query, budget=counted, table=table)
            self.expansions, self.queries, self.passes = first.expansions, first.queries, 1
            if first.word is None:
                return
            self.best = first.word
            yield first.word
        self.best = with_cost(self.best, self.query)
        if self.budget.is_over:
            return
        restarts = self.restarts.of(self.query, self.rng)
        patience, slice_, begun = self.schedule.patience, SLICE, next(restarts)
        restart: Restart | None = begun
        yield from self._considered(self._shortened(self.best, begun, SLICE))
        grids = distance_grids(self.query)
        idle_attempts = idle_passes = step = 0
        while (
            restart is not None
            and not self._over()
            and (idle_attempts < patience.attempts or idle_passes < patience.passes)
        ):
            before = self.best.cost
            yield from self._searched_again(restart, grids)
            idle_passes = 0 if self._gained(before) else idle_passes + 1
            if not self._over():
                before = self.best.cost
                yield from self._considered(self._attempted(self.best, slice_))
                idle_attempts = 0 if self._gained(before) else idle_attempts + slice_
                slice_ = min(int(1.2 * slice_), 8000)
            step += 1
            if step == FIRST_GAINS:
                self.schedule.meanwhile()
            if self.whole is not None and self.whole.is_due(step):
                yield from self._with_every_trim(self.whole, step)
            begun, restart = restart, next(restarts, None)
            if restart is not None and restart.all_words != begun.all_words:
                yield from self._considered(self._shortened(self.best, restart, SLICE))
        if self.whole is not None:
            yield from self._with_every_trim(self.whole, step)

    def _gained(self, before: float) -> bool:
        return self.best.cost < before * (1.0 - 1e-4)

    def _over(self) -> bool:
        return self.is_late or self.word.cost <= self.schedule.floor * (1.0 + 1e-12)

    def _considered(self, candidate: Word) -> Iterator[Word]:
        """The candidate, if it is the best."""
        self.words.append(candidate)
        if candidate.cost < self.best.cost:
            cheapest = candidate.cost < self.word.cost
            self.best = candidate
            if cheapest:
                yield candidate

    def _with_every_trim(self, whole: Whole, step: int) -> Iterator[Word]:
        """Words that any trims of a large library have made cheaper: attempts, no expansions."""
        if not self.budget.is_over:
            before = whole.attempts
            yield from whole.gains(self.best, step=step, budget=self.budget)
            self.attempts += whole.attempts - before

    def _searched_again(self, restart: Restart, grids: tuple[DistanceGrid, ...]) -> Iterator[Word]:
        """Words found by a new search that is pruned by the best, and made shorter."""
        one = pass_of(
            self.query,
            restart.resolution,
            grid=grids[0 if restart.sign > 0.0 else 1],
            sign=restart.sign,
            table=self.schedule.table,
            arrays=self.arrays,
        )
        one.chunk, last = restart.chunk, math.inf
        self.passes += 1
        while one.may_go_on and not self._over():
            done, asked = one.expansions, one.queries
            most = min(one.chunk, restart.resolution.most - done)
            if self.budget.expansions is not None:
                most = min(most, self.budget.expansions - self.expansions)
            word = one.run(most, restart.prune * self.best.cost, budget=self.budget)
            self.expansions += one.expansions - done
            self.queries += one.queries - asked
            one.chunk = min(2 * one.chunk, MOST_CHUNK)
            if word is not None and word.cost < last and not self._over():
                last, candidate = word.cost, self._shortened(word, restart, SLICE)
                if candidate.cost < NEAR * self.best.cost:
                    candidate = self._attempted(candidate, SECOND_SLICE)
                yield from self._considered(candidate)
            if word is not None and restart.resolution.stop:
                break
        self.arrays = one.arrays

    def _shortened(self, word: Word, restart: Restart, attempts: int) -> Word:
        """The word after rounds of the dynamic program and some attempts."""
        arrays, restarts = self.query.library.arrays.library, self.restarts
        rounds = restarts.moving_rounds if self.query.moves else restarts.rounds
        most = len(arrays.tried.words) if restart.all_words else arrays.tried.n_few
        for n_words in sorted({arrays.tried.n_few, most}):
            for n in range(rounds):
                if n > 0 and self.budget.is_over:
                    return word
                before, cut = word.cost, (GOLDEN * n) % 1.0
                word = shortcut(self.query, word, n_words=n_words, cut=cut, budget=self.budget)
                if n > 0 and before - word.cost < WORTH * before:
                    break
        return self._attempted(word, attempts)

    def _attempted(self, word: Word, attempts: int) -> Word:
        """The word after random shortcuts and via-points."""
        query, one = self.query, improving(self.query, word)
        pace = Pace(self.budget, self.restarts.timely)
        done = 0
        while done < attempts:
            n = min(DRAWN, attempts - done)
            uniform, normal = self.rng.random((n, 6)), self.rng.standard_normal((n, 3))
            first = 0
            while step := pace.take(n - first):
                some = slice(first, first + step)
                attempt_all(one, uniform[some], normal[some])
                first += step
            self.attempts += first
            done += n
        return word_of(one, word, query)
