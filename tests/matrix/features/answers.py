"""Features of an answer besides its plan: alternatives, sameness, lower bound, certificate."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from maneuver_automaton.costs import Cost
from maneuver_automaton.planning import PlanResult, plan
from maneuver_automaton.problem import Problem
from tests.matrix import outside
from tests.matrix.measuring import SAME, TIME_LIMIT, Nothing, asked, found, obeys
from tests.matrix.rows import Engine, feature
from tests.matrix.scenes import base, pillar
from tests.matrix.vehicles import Vehicle


def _one_motion(problem: Problem, *, alternatives: int = 0, **options: Any) -> PlanResult:
    """A planner whose alternatives are all the best plan, with a trim split in two."""
    result = plan(problem, alternatives=alternatives, **options)
    if result.plan is None or not result.alternatives:
        return result
    again = tuple(replace(one, plan=result.plan, cost=result.cost) for one in result.alternatives)
    return replace(result, alternatives=again)


def _different(vehicle: Vehicle, engine: Engine, **changes: object) -> None:
    problem = vehicle.problem(**changes)
    result = engine.plan(problem, time_limit=TIME_LIMIT, alternatives=3)
    best = found(result)
    if not result.alternatives:
        raise Nothing("no alternative")
    plans = [best, *(one.plan for one in result.alternatives)]
    costs = [result.cost, *(one.cost for one in result.alternatives)]
    for one in plans:
        obeys(vehicle, problem, one)
    told = [float(f"{cost:.10g}") for cost in costs]  # but for rounding
    assert told == sorted(told), "costs fall"
    same = list(outside.repeated(plans, tolerance=1e-4 * vehicle.reach))
    assert not same, f"plans {same[0][0]} and {same[0][1]} are the same motion"


@feature(Engine(plan=_one_motion), says="are the same motion")
def alternatives(vehicle: Vehicle, engine: Engine) -> None:
    _different(vehicle, engine)


@feature(Engine(plan=_one_motion), says="are the same motion")
def alternatives_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _different(vehicle, engine, obstacles=[pillar(vehicle)])


class _Fickle:
    """A planner that minds something else at every call."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, problem: Problem, **options: Any) -> PlanResult:
        self.calls += 1
        price = Cost(time=1.0, length=0.01 * self.calls)
        return plan(replace(problem, cost=price), **options)


def _twice(vehicle: Vehicle, engine: Engine, **changes: object) -> None:
    one = asked(vehicle, engine, cost_is=False, **changes)
    other = asked(vehicle, engine, cost_is=False, **changes)
    assert one.plan.word == other.plan.word, f"{one.plan.word} and then {other.plan.word}"
    assert one.cost == other.cost, f"cost {one.cost!r} and then {other.cost!r}"
    assert np.array_equal(one.plan.primitive_durations, other.plan.primitive_durations)


@feature(Engine(plan=_Fickle()), says="and then")
def same_plan_twice(vehicle: Vehicle, engine: Engine) -> None:
    _twice(vehicle, engine)


@feature(Engine(plan=_Fickle()), says="and then")
def same_plan_twice_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _twice(vehicle, engine, obstacles=[pillar(vehicle)])


def _answering(**values: object) -> Engine:
    """A planner with some numbers of its answers set."""

    def planned(problem: Problem, **options: Any) -> PlanResult:
        return replace(plan(problem, **options), **values)  # type: ignore[arg-type]

    return Engine(plan=planned)


@feature(_answering(lower_bound=0.0), says="lower bound 0.0")
def lower_bound(vehicle: Vehicle, engine: Engine) -> None:
    """It is above zero, and below what every known plan costs."""
    result = asked(vehicle, engine)
    if not result.lower_bound or not result.lower_bound > 0.0:
        raise Nothing(f"lower bound {result.lower_bound}")
    assert result.lower_bound <= result.cost * (1.0 + SAME)
    assert result.lower_bound <= base(vehicle).cost * (1.0 + SAME)


@feature(_answering(certificate=None), says="no certificate")
def certificate(vehicle: Vehicle, engine: Engine) -> None:
    """The smallest reduced cost is given; a quickest plan has none below zero."""
    # a polished plan is no word of the library; where time costs nothing, words are not polished
    cost = Cost(time=1.0) if vehicle.automaton.is_kinematic else Cost(effort=1.0)
    result = asked(vehicle, engine, cost=cost)
    if result.certificate is None:
        raise Nothing("no certificate")
    assert -1e-3 * result.cost <= result.certificate <= 1e-6, f"certificate {result.certificate}"
