"""Load or compile the search kernels before the clock runs: a time limit is for searching."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.search.certificate import certificate
from maneuver_automaton.search.free_insertion import compile_calming
from maneuver_automaton.search.insertion import search_insertion
from maneuver_automaton.search.word_scan import MOST_AT_ONCE
from maneuver_automaton.search.words import search_words
from maneuver_automaton.words import solve_switching_times
from maneuver_automaton.words.word import Word

if TYPE_CHECKING:
    from maneuver_automaton.search.lattice_query import LatticeQuery


MANY = 10**9


@functools.cache
def load_word_kernels(max_trims: int) -> None:
    """Have the kernels of exhaustive search ready, for words of up to `max_trims` trims."""
    problem = replace(_smallest_problem(), horizon=Horizon(max_trims=max_trims))
    at_once = replace(problem, horizon=Horizon(max_trims=min(max_trims, MOST_AT_ONCE)))
    search_words(at_once, at_once.goals[0])
    counted = SearchSettings(max_expansions=MANY)  # which is never done at once
    found = search_words(replace(problem, search=counted), problem.goals[0])
    for solution in found.solutions[:1]:  # none where a signal ended the search
        certificate(problem, problem.goals[0], solution)


@functools.cache
def load_insertion_kernels() -> None:
    """Have the kernels of insertion ready."""
    problem = _smallest_problem()
    search_insertion(problem, problem.goals[0])
    compile_calming(problem)


@functools.cache
def load_times_kernels() -> None:
    """Have the kernels that solve the times of a given word ready, and those that price it."""
    solve_switching_times([[1.0, 0.0, 0.0]], [1.0], [1.0, 0.0, 0.0])
    problem = _smallest_problem()
    straight = Word(trims=np.array([0]), durations=np.array([1.0]), cost=1.0)
    certificate(problem, problem.goals[0], straight)


def smallest_lattice_query() -> LatticeQuery:
    """A query with a wall and a map, which compiles every kernel of the lattice."""
    from maneuver_automaton.collision import Box, Obstacle, OccupancyMap
    from maneuver_automaton.search._kernels_distance import distances
    from maneuver_automaton.search.distance_grid import distance_grid
    from maneuver_automaton.search.lattice import plane_bound
    from maneuver_automaton.search.lattice_query import lattice_query

    wall = Obstacle(Box([1.0, 1.0], [0.0, 9.0]))
    room = OccupancyMap(np.eye(2, dtype=np.bool_), resolution=0.5, origin=[5.0, 9.0, 0.1])
    query = lattice_query(replace(_smallest_problem(), obstacles=(wall, room)), (0,))
    plane_bound(query)
    grid = distance_grid(query.world, query.box, query.goals, query.start)
    distances(grid, query.world.arrays.field, np.zeros((1, 2)))
    return query


def _smallest_problem() -> Problem:
    robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "left": (1.0, 1.0)})
    goal = Goal(pose=np.array([1.0, 0.0, 0.0]))
    return Problem(robot, np.zeros(3), (goal,), cost=Cost(time=1.0))
