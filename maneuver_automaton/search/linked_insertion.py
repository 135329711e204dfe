"""Insertion of trims with their maneuvers: a local search over words.

A trim that needs maneuvers to be entered and left changes the end of the word by a jump. So its
price, the momentum of Pontryagin's condition times that jump, only says which changes to try first;
each is tried with its best times. A word that no change makes cheaper is a local optimum.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.groups import LieGroup
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.linked_words import (
    EXPANSIONS_A_WORD,
    scan_linked_words,
    steer_linked_words,
)
from maneuver_automaton.search.result import (
    BestWords,
    InsertionTask,
    SearchResult,
    SearchStatus,
    TimedWord,
)
from maneuver_automaton.search.word_setup import WordSetup, word_setup
from maneuver_automaton.words.word import Word, word_of_plan

GAIN = 1e-7  # relative: less is none
AT_FIRST = 0.25  # [s] an inserted trim lasts before its times are solved for
CHUNK = 30  # changes that are tried before the best of them is taken
MOST_TRIES = 240  # changes of one word that are tried, by rising price
MOST_TRIMS = 400  # of a larger library those that differ most
FEW = 2  # trims of a word that may be taken out at once
CLOSED_FORM = 3  # trims of a word whose times follow in closed form
SCANNED_TRIMS = 14  # that words of four trims are made of
SCAN_SHARE = 0.4  # of the time that is left, for scanning
SEED_SLACK = 0.1  # share by which words may be costlier than a plan that is known, and yet be seeds
SEEDS = 4  # words of three trims that insertion begins with, beside the cheapest one


def linked_stages(task: InsertionTask) -> Iterator[SearchResult]:
    """Short words, then longer ones, then what insertion makes of them seed by seed."""
    problem, goal = task.problem, task.goal
    if not problem.automaton.body_velocities.any():  # nothing that words are made of
        yield SearchResult(status=SearchStatus.EXHAUSTED, solutions=())
        return
    most_seeds = SEEDS if task.seeds is None else task.seeds
    others = max(task.alternatives, most_seeds - 1)
    near = task.upper_bound * (1.0 + SEED_SLACK)
    found, known = BestWords(problem, others + 1, task.budget), _known(task)
    found.add(SearchResult(status=SearchStatus.EXHAUSTED, solutions=known))
    found.add(
        steer_linked_words(problem, goal, alternatives=others, budget=task.budget, upper_bound=near)
    )
    yield _so_far(task, found)
    seeds = found.words[:most_seeds]  # they differ more than words of four trims: those are alike
    if not task.budget.is_over:
        counted = problem.search.max_expansions is not None
        cheap = len(found.words) > task.alternatives
        found.add(
            scan_linked_words(
                problem,
                goal,
                alternatives=others,
                alphabet=SCANNED_TRIMS,
                budget=task.budget if counted else task.budget.part(SCAN_SHARE),
                upper_bound=found.words[task.alternatives].cost if cheap else near,
            )
        )
        yield _so_far(task, found)
    most = problem.horizon.max_trims
    if not task.budget.is_over and found.words and (most is None or most > CLOSED_FORM):
        begun = dict.fromkeys([*known, found.words[0], *seeds])
        for one in improve_linked_words(problem, goal, list(begun), budget=task.budget):
            found.add(one)
            yield _so_far(task, found)


def _known(task: InsertionTask) -> tuple[Word, ...]:
    """The plan that is known as a word, if it is one of the library."""
    plan = task.known
    word = None if plan is None else word_of_plan(task.problem.automaton, plan)
    if plan is None or word is None:
        return ()
    return (replace(word, cost=task.problem.invariant_cost_of(plan)),)


def _so_far(task: InsertionTask, found: BestWords) -> SearchResult:
    """The result so far, and whether the time is over."""
    status = SearchStatus.OUT_OF_BUDGET if task.budget.is_over else SearchStatus.EXHAUSTED
    return replace(found.result(), status=status)


def improve_linked_words(
    problem: Problem, goal: Goal, seeds: Sequence[Word], *, budget: Budget = UNLIMITED
) -> Iterator[SearchResult]:
    """Insert, replace, split and delete trims of words with maneuvers while that gains.

    Yields the solution of each seed in turn, a local optimum: none of up to `MOST_TRIES` changes of
    it, those of the least prices, is cheaper. With maneuvers of finite size no reduced cost
    certifies more than that. The `budget` limits the time; ``search.max_expansions`` of the problem
    limits the number of words that are solved for instead, the same at every call.
    """
    used = tuple(sorted({trim for seed in seeds for trim in seed.trims.tolist()}))
    setup = word_setup(problem, goal, most_trims=MOST_TRIMS, also=used)
    climb = _Climb(setup, budget)
    for seed in seeds:
        solved, changes = climb.solved, climb.changes
        timed = setup.timed(seed)
        word = setup.solved(timed.trims, [timed.durations])
        found = () if word is None else (setup.word(climb.top(word)),)
        yield SearchResult(
            status=SearchStatus.FOUND if found else SearchStatus.EXHAUSTED,
            solutions=found,
            counts={"solved": climb.solved - solved, "changes": climb.changes - changes},
        )
        if climb.is_over():
            break


# Another word: an estimate of its cost, its trims, and times to start from.
_Change: TypeAlias = tuple[float, tuple[int, ...], Array]


@dataclass(slots=True, eq=False)
class _Climb:
    """A local search, with what it has tried."""

    setup: WordSetup
    budget: Budget
    solved: int = 0
    changes: int = 0

    def is_over(self) -> bool:
        """Whether no time is left, or as many words were solved for as the problem admits."""
        most = self.setup.problem.search.max_expansions
        work = EXPANSIONS_A_WORD * self.solved
        return self.budget.is_over or (most is not None and work >= most)

    def top(self, word: TimedWord) -> TimedWord:
        """The word that no change makes cheaper, from this one on."""
        seen = {word.trims}
        while True:
            better = self._better(word, seen)
            if better is None:
                return word
            self.changes += 1
            word = better

    def _better(self, word: TimedWord, seen: set[tuple[int, ...]]) -> TimedWord | None:
        """The best of the first changes that gain."""
        changes = sorted(self._changes(word), key=lambda one: one[:2])
        best: TimedWord | None = None
        tried = 0
        for _, trims, times in changes[:MOST_TRIES]:
            if self.is_over():
                break
            if trims in seen:
                continue
            seen.add(trims)
            least = word.cost if best is None else best.cost
            if self.setup.fixed(trims)[0] >= least:
                continue
            tried += 1
            self.solved += 1
            other = self.setup.solved(trims, [times])
            if other is not None and other.cost < least - GAIN * (1.0 + least):
                best = other
            if best is not None and tried >= CHUNK:
                break
        return best

    def _changes(self, word: TimedWord) -> Iterator[_Change]:
        """Words that differ by one trim: inserted, replaced, in the midst of another, or less."""
        n = len(word.trims)
        prices = _Prices(self.setup, word)
        for k in range(n + 1):
            yield from prices.put(k, k, AT_FIRST)
        for k in range(n):
            yield from prices.put(k, k + 1, max(float(word.durations[k]), AT_FIRST))
            if word.durations[k] > 2.0 * AT_FIRST:
                yield from prices.split(k, AT_FIRST)
        for few in range(1, FEW + 1):
            for k in range(n - few + 1):
                trims = word.trims[:k] + word.trims[k + few :]
                times = np.delete(word.durations, slice(k, k + few))
                if trims and not (0 < k < len(trims) and trims[k - 1] == trims[k]):
                    yield -math.inf, trims, times


class _Prices:
    """Estimates of what a word costs if a trim is put somewhere in it."""

    def __init__(self, setup: WordSetup, word: TimedWord) -> None:
        self.setup = setup
        self.word = word
        self.arrays = setup.library.arrays
        self.group = setup.group
        self.alphabet = np.array(setup.alphabet, dtype=np.int64)
        dof = setup.problem.start.size
        self.twists = self.arrays.twists[:, :dof]
        chain = (setup.start_trim, *word.trims, setup.goal_trim)
        self.chain = chain
        group = self.group
        pose = group(np.zeros(dof))
        self.begins: list[LieGroup] = []  # of each trim of the word, and of the last one
        self.ends: list[LieGroup] = [pose]  # of the first trim, and of each of the word
        for before, trim, lasting in zip(
            chain, chain[1:], (*word.durations.tolist(), 0.0), strict=False
        ):
            pose = pose @ group(self._step(before, trim))
            self.begins.append(pose)
            pose = pose @ group.exp(lasting * self.twists[trim])
            self.ends.append(pose)
        self.end = self.ends[-1]
        self.momentum = self._momentum()

    def _step(self, before: ArrayLike, after: ArrayLike) -> Array:
        """Displacement (..., dof) of the transition between trims."""
        known, pair = self.setup.library.transitions, self.setup.library.class_pair(before, after)
        return np.asarray(known.displacement[pair][..., : self.twists.shape[1]])

    def _cost(self, before: ArrayLike, after: ArrayLike) -> Array:
        """Cost (...,) of the transition between trims; inf where there is none."""
        library = self.setup.library
        return np.asarray(library.transitions.cost[library.class_pair(before, after)])

    def _momentum(self) -> Array:
        """Prices (dof,) of a displacement of the end, seen from the start."""
        used = [k for k in range(len(self.word.trims)) if self.word.durations[k] > 0.0]
        if not used:
            return np.zeros(self.twists.shape[1])
        trims = [self.word.trims[k] for k in used]
        rows = [self.begins[k].adjoint() @ self.twists[t] for k, t in zip(used, trims, strict=True)]
        return np.asarray(np.linalg.lstsq(np.array(rows), -self.arrays.rates[trims], rcond=1e-9)[0])

    def put(self, first: int, after: int, lasting: float) -> Iterator[_Change]:
        """Any trim for `lasting` seconds in place of trims `first` up to `after` of the word."""
        word, chain = self.word, self.chain
        before, following = chain[first], chain[after + 1]
        rest = self.begins[after].inverse() @ self.end
        chosen = self.alphabet[(self.alphabet != before) & (self.alphabet != following)]
        if first < after:
            chosen = chosen[chosen != chain[first + 1]]
        removed = float(
            self.arrays.rates[list(word.trims[first:after])] @ word.durations[first:after]
        )
        removed += float(self._cost(chain[first : after + 1], chain[first + 1 : after + 2]).sum())
        prices = self._priced(self.ends[first], before, chosen, lasting, following, rest) - removed
        head, tail = word.trims[:first], word.trims[after:]
        times = np.concatenate([word.durations[:first], [lasting], word.durations[after:]])
        for trim, price in zip(chosen.tolist(), prices.tolist(), strict=True):
            if price < math.inf:
                yield price, (*head, trim, *tail), times

    def split(self, k: int, lasting: float) -> Iterator[_Change]:
        """Any trim for `lasting` seconds in the midst of trim `k` of the word."""
        word, group = self.word, self.group
        host, half = word.trims[k], 0.5 * float(word.durations[k])
        chosen = self.alphabet[self.alphabet != host]
        middle = self.begins[k] @ group.exp(half * self.twists[host])
        rest = middle.inverse() @ self.end
        prices = self._priced(middle, host, chosen, lasting, host, rest)
        times = np.concatenate([word.durations[:k], [half, lasting, half], word.durations[k + 1 :]])
        for trim, price in zip(chosen.tolist(), prices.tolist(), strict=True):
            if price < math.inf:
                trims = (*word.trims[:k], host, trim, host, *word.trims[k + 1 :])
                yield price, trims, times

    def _priced(
        self,
        here: LieGroup,
        before: int,
        chosen: IntArray,
        lasting: float,
        following: int,
        rest: LieGroup,
    ) -> Array:
        """Estimated costs (n,) of the word with each of the trims `chosen` put in."""
        arrays, group = self.arrays, self.group
        n, dof = chosen.size, self.twists.shape[1]
        if not n:
            return np.zeros(0)
        end = group(np.tile(here.pose, (n, 1))) @ group(self._step(np.full(n, before), chosen))
        end = end @ group.exp(lasting * self.twists[chosen])
        end = (
            end
            @ group(self._step(chosen, np.full(n, following)))
            @ group(np.tile(rest.pose, (n, 1)))
        )
        back = self.end.inverse()
        moved = np.array((end @ group(np.tile(back.pose, (n, 1)))).pose)
        moved[:, 2] = np.remainder(moved[:, 2] + np.pi, 2.0 * np.pi) - np.pi
        jump = group(moved).log().reshape(n, dof)
        added = self._cost(np.full(n, before), chosen)
        added = added + self._cost(chosen, np.full(n, following))
        return np.asarray(
            self.word.cost + added + lasting * arrays.rates[chosen] + jump @ self.momentum
        )
