"""Which steps lead to the plans of a problem: decided once, by what its vehicle and library can do.

The order of the steps and all that they share is the same for every vehicle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.automaton.same_motion import POLISHED, UNFINISHED, Likeness
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning.bounds import least_price_per_metre
from maneuver_automaton.planning.checking import load_checking
from maneuver_automaton.planning.needs import (
    climbs_among_obstacles,
    has_inertia,
    rests_at_both_ends,
)
from maneuver_automaton.planning.polished_price import prices_metres_alone
from maneuver_automaton.planning.polishing import load_polishing, why_not_polished
from maneuver_automaton.planning.result import Workspace
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement.kinematic_paths import follows_paths, kinematic_problem
from maneuver_automaton.search.choose import load_search
from maneuver_automaton.search.cost_to_go import cost_to_go_table
from maneuver_automaton.search.lattice_library import lattice_library
from maneuver_automaton.search.lattice_trims import stands_for_more
from maneuver_automaton.search.linked_words import ALPHABET
from maneuver_automaton.search.word_setup import word_setup

BY_TIME = Cost(time=1.0)  # one value: what is prepared for it is found again


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """The steps of planning for a problem, in their order."""

    along_paths: bool  # stop and steer along the paths of a kinematic vehicle
    words: bool  # offer words of free space before the lattice is searched
    lattice: bool
    polishes: bool  # at the end, what was found
    at_will: bool  # trims are switched so: plans are words, and words are all there is
    likeness: Likeness  # of plans that count as one motion


def steps_of(problem: Problem) -> Steps:
    """The steps that lead to plans of a problem.

    Where nothing is in the way, words come before the lattice: they are found sooner, and keep to
    every condition of the horizon. Among obstacles the lattice alone finds a path round them; but
    in space, where it has one more dimension, a word that passes above or below is found sooner.
    """
    method, automaton = problem.search.method, problem.automaton
    searched = method in ("auto", "lattice")
    if not has_inertia(problem):
        return Steps(
            along_paths=False,
            words=climbs_among_obstacles(problem),
            lattice=searched,
            polishes=False,
            at_will=True,
            likeness=UNFINISHED,
        )
    linked = bool(automaton.maneuvers)
    first = method == "auto" and _suits_words(problem)
    along = searched and follows_paths(automaton.model) and rests_at_both_ends(problem)
    shortest = along and prices_metres_alone(problem.cost)  # to stop and steer costs no metre
    return Steps(
        along_paths=along,
        words=linked and (not searched or first),
        lattice=linked and searched,
        polishes=not (shortest or why_not_polished(problem)),
        at_will=False,
        likeness=POLISHED,
    )


def load_steps(problem: Problem, workspace: Workspace) -> None:
    """Compile or load what the steps of a problem need, before the clock runs."""
    steps = steps_of(problem)
    if steps.at_will and problem.start.size > 3:
        load_search(problem)
        load_kernels("lattice", "improvement")
        return
    load_kernels("lattice", "improvement")
    if steps.at_will:
        cost_to_go_table(problem, prepared=workspace.prepared)
        if stands_for_more(problem):
            load_kernels("insertion")
        return
    load_checking()
    if follows_paths(problem.automaton.model) and rests_at_both_ends(problem):
        simpler = kinematic_problem(problem, switch=0.0)
        cost_to_go_table(simpler, prepared=workspace.prepared)
    if steps.polishes and rests_at_both_ends(problem):
        load_polishing(problem)
    if problem.automaton.maneuvers:
        load_kernels("times")
        least_price_per_metre(problem.automaton, problem.cost)
        if steps.lattice:
            goals, horizon = range(len(problem.goals)), problem.horizon
            library = lattice_library(problem, goals, prepared=workspace.prepared)
            if horizon.time or horizon.max_time or library.per_metre == 0.0:
                in_time = replace(problem, cost=BY_TIME)
                lattice_library(in_time, goals, prepared=workspace.prepared)
        if _suits_words(problem) or steps.words:
            load_kernels("words")
            for goal in problem.goals:
                word_setup(problem, goal, most_trims=ALPHABET, steers=True)


def _suits_words(problem: Problem) -> bool:
    """Whether words may be searched first: nothing is in the way, or they alone meet the time."""
    rests = problem.first_trim.is_rest or problem.last_trim(problem.goals[0]).is_rest
    return not problem.obstacles or (problem.horizon.time is not None and not rests)
