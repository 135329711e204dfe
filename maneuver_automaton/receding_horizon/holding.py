"""Plans within a goal's tolerance: they correct disturbances, and stay."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.receding_horizon.candidates import Candidate, candidate, within
from maneuver_automaton.receding_horizon.log import Origin
from maneuver_automaton.receding_horizon.settings import EXACT, Settings
from maneuver_automaton.search.choose import search_goal
from maneuver_automaton.search.result import plan_of

MOST_STEPS = 4  # that a plan within the goal's set may take
ALTERNATIVES = 1  # costlier plans, of which one may stay in the set
CALM = 0.5  # share of the tolerance that a plan of several steps may use up at the next step
FINE = 0.01  # [m, rad] between the poses that are looked at


def holding(here: Problem, settings: Settings, goal_index: int) -> Candidate | None:
    """A plan to the middle of a goal's set within a step or a few.

    The cheapest that stays in the set all along and does not linger at its edge, otherwise one that
    is inside whenever the loop closes; None if there is neither, or trims are not switched at will.
    """
    if not settings.at_will:
        return None
    goal = here.goals[goal_index]
    middle = replace(goal, tolerance_m=0.0, tolerance_rad=0.0)
    second: Candidate | None = None
    for steps in range(1, MOST_STEPS + 1):
        limit = steps * settings.step
        fixed = settings.pad_of(here) is not None
        near = replace(
            here,
            goals=(middle,),
            horizon=Horizon(time=limit) if fixed else Horizon(max_time=limit),
            search=replace(here.search, method="insertion"),
        )
        results = search_goal(
            near, middle, alternatives=ALTERNATIVES, budget=Budget.from_now(settings.time_limit)
        )
        found = [
            candidate(
                near,
                settings,
                plan_of(near, solution),
                goal_index=goal_index,
                origin=Origin.SEARCHED,
            )
            for result in results
            for solution in result.solutions
        ]
        for one in sorted(found, key=lambda candidate: candidate.cost):
            calm = steps == 1 or _share(one.plan, goal, settings.step) <= CALM
            if calm and _stays(one.plan, goal):
                return one
            if second is None and _inside_at_steps(one.plan, goal, settings.step):
                second = one
    return second


def _share(plan: Plan, goal: Goal, step: float) -> float:
    """How much of the tolerance is used up at the next step, 1 at the edge of the set."""
    distance, turn = goal.off(plan.pose_at(plan.start_time + step))
    return max(distance / max(goal.tolerance_m, EXACT), turn / max(goal.tolerance_rad, EXACT))


def _stays(plan: Plan, goal: Goal) -> bool:
    samples = plan.sample(max_step_m=FINE, max_step_rad=FINE)
    return all(within(pose, goal) for pose in samples.pose)


def _inside_at_steps(plan: Plan, goal: Goal, step: float) -> bool:
    times = plan.start_time + step * np.arange(1, math.ceil(plan.duration / step) + 1)
    return all(within(pose, goal) for pose in plan.pose_at(times))
