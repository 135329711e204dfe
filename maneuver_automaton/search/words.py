"""Exhaustive search over words: every locally optimal solution, cheapest first."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.result import SearchResult, SearchStatus, in_order, tied
from maneuver_automaton.search.setup import SearchSetup, search_setup
from maneuver_automaton.search.word_scan import MOST_TRIMS, NODES, Extent, WordScan, scan_of
from maneuver_automaton.words.word import Word

MOST_LATE = 100  # solutions, of thousands, that are handed over once the time is over
SEED_NODES = 24  # per scanned time, where a rough answer will do


def search_words(
    problem: Problem,
    goal: Goal,
    *,
    alternatives: int | None = 0,
    budget: Budget = UNLIMITED,
    nodes: int = NODES,
    upper_bound: float = math.inf,
    ties: bool = False,
    not_first: int | None = None,
) -> SearchResult:
    """Search every word of at most ``max_trims`` trims for its locally optimal coasting times.

    *Locally optimal*: all times are positive and no small feasible change of them is cheaper;
    isolated solutions count. Three times follow in closed form; of four trims one is scanned, with
    its roots bracketed.

    Parameters
    ----------
    problem : Problem
    goal : Goal
    alternatives : int, optional
        How many solutions beside the cheapest; bounds prune what cannot be among them. None asks
        for the complete list, and nothing is pruned.
    budget : Budget
        The search ends with what it has once its time is over.
    nodes : int
        Grid nodes per scanned time.
    upper_bound : float
        Cost of a plan that is known: what is costlier may be left out, and so there may be none.
    ties : bool
        Whether to list, beside the solutions asked for, all that cost as much as the last of them.
    not_first : int, optional
        A trim of the automaton. No word of fewer than ``max_trims`` trims, and none that begins
        with this trim, is cheaper than `upper_bound`, or as cheap and another plan, as the caller
        has proven: they need not be searched.

    Returns
    -------
    SearchResult
        Solutions by rising cost, then fewer trims, then word; ``complete`` if nothing was pruned.

    Raises
    ------
    ValueError
        If more trims are admitted than an exhaustive search can take.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import Unicycle
    >>> controls = {"ahead": (1, 0), "left": (0, 1), "right": (0, -1)}
    >>> robot = Automaton.of_controls(Unicycle(), controls)
    >>> problem = Problem(robot, [0, 0, 0], [1, 1, 0])
    >>> best = search_words(problem, problem.goals[0]).solutions[0]
    >>> [robot.trim_names[k] for k in best.trims], round(best.cost, 4)
    (['left', 'ahead', 'right'], 2.985)
    """
    setup = search_setup(problem, goal)
    most = problem.horizon.max_trims
    longest = MOST_TRIMS - int(setup.free_heading)  # moving trims
    limit = most_admitted(free_heading=setup.free_heading, fixed=problem.horizon.time is not None)
    if most is None:
        most = limit
    elif most > limit:
        raise ValueError(
            f"search by words: max_trims is {most}, need at most {limit}; use insertion for more"
        )
    if setup.start_is_goal and (problem.horizon.time is None or setup.library.rest is not None):
        return resting(problem, setup)
    job = scan_of(problem, setup, Extent(most=most, alternatives=alternatives, nodes=nodes))
    job.begin(setup, upper_bound=upper_bound, not_first=not_first)
    finished = job.run(budget, problem.search.max_expansions)
    solutions = tuple(in_order(_handed_over(job, budget))) if job.n_found else ()
    if alternatives is not None and len(solutions) > alternatives + 1:
        asked = solutions[: alternatives + 1]
        most_tied = tied(asked[-1].cost) if ties else -math.inf
        solutions = asked + tuple(
            one for one in solutions[alternatives + 1 :] if one.cost <= most_tied
        )
    job.idle.append(job)
    exhaustive = finished and most <= longest  # no words of more moving trims are admitted
    none = SearchStatus.EXHAUSTED if finished else SearchStatus.OUT_OF_BUDGET
    return SearchResult(
        status=SearchStatus.FOUND if solutions else none,
        solutions=solutions,
        complete=alternatives is None and exhaustive and upper_bound == math.inf,
        exhaustive=exhaustive and problem.horizon.max_trims is not None,
        counts={"expansions": job.n_words, "steering_calls": job.n_steering},
    )


def most_admitted(*, free_heading: bool, fixed: bool) -> int:
    """Trims of a word that is searched for, with the rest that may fill a fixed time."""
    return MOST_TRIMS - int(free_heading) + int(fixed)


def search_setup_words(
    problem: Problem, setup: SearchSetup, *, alternatives: int, budget: Budget, spare: bool
) -> list[Word]:
    """Cheapest words of as few trims as the conditions need, from the trims of `setup` alone.

    `spare`: where a rest pads a fixed time, words that meet it exactly have two trims at most.
    """
    conditions = 3 + int(setup.climbs)
    padded = problem.horizon.time is not None and setup.library.rest is not None
    exact = problem.horizon.time is not None and not padded
    most = conditions + int(exact)  # as far as so many are scanned
    most += int(padded)
    spare = spare and padded
    extent = Extent(most=most, alternatives=alternatives, nodes=SEED_NODES, spare=spare)
    job = scan_of(problem, setup, extent)
    job.begin(setup)
    job.run(budget, None)
    cheapest: list[Word] = []
    for word in _handed_over(job, budget):  # by rising cost, but for a user's own prices
        enough = len(cheapest) > alternatives and not job.own_prices
        if enough and word.cost > tied(cheapest[alternatives].cost):
            break
        cheapest.append(word)
    job.idle.append(job)
    return list(in_order(cheapest))[: alternatives + 1]


def _handed_over(job: WordScan, budget: Budget) -> Iterator[Word]:
    """The words that were found; once the time is over some of them only."""
    for number, word in enumerate(job.solutions()):
        if number >= MOST_LATE and budget.is_over:
            return
        yield word


def resting(problem: Problem, setup: SearchSetup) -> SearchResult:
    """Start equal to goal: an empty word, or the whole of a fixed time at rest."""
    time_s, rest, cost = problem.horizon.time, setup.library.rest, 0.0
    trims, times = np.zeros(0, dtype=np.int64), np.zeros(0)
    if time_s is not None and rest is not None:
        trims, times = np.array([rest]), np.array([time_s])
        cost = setup.library.rest_rate * time_s
    word = Word(trims=trims, durations=times, cost=cost)
    return SearchResult(status=SearchStatus.FOUND, solutions=(word,), exhaustive=True)
