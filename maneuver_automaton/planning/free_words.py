"""Words of free space, for every vehicle: they look at no obstacle, and the checks decide."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Iterator

from maneuver_automaton.planning.incumbents import Candidate, Incumbents
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.choose import search_goal
from maneuver_automaton.search.insertion import insertion_stages
from maneuver_automaton.search.result import SearchResult, plan_of
from maneuver_automaton.words.word import Word

LEAST_TIME = 1e-3  # [s] for each goal, also where the time is over


def free_words(
    found: Incumbents, goals: Iterable[int], *, others: int | None, share: float = 1.0
) -> Iterator[tuple[int, SearchResult]]:
    """Results of the searches for words to some goals, stage by stage, each with its goal.

    Each search may take a `share` of the time that is left, and finds `others` words beside the
    cheapest; None asks for all there are. Words with maneuvers count their work where the problem
    limits it, and then may take all the time. Where only the cheapest of these counts, the
    best plan known bounds its cost.
    """
    problem = found.problem
    for index in goals:
        goal = problem.goals[index]
        if problem.automaton.is_kinematic:
            part = found.budget.part(share, at_least=LEAST_TIME)
            for result in search_goal(problem, goal, alternatives=others, budget=part):
                yield index, result
            continue
        for result in insertion_stages(
            problem,
            goal,
            alternatives=others or 0,
            budget=found.budget.stage(share),
            upper_bound=math.inf if others else found.cost,
        ):
            yield index, result


def words_once(stages: Iterable[tuple[int, SearchResult]]) -> Iterator[tuple[Word, int]]:
    """The words of all stages as they are found, each once, with the goals they reach."""
    seen: list[Word] = []
    for index, result in stages:
        for word in result.solutions:
            if not any(word is one for one in seen):
                seen.append(word)
                yield word, index


def word_candidate(
    problem: Problem, word: Word, goal_index: int, *, proven: bool = True
) -> Candidate:
    """A word as a plan that is still to be checked, `proven` as in `Candidate`."""
    make = functools.partial(plan_of, problem, word)
    return Candidate(word.cost, goal_index, make, proven=proven)
