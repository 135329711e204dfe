"""What searches find: words under work, words in order with each motion once, and results."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from maneuver_automaton._arrays import Array, IntArray, freeze
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.same_motion import is_new
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.words.word import Word
from maneuver_automaton.words.word import plan_of as plan_of_word


@dataclass(frozen=True, slots=True, eq=False)
class TimedWord:
    """Trims by the numbers of a search, with their times; what leads from trim to trim follows."""

    trims: tuple[int, ...]
    durations: Array  # (n,) [s]
    cost: float = math.inf  # inf: as yet unknown, or the goal is not met
    certificate: float = -math.inf  # smallest reduced cost over the library, as far as it is known

    def __post_init__(self) -> None:
        freeze(self, "durations")

    @property
    def numbers(self) -> IntArray:
        """The trims as an array (n,)."""
        return np.array(self.trims, dtype=np.int64)


class SearchStatus(enum.Enum):
    """How a search ended."""

    FOUND = "found"
    EXHAUSTED = "exhausted"  # everything admitted was tried
    OUT_OF_BUDGET = "out_of_budget"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SearchResult:
    """Solutions, cheapest first."""

    status: SearchStatus
    solutions: tuple[Word, ...]
    complete: bool = False  # every locally optimal solution within the limits is listed
    exhaustive: bool = False  # no admitted word is cheaper than the first solution
    counts: dict[str, int] = field(default_factory=dict)


def plan_of(problem: Problem, word: Word) -> Plan:
    """The plan of a word from the problem's start."""
    return plan_of_word(problem.automaton, word, problem.start, start_time=problem.start_time)


TIE = 1e-9  # costs closer than this, relative, are equal


def tied(cost: float) -> float:
    """The largest cost that counts as equal."""
    return cost + TIE * (1.0 + abs(cost))


def in_order(words: Iterable[Word]) -> Iterator[Word]:
    """Words by rising cost; among equal costs, fewer trims first, then by word."""
    equal: list[Word] = []
    for word in sorted(words, key=lambda one: one.cost):
        if equal and word.cost > tied(equal[0].cost):
            yield from sorted(equal, key=_simplicity)
            equal = []
        equal.append(word)
    yield from sorted(equal, key=_simplicity)


def distinct(
    problem: Problem, words: Iterable[Word], *, most: int, budget: Budget = UNLIMITED
) -> Iterator[Word]:
    """The `most` cheapest motions, each with the word that comes first.

    Once the time of a `budget` is over only the cheapest one comes.
    """
    known: list[Plan] = []
    for word in in_order(words):
        if most == 1:  # nothing to compare it with
            yield word
            return
        if len(known) == most or (known and budget.is_over):
            return
        plan = plan_of(problem, word)
        if is_new(plan, known):
            known.append(plan)
            yield word


def _simplicity(word: Word) -> tuple[int, tuple[int, ...]]:
    return len(word.trims), tuple(word.trims.tolist())


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class InsertionTask:
    """One search by insertion; see `insertion_stages`."""

    problem: Problem
    goal: Goal
    alternatives: int = 0
    seeds: int | None = None
    known: Plan | None = None
    budget: Budget = UNLIMITED
    upper_bound: float = math.inf


@dataclass(slots=True, eq=False)
class BestWords:
    """The cheapest motions found so far, each once, and what they took."""

    problem: Problem
    most: int  # motions that are kept
    budget: Budget = UNLIMITED  # of comparing them
    words: list[Word] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    status: SearchStatus = SearchStatus.EXHAUSTED  # of the last search

    def add(self, more: SearchResult) -> None:
        """Take note of the result of another search."""
        both = [*self.words, *more.solutions]
        self.words = list(distinct(self.problem, both, most=self.most, budget=self.budget))
        for name, value in more.counts.items():
            self.counts[name] = self.counts.get(name, 0) + value
        self.status = more.status

    def result(self) -> SearchResult:
        """All that is kept, by rising cost."""
        return SearchResult(
            status=self.status, solutions=tuple(self.words), counts=dict(self.counts)
        )
