"""`verify(problem, plan)`: the checks of a plan that somebody else has made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import wrapped
from maneuver_automaton._brief import brief
from maneuver_automaton.audit import Audit, terminal_error
from maneuver_automaton.automaton import Plan
from maneuver_automaton.planning.checking import check_plan
from maneuver_automaton.planning.leaving import check_leaving, says_left
from maneuver_automaton.problem import Problem

START_TOLERANCE = 1e-9  # [m, rad] between the first pose of the plan and the start, as the audit's


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What the checks say of a plan, and what it costs."""

    passed: bool
    reason: str  # what the plan breaks; empty if nothing
    cost: float  # by the cost of the problem, whether it passed or not
    goal_index: int  # of the goal that it was held against: the one it reaches, or the nearest
    audit: Audit | None  # None if a check before it failed
    notes: tuple[str, ...] = ()  # what was admitted, as the plan says it was

    __repr__ = brief


def verify(problem: Problem, plan: Plan, *, leave: bool | None = None) -> Verdict:
    """Check a plan, say of another planner, as `plan` checks its own before it returns one.

    In this order, and the first that fails ends it: the start, the horizon and the number of trims,
    the bounds, zones and collisions by FCL, and the audit, which integrates the equations of the
    problem's model under the controls of the plan. The trims need not be those of the problem's
    automaton.

    Parameters
    ----------
    problem : Problem
        Start, goals, body, obstacles, margin, limits, cost.
    plan : Plan
        A word of trims and maneuvers with their durations [s].
    leave : bool, optional
        Whether what the start touches may be touched until the body is out of it, never deeper;
        clearance counts from there. By default that is so where the notes of the plan say it, as
        those of ``plan(problem, leave=True)`` do, and of their files; the verdict then says so too.

    Returns
    -------
    Verdict
        ``passed`` if the plan keeps every condition of the problem for one of its goals.

    Raises
    ------
    ValueError
        If plan and problem do not live in the same group.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Box, Plan, Problem, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0)})
    >>> wall = Box([1.0, 1.0], [3.0, 0.2])
    >>> problem = Problem(robot, [0, 0, 0], [6, 0, 0], obstacles=wall, footprint=Box([0.4, 0.2]))
    >>> verdict = verify(problem, Plan([0, 0, 0], robot.trims, durations=[6.0]))
    >>> verdict.passed, verdict.reason, verdict.cost
    (False, "obstacle 0 is hit in trim 0, 'ahead'", 6.0)
    """
    if plan.start.size != problem.start.size:
        raise ValueError(
            f"plan: starts at a pose of {plan.start.size} numbers, need {problem.start.size} as "
            "the problem's"
        )
    errors = [terminal_error(plan, goal) for goal in problem.goals]
    nearest = sorted(
        range(len(errors)), key=lambda k: (errors[k].position_m, errors[k].heading_rad)
    )
    cost = problem.cost_of(plan)
    off = plan.start - problem.start
    off[2] = wrapped(off[2])
    if np.abs(off).max() > START_TOLERANCE * (1.0 + float(np.abs(problem.start).max())):
        reason = (
            f"it starts at {plan.start.round(6).tolist()}, the problem at "
            f"{problem.start.round(6).tolist()}"
        )
        return Verdict(passed=False, reason=reason, cost=cost, goal_index=nearest[0], audit=None)
    said = "" if leave is False else says_left(plan)
    check = check_leaving if leave or said else check_plan
    verdicts = []
    for index in nearest:
        checked = check(problem, plan, problem.goals[index])
        verdict = Verdict(
            passed=checked.passed,
            reason=checked.reason,
            cost=cost,
            goal_index=index,
            audit=checked.audit,
            notes=(said,) if said and checked.passed else (),
        )
        if verdict.passed:
            return verdict
        verdicts.append(verdict)
    return verdicts[0]
