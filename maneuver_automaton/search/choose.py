"""Which search suits a problem, and that search: of all words, by insertion, with least times.

Insertion improves short words by whatever pays most until nothing pays. A kinematic vehicle has one
class of trims, which switch at will: a trim is inserted for an instant, and its price tells exactly
what that saves; see `free_insertion`. Between classes lead transitions of finite size, so that
another word has to be tried; see `linked_insertion`. Trying words would do for one class, too,
without a certificate and in 250 times the time: 545 ms in place of 2 for 81 trims, 11.7 s in place
of 7 ms for 441. So each improves words in its own way, and both have the question, the first words
and the answer in common.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from maneuver_automaton._kept import kept_by_first
from maneuver_automaton._kernel_list import load_kernels, many_calls_are_expected
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search import free_insertion, linked_insertion
from maneuver_automaton.search.limits import sole_shortest, three_are_enough
from maneuver_automaton.search.momenta import momenta_of
from maneuver_automaton.search.result import InsertionTask, SearchResult, SearchStatus, in_order
from maneuver_automaton.search.setup import SearchSetup, few_of, search_setup
from maneuver_automaton.search.word_scan import MOST_TRIMS, tables
from maneuver_automaton.search.words import resting, search_words
from maneuver_automaton.words import TimesStatus, solve_switching_times
from maneuver_automaton.words.library import moving_trims
from maneuver_automaton.words.word import Word

AFFORDABLE = 2.0  # [s] an exhaustive search may be expected to take when the method is `auto`
SHORT = 4  # trims of words that are a second opinion
LARGE = 200  # trims of a library whose tables are worth to be had ready
SECONDS_PER_WORD = (0.0, 1e-6, 1e-6, 1e-6, 5e-5)  # by moving trims, measured, generous


def load_search(problem: Problem) -> None:
    """Compile or load what the search will need: that does not count as searching."""
    if problem.horizon.min_coast > 0.0:
        load_kernels("times")
        return
    if all(_suits_words(problem, goal) for goal in problem.goals):
        load_kernels("words")
        library = moving_trims(problem.automaton, problem.cost)
        if problem.horizon.time is None and many_calls_are_expected():
            momenta_of(library)
        if len(problem.automaton) > LARGE:
            tables(library, free_heading=problem.goals[0].free_heading)
    else:
        load_kernels("words", "linked words", "insertion")


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
    if method == "auto" and alternatives == 0 and known is None and not ties:
        sole = sole_shortest(problem, goal)
        if sole is not None:
            return [SearchResult(status=SearchStatus.FOUND, solutions=(sole,), exhaustive=True)]
    upper_bound = math.inf
    if known is not None:
        upper_bound = problem.cost_of(known) if known_cost is None else known_cost
    words = functools.partial(
        search_words, goal=goal, alternatives=alternatives, budget=budget, ties=ties
    )
    if _suits_words(problem, goal):
        return [words(problem, upper_bound=upper_bound, not_first=not_first)]
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
            short = words(few, upper_bound=upper_bound)
            proven = short.exhaustive and three_are_enough(problem)
            results.append(replace(short, exhaustive=proven))
    return results


def _suits_words(problem: Problem, goal: Goal) -> bool:
    """Whether all words are searched: because that is asked for, or affordable."""
    search, most, tail = problem.search, problem.horizon.max_trims, int(goal.free_heading)
    if search.method != "auto":
        return search.method == "words"
    return _affordable(problem.automaton, most, tail, search.max_expansions)


@kept_by_first
def _seconds(automaton: Automaton, most: int, tail: int) -> float:
    """How long a search of all words of up to `most` trims, and of a `tail`, may take [s]."""
    moving = int(automaton.body_velocities.any(axis=1).sum())
    return math.fsum(moving**n * SECONDS_PER_WORD[n + tail] for n in range(1, most + 1))


@kept_by_first
def _affordable(automaton: Automaton, most: int | None, tail: int, limit: int | None) -> bool:
    """Whether every admitted word can be searched in a moment, and within the expansions."""
    if most is None or most > MOST_TRIMS - tail:
        return False
    moving = int(automaton.body_velocities.any(axis=1).sum())
    words = sum(moving * (moving - 1) ** n for n in range(most))
    return _seconds(automaton, most, tail) <= AFFORDABLE and (limit is None or words <= limit)


MOST_LASTING = 4  # moving trims of a word
RESTARTS = 3  # starts of each word beside the first


def search_with_least_times(
    problem: Problem, goal: Goal, *, alternatives: int | None = 0, budget: Budget = UNLIMITED
) -> SearchResult:
    """Words in which every moving trim lasts at least ``horizon.min_coast``.

    The least time of each trim gives a fixed displacement after it; the time beyond is solved for.
    Each word is solved from several starts, so solutions may be missed. Of a large library only the
    trims that reach far are combined.
    """
    setup = search_setup(problem, goal)
    if setup.start_is_goal and (problem.horizon.time is None or setup.library.rest is not None):
        return resting(problem, setup)
    padded = problem.horizon.time is not None and setup.library.rest is not None
    most = min(problem.horizon.max_trims or MOST_LASTING + 1, MOST_LASTING + int(padded))
    found: list[Word] = []
    words = 0
    status = SearchStatus.EXHAUSTED
    reaching = np.flatnonzero(np.isin(setup.library.trims, few_of(setup.library).trims)).tolist()
    for word in _words(reaching, most):
        if budget.is_over or words == problem.search.max_expansions:
            status = SearchStatus.OUT_OF_BUDGET
            break
        words += 1
        for rest in (False, True) if padded else (False,):
            if len(word) + rest <= most:
                found += _solved(problem, setup, word, rest=rest)
    solutions = tuple(in_order(found))[: None if alternatives is None else alternatives + 1]
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
    twists, rates = setup.library.twists[rows], setup.library.rates[rows]
    floors = np.full(len(rows), least)
    trims = setup.library.trims[rows]
    if rest and setup.library.rest is not None:
        twists = np.vstack([twists, np.zeros(4)])
        rates = np.append(rates, setup.library.rest_rate)
        floors = np.append(floors, 0.0)
        trims = np.append(trims, setup.library.rest)
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
    switching = problem.cost.switching(problem.automaton.body_velocities[trims])
    return [Word(trims=trims, durations=times, cost=float(rates @ times) + switching)]


def search_insertion(
    problem: Problem,
    goal: Goal,
    *,
    alternatives: int = 0,
    seeds: int | None = None,
    budget: Budget = UNLIMITED,
    known: Plan | None = None,
    upper_bound: float = math.inf,
) -> SearchResult:
    """Plans to a goal in free space: short words, and what insertion makes of them.

    Parameters
    ----------
    problem : Problem
        With maneuvers, its first trim, and the last one of `goal`, are those named, or rest.
        Obstacles and bounds are not looked at.
    goal : Goal
    alternatives : int
        How many solutions beside the cheapest, as far as the seeds lead to different words.
    seeds : int, optional
        How many short words to start from; by default 4, or 10 for small libraries whose trims
        switch at will. 0: from the known plan alone, as long as that has a solution.
    budget : Budget
        No further seed is begun once its time is over. Where the problem limits its expansions,
        every stage counts its work, and the time only ends it earlier.
    known : Plan, optional
        A plan of this library from start to goal, improved before any seed.
    upper_bound : float
        Cost of a plan that is known: what costs as much is left out. Insertion still begins with
        words that are a little costlier.

    Returns
    -------
    SearchResult
        Solutions by rising cost. Where trims switch at will, the certificate of each is its
        smallest reduced cost over the whole library and all times: at least ``-1e-9`` where
        Pontryagin's condition holds. With maneuvers, a solution is a local optimum.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.costs import Cost
    >>> from maneuver_automaton.models import Unicycle
    >>> speeds = [-2, -1.5, -1, -0.5, 0, 0.5, 1, 1.5, 2]
    >>> robot = Automaton.of_grid(Unicycle(), [speeds, speeds])
    >>> from maneuver_automaton.problem import Horizon
    >>> cost, horizon = Cost(effort=1), Horizon(time=1.25)
    >>> problem = Problem(robot, [-2, 0, 0], [0, 0, 0], cost=cost, horizon=horizon)
    >>> best = search_insertion(problem, problem.goals[0]).solutions[0]
    >>> round(best.cost, 6), best.certificate > -1e-9
    (3.25, True)
    """
    *_, last = insertion_stages(
        InsertionTask(
            problem=problem,
            goal=goal,
            alternatives=alternatives,
            seeds=seeds,
            known=known,
            budget=budget,
            upper_bound=upper_bound,
        )
    )
    return last


def insertion_stages(task: InsertionTask) -> Iterator[SearchResult]:
    """Results so far after each stage; the last one is the answer of `search_insertion`."""
    most = task.alternatives + 1
    # a trim that has to last a while cannot be priced for an instant
    instants = task.problem.automaton.is_kinematic and task.problem.horizon.min_coast == 0.0
    for stage in (free_insertion.free_stages if instants else linked_insertion.linked_stages)(task):
        kept = tuple(one for one in stage.solutions if one.cost < task.upper_bound)[:most]
        yield replace(stage, solutions=kept, status=SearchStatus.FOUND if kept else stage.status)
