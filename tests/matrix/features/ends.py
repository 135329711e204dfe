"""Features of the ends of a plan and of its horizon."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from maneuver_automaton.costs import Cost
from maneuver_automaton.problem import Horizon, Problem
from tests.matrix import outside
from tests.matrix.measuring import (
    EXACT,
    TIME_LIMIT,
    asked,
    close,
    fine,
    found,
    no_dearer,
    obeys,
    trims_lasting,
)
from tests.matrix.outside import Course
from tests.matrix.rows import Engine, changed, feature, with_goals, without
from tests.matrix.scenes import base, fixed_duration, passing, pillar
from tests.matrix.vehicles import Vehicle


@feature(
    with_goals(lambda goal: replace(goal, tolerance_m=0.0, tolerance_rad=0.0)),
    says="the tolerance is not used",
)
def goal_tolerance(vehicle: Vehicle, engine: Engine) -> None:
    """Above zero the plan may end anywhere within, so it is cheaper; at zero it ends exactly."""
    goal = vehicle.target(tolerance_m=0.05 * vehicle.reach, tolerance_rad=0.1)
    result = asked(vehicle, engine, goals=goal)
    no_dearer(result, base(vehicle).cost, "the exact plan")
    assert result.cost < base(vehicle).cost * (1.0 - 1e-3), "the tolerance is not used"
    way, turn = outside.off_goal(found(base(vehicle)).end, vehicle.target())
    assert max(way, turn) <= EXACT


def _at_rest(problem: Problem) -> Problem:
    goals = tuple(replace(goal, trim=None) for goal in problem.goals)
    return replace(problem, start_trim=None, goals=goals)


@feature(
    changed(_at_rest),
    on="user",
    applies=lambda vehicle: vehicle.inertia and vehicle.moving_trim is not None,
    says="reduced state",
)
def moving_ends(vehicle: Vehicle, engine: Engine) -> None:
    """It starts and ends in a moving trim, sooner than from rest to rest."""
    trim = vehicle.moving_trim
    result = asked(vehicle, engine, start_trim=trim, goals=vehicle.target(trim=trim))
    speed = fine(vehicle, result.plan).speed
    wanted = float(np.linalg.norm(vehicle.automaton[str(trim)].body_velocity[:2]))
    close(float(speed[0]), wanted, "speed at the start", share=0.1)
    close(float(speed[-1]), wanted, "speed at the end", share=0.1)
    if vehicle.rests:
        no_dearer(result, base(vehicle).cost, "the plan from rest to rest")


@feature(without("horizon"), on="unicycle", says="it takes")
def fixed_time(vehicle: Vehicle, engine: Engine) -> None:
    """The plan lasts exactly as long as asked, with no more effort than the quick one needs."""
    time = fixed_duration(vehicle)
    result = asked(vehicle, engine, cost=Cost(effort=1.0), horizon=Horizon(time=time))
    if vehicle.rests:  # the quick plan and then rest would do
        quick = Course.of(found(base(vehicle))).effort + _idle(vehicle) * time / 3.0
        no_dearer(result, quick, "the quick plan and rest")


def _idle(vehicle: Vehicle) -> float:
    """Effort per second at rest."""
    index = vehicle.automaton.rest
    assert index is not None
    return float((vehicle.automaton.trims[index].control ** 2).sum())


@feature(without("horizon"), on="grid", says="it takes")
def max_time(vehicle: Vehicle, engine: Engine) -> None:
    """What is cheap but slow is cut short, and too little time is not enough."""
    quick, cost = found(base(vehicle)).duration, Cost(effort=1.0, time=0.1)
    slow = engine.plan(vehicle.problem(cost=cost), time_limit=TIME_LIMIT)
    longest = quick if slow.plan is None else max(quick, slow.plan.duration)
    limit = 0.5 * (1.05 * quick + longest)
    _ = asked(vehicle, engine, cost=cost, horizon=Horizon(max_time=limit))
    short = vehicle.problem(horizon=Horizon(max_time=0.6 * quick))
    result = engine.plan(short, time_limit=TIME_LIMIT)
    if result.plan is not None:
        obeys(vehicle, short, result.plan)


@feature(without("horizon"), on="dubins", says="it takes")
def max_time_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    """A limit just above the quickest known plan is met; too little is not exceeded."""
    known = found(passing(vehicle)).duration
    block = [pillar(vehicle)]
    _ = asked(vehicle, engine, obstacles=block, horizon=Horizon(max_time=1.05 * known))
    short = vehicle.problem(obstacles=block, horizon=Horizon(max_time=0.6 * known))
    result = engine.plan(short, time_limit=TIME_LIMIT)
    if result.plan is not None:
        obeys(vehicle, short, result.plan)


@feature(without("horizon"), says="lasts")
def min_coast(vehicle: Vehicle, engine: Engine) -> None:
    """No trim lasts less than asked: longer than the shortest one of the plan without it."""
    motion = found(base(vehicle))
    times = [time for trim, time in trims_lasting(motion) if trim.body_velocity.any()]
    least = 1.5 * min(times, default=0.1 * motion.duration)
    result = asked(vehicle, engine, horizon=Horizon(min_coast=least))
    assert result.cost >= base(vehicle).cost * (1.0 - 1e-2)
