"""Features of goals and words, in free space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from maneuver_automaton.problem import Horizon
from tests.matrix import outside
from tests.matrix.measuring import SAME, TIME_LIMIT, asked, found, no_dearer, obeys, trims_lasting
from tests.matrix.rows import Engine, changed, feature, with_goals, without
from tests.matrix.scenes import base
from tests.matrix.vehicles import Vehicle


@feature(with_goals(lambda goal: replace(goal, free_heading=True)), says="its heading is")
def free_space(vehicle: Vehicle, engine: Engine) -> None:
    result = asked(vehicle, engine)
    assert result.plan.word


@feature(
    with_goals(lambda goal: replace(goal, free_heading=False)),
    says="the heading is not used",
    applies=lambda vehicle: vehicle.has_heading,
)
def free_heading(vehicle: Vehicle, engine: Engine) -> None:
    pose = np.array(vehicle.goal)
    if not vehicle.rotates:  # it has few headings, and the one of its goal is the best of them
        pose[2] += np.pi
    goal = vehicle.target(pose=pose, free_heading=True)
    result = asked(vehicle, engine, goals=goal)
    known = base(vehicle).cost
    no_dearer(result, known, "the plan with the heading")
    _, turn = outside.off_goal(result.plan.end, goal)
    assert turn > SAME or result.cost < known * (1.0 - SAME), "the heading is not used"


@feature(
    changed(lambda problem: replace(problem, goals=problem.goals[:1])),
    says="the plan to the nearer goal costs",
)
def several_goals(vehicle: Vehicle, engine: Engine) -> None:
    """The nearer one is taken, at the cost of the plan to it alone."""
    far = np.array(vehicle.goal)
    far[:2] *= 1.6
    goals = (vehicle.target(pose=far), vehicle.target())
    result = asked(vehicle, engine, goals=goals)
    no_dearer(result, base(vehicle).cost, "the plan to the nearer goal", share=1e-2)
    assert result.goal_index == 1


@feature(without("horizon"), says="it has 3 trims")
def max_trims(vehicle: Vehicle, engine: Engine) -> None:
    count = len(trims_lasting(found(base(vehicle))))
    result = asked(vehicle, engine, horizon=Horizon(max_trims=max(count, 1)))
    no_dearer(result, base(vehicle).cost, "the plan with as many trims", share=1e-3)
    if count > 1:
        problem = vehicle.problem(horizon=Horizon(max_trims=count - 1))
        fewer = engine.plan(problem, time_limit=TIME_LIMIT)
        if fewer.plan is not None:
            obeys(vehicle, problem, fewer.plan, fewer.goal_index or 0)
