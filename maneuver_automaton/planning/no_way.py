"""The proof that no plan exists, for a problem whose search has ended without one."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from maneuver_automaton.bounds import pose_scene, separation
from maneuver_automaton.budget import Budget
from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.problem import Problem

RESERVED = 0.1  # share of the time that is left for a proof where there is no plan by then
MOST_BOXES = 300_000  # of poses that are tested
UNPROVEN = (PlanStatus.NO_PLAN, PlanStatus.OUT_OF_BUDGET)


def before_proof(budget: Budget) -> Budget:
    """The budget of a search for a first plan: the last share of the time is for the proof."""
    return replace(budget, deadline=budget.deadline - RESERVED * budget.seconds)


def with_proof(result: PlanResult, budget: Budget) -> PlanResult:
    """The result, or that no plan exists if the time that is left proves it.

    The proof does a stated amount of work: what is proven depends on no clock unless the time gets
    short.
    """
    if result.status not in UNPROVEN or not result.problem.obstacles or budget.is_over:
        return result
    left = budget.left
    _load()  # the compiler's time is not the budget's
    proof = separation(
        result.problem, most_boxes=MOST_BOXES, deadline=Budget.from_now(left).deadline
    )
    if proof is None:
        return result
    return replace(
        result,
        status=PlanStatus.UNREACHABLE,
        reason=proof.reason,
        narrowest=proof.narrowest,
        reached=proof.reached,
    )


@functools.cache
def _load() -> None:
    """Compile or load what a proof needs."""
    from maneuver_automaton.automaton import Automaton
    from maneuver_automaton.collision import Box
    from maneuver_automaton.models import Unicycle

    robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "left": (0.0, 1.0)})
    walls = [Box([1.0, 9.0], [2.0, 5.0]), Box([1.0, 9.0], [2.0, -5.0])]
    problem = Problem(robot, [0, 0, 0], [4, 0, 0], obstacles=walls, footprint=Box([1.0, 0.5]))
    separation(problem, most_boxes=5_000)
    pose_scene(problem).states(np.zeros((1, 6)))
