"""From a problem to the query of the search over trims and maneuvers."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.between import part_between
from maneuver_automaton.automaton.headings import origin_of
from maneuver_automaton.collision import Shape
from maneuver_automaton.costs import StageCost
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.lattice_goals import aim_of
from maneuver_automaton.search.maneuver_motion import Part, parts_of
from maneuver_automaton.search.maneuver_query import ManeuverQuery
from maneuver_automaton.words.library import Library, library_of

FREE_HEADINGS = 16  # that stand for a free one


def maneuver_problem_query(problem: Problem, goals: tuple[int, ...]) -> ManeuverQuery:
    """What the search over trims and maneuvers is asked to solve, for the goals of these numbers.

    Trims that lead to no goal are left out: their speeds would make the estimates of cost too low.
    A goal of any heading is asked for at several: best times then let the heading go. A fixed time
    is a longest one, since rest fills it. Prices of switches and changes of direction are left to
    whoever compares plans.

    Raises
    ------
    ValueError
        If a maneuver has no course, and so no known cost.
    """
    aims = [problem.goals[k] for k in goals]
    first = problem.first_trim.name
    last = [problem.last_trim(goal).name for goal in problem.goals]
    whole = problem.automaton
    ends = [whole.index_of(last[k]) for k in goals]
    automaton = part_between(whole, whole.index_of(first), ends)
    poses = [_poses(problem, goal) for goal in aims]
    owners = np.repeat(goals, [len(rows) for rows in poses])
    horizon = problem.horizon
    most = horizon.max_time if horizon.time is None else horizon.time
    query = ManeuverQuery(
        transfer=priced_transfers(automaton, problem.cost),
        parts=_parts(automaton, problem.footprint, tuple(problem.parts.items())),
        start=problem.start,
        goals=np.concatenate(poses),
        start_trim=automaton.index_of(first),
        goal_trims=np.array([automaton.index_of(last[k]) for k in owners], dtype=np.int64),
        obstacles=problem.obstacles,
        bounds=problem.bounds,
        keep=problem.margin,
        body_height=problem.body_height,
        start_time=problem.start_time,
        most_time=np.inf if most is None else most,
        zones=problem.zones,
        least_coast=horizon.min_coast,
        settings=problem.search,
        owners=owners,
    )
    open_ = query.end_clearances()[1:] > 0.0
    if open_.all() or not open_.any():
        return query
    return replace(
        query,
        goals=query.goals[open_],
        goal_trims=query.goal_trims[open_],
        owners=owners[open_],
    )


def _poses(problem: Problem, goal: Goal) -> Array:
    """The pose of a goal (1, dof), or those of several headings: from the way there on."""
    if not goal.free_heading:
        return np.array(aim_of(problem, goal))[None]
    ahead = goal.pose[:2] - problem.start[:2]
    first = float(np.arctan2(ahead[1], ahead[0])) if ahead.any() else float(problem.start[2])
    poses = np.tile(goal.pose, (FREE_HEADINGS, 1))
    poses[:, 2] = first + np.arange(FREE_HEADINGS) * (2.0 * np.pi / FREE_HEADINGS)
    return poses


@functools.lru_cache(maxsize=8)
def priced_transfers(automaton: Automaton, cost: StageCost) -> Library:
    """The transfers of an automaton under a cost, made once."""
    origin = origin_of(automaton, automaton.trims[0])
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
