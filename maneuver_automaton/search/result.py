"""Results of searches."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

from maneuver_automaton.automaton import Plan
from maneuver_automaton.problem import Problem
from maneuver_automaton.words.word import Word
from maneuver_automaton.words.word import plan_of as plan_of_word


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
    exhaustive: bool = False  # every admitted word was searched, so the first solution is the best
    counts: dict[str, int] = field(default_factory=dict)


def plan_of(problem: Problem, word: Word) -> Plan:
    """The plan of a word from the problem's start."""
    return plan_of_word(problem.automaton, word, problem.start, start_time=problem.start_time)
