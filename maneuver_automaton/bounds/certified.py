"""Certified lower bounds of a problem: the scene and the motions, seen from its first goal."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.bounds.families import Motions, motions_of
from maneuver_automaton.bounds.levels import Proof, proofs
from maneuver_automaton.bounds.pose_scene import PoseScene, pose_scene
from maneuver_automaton.problem import Goal, Problem

TURNS = 1.25  # whole turns beyond the straight way, and round the obstacles, are looked at


def cell_proofs(
    problem: Problem,
    *,
    incumbent: Callable[[], float] = lambda: math.inf,
    ends: Callable[[int], bool] = lambda _work: False,
    over: Callable[[], bool] = lambda: False,
) -> Iterator[Proof]:
    """Better and better lower bounds of the cost of a problem's plans; none if it has no motions.

    Parameters
    ----------
    problem : Problem
    incumbent : callable
        Cost of the best plan known, inf if there is none. No bound exceeds it: what is proven
        concerns plans that are cheaper. Of a vehicle with inertia, costs are those of the
        kinematic one at its limits.
    ends : callable
        Asked with the work done, in steps times cells: whether to polish what there is and end.
    over : callable
        Asked now and then, while polishing too: whether to end at once.

    Yields
    ------
    Proof
        After every block of work; all but the time it takes is the same at every call.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Car, Cost, Problem
    >>> car = Car(wheelbase=2.8, max_steering=0.6)
    >>> controls = {"ahead": (1, 0), "left": (1, 0.6), "right": (1, -0.6), "back": (-1, 0)}
    >>> robot = Automaton.of_controls(car, controls)
    >>> problem = Problem(robot, [0, 0, 0], [6, 3, 0.9], cost=Cost(length=1.0))
    >>> *_, last = cell_proofs(problem, incumbent=lambda: 6.84, ends=lambda work: work > 2e6)
    >>> 6.6 < last.value < 6.84
    True
    """
    motions = motions_of(problem)
    if motions is None:
        return
    scene = pose_scene(problem, frame=problem.goals[0].pose[:3])
    start = scene.world.into(problem.start[:3])
    goals = tuple(
        replace(goal, pose=scene.world.into(goal.pose[:3]), trim=None) for goal in problem.goals
    )
    besides = motions.besides
    for proof in proofs(
        scene,
        motions,
        start=start,
        goals=goals,
        incumbent=lambda: incumbent() - besides,
        cap=_cap(scene, motions, start, goals),
        ends=ends,
        over=over,
    ):
        yield replace(proof, value=proof.value + besides)


def _cap(scene: PoseScene, motions: Motions, start: Array, goals: tuple[Goal, ...]) -> float:
    """Cost beyond which plans are not looked at where none is known."""
    apart = min(float(np.linalg.norm(start[:2] - goal.pose[:2])) for goal in goals)
    low, high = scene.box[:2], scene.box[2:]
    size = float(np.linalg.norm(high - low)) if np.isfinite(scene.box).all() else 0.0
    round_once = TURNS * 2.0 * math.pi / max(motions.turn_rate, motions.speed / (1.0 + apart))
    return (apart + size) / motions.speed + round_once
