"""The closed loop without terminal constraint: search, drive the first intervals, search again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, IntArray, as_array
from maneuver_automaton.groups import SE2
from maneuver_automaton.receding_horizon.unconstrained import (
    HorizonPlan,
    HorizonSearch,
    UnconstrainedProblem,
    search_horizon,
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class UnconstrainedLoop:
    """The closed loop: k steps, and the horizon's value before and after each."""

    poses: Array  # (k + 1, 3) of the world [m, m, rad]
    trims: IntArray  # (k, applied) indices, one per interval
    stage_costs: Array  # (k,) of the driven pieces
    values: Array  # (k + 1,) of the horizon at each pose
    settled: bool  # whether standing still is the best sequence at the last pose

    @property
    def cost(self) -> float:
        """Cost of the whole loop."""
        return float(self.stage_costs.sum())


def simulate_unconstrained(
    problem: UnconstrainedProblem,
    start: ArrayLike,
    *,
    steps: int,
    search: HorizonSearch | None = None,
) -> UnconstrainedLoop:
    """The closed loop from a `start` (3,) of the world, for `steps` steps or until it settles.

    Each search begins with the sequence before it, shifted by the driven piece and filled up with
    the trim whose control is cheapest. It settles where standing still is the best sequence found:
    from there on every step would be the same.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import Unicycle
    >>> from maneuver_automaton.receding_horizon.mixed_order_cost import MixedOrderCost
    >>> from maneuver_automaton.receding_horizon.unconstrained import FixedHorizon
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "ahead": (1, 0)})
    >>> cost = MixedOrderCost(pose_weights=[1, 1, 1], control_weights=[0.1, 1])
    >>> horizon = FixedHorizon(interval=0.5, intervals=4)
    >>> problem = UnconstrainedProblem(robot, [1, 0, 0], cost=cost, horizon=horizon)
    >>> loop = simulate_unconstrained(problem, [0, 0, 0], steps=9)
    >>> loop.settled, loop.poses[:, 0].tolist()
    (True, [0.0, 0.5, 1.0])
    """
    if steps < 1:
        raise ValueError(f"steps: got {steps}, need at least 1")
    applied, twists = problem.horizon.applied, problem.automaton.body_velocities
    drive = SE2.exp(problem.horizon.interval * twists)
    pose = SE2(as_array("start", start, last=3))
    plan = search_horizon(problem, pose.pose, search=search)
    poses, values = [pose.pose], [plan.value]
    trims: list[IntArray] = []
    costs: list[float] = []
    while len(trims) < steps and not _stands_still(plan, twists):
        for trim in plan.trims[:applied]:
            pose = pose @ SE2(drive.pose[trim])
        trims.append(plan.trims[:applied])
        costs.append(float(plan.costs[:applied].sum()))
        plan = search_horizon(problem, pose.pose, warm=shifted(problem, plan), search=search)
        poses.append(pose.pose)
        values.append(plan.value)
    return UnconstrainedLoop(
        poses=np.array(poses),
        trims=np.array(trims, dtype=np.int64).reshape(-1, applied),
        stage_costs=np.array(costs),
        values=np.array(values),
        settled=_stands_still(plan, twists),
    )


def shifted(problem: UnconstrainedProblem, plan: HorizonPlan) -> IntArray:
    """The rest of a sequence after its applied intervals, filled up with the cheapest trim (n,)."""
    applied = problem.horizon.applied
    fill = np.full(applied, problem.least_trim, dtype=np.int64)
    return np.concatenate([plan.trims[applied:], fill])


def _stands_still(plan: HorizonPlan, twists: Array) -> bool:
    return not twists[plan.trims].any()
