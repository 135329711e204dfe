"""Plans of a vehicle with inertia along the paths of a simpler one, which switches at will.

It stops at each switch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.planning.checking import TooLate, what_is_hit
from maneuver_automaton.planning.incumbents import Incumbents, PlanningStep
from maneuver_automaton.planning.no_way import proven_apart
from maneuver_automaton.planning.polishing import Polish, guess_along
from maneuver_automaton.planning.result import Workspace
from maneuver_automaton.planning.tracking import AT_ONCE, track
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement.guesses import path_guesses
from maneuver_automaton.refinement.stop_and_steer import kinematic_problem, stop_and_steer
from maneuver_automaton.search.cost_to_go import cost_to_go_table

FIRST_SHARE = 0.8  # of the time limit, for a first path
IMPROVED_SHARE = 0.2  # of what is left, for a path that is faster to follow
STOPPING_S = 0.01  # [s] that it takes to stop and steer along a path
WAITS = 9  # at rest, before a path is followed among moving obstacles


@dataclass(slots=True, eq=False)
class AlongPaths(PlanningStep):
    """Stop and steer along the paths of a kinematic vehicle."""

    polish: Polish | None  # what guesses along the paths are for

    def prepare(self, problem: Problem, workspace: Workspace) -> None:
        """Load the kernels, and make the table of the simpler vehicle."""
        load_kernels("lattice", "improvement")
        cost_to_go_table(kinematic_problem(problem, switch=0.0), prepared=workspace.prepared)

    def offer(self, found: Incumbents) -> None:
        """Offer plans along a first path, then along one that is fast to follow so."""
        if not found.wants_more:
            return
        problem, ended, prepared = found.problem, found.ended, found.workspace.prepared
        free, part = kinematic_problem(problem, switch=0.0), found.budget.stage(FIRST_SHARE)
        first = track(free, budget=part, prepared=prepared, patience=AT_ONCE)
        found.counts.update(expansions=first.expansions, collision_queries=first.queries)
        if first.plan is None or first.goal_index is None:
            ended.proof = first.reason if first.enclosed else ""
            ended.remark = f" ({first.reason})" if first.reason else ""
            ended.is_complete = proven_apart(problem, found.budget)
            return
        _offer_along(found, first.plan, first.goal_index)
        if not found.wants_more:
            return
        along = path_guesses(problem.automaton.model)
        if self.polish and along and first.plan.duration > 0.0:
            self.polish.guesses.append(guess_along(problem, along, first.plan))
        priced, part = kinematic_problem(problem), found.budget.stage(IMPROVED_SHARE)
        better = track(priced, budget=part, prepared=prepared, known=first.plan)
        found.counts.update(expansions=better.expansions, collision_queries=better.queries)
        if better.plan is not None and better.goal_index is not None:
            _offer_along(found, better.plan, better.goal_index)


def _offer_along(found: Incumbents, path: Plan, goal_index: int) -> None:
    """Offer to stop and steer along a path, once moving obstacles let it pass."""
    problem, goal = found.problem, found.problem.goals[goal_index]
    if not found.may_check or found.for_checks.left_to_check < STOPPING_S:
        return
    plan = stop_and_steer(
        problem.automaton.model,  # type: ignore[arg-type]
        path,
        first=problem.first_trim,
        last=problem.last_trim(goal),
    )
    if not problem.moves:
        found.offer(plan, goal_index)
        return
    settled = max(
        float(one.motion.time[-1])
        for one in problem.obstacles
        if isinstance(one, Obstacle) and one.motion is not None
    )
    for wait in np.linspace(0.0, max(settled - problem.start_time, 0.0), WAITS):
        if found.budget.is_over:
            return
        durations = plan.durations.copy()
        durations[0] += wait
        later = replace(plan, durations=durations)
        try:
            hit = what_is_hit(problem, later, goal, found.workspace, budget=found.for_checks)
        except TooLate:
            return
        if not hit:
            found.offer(later, goal_index)
            return
