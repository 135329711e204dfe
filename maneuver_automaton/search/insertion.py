"""Search by insertion: short words, improved by whatever pays most until nothing pays.

A kinematic vehicle has one class of trims, which switch at will: a trim is inserted for an instant,
and its price tells exactly what that saves; see `free_insertion`. Between classes lead transitions
of finite size, so that another word has to be tried; see `linked_insertion`. Trying words would do
for one class, too, without a certificate and in 250 times the time: 545 ms in place of 2 for 81
trims, 11.7 s in place of 7 ms for 441. So each improves words in its own way, and both have the
question, the first words and the answer in common.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.free_insertion import free_stages
from maneuver_automaton.search.linked_insertion import linked_stages
from maneuver_automaton.search.result import InsertionTask, SearchResult, SearchStatus


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
    at_will = task.problem.automaton.is_kinematic and task.problem.horizon.min_coast == 0.0
    for stage in (free_stages if at_will else linked_stages)(task):
        kept = tuple(one for one in stage.solutions if one.cost < task.upper_bound)[:most]
        yield replace(stage, solutions=kept, status=SearchStatus.FOUND if kept else stage.status)
