"""From a word of the lattice to a plan that ends exactly."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.search.lattice_pass import Word
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.words.closing import closed_at


def plan_of_word(query: LatticeQuery, word: Word) -> Plan:
    """The word from the problem's own start, its times corrected until it ends at the goal."""
    problem = query.problem
    goal = problem.goals[query.goal_index[word.goal]]
    trims = [problem.automaton.trims[k] for k in query.library.trims[word.trims]]
    twists = np.array([trim.body_velocity for trim in trims]).reshape(-1, 3)
    durations = closed_at(
        problem.start, twists, word.durations, goal.pose, free_heading=goal.free_heading
    )
    total = float(durations.sum())
    fixed, rest = problem.horizon.time, query.library.rest
    if fixed is not None and rest is not None and total < fixed:
        trims.append(problem.automaton.trims[rest])
        durations = np.append(durations, fixed - total)
    return Plan(problem.start, tuple(trims), durations=durations, start_time=problem.start_time)
