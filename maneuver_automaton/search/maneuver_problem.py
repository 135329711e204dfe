"""From a problem to the query of the search over trims and maneuvers."""

from __future__ import annotations

import functools

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.between import part_between
from maneuver_automaton.collision import Shape
from maneuver_automaton.costs import StageCost
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.lattice_goals import aim_of
from maneuver_automaton.search.maneuver_motion import Part, parts_of
from maneuver_automaton.search.maneuver_query import ManeuverQuery
from maneuver_automaton.words.library import Library, library_of


def maneuver_problem_query(problem: Problem, goals: tuple[int, ...]) -> ManeuverQuery:
    """What the search over trims and maneuvers is asked to solve, for the goals of these numbers.

    Trims that lead to no goal are left out: their speeds would make the estimates of cost too low.
    Prices of switches and changes of direction are left to whoever compares plans.

    Raises
    ------
    ValueError
        If a maneuver has no course, and so no known cost.
    """
    aims = [problem.goals[k] for k in goals]
    first, last = problem.first_trim.name, [problem.last_trim(goal).name for goal in aims]
    whole = problem.automaton
    automaton = part_between(whole, whole.index_of(first), [whole.index_of(one) for one in last])
    most = problem.horizon.max_time
    return ManeuverQuery(
        transfer=priced_transfers(automaton, problem.cost),
        parts=_parts(automaton, problem.footprint, tuple(problem.parts.items())),
        start=problem.start,
        goals=np.array([aim_of(problem, goal) for goal in aims]),
        start_trim=automaton.index_of(first),
        goal_trims=np.array([automaton.index_of(one) for one in last], dtype=np.int64),
        obstacles=problem.obstacles,
        bounds=problem.bounds,
        keep=problem.margin,
        body_height=problem.body_height,
        start_time=problem.start_time,
        most_time=np.inf if most is None else most,
    )


@functools.lru_cache(maxsize=8)
def priced_transfers(automaton: Automaton, cost: StageCost) -> Library:
    """The transfers of an automaton under a cost, made once."""
    origin = np.zeros(automaton.model.group.dof)
    rest = automaton.trims[0].name
    known = Problem(automaton, origin, Goal(pose=origin, trim=rest), start_trim=rest, cost=cost)
    return library_of(
        automaton,
        rates=known.rates,
        maneuver_costs=[known.maneuver_cost(maneuver) for maneuver in automaton.maneuvers],
    )


@functools.lru_cache(maxsize=8)
def _parts(
    automaton: Automaton,
    footprint: tuple[Shape, ...],
    carried: tuple[tuple[str, tuple[Shape, ...]], ...],
) -> tuple[Part, ...]:
    shapes = dict(carried)
    names = automaton.model.part_names
    bodies = [shapes[name] for name in names if name in shapes]
    parts = parts_of(automaton, footprint, [shapes.get(name, ()) for name in names])
    if len(bodies) == len(names):
        return parts
    kept = [part for name, part in zip(names, parts[1:], strict=True) if name in shapes]
    return (parts[0], *kept)
