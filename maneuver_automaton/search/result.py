"""What a search returns."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

from maneuver_automaton._arrays import Array, IntArray, freeze
from maneuver_automaton.automaton import Plan
from maneuver_automaton.problem import Problem


class SearchStatus(enum.Enum):
    """How a search ended."""

    FOUND = "found"
    EXHAUSTED = "exhausted"  # everything admitted was tried
    OUT_OF_BUDGET = "out_of_budget"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Solution:
    """A word and its coasting times, with the multipliers that certify them."""

    word: IntArray  # (n,) indices of trims, rest last
    durations: Array  # (n,) [s]
    cost: float
    certificate: float | None = None  # smallest reduced cost over the library, all times

    def __post_init__(self) -> None:
        freeze(self, "durations")

    @property
    def duration(self) -> float:
        """Time the motion takes [s]."""
        return float(self.durations.sum())


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SearchResult:
    """Solutions, cheapest first."""

    status: SearchStatus
    solutions: tuple[Solution, ...]
    complete: bool  # every locally optimal solution within the limits is listed
    exhaustive: bool = False  # every admitted word was searched, so the first solution is the best
    counts: dict[str, int] = field(default_factory=dict)


def plan_of(problem: Problem, solution: Solution) -> Plan:
    """What a search found, as a plan from the problem's start."""
    trims = problem.automaton.trims
    return Plan(
        problem.start,
        tuple(trims[k] for k in solution.word),
        durations=solution.durations,
        start_time=problem.start_time,
    )
