"""Words whose trims must each last a while: the least coasting time as a fixed displacement."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.result import SearchResult, SearchStatus, in_order
from maneuver_automaton.search.setup import SearchSetup, search_setup, sub_library
from maneuver_automaton.search.words import resting
from maneuver_automaton.words import TimesStatus, solve_switching_times
from maneuver_automaton.words.word import Word

MOST_TRIMS = 4  # moving trims of a word
RESTARTS = 3  # starts of each word beside the first


def search_with_least_times(
    problem: Problem, goal: Goal, *, alternatives: int | None = 0, budget: Budget = UNLIMITED
) -> SearchResult:
    """Words in which every moving trim lasts at least ``horizon.min_coast``.

    The least time of each trim gives a fixed displacement after it; the time beyond is solved for.
    Each word is solved from several starts, so solutions may be missed. Of a large library only the
    trims that reach far are combined.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import Unicycle
    >>> from maneuver_automaton.problem import Horizon
    >>> controls = {"ahead": (1, 0), "left": (1, 1), "right": (1, -1)}
    >>> robot = Automaton.of_controls(Unicycle(), controls)
    >>> problem = Problem(robot, [0, 0, 0], [4, 1, 0], horizon=Horizon(max_trims=3, min_coast=0.5))
    >>> best = search_with_least_times(problem, problem.goals[0]).solutions[0]
    >>> bool((best.durations >= 0.5).all()), round(best.cost, 4)
    (True, 4.3623)
    """
    setup = search_setup(problem, goal)
    if setup.start_is_goal and (problem.horizon.time is None or setup.rest is not None):
        return resting(problem, setup)
    padded = problem.horizon.time is not None and setup.rest is not None
    most = min(problem.horizon.max_trims or MOST_TRIMS + 1, MOST_TRIMS + int(padded))
    found: list[Word] = []
    words = 0
    status = SearchStatus.EXHAUSTED
    reaching = np.flatnonzero(np.isin(setup.trims, sub_library(setup).trims)).tolist()
    for word in _words(reaching, most):
        if budget.is_over or words == problem.search.max_expansions:
            status = SearchStatus.OUT_OF_BUDGET
            break
        words += 1
        for rest in (False, True) if padded else (False,):
            if len(word) + rest <= most:
                found += _solved(problem, setup, word, rest=rest)
    solutions = tuple(in_order(found))
    if alternatives is not None:
        solutions = solutions[: alternatives + 1]
    return SearchResult(
        status=SearchStatus.FOUND if solutions else status,
        solutions=solutions,
        complete=False,
        counts={"expansions": words},
    )


def _words(trims: list[int], most: int) -> Iterator[tuple[int, ...]]:
    """Words of these trims without equal neighbours, shorter ones first."""
    for n in range(1, most + 1):
        for word in itertools.product(trims, repeat=n):
            if all(a != b for a, b in itertools.pairwise(word)):
                yield word


def _solved(
    problem: Problem, setup: SearchSetup, word: tuple[int, ...], *, rest: bool
) -> list[Word]:
    """The word with its best times, if it reaches the goal."""
    rows = list(word)
    least = problem.horizon.min_coast
    twists, rates = setup.twists[rows], setup.rates[rows]
    floors = np.full(len(rows), least)
    trims = setup.trims[rows]
    if rest and setup.rest is not None:
        twists = np.vstack([twists, np.zeros(4)])
        rates = np.append(rates, setup.rest_rate)
        floors = np.append(floors, 0.0)
        trims = np.append(trims, setup.rest)
    longest = problem.horizon.max_time
    # Where the cheapest times are too long, the greatest time binds: it becomes a fixed one.
    for total in (problem.horizon.time,) if longest is None else (None, longest):
        solved = solve_switching_times(
            twists,
            rates,
            setup.goal,
            total=total,
            free_heading=setup.free_heading,
            least=floors,
            restarts=RESTARTS,
        )
        if solved.status is TimesStatus.FAILED:
            return []
        if longest is None or solved.durations.sum() <= longest + 1e-9:
            break
    times = solved.durations
    if longest is not None and times.sum() > longest + 1e-9:
        return []
    if rest and times[-1] <= 1e-9:
        return []  # the same word without rest is tried too
    return [_priced(problem, Word(trims=trims, durations=times, cost=0.0), rates)]


def _priced(problem: Problem, solution: Word, rates: Array) -> Word:
    velocities = problem.automaton.body_velocities[solution.trims]
    cost = float(rates @ solution.durations) + problem.cost.switching(velocities)
    return replace(solution, cost=cost)
