"""Order of the words that a search found, and a list with each motion once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.same_motion import is_new
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.words.word import Word

TIE = 1e-9  # costs closer than this, relative, are equal


def tied(cost: float) -> float:
    """The largest cost that counts as equal."""
    return cost + TIE * (1.0 + abs(cost))


def in_order(words: Iterable[Word]) -> Iterator[Word]:
    """Words by rising cost; among equal costs, fewer trims first, then by word.

    Examples
    --------
    >>> costly, long, short = (
    ...     Word(trims=trims, durations=[1.0] * len(trims), cost=cost)
    ...     for trims, cost in (([0], 2.0), ([0, 1], 1.0), ([2], 1.0 + 1e-12))
    ... )
    >>> [word.trims.tolist() for word in in_order([costly, long, short])]
    [[2], [0, 1], [0]]
    """
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
        if len(known) == most or (known and budget.is_over):
            return
        plan = plan_of(problem, word)
        if is_new(plan, known):
            known.append(plan)
            yield word


def _simplicity(word: Word) -> tuple[int, tuple[int, ...]]:
    return len(word.trims), tuple(word.trims.tolist())
