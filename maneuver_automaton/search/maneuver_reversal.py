"""The search from the goal: an automaton in reverse, and its words turned round.

Run backwards in time a trim moves by the opposite twist and a maneuver leads from its target to its
source, along the same poses. So what searches from the start also searches from the goal, and finds
the same words from their other end.
"""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import group_of
from maneuver_automaton.primitives import Maneuver, Trajectory
from maneuver_automaton.search.maneuver_motion import Part
from maneuver_automaton.search.maneuver_query import ManeuverQuery
from maneuver_automaton.words.library import Library, library_of
from maneuver_automaton.words.word import Word


def reversed_query(query: ManeuverQuery) -> ManeuverQuery | None:
    """The same question asked from the goal; None where obstacles move, or with several goals."""
    if query.moves or len(query.goals) > 1:
        return None
    transfer = _reversed_transfer(query.transfer)
    return replace(
        query,
        transfer=transfer,
        parts=_reversed_parts(query.parts),
        start=query.goals[0],
        goals=query.start[None],
        start_trim=int(query.goal_trims[0]),
        goal_trims=np.array([query.start_trim], dtype=np.int64),
        owners=None,
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


@functools.lru_cache(maxsize=4)
def _reversed_transfer(transfer: Library) -> Library:
    return library_of(
        _reversed_automaton(transfer.automaton),
        rates=transfer.arrays.rates[: transfer.arrays.n_trims],
        maneuver_costs=transfer.maneuver_costs,
    )


@functools.lru_cache(maxsize=4)
def _reversed_automaton(automaton: Automaton) -> Automaton:
    """Trims of opposite twists, and maneuvers from their ends to their begins."""
    trims = tuple(replace(trim, body_velocity=-trim.body_velocity) for trim in automaton.trims)
    return replace(
        automaton, trims=trims, maneuvers=tuple(_reversed(one) for one in automaton.maneuvers)
    )


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


@functools.lru_cache(maxsize=4)
def _reversed_parts(parts: tuple[Part, ...]) -> tuple[Part, ...]:
    """The parts with the samples of every course in reverse."""
    return tuple(
        replace(part, course_poses=tuple(poses[::-1].copy() for poses in part.course_poses))
        for part in parts
    )
