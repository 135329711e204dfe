"""Which search suits a problem, and that search."""

from __future__ import annotations

import math
from dataclasses import replace

from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.insertion import search_insertion
from maneuver_automaton.search.min_coast import search_with_least_times
from maneuver_automaton.search.ready import (
    load_insertion_kernels,
    load_times_kernels,
    load_word_kernels,
)
from maneuver_automaton.search.result import SearchResult
from maneuver_automaton.search.setup import search_setup
from maneuver_automaton.search.word_scan import MOST_TRIMS, tables_of
from maneuver_automaton.search.words import search_words

AFFORDABLE = 2.0  # [s] an exhaustive search may be expected to take when the method is `auto`
SHORT = 4  # trims of words that are a second opinion
LARGE = 200  # trims of a library whose tables are worth to be had ready
SECONDS_PER_WORD = (0.0, 1e-6, 1e-6, 1e-6, 5e-5, 2e-3)  # by moving trims, measured, generous


def load_search(problem: Problem) -> None:
    """Compile or load what the search will need: that does not count as searching."""
    if problem.horizon.min_coast > 0.0:
        load_times_kernels()
        return
    affordable = all(_affordable(problem, goal) for goal in problem.goals)
    if problem.search.method == "words" or (problem.search.method == "auto" and affordable):
        tail = int(any(goal.free_heading for goal in problem.goals))
        load_word_kernels(min((problem.horizon.max_trims or MOST_TRIMS) + tail, MOST_TRIMS))
        if len(problem.automaton) > LARGE:
            tables_of(search_setup(problem, problem.goals[0]))
    else:
        more = problem.start.size > 3 or problem.horizon.time or problem.horizon.max_time
        turned = any(goal.free_heading for goal in problem.goals)
        load_word_kernels(MOST_TRIMS if more or turned else 4)
        load_insertion_kernels()


def search_goal(
    problem: Problem,
    goal: Goal,
    *,
    alternatives: int | None,
    budget: Budget = UNLIMITED,
    known: Plan | None = None,
    known_cost: float | None = None,
    ties: bool = False,
    second_opinion: float = AFFORDABLE,
    not_first: int | None = None,
    seeds: int | None = None,
) -> list[SearchResult]:
    """The method asked for; `auto`: exhaustive where affordable, otherwise insertion, or both.

    One result per method that was tried. Beside the parameters of `search_words` and
    `search_insertion`: of a `known` plan and its cost exhaustive search lists only what is at least
    as cheap (it may find nothing), and insertion improves it beside its own seeds; `second_opinion`
    [s] is what exhaustive search of short words may be expected to take beside insertion.
    """
    method = problem.search.method
    if problem.horizon.min_coast > 0.0:
        return [search_with_least_times(problem, goal, alternatives=alternatives, budget=budget)]
    upper_bound = math.inf
    if known is not None:
        upper_bound = problem.cost_of(known) if known_cost is None else known_cost
    if method == "words" or (method == "auto" and _affordable(problem, goal)):
        return [
            search_words(
                problem,
                goal,
                alternatives=alternatives,
                budget=budget,
                upper_bound=upper_bound,
                ties=ties,
                not_first=not_first,
            )
        ]
    results = [
        search_insertion(
            problem,
            goal,
            alternatives=10 if alternatives is None else alternatives,
            budget=budget,
            known=known,
            seeds=seeds,
        )
    ]
    if method == "auto":  # short words too, where they are few: alternatives, and a second opinion
        tail = int(goal.free_heading)
        is_quick = _seconds(problem.automaton, SHORT - tail, tail) <= second_opinion
        if (problem.horizon.max_trims or math.inf) > SHORT and is_quick:
            few = replace(problem, horizon=replace(problem.horizon, max_trims=SHORT - tail))
            best = min((one.cost for one in results[0].solutions), default=math.inf)
            if alternatives == 0:
                upper_bound = min(upper_bound, best)
            short = search_words(
                few,
                goal,
                alternatives=alternatives,
                budget=budget,
                upper_bound=upper_bound,
                ties=ties,
            )
            results.append(replace(short, exhaustive=False))
    return results


@kept_by_first
def _seconds(automaton: Automaton, most: int, tail: int) -> float:
    """How long a search of all words of up to `most` trims, and of a `tail`, may take [s]."""
    moving = int(automaton.body_velocities.any(axis=1).sum())
    return math.fsum(moving**n * SECONDS_PER_WORD[n + tail] for n in range(1, most + 1))


def _affordable(problem: Problem, goal: Goal) -> bool:
    """Whether every admitted word can be searched in a moment."""
    most = problem.horizon.max_trims
    if most is None or most > MOST_TRIMS - int(goal.free_heading):
        return False
    return _seconds(problem.automaton, most, int(goal.free_heading)) <= AFFORDABLE
