"""Goals that no word of lattice primitives ends at: they lie beside the lattice of the start."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import OnLattice
from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.problem import Goal, Problem

ENDS = 1e-3  # of a cell, between the end of a primitive and the cell it is taken for
EXACT = 1e-9  # [m, rad] by which a plan may miss its goal, as in the audit


def goals_off_lattice(problem: Problem) -> PlanResult | None:
    """The verdict, if every goal lies beside the lattice on which the library's maneuvers end.

    The lattice begins at the start: primitives move with the vehicle, so any pose will do there.
    """
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
    >>> from maneuver_automaton.formats.lattice import Lattice, Move, automaton_of_lattice
    >>> ahead = Move(start=0, end=0, poses=[[0, 0, 0], [0.5, 0, 0]])
    >>> library = automaton_of_lattice(Lattice(resolution=0.5, headings=[0.0], moves=(ahead,)))
    >>> problem = Problem(library, [0, 0, 0], [1.1, 0, 0])
    >>> why_off_lattice(problem, problem.goals[0])  # doctest: +ELLIPSIS
    'the goal is 0.1 m from the nearest cell of the lattice of 0.5 m ... at (1, 0) m'
    """
    automaton, model = problem.automaton, problem.automaton.model
    if not isinstance(model, OnLattice) or not _stays_on_grid(automaton, model):
        return ""
    first, last = problem.first_trim, problem.last_trim(goal)
    heading = model.heading(first.reduced_state)
    # the lattice's own frame, seen from the world: where the start faces its heading
    world = SE2(problem.start) @ SE2([0.0, 0.0, -heading])
    seen = (world.inverse() @ SE2(goal.pose)).pose
    cell = np.round(seen[:2] / model.resolution) * model.resolution
    off = float(np.linalg.norm(seen[:2] - cell))
    if off > goal.tolerance_m + EXACT * (1.0 + float(np.abs(seen[:2]).max())):
        near = (world @ SE2([*cell.tolist(), 0.0])).pose
        return (
            f"the goal is {off:.6g} m from the nearest cell of the lattice of "
            f"{model.resolution:g} m that begins at the start; it lies "
            f"at ({near[0] + 0.0:.10g}, {near[1] + 0.0:.10g}) m"
        )
    there = model.heading(last.reduced_state)
    turn = abs(math.remainder(float(seen[2]) - there, 2.0 * math.pi))
    if not goal.free_heading and turn > goal.tolerance_rad + EXACT:
        facing = math.remainder(float((world @ SE2([0.0, 0.0, there])).pose[2]), 2.0 * math.pi)
        return (
            f"the heading of the goal is {turn:.6g} rad from that of {last.name!r}, "
            f"{facing:.10g} rad from the start's lattice"
            if goal.trim is not None
            else f"the heading of the goal is {turn:.6g} rad from the nearest one of the lattice, "
            f"{facing:.10g} rad of {last.name!r}"
        )
    return ""


def _stays_on_grid(automaton: Automaton, model: OnLattice) -> bool:
    """Whether every trim stands still, and every maneuver ends in the middle of a cell."""
    if automaton.body_velocities.any():
        return False
    ends = np.array([_end(automaton, model, k) for k in range(len(automaton.maneuvers))])
    across = ends.reshape(-1, 2) / model.resolution
    return bool(np.abs(across - np.round(across)).max(initial=0.0) <= ENDS)


def _end(automaton: Automaton, model: OnLattice, k: int) -> Array:
    """Where maneuver `k` ends (2,) [m], along the axes of the lattice."""
    one = automaton.maneuvers[k]
    heading = model.heading(automaton[one.source].reduced_state)
    return np.asarray(SE2([0.0, 0.0, heading]).act(one.displacement[:2]))
