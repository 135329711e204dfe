"""From a word of the lattice to a plan that ends exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.words.word import Word, plan_of


def plan_of_word(query: LatticeQuery, word: Word) -> Plan:
    """The word from the problem's own start, its times corrected until it ends at the goal.

    Where trims are switched at will, a rest fills a fixed time.
    """
    problem = query.problem
    plan = plan_of(
        query.automaton,
        word,
        problem.start,
        goal=query.goal_poses[word.goal],
        free_heading=bool(query.free_heading[word.goal]),
        start_time=problem.start_time,
    )
    fixed, rest = problem.horizon.time, query.library.rest
    if not query.automaton.is_kinematic or fixed is None or rest is None:
        return plan
    if not plan.duration < fixed:
        return plan
    return replace(
        plan,
        trims=(*plan.trims, problem.automaton.trims[rest]),
        durations=np.append(plan.durations, fixed - plan.duration),
    )
