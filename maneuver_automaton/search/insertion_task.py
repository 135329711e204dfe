"""The task of a search by insertion, and the words that it has found so far."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from maneuver_automaton._interrupts import clock
from maneuver_automaton.automaton import Plan
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.alternatives import distinct
from maneuver_automaton.search.result import SearchResult, SearchStatus
from maneuver_automaton.words.word import Word


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class InsertionTask:
    """One search by insertion; see `insertion_stages`."""

    problem: Problem
    goal: Goal
    alternatives: int = 0
    seeds: int | None = None
    known: Plan | None = None
    deadline: float = math.inf  # on the monotonic clock [s]
    upper_bound: float = math.inf

    @property
    def left(self) -> float:
        """Time that is left [s]."""
        return self.deadline - clock()

    def is_over(self) -> bool:
        """Whether no time is left."""
        return clock() > self.deadline


@dataclass(slots=True, eq=False)
class Found:
    """The cheapest motions found so far, each once, and what they took."""

    problem: Problem
    most: int  # motions that are kept
    words: list[Word] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    status: SearchStatus = SearchStatus.EXHAUSTED  # of the last search

    def add(self, more: SearchResult) -> None:
        """Take note of the result of another search."""
        both = [*self.words, *more.solutions]
        self.words = list(distinct(self.problem, both, most=self.most))
        for name, value in more.counts.items():
            self.counts[name] = self.counts.get(name, 0) + value
        self.status = more.status

    def result(self) -> SearchResult:
        """All that is kept, by rising cost."""
        return SearchResult(
            status=self.status, solutions=tuple(self.words), counts=dict(self.counts)
        )
