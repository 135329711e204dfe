"""Goals that no word of lattice primitives ends at: they lie beside the lattice of the start."""

from __future__ import annotations

import math

from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.lattice_goals import nearest_on_lattice


def goals_off_lattice(problem: Problem) -> PlanResult | None:
    """The verdict, if every goal lies beside the lattice on which the library's maneuvers end."""
    reasons = [why_off_lattice(problem, goal) for goal in problem.goals]
    if not all(reasons):
        return None
    many = f"every goal lies beside the lattice; the first: {reasons[0]}"
    return PlanResult(
        problem=problem,
        status=PlanStatus.NO_PLAN,
        reason=reasons[0] if len(reasons) == 1 else many,
    )


def why_off_lattice(problem: Problem, goal: Goal) -> str:
    """Why a goal lies beside the lattice of the start; empty if it does not, or there is none.

    Examples
    --------
    >>> import numpy as np
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import LatticeBody
    >>> from maneuver_automaton.primitives import Maneuver, Trim
    >>> east = Trim(name="east", body_velocity=np.zeros(3), control=np.zeros(3),
    ...             reduced_state=np.array([1.0, 0.0]))
    >>> ahead = Maneuver(name="ahead", source="east", target="east", displacement=[0.5, 0, 0])
    >>> library = Automaton(LatticeBody(resolution=0.5), (east,), (ahead,))
    >>> problem = Problem(library, [0, 0, 0], [1.1, 0, 0])
    >>> why_off_lattice(problem, problem.goals[0])
    'the goal is beside the lattice of 0.5 m that begins at the start: the nearest node, (1, 0) m \
at 0 rad, is 0.1 m and 0 rad off'
    """
    near = nearest_on_lattice(problem, goal)
    if near is None or near.is_near(goal):
        return ""
    x, y, heading = (near.pose + 0.0).tolist()
    cell = problem.automaton.model.resolution  # type: ignore[attr-defined]
    allowed = ""
    if goal.tolerance_m or goal.tolerance_rad:
        allowed = f"; its tolerance is {goal.tolerance_m:.6g} m and {goal.tolerance_rad:.6g} rad"
    return (
        f"the goal is beside the lattice of {cell:g} m that begins at the start: the nearest node, "
        f"({x:.10g}, {y:.10g}) m at {math.remainder(heading, 2.0 * math.pi):.10g} rad, is "
        f"{near.distance:.6g} m and {near.turn:.6g} rad off{allowed}"
    )
