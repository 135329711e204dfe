"""Plans among obstacles for callers that plan again and again: unchecked, proven in the kernels.

A closed loop has a plan already and a moment to find a better one. What it drives is audited where
it is applied.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._kept import RECENT, Prepared
from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.advancement import clearances, free_times
from maneuver_automaton.planning.blocked import open_goals
from maneuver_automaton.planning.no_way import along_free_path, proven_apart
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement.improve import NO_WORD, Patience, WordSchedule, words_of
from maneuver_automaton.search.cost_to_go import cost_to_go_table
from maneuver_automaton.search.lattice import first_plan
from maneuver_automaton.search.lattice_pass import plan_of_word
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.scene import world_around
from maneuver_automaton.words.word import Word

AT_ONCE = Patience(attempts=0, passes=0)
LITTLE = Patience(attempts=800, passes=2)  # where a step's budget is short
PROVEN = 1e-6  # [m] what a search has proven with its margin passes with this one, once more
PROVEN_SHARE = 0.2  # of the search's margin, where that is tiny


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Tracked:
    """A plan proven free by the kernels, or none."""

    plan: Plan | None
    goal_index: int | None
    cost: float
    reason: str = ""
    expansions: int = 0
    queries: int = 0  # collision queries
    others: tuple[Plan, ...] = ()  # costlier plans of other words, cheapest first
    enclosed: bool = False  # proven: obstacles enclose the start or every goal


def free_until(problem: Problem, plan: Plan) -> float:
    """Time since its start [s] up to which a plan is proven free of the problem's obstacles.

    The plan's own duration if all of it is; the obstacles are where they are at the plan's times.
    What comes nearer than ``problem.margin + PROVEN`` [m] counts as hit.
    """
    if not plan.trims:
        return plan.duration
    query = lattice_query(problem, (0,))
    world = query.world
    free = free_times(
        world,
        world.into(plan.switching_poses[:-1]),
        twists=np.array([trim.body_velocity[:3] for trim in plan.trims]),
        durations=plan.durations,
        margin=min(PROVEN, PROVEN_SHARE * query.margin),
        keep=problem.margin,
        times=plan.switching_times[:-1],
    )
    short = np.flatnonzero(free < plan.durations)
    if not short.size:
        return plan.duration
    k = int(short[0])
    return float(plan.switching_times[k] - plan.start_time + free[k])


def stands_free(problem: Problem, pose: Array, *, time: float, duration: float) -> float:
    """How long from `time` on [s] it is proven free to stand at a pose, at most `duration`."""
    query = lattice_query(problem, (0,))
    (free,) = free_times(
        query.world,
        query.world.into(pose)[None],
        twists=np.zeros((1, 3)),
        durations=[duration],
        margin=min(PROVEN, PROVEN_SHARE * query.margin),
        keep=problem.margin,
        times=[time],
    )
    return float(free)


def clearance_at(problem: Problem, poses: Array, times: Array) -> Array:
    """Clearance (n,) [m] to the nearest obstacle at poses (n, 3) and times (n,): a lower bound.

    Exact near contact, at most what the kernels look for, not positive on contact.
    """
    world = world_around(problem)
    return clearances(world, world.into(poses), times=times)


def track(
    problem: Problem,
    *,
    budget: Budget,
    known: Plan | None = None,
    patience: Patience = LITTLE,
    max_expansions: int | None = None,
    prepared: Prepared = RECENT,
) -> Tracked:
    """A plan to any goal within a `budget`; `known` is improved if it is free.

    Parameters
    ----------
    problem : Problem
        From the vehicle's pose, at its time.
    budget : Budget
        Its time is for all of it.
    known : Plan, optional
        A plan from the problem's start that ends at one of its goals, of trims of its library.
    patience : Patience
        When to stop before the time is over.
    max_expansions : int, optional
        Of nodes, until a first plan is found; the problem's own limit if omitted.
    prepared : Prepared, optional
        Where libraries, worlds and tables are kept.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
    >>> problem = Problem(robot, [0, 0, 0], [9, 0, 0], obstacles=Disc(1.0, [5, 4]))
    >>> track(problem, budget=Budget.from_now(5.0)).cost
    9.0
    """
    load_kernels("lattice", "improvement")
    table = cost_to_go_table(problem, prepared=prepared)
    goals = open_goals(problem)
    if not goals:
        return Tracked(plan=None, goal_index=None, cost=math.inf, reason="every goal is blocked")
    query = lattice_query(problem, goals, prepared=prepared)
    word = None if known is None else word_of_plan(query, known)
    aside, proven = along_free_path(query, table), functools.partial(proven_apart, problem)
    schedule = WordSchedule(
        most=max_expansions or problem.search.max_expansions,
        patience=patience,
        table=table,
        first=functools.partial(first_plan, aside=aside, is_proven=proven),
    )
    found = words_of(query, budget=budget._replace(expansions=None), schedule=schedule, known=word)
    for _ in found:
        pass
    if found.word is NO_WORD:
        enclosed = found.first.enclosed if found.first else ""
        return Tracked(
            plan=None,
            goal_index=None,
            cost=math.inf,
            reason=enclosed or "no plan was found in the time given",
            expansions=found.expansions,
            queries=found.queries,
            enclosed=bool(enclosed),
        )
    plan = plan_of_word(query, found.word)
    return Tracked(
        plan=plan,
        goal_index=query.goal_index[found.word.goal],
        cost=problem.cost_of(plan),
        expansions=found.expansions,
        queries=found.queries,
        others=tuple(plan_of_word(query, other) for other in found.others),
    )


def word_of_plan(query: LatticeQuery, plan: Plan) -> Word | None:
    """A plan as a word of the lattice's library; None if it uses other trims or hits something.

    Rest that only pads at its end is left out.
    """
    problem = query.problem
    if free_until(problem, plan) < plan.duration:
        return None
    numbers = {problem.automaton.trims[k].name: k for k in query.library.trims}
    trims, durations = list(plan.trims), plan.durations.tolist()
    while trims and trims[-1].is_rest:
        trims.pop()
        durations.pop()
    if any(trim.name not in numbers for trim in trims):
        return None
    ends = [problem.goals[index].off(np.asarray(plan.end[:3])) for index in query.goal_index]
    reached = [k for k, (distance, turn) in enumerate(ends) if distance < 1e-7 and turn < 1e-7]
    if not reached:
        return None
    return Word(
        trims=np.array([numbers[trim.name] for trim in trims], dtype=np.int64),
        durations=np.array(durations, dtype=np.float64),
        goal=reached[0],
    )
