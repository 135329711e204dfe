"""Insertion with clearance: a word among obstacles made cheaper by any trim of a large library.

A section of the word is taken as a problem of its own in free space: its best times, and then
whichever trim of the whole library pays most, where it pays most, as `search.free_insertion` does
it. What comes out takes the place of the section if it is proven free and the word is cheaper. Most
sections have a via-point, which moves a little: so a word slides along an obstacle.

The searches of the lattice use a few trims (`search.lattice_trims`). They take as long as those of
a small library, and know nothing of the words found here, whose trims they lack.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.budget import Budget
from maneuver_automaton.groups import SE2
from maneuver_automaton.groups.se2 import coasted
from maneuver_automaton.refinement.fitting import TIME_TOLERANCE
from maneuver_automaton.refinement.work import SNAP, VIA
from maneuver_automaton.search import _kernels_insertion
from maneuver_automaton.search.lattice_library import library_with
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.lattice_trims import (
    Chosen,
    at_two_paces,
    paced_trims,
    paying_trims,
    stands_for_more,
)
from maneuver_automaton.search.waiting import is_free
from maneuver_automaton.words._kernels_times import TimesProblem
from maneuver_automaton.words.library import SWITCH, MovingTrims, four_columns, moving_trims
from maneuver_automaton.words.word import Word, word_of_steps

SEED = 19_09  # of the random draws
PATIENCE = 300  # attempts in a row that may gain nothing
FIRST, FIRST_LIMITED = 4, 1  # new searches before its first turn
SHARE = 25  # attempts for each new search so far ...
LEAST = 100  # ... and at least
LONGEST = 24  # trims of one section
ROOM = 4  # more, while trims are inserted
ROUNDS = 6  # insertions into one section, at most
ACCURACY = 1e-9  # relative: reduced costs above minus this count as none
GAIN = 1e-6  # share of the cost that a change has to save
MET = 1e-9  # [m, rad] by which the end of a section may miss, in lengths of the section
SHORTEST = 0.02  # share of a word that the shortest section is
SPREAD = 0.2  # [length scales] that a via-point moves at most, along each axis


@dataclass(slots=True, eq=False)
class Whole:
    """The cheapest word so far that uses any trim of a large library, and how it got there."""

    query: LatticeQuery
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(SEED))
    best: Word | None = None
    origin: Word | None = None  # the word of the searches that it comes from
    idle: int = 0  # attempts since the last gain
    attempts: int = 0
    work: _Work | None = None

    def is_due(self, step: int) -> bool:
        """Whether it is its turn after so many new searches: ever more seldom, ever longer.

        Where time is limited the paces matter most, and it begins at once.
        """
        first = FIRST_LIMITED if math.isfinite(self.query.most_time) else FIRST
        return step >= first and step & (step - 1) == 0

    def cheaper_than(self, word: Word) -> Word:
        """The cheaper of the best word and another one."""
        return self.best if self.best is not None and self.best.cost < word.cost else word

    def gains(self, word: Word, *, step: int, budget: Budget) -> Iterator[Word]:
        """Words, each cheaper than all before, after so many new searches.

        It goes on from `word` if that is new, and from where it stood otherwise.
        """
        if word is not self.origin:
            self.origin, self.work, self.idle = word, _Work(self.query, word), 0
        work = self.work
        if work is None or not work.can_change:
            return
        for _ in range(max(LEAST, SHARE * step)):
            if budget.is_over or self.idle >= PATIENCE:
                return
            self.attempts, self.idle = self.attempts + 1, self.idle + 1
            better = work.attempt(self.rng.random(7), self.rng.standard_normal(3))
            if better is None:
                continue
            work.word, self.idle = better, 0
            if better.cost < self.cheaper_than(word).cost:
                self.best = better
                yield better


def has_paces(query: LatticeQuery) -> bool:
    """Whether the paces of a large library have to be chosen, since time is limited."""
    return math.isfinite(query.most_time) and stands_for_more(query.problem)


def paced(query: LatticeQuery, word: Word) -> tuple[LatticeQuery, Word]:
    """The query with trims at the paces that suit a word, where its time is limited, and the word.

    The trims of `query` stay beside them, so that its words are words of both. The word is driven
    at these paces, if that is cheaper.
    """
    problem, held = query.problem, query.library.trims
    if not has_paces(query):
        return query, word
    known = moving_trims(problem.automaton, problem.cost)
    moves = np.isin(word.trims, known.trims)
    rows, durations = np.searchsorted(known.trims, word.trims[moves]), word.durations[moves]
    rates = known.rates - query.library.rest_rate
    most = query.most_time * (1.0 - ACCURACY)  # whatever rounding says
    paces = paced_trims(known.twists, rates, rows, durations, most)
    chosen = known.trims[np.union1d(*paces)]
    query = with_trims(query, Chosen(tuple(chosen.tolist()), tuple(held.tolist())))
    driven = at_two_paces(known.twists, rows, durations, paces, most)
    if driven is None or not moves.all():
        return query, word
    other = query.word_of([(SWITCH, int(known.trims[k]), t) for k, t in driven], word.goal)
    keeps = other.duration <= query.most_time and (other.durations >= query.least_coast).all()
    few = query.most_trims == 0 or len(other.trims) <= query.most_trims
    cheaper = keeps and few and other.cost < word.cost and is_free(query, other)
    return query, other if cheaper else word


@kept_by_first
def _paying(library: MovingTrims) -> IntArray:
    """The trims that pay at some prices, the same for every start, goal and map."""
    return paying_trims(library.twists, library.rates)


@dataclass(slots=True, eq=False)
class _Work:
    """A word that is improved, and the library whose trims may be used."""

    query: LatticeQuery  # its library has the trims of the word, and grows with it
    word: Word
    columns: IntArray = field(init=False)  # (M,) indices in the automaton; -1: time left over
    twists: Array = field(init=False)  # (M, 4)
    rates: Array = field(init=False)  # (M,)
    rows: Array = field(init=False)  # (m, M) 1 where the time is limited
    number_of: IntArray = field(init=False)
    scale: float = field(init=False)

    def __post_init__(self) -> None:
        problem = self.query.problem
        known = moving_trims(problem.automaton, problem.cost)
        rates = known.rates - self.query.library.rest_rate
        limited = math.isfinite(self.query.most_time)
        chosen = np.arange(len(rates))
        if not limited:  # the word has trims that pay at the prices of switches alone
            held = np.isin(known.trims, np.append(self.query.library.trims, self.word.trims))
            chosen = np.union1d(_paying(known), np.flatnonzero(held))
        columns, twists, prices = known.trims[chosen], known.twists[chosen], rates[chosen]
        if limited:  # time that is left over moves nothing and costs nothing
            columns = np.append(columns, -1)
            twists, prices = np.vstack([twists, np.zeros(4)]), np.append(prices, 0.0)
        twists = four_columns(twists)
        twists[:, 3] = 0.0
        self.columns, self.twists, self.rates = columns, twists, np.array(prices)
        self.rows = np.ones((int(limited), len(columns)))
        self.number_of = np.full(len(problem.automaton), -1, dtype=np.int64)
        self.number_of[columns[columns >= 0]] = np.flatnonzero(columns >= 0)
        self.scale = max(1.0, float(np.abs(self.rates).max()))

    @property
    def can_change(self) -> bool:
        """Whether its trims are all priced: it does not rest within."""
        moving = self.word.durations > 0.0
        return bool(moving.any() and (self.number_of[self.word.trims[moving]] >= 0).all())

    def attempt(self, draws: Array, shift: Array) -> Word | None:
        """The word with another section, if that is cheaper and free."""
        moving = self.word.durations > 0.0
        trims, times = self.word.trims[moving], self.word.durations[moving]
        ends = np.cumsum(times)
        joints, total = np.append(0.0, ends), float(ends[-1])
        span = total * SHORTEST ** draws[2]
        begin = max(draws[1] * total - 0.5 * span, 0.0)
        end = min(draws[1] * total + 0.5 * span, total)
        if draws[3] < SNAP:
            begin = float(joints[np.abs(joints - begin).argmin()])
        if draws[4] < SNAP:
            end = float(joints[np.abs(joints - end).argmin()])
        if not end > begin:
            return None
        cuts = [begin, *([0.5 * (begin + end)] if draws[0] < VIA else []), end]
        pieces = [_cut(trims, times, ends, a, b) for a, b in pairwise(cuts)]
        goals = [  # where each leads, seen from its begin
            SE2(coasted(np.zeros(3), self.twists[self.number_of[part], :3], lasting)[-1])
            for part, lasting in pieces
        ]
        if len(pieces) > 1:
            size = SPREAD * self.query.library.radius * (1.0 / 100.0) ** draws[5]
            via = SE2(shift * np.array([size, size, 0.5 * size / self.query.library.radius]))
            goals = [goals[0] @ via, via.inverse() @ goals[1]]
        steps: list[tuple[int, float]] = []
        rounds = 1 + int(draws[6] * ROUNDS)
        most = self.query.most_trims
        most = LONGEST if most == 0 else min(LONGEST, most - len(trims) + len(pieces[0][0]))
        spare = self.query.most_time - self.word.duration
        for piece, goal in zip(pieces, goals, strict=True):
            solved = self._solved(*piece, goal, max(spare, 0.0) / total, most, rounds)
            if solved is None:
                return None
            steps += solved
        before, after = _cut(trims, times, ends, 0.0, begin), _cut(trims, times, ends, end, total)
        driven = [*zip(*before, strict=True), *steps, *zip(*after, strict=True)]
        return self._accepted([(int(trim), float(t)) for trim, t in driven])

    def _solved(
        self, trims: IntArray, times: Array, goal: SE2, spare: float, most: int, rounds: int
    ) -> list[tuple[int, float]] | None:
        """The best trims and times from a section's own on; None if they miss its end."""
        n = len(trims)
        if n == 0 or n > LONGEST:
            return None
        room = LONGEST + ROOM
        word, lasting = np.zeros(room, dtype=np.int64), np.zeros(room)
        word[:n], lasting[:n] = self.number_of[trims], times
        targets = np.zeros(0)
        if len(self.rows):
            lasting[n], word[n] = spare * float(times.sum()), len(self.columns) - 1
            n += 1
            targets = np.array([float(lasting[:n].sum())])
        end = np.append(goal.pose, 0.0)
        size, cost, _, _ = _kernels_insertion.improve_word(
            TimesProblem(self.twists, self.rates, self.rows, end, targets),
            len(self.columns),
            0,
            word,
            lasting,
            n,
            most,
            ACCURACY * self.scale,
            rounds,
        )
        if not math.isfinite(cost):
            return None
        word, lasting = word[:size], lasting[:size]
        off = coasted(np.zeros(3), self.twists[word, :3], lasting)[-1] - end[:3]
        off[2] = math.remainder(float(off[2]), 2.0 * math.pi)
        if np.abs(off).max() > MET * (1.0 + float(np.abs(end[:2]).max())):
            return None
        used = (lasting > TIME_TOLERANCE) & (self.columns[word] >= 0)
        return list(zip(self.columns[word[used]].tolist(), lasting[used].tolist(), strict=True))

    def _accepted(self, driven: list[tuple[int, float]]) -> Word | None:
        """A word of trims and times, if it is cheaper, keeps the limits and is free."""
        query = self.query
        found = word_of_steps(((SWITCH, trim, t) for trim, t in driven), goal=self.word.goal)
        prices, numbers = query.library.arrays.library, self.number_of[found.trims]
        gears = np.sign(self.twists[numbers, 0])
        gears = gears[gears != 0.0]
        changes = int(np.count_nonzero(gears[1:] != gears[:-1]))
        switches = prices.switch * (len(numbers) - 1) + prices.direction_change * changes
        coasting = float(self.rates[numbers] @ found.durations)  # without what places cost
        found = replace(found, cost=coasting + switches)
        if not found.cost < self.word.cost * (1.0 - GAIN) or found.duration > query.most_time:
            return None
        if 0 < query.most_trims < len(found.trims) or (found.durations < query.least_coast).any():
            return None
        if not np.isin(found.trims, query.library.trims).all():
            query = with_trims(query, Chosen(words=(), others=tuple(found.trims.tolist())))
        found = query.with_places(found)
        cheaper = found.cost < self.word.cost * (1.0 - GAIN)
        return found if cheaper and is_free(query, found) else None


def with_trims(query: LatticeQuery, choice: Chosen) -> LatticeQuery:
    """The query with a library of other trims."""
    goals = list(dict.fromkeys(query.goal_index))
    library = library_with(query.problem, choice)
    return lattice_query(query.problem, goals, prepared=query.prepared, library=library)


def _cut(
    trims: IntArray, times: Array, ends: Array, begin: float, end: float
) -> tuple[IntArray, Array]:
    """Trims and times of a word between two moments [s]."""
    lasting = np.minimum(ends, end) - np.maximum(ends - times, begin)
    used = lasting > TIME_TOLERANCE
    return trims[used], lasting[used]
