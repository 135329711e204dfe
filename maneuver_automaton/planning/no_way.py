"""The proof that no plan exists, for a problem whose search has ended without one."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from maneuver_automaton.budget import Budget
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.problem import Horizon, Problem

RESERVED = 0.1  # share of the time that is left for a proof where there is no plan by then
MOST_BOXES = 300_000  # of poses that are tested
MOST_AT_GOALS = 100_000  # ... within the tolerance of a goal
MOST_WORK = 40_000_000  # steps times cells of a proof that plans take too long
ROUNDING = 1e-6  # relative
BEYOND = 1.25  # times the longest time: plans that take longer are not looked at
FIRST_BOXES = 0.04  # [s] that the first boxes take among many obstacles, in one piece
FIRST_LOOK = 0.5  # [s] that the first look at the cells takes, the same
SWEEPS = 250  # steps over all cells that polishing takes as long as, the same
UNPROVEN = (PlanStatus.NO_PLAN, PlanStatus.OUT_OF_BUDGET)


def before_proof(budget: Budget) -> Budget:
    """The budget of a search for a first plan: the last share of the time is for the proof."""
    return replace(budget, deadline=budget.deadline - RESERVED * budget.seconds)


def with_proof(result: PlanResult, budget: Budget) -> PlanResult:
    """The result, or that no plan exists if the time that is left proves it.

    The proof does a stated amount of work: what is proven depends on no clock unless the time gets
    short. Work that nobody can stop is begun only if the time that is left is enough for it.
    """
    unproven = result.status in UNPROVEN and result.problem.obstacles
    if not unproven or budget.left < FIRST_BOXES:
        return result
    from maneuver_automaton.bounds import separation

    left = budget.left
    load_proof()  # the compiler's time is not the budget's
    proof = separation(
        result.problem, most_boxes=MOST_BOXES, deadline=Budget.from_now(left).deadline
    )
    if proof is None:
        reason = too_long(result.problem, Budget.from_now(max(budget.left, 0.0)))
        return replace(result, status=PlanStatus.UNREACHABLE, reason=reason) if reason else result
    return replace(
        result,
        status=PlanStatus.UNREACHABLE,
        reason=proof.reason,
        narrowest=proof.narrowest,
        reached=proof.reached,
    )


def proven_blocked(problem: Problem, budget: Budget) -> bool:
    """Whether no plan can end within the tolerance of any goal, as far as the time proves it."""
    from maneuver_automaton.bounds import goals_blocked

    left = budget.left
    load_proof()
    deadline = Budget.from_now(left).deadline
    return left >= FIRST_BOXES and goals_blocked(
        problem, most_boxes=MOST_AT_GOALS, deadline=deadline
    )


def too_long(problem: Problem, budget: Budget) -> str:
    """Why every plan takes longer than the horizon admits; empty if that is not proven."""
    horizon = problem.horizon
    longest = horizon.time or horizon.max_time
    if longest is None or budget.left < FIRST_LOOK:
        return ""
    from maneuver_automaton.planning.lower_bound import known_bound, load_proofs, proofs_of

    left = budget.left
    load_proofs()
    budget = Budget.from_now(left)
    timed = replace(problem, cost=Cost(time=1.0), horizon=Horizon())
    least, polishing = known_bound(timed).value, 0.0

    def ends(work: int) -> bool:
        return work >= MOST_WORK or budget.left < 2.0 * polishing

    if least <= longest:
        for proof in proofs_of(timed, incumbent=lambda: BEYOND * longest, ends=ends):
            least = max(least, proof.value)
            polishing = SWEEPS * proof.cells * budget.elapsed / max(proof.work, 1)
            if least > longest * (1.0 + ROUNDING) or budget.left < polishing:
                break
    if least <= longest * (1.0 + ROUNDING):
        return ""
    return (
        f"every plan takes at least {least:.4g} s, and the horizon admits {longest:g} s: no path "
        "that leads to the goal is short enough"
    )


@functools.cache
def load_proof() -> None:
    """Compile or load what a proof needs."""
    from maneuver_automaton.automaton import Automaton
    from maneuver_automaton.bounds import pose_scene, separation
    from maneuver_automaton.collision import Box
    from maneuver_automaton.models import Unicycle

    robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "left": (0.0, 1.0)})
    walls = [Box([1.0, 9.0], [2.0, 5.0]), Box([1.0, 9.0], [2.0, -5.0])]
    problem = Problem(robot, [0, 0, 0], [4, 0, 0], obstacles=walls, footprint=Box([1.0, 0.5]))
    separation(problem, most_boxes=5_000)
    pose_scene(problem).states(np.zeros((1, 6)))
