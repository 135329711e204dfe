"""Features of symmetry: a moved problem has the moved plan."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import group_of
from maneuver_automaton.planning import PlanResult, plan
from maneuver_automaton.problem import Problem
from tests.matrix import outside
from tests.matrix.measuring import TIME_LIMIT, close, found, obeys
from tests.matrix.rows import Engine, feature
from tests.matrix.scenes import pillar
from tests.matrix.vehicles import Vehicle


def _still(problem: Problem, **options: Any) -> PlanResult:
    """A planner that rounds what it is given: no two places are alike to it."""
    place = np.round(problem.start[:2]) - problem.start[:2]
    bent = 1.0 + 0.05 * float(np.abs(place).sum())
    return plan(replace(problem, cost=Cost(time=1.0, length=bent - 1.0)), **options)


def _moves(vehicle: Vehicle, engine: Engine, **changes: object) -> None:
    """The moved problem has the moved plan, at the same cost."""
    by = np.array([31.4, -12.3, 2.1 if vehicle.rotates else 0.0, 5.0][: len(vehicle.goal)])
    problem = vehicle.problem(**changes)
    here = engine.plan(problem, time_limit=TIME_LIMIT)
    there = engine.plan(problem.moved(group_of(len(by))(by)), time_limit=TIME_LIMIT)
    one, other = found(here), found(there)
    close(there.cost, here.cost, "cost of the moved plan")
    assert one.word == other.word, f"{one.word} and {other.word}"
    close(other.duration, one.duration, "duration of the moved plan")
    times = np.linspace(0.0, min(one.duration, other.duration), 300)
    off = float(np.abs(outside.moved(one.pose_at(times), by) - other.pose_at(times)).max())
    assert off <= 1e-4 * vehicle.reach, f"the moved plan is {off:.3g} off"
    obeys(vehicle, problem.moved(group_of(len(by))(by)), other)


@feature(Engine(plan=_still), says="cost of the moved plan")
def moved_problem(vehicle: Vehicle, engine: Engine) -> None:
    _moves(vehicle, engine)


@feature(Engine(plan=_still), says="cost of the moved plan")
def moved_problem_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _moves(vehicle, engine, obstacles=[pillar(vehicle)])
