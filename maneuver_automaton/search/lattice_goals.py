"""Poses that a search aims at: goals, several headings, poses on the lattice of a library."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import OnLattice
from maneuver_automaton.problem import Goal, Problem

ENDS = 1e-3  # of a cell, between the end of a primitive and the cell it is taken for
FREE_HEADINGS = 16  # that stand for a free one
EXACT = 1e-9  # [m, rad] by which a plan may miss its goal, as in the audit


class LatticePose(NamedTuple):
    """The pose of a lattice that is next to a goal, at the heading of the goal's trim."""

    pose: Array  # (3,) [m, m, rad]
    distance: float  # [m] from the goal
    turn: float  # [rad] from the goal, 0 if its heading is free

    def is_near(self, goal: Goal) -> bool:
        """Whether it is within the goal's tolerance."""
        exact = EXACT * (1.0 + float(np.abs(self.pose[:2]).max()))
        return self.distance <= goal.tolerance_m + exact and self.turn <= goal.tolerance_rad + EXACT


def nearest_on_lattice(problem: Problem, goal: Goal) -> LatticePose | None:
    """The pose next to a goal on the lattice of the start; None if the library has no lattice.

    Primitives move with the vehicle, so any pose will do for the start, where the lattice begins.
    """
    automaton, model = problem.automaton, problem.automaton.lattice
    if model is None or not _stays_on_grid(automaton, model):
        return None
    first, last = problem.first_trim, problem.last_trim(goal)
    # the lattice's own frame, seen from the world: at the start it has the first trim's heading
    world = SE2(problem.start) @ SE2(facing(-model.heading(first.reduced_state)))
    seen = (world.inverse() @ SE2(goal.pose)).pose
    cell = np.round(seen[:2] / model.resolution) * model.resolution
    turn = math.remainder(model.heading(last.reduced_state) - float(seen[2]), 2.0 * math.pi)
    pose = np.array((world @ SE2(np.append(cell, 0.0))).pose)
    pose[2] = goal.pose[2] + turn
    distance = float(np.linalg.norm(seen[:2] - cell))
    return LatticePose(pose, distance, 0.0 if goal.free_heading else abs(turn))


def at_headings(problem: Problem, goal: Goal) -> list[Goal]:
    """The goal at each heading of the lattice within its tolerance, all of them where any will do.

    The lattice lies under the start.
    """
    model, automaton = problem.automaton.lattice, problem.automaton
    assert model is not None
    begun = problem.start[2] - model.heading(problem.first_trim.reduced_state)
    found = []
    for trim in automaton.trims:
        heading = float(begun + model.heading(trim.reduced_state))
        off = abs(math.remainder(heading - float(goal.pose[2]), 2.0 * math.pi))
        admitted = goal.free_heading or off <= goal.tolerance_rad + EXACT
        if admitted and trim.is_rest and goal.trim in (None, trim.name):
            found.append(Goal(pose=np.append(goal.pose[:2], heading), trim=trim.name))
    return found


def nodes_within(problem: Problem, goal: Goal) -> list[Goal]:
    """The nodes of the lattice within a goal's tolerance as goals, the nearest ones first."""
    model = problem.automaton.lattice
    assert model is not None
    headings, nearest = at_headings(problem, goal), nearest_on_lattice(problem, goal)
    if nearest is None or not headings:
        return []
    turn = float(problem.start[2]) - model.heading(problem.first_trim.reduced_state)
    lattice = SE2(np.append(problem.start[:2], turn))
    place = (lattice.inverse() @ SE2(goal.pose)).pose[:2]
    slack = EXACT * (1.0 + float(np.abs(goal.pose[:2]).max()))
    cells = cells_within(place, goal.tolerance_m + slack, model.resolution)
    places = np.asarray(lattice.act(cells * model.resolution))
    order = np.argsort(np.hypot(*(places - goal.pose[:2]).T), kind="stable").tolist()
    return [replace(one, pose=np.append(places[k], one.pose[2])) for k in order for one in headings]


def cells_within(place: Array, within: float, cell: float) -> IntArray:
    """Columns and rows (n, 2) of a lattice, seen from its frame, within a distance of a place."""
    low, high = np.ceil((place - within) / cell), np.floor((place + within) / cell)
    columns, rows = (np.arange(a, b + 1.0) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    near: IntArray = grid[np.hypot(*(grid * cell - place).T) <= within].astype(np.int64)
    return near


def poses_aimed_at(problem: Problem, goal: Goal) -> Array:
    """The poses (n, dof) that a search aims at: several headings where any will do.

    A vehicle that switches at will may turn anywhere: the goal's own heading is among them, so that
    to leave it free is no loss. Others come in from where they start.
    """
    if not goal.free_heading:
        return np.array(goal.pose)[None]
    ahead = goal.pose[:2] - problem.start[:2]
    first = float(np.arctan2(ahead[1], ahead[0])) if ahead.any() else float(problem.start[2])
    first = float(goal.pose[2]) if problem.automaton.is_kinematic else first
    poses = np.tile(goal.pose, (FREE_HEADINGS, 1))
    poses[:, 2] = first + np.arange(FREE_HEADINGS) * (2.0 * np.pi / FREE_HEADINGS)
    return poses


@kept_by_first
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
    return np.asarray(SE2(facing(heading)).act(one.displacement[:2]))


def facing(heading: Array | float) -> Array:
    """Poses (..., 3) at the origin."""
    return np.stack([np.zeros_like(heading), np.zeros_like(heading), heading], axis=-1)
