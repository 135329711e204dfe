"""Features of closed loops."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton.collision import Box, Zone
from maneuver_automaton.costs import Cost
from maneuver_automaton.formats.closed_loop_json import load_steps, save_closed_loop
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.receding_horizon import ClosedLoop, Disturbance, simulate
from tests.matrix import outside
from tests.matrix.measuring import (
    EXACT,
    SAME,
    SAMPLED,
    TIME_LIMIT,
    Costlier,
    Nothing,
    close,
    found,
    obeys,
)
from tests.matrix.outside import Course
from tests.matrix.rows import Engine, feature, without
from tests.matrix.scenes import base, crossing, fixed_duration, midway, pillar, slow_speed
from tests.matrix.vehicles import Vehicle

STEPS = 60  # of a closed loop, at most


def driven(
    vehicle: Vehicle, engine: Engine, *, options: Mapping[str, Any] | None = None, **changes: object
) -> ClosedLoop:
    """A loop that reaches the goal, its pieces joined, and all it drove within the problem."""
    problem = vehicle.problem(**changes)
    loop = engine.simulate(
        problem,
        step=_step(vehicle),
        **({"steps": STEPS, "time_limit": TIME_LIMIT} | (options or {})),
    )
    _driven_well(vehicle, problem, loop, noisy="disturbance" in (options or {}))
    return loop


def _step(vehicle: Vehicle) -> float:
    """A step that some ten of make up the plan."""
    return found(base(vehicle)).duration / 8.0


def _driven_well(vehicle: Vehicle, problem: Problem, loop: ClosedLoop, *, noisy: bool) -> None:
    if not loop.reached:
        raise Nothing(f"{loop.status}: {loop.reason}")
    nearest = min(
        max(way - goal.tolerance_m, 0.0 if goal.free_heading else turn - goal.tolerance_rad)
        for goal in problem.goals
        for way, turn in [outside.off_goal(loop.poses[-1], goal)]
    )
    assert nearest <= EXACT * 10.0, f"it stops {nearest:.3g} from the goal"
    assert loop.driven, "nothing was driven"
    for piece, pose, after in zip(loop.driven, loop.poses, loop.poses[1:], strict=False):
        assert np.abs(piece.pose_at(piece.start_time) - pose).max() <= EXACT
        if not noisy:
            assert np.abs(piece.end - after).max() <= EXACT, "it jumps between two steps"
        if piece.primitives:
            obeys(vehicle, problem, piece, ends=False)


def _lazy(problem: Problem, **options: Any) -> ClosedLoop:
    return simulate(problem, **(options | {"steps": 1}))


@feature(Engine(simulate=_lazy), says="the goal is not reached")
def loop(vehicle: Vehicle, engine: Engine) -> None:
    ended = driven(vehicle, engine)
    promised = ended.steps[0].value
    if ended.cost > promised * (1.0 + SAME):
        raise Costlier(f"it spends {ended.cost:.6g}, its first plan cost {promised:.6g}")


@feature(without("obstacles"), says="clearance")
def loop_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _ = driven(vehicle, engine, obstacles=[pillar(vehicle)])


@feature(without("obstacles"), says="clearance")
def loop_moving_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _ = driven(vehicle, engine, obstacles=[crossing(vehicle)])


@feature(without("zones"), says="m/s in a zone")
def loop_zones(vehicle: Vehicle, engine: Engine) -> None:
    zone = Zone(
        shape=Box([1.5 * vehicle.size] * 2, midway(vehicle)[:2]), max_speed=slow_speed(vehicle)
    )
    _ = driven(vehicle, engine, zones=[zone])


def _undisturbed(problem: Problem, **options: Any) -> ClosedLoop:
    return simulate(problem, **{k: v for k, v in options.items() if k != "disturbance"})


@feature(Engine(simulate=_undisturbed), says="nothing was disturbed")
def loop_noise(vehicle: Vehicle, engine: Engine) -> None:
    """Pushed a little after every step, it still gets there, to within the goal's tolerance."""
    goal = vehicle.target(tolerance_m=0.02 * vehicle.reach, tolerance_rad=0.1)
    turned = 0.003 if vehicle.rotates else 0.0
    upset = Disturbance(position_m=0.001 * vehicle.reach, heading_rad=turned, seed=1)
    ended = driven(vehicle, engine, goals=goal, options={"disturbance": upset})
    pushed = [
        float(np.abs(piece.end - after).max())
        for piece, after in zip(ended.driven, ended.poses[1:], strict=True)
    ]
    assert max(pushed) > 1e-6, "nothing was disturbed"


@feature(without("horizon"), on="unicycle", says="duration of a step's plan")
def loop_fixed_time(vehicle: Vehicle, engine: Engine) -> None:
    """As in the paper: every step plans for the same time again, and the value falls to zero.

    Where no trim stands still nothing can fill the time: every step plans for what is left of it.
    """
    horizon = Horizon(time=fixed_duration(vehicle))
    ended = driven(vehicle, engine, cost=Cost(effort=1.0), horizon=horizon)
    values = [step.value for step in ended.steps]
    assert all(b <= a * (1.0 + SAME) for a, b in itertools.pairwise(values))
    for step in ended.steps:
        lasts, passed = Course.of(step.plan).duration, step.time - ended.problem.start_time
        asked_for = fixed_duration(vehicle) - (passed if vehicle.automaton.rest is None else 0.0)
        close(lasts, asked_for, "duration of a step's plan")


def _forgetful(*arguments: Any) -> Any:
    steps, poses = load_steps(*arguments)
    return (replace(steps[-1], number=0, accumulated_cost=0.0),), poses


def _resumed(vehicle: Vehicle, engine: Engine, **changes: object) -> None:
    """Stopped after three steps and taken up from its file, a loop goes on as if it never was."""
    problem = vehicle.problem(**changes)
    options = {"step": _step(vehicle), "time_limit": TIME_LIMIT}
    begun = engine.simulate(problem, steps=3, **options)
    if len(begun.steps) < 3:
        raise Nothing(begun.reason)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "closed_loop.json"
        save_closed_loop(begun, path)
        steps, poses = engine.load_last(path, vehicle.automaton)
    pose = poses[-1]
    assert np.abs(pose - begun.poses[-1]).max() <= EXACT
    rest = engine.simulate(replace(problem, start=pose), steps=STEPS, last=steps[-1], **options)
    _driven_well(vehicle, replace(problem, start=pose), rest, noisy=False)
    assert rest.steps[0].number == 3, "the steps are not counted on"
    spent = sum(Course.of(one).duration for one in (*begun.driven, *rest.driven))
    close(spent, rest.cost, "cost of the whole loop", share=SAMPLED)
    close(rest.times[0], begun.times[-1], "time")


@feature(Engine(load_last=_forgetful), says="the steps are not counted on")
def resume(vehicle: Vehicle, engine: Engine) -> None:
    _resumed(vehicle, engine)


@feature(Engine(load_last=_forgetful), says="the steps are not counted on")
def resume_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _resumed(vehicle, engine, obstacles=[pillar(vehicle)])
