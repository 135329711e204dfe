"""The search from the goal: an automaton in reverse, and its words turned round.

Run backwards in time a trim moves by the opposite twist and a maneuver leads from its target to its
source, along the same poses. So the search from the start also serves from the goal, and finds the
same words from their other end.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Shape
from maneuver_automaton.costs import StageCost
from maneuver_automaton.groups import group_of
from maneuver_automaton.primitives import Maneuver, Trajectory
from maneuver_automaton.search.lattice_arrays import LatticeLibrary
from maneuver_automaton.search.lattice_library import Carried, library_of_trims
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_trims import priced_library, trims_of
from maneuver_automaton.search.part_motion import posed_parts
from maneuver_automaton.search.scene import for_library
from maneuver_automaton.words.library import library_of
from maneuver_automaton.words.word import Word

SECONDS_A_MANEUVER, SECONDS_A_WORD = 1e-3, 2e-6  # measured, generous


def to_reverse(query: LatticeQuery) -> float:
    """Time [s] that it may take to make the reversed library of a query, which cannot be stopped.

    By the number of maneuvers, whose courses are sampled and priced anew, and of words.
    """
    words = len(query.library.arrays.library.words)
    return SECONDS_A_MANEUVER * len(query.automaton.maneuvers) + SECONDS_A_WORD * words


def reversed_query(query: LatticeQuery) -> LatticeQuery | None:
    """The query from goal to start; None where obstacles move, or with several goals."""
    if query.moves or len(query.goals) > 1:
        return None
    problem = query.problem
    library = query.prepared.once(
        _reversed_library,
        query.automaton,
        problem.cost,
        problem.footprint,
        tuple(problem.parts.items()),
    )
    return replace(
        query,
        library=library,
        around=for_library(query.around, problem, library),
        start=query.goals[0],
        goals=query.start[None],
        goal_poses=problem.start[None],
        start_trim=int(query.goal_trims[0]),
        goal_trims=np.array([query.start_trim], dtype=np.int64),
    )


def forward_word(word: Word) -> Word:
    """A word of the reversed query as a word of the query."""
    return replace(
        word,
        trims=word.trims[::-1],
        durations=word.durations[::-1].copy(),
        transitions=word.transitions[::-1],
        goal=0,
    )


def _reversed_library(
    automaton: Automaton, cost: StageCost, footprint: tuple[Shape, ...], carried: Carried
) -> LatticeLibrary:
    """The library of an automaton in reverse, at the same prices, for static obstacles."""
    priced = priced_library(automaton, cost)
    trims = tuple(replace(trim, body_velocity=-trim.body_velocity) for trim in automaton.trims)
    maneuvers = tuple(_reversed(one) for one in automaton.maneuvers)
    back = library_of(
        replace(automaton, trims=trims, maneuvers=maneuvers),
        rates=priced.arrays.rates[: priced.arrays.n_trims],
        maneuver_costs=priced.maneuver_costs,
    )
    parts = tuple(
        replace(part, course_poses=tuple(poses[::-1].copy() for poses in part.course_poses))
        for part in posed_parts(automaton, footprint, dict(carried), priced.trims)
    )
    return library_of_trims(trims_of(back, cost), parts, waits=False)


def _reversed(maneuver: Maneuver) -> Maneuver:
    group = group_of(maneuver.displacement.size)
    back = np.array(group(maneuver.displacement).inverse().pose)
    course = maneuver.course
    if course is not None:
        last = course.pose[-1]
        poses = np.array((group(last).inverse() @ group(course.pose[::-1])).pose)
        poses[0] = 0.0
        back = poses[-1]
        course = Trajectory(
            time=course.time[-1] - course.time[::-1],
            pose=poses,
            reduced_state=course.reduced_state[::-1].copy(),
            control=np.concatenate([course.control[-2::-1], course.control[:1]]),
        )
    return replace(
        maneuver,
        source=maneuver.target,
        target=maneuver.source,
        displacement=back,
        course=course,
    )
