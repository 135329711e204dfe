"""From a word of the lattice to a plan that ends exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.words.word import Word, plan_of


def plan_of_word(query: LatticeQuery, word: Word) -> Plan:
    """The word from the problem's own start, its times corrected until it ends at the goal."""
    problem = query.problem
    goal = problem.goals[query.goal_index[word.goal]]
    plan = plan_of(
        problem.automaton,
        word,
        problem.start,
        goal=goal.pose,
        free_heading=goal.free_heading,
        start_time=problem.start_time,
    )
    fixed, rest = problem.horizon.time, query.library.rest
    if fixed is None or rest is None or not plan.duration < fixed:
        return plan
    return replace(
        plan,
        trims=(*plan.trims, problem.automaton.trims[rest]),
        durations=np.append(plan.durations, fixed - plan.duration),
    )
