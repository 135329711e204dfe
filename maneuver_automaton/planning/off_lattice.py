"""Goals that no word of lattice primitives ends at: they lie beside the lattice of the start."""

from __future__ import annotations

import math

from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.lattice_goals import EXACT, nearest_on_lattice


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
    'the goal is 0.1 m beside the lattice of 0.5 m that begins at the start: its next cell is \
at (1, 0) m'
    """
    near = nearest_on_lattice(problem, goal)
    if near is None or near.is_near(goal):
        return ""
    x, y, heading = (near.pose + 0.0).tolist()
    if near.turn > goal.tolerance_rad + EXACT:
        facing = math.remainder(heading, 2.0 * math.pi)
        return (
            f"the heading of the goal is {near.turn:.6g} rad beside the headings of the lattice "
            f"that begins at the start: that of {problem.last_trim(goal).name!r} is {facing:.10g} "
            "rad"
        )
    cell = problem.automaton.model.resolution  # type: ignore[attr-defined]
    return (
        f"the goal is {near.distance:.6g} m beside the lattice of {cell:g} m "
        "that begins at the start: "
        f"its next cell is at ({x:.10g}, {y:.10g}) m"
    )
