"""A plan made to start elsewhere: the same goal, met exactly, from a measured pose."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.receding_horizon.shifting import merged
from maneuver_automaton.search.insertion import sub_library
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.search.setup import search_setup
from maneuver_automaton.search.words import search_setup_words
from maneuver_automaton.words import TimesStatus, solve_switching_times

LOOK_AHEAD = 3  # joints of a plan that steering tries to rejoin
NEAR = 1e-9  # [m, rad] a plan that ends so close to the goal leads there
FIRST = 1  # of the cheapest connections to each


def reanchored(problem: Problem, plan: Plan, goal: Goal, *, pad: Trim | None) -> Iterator[Plan]:
    """Plans from the problem's start that go on with `plan` as far as they can, and end at `goal`.

    First the same word with other times. Then the steering function: three trims that rejoin the
    plan at one of its next joints, or lead to the goal. Each ends exactly at the goal; with a
    fixed time, in it.

    Parameters
    ----------
    problem : Problem
        Its start is where the vehicle was measured.
    plan : Plan
        What was about to be driven, from somewhere near; it ends at the goal, rest included.
    goal : Goal
    pad : Trim, optional
        The rest that makes up for what is left of a fixed time.

    Yields
    ------
    Plan
    """
    same = same_word(problem, plan, goal, pad=pad)
    if same is not None:
        yield same
    yield from rejoining(problem, plan, goal, pad=pad)


def same_word(problem: Problem, plan: Plan, goal: Goal, *, pad: Trim | None) -> Plan | None:
    """The word of `plan` with the best times that lead from the problem's start to the goal."""
    if goal.free_heading or not plan.trims:
        return None
    setup = search_setup(problem, goal)
    total = problem.horizon.time
    trims, guess = plan.trims, plan.durations.tolist()
    if total is not None and pad is not None and trims[-1].body_velocity.any():
        trims, guess = (*trims, pad), [*guess, 0.0]
    controls = np.array([trim.control for trim in trims])
    twists = np.array([trim.body_velocity for trim in trims])
    solved = solve_switching_times(
        twists,
        problem.cost.rates(controls, twists),
        setup.goal[: twists.shape[1]],
        total=total,
        guesses=[guess],
        restarts=2,
    )
    if solved.status is TimesStatus.FAILED or not math.isfinite(solved.cost):
        return None
    limit = problem.horizon.max_time
    if limit is not None and float(solved.durations.sum()) > limit * (1.0 + 1e-9):
        return None
    word, times = merged(trims, solved.durations.tolist())
    return Plan(problem.start, word, durations=times, start_time=problem.start_time)


def rejoining(problem: Problem, plan: Plan, goal: Goal, *, pad: Trim | None) -> Iterator[Plan]:
    """Three trims to a joint of `plan` or to its end, then what follows there, then rest."""
    moving = [k for k, trim in enumerate(plan.trims) if trim.body_velocity.any()]
    leads_there = missed(plan, goal) <= NEAR * (1.0 + float(np.abs(plan.start).max()))
    joints = [k + 1 for k in moving[:LOOK_AHEAD]] if leads_there else []
    hurry = replace(problem, horizon=Horizon(), search=replace(problem.search, method="auto"))
    end = moving[-1] + 1 if moving else 0
    for joint in dict.fromkeys([*joints, end]):
        ahead = plan.switching_poses[joint]
        last = joint == end
        target = goal if last else Goal(pose=ahead)
        for way in (hurry, quickest(hurry)):
            found = False
            for first in _connections(replace(way, goals=(target,)), target):
                trims = (*first.trims, *(() if last else plan.trims[joint:end]))
                times = [*first.durations.tolist(), *(() if last else plan.durations[joint:end])]
                padded = _in_time(problem, trims, times, pad)
                if padded is not None:
                    found = True
                    yield padded
            if found:
                break  # otherwise the quickest connection may be in time


def _connections(problem: Problem, goal: Goal) -> Iterator[Plan]:
    """Cheapest words of three trims from a sub-library, in any time."""
    setup = search_setup(problem, goal)
    if setup.start_is_goal:
        yield Plan(problem.start, (), durations=[], start_time=problem.start_time)
        return
    small = sub_library(setup)
    solutions = search_setup_words(
        problem, small, alternatives=FIRST - 1, deadline=math.inf, spare=True
    )
    for solution in solutions:
        yield plan_of(problem, solution)


def _in_time(
    problem: Problem, trims: tuple[Trim, ...], times: list[float], pad: Trim | None
) -> Plan | None:
    """A plan that rests for what is left of a fixed time; None if it takes longer."""
    spent = math.fsum(times)
    total = problem.horizon.time
    limit = total if total is not None else problem.horizon.max_time
    if limit is not None and spent > limit + 1e-9:
        return None
    if total is not None and total - spent > 1e-9:
        if pad is None:
            return None
        trims, times = (*trims, pad), [*times, total - spent]
    word, durations = merged(trims, times)
    return Plan(problem.start, word, durations=durations, start_time=problem.start_time)


def quickest(problem: Problem) -> Problem:
    """The same problem in least time, whatever time it takes."""
    return replace(
        problem,
        cost=Cost(time=1.0),
        horizon=Horizon(max_trims=problem.horizon.max_trims),
    )


def missed(plan: Plan, goal: Goal) -> float:
    """Largest of distance [m] and heading error [rad] between the end of a plan and a goal."""
    return distance(plan.end, goal)


def distance(pose: Array, goal: Goal) -> float:
    """Largest of distance [m] and heading error [rad] between a pose and a goal."""
    return max(goal.off(pose))
