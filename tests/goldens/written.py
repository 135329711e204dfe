"""Files as this package once wrote them: plans, loops and libraries that must go on loading."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import maneuver_automaton as ma
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.collision import Box
from maneuver_automaton.formats.closed_loop_json import load_steps, save_closed_loop
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon import ClosedLoop, Disturbance, simulate
from tests.goldens.scenes import all_kinematic, glider, platform
from tests.inertia import CAR, car_automaton, resting, unicycle_automaton
from tests.receding_horizon.loops import NEAR, parking_loop
from tests.scenes import differential_robot
from tests.search.cases import TABLE_2, helicopter, robot

FILES = Path(__file__).parent / "files"
SHORT = 2  # steps, after which a loop was stopped

SLOPE = Problem(unicycle_automaton(), [0.0, 0.0, 0.0], [3.0, 1.0, 1.0])
NOISE = Disturbance(position_m=0.02, heading_rad=0.02, seed=1)
POLISHED = Problem(
    resting(CAR), [0.0, 0.0, 0.0], [4.0, 0.0, 0.0], obstacles=[Box([1.0, 1.0], [2.0, 3.0])]
)
PLANS: dict[str, Callable[[], ma.PlanResult]] = {
    "plan_parking": lambda: _planned("table2/fixed/0", alternatives=2),
    "plan_among_obstacles": lambda: _planned("obstacles/5"),
    "plan_helicopter": lambda: ma.plan(
        Problem(helicopter(), [0.0, 0.0, 0.0, 0.0], [3.0, 0.5, 0.2, 1.0])
    ),
    "plan_platform": lambda: _planned("platform/0"),
    "plan_start_is_goal": lambda: _planned("goals/6"),
    "plan_maneuvers": lambda: ma.plan(
        replace(SLOPE, horizon=ma.Horizon(time=20.0)), time_limit=2.0
    ),
    "plan_polished": lambda: ma.plan(POLISHED, time_limit=5.0),
    "plan_none": lambda: _planned("random/2"),
}
LOOPS: dict[str, tuple[Problem, dict[str, Any]]] = {
    "loop_parking": (parking_loop(), {"step": 1.0}),
    "loop_noise": (parking_loop(goal=NEAR), {"step": 1.0, "disturbance": NOISE}),
    "loop_maneuvers": (SLOPE, {"step": 0.4, "time_limit": 5.0}),
}
LIBRARIES: dict[str, Callable[[], Automaton]] = {
    "library_table2": lambda: robot(TABLE_2),
    "library_differential": differential_robot,
    "library_glider": glider,
    "library_platform": platform,
    "library_unicycle_with_inertia": lambda: unicycle_automaton(((0.0, 0.0), (1.0, 0.0))),
    "library_car_with_inertia": lambda: car_automaton((1.0,), (-0.6, 0.0)),
    "library_slope": lambda: SLOPE.automaton,
}


def _planned(name: str, **options: Any) -> ma.PlanResult:
    scene = all_kinematic()[name]
    return ma.plan(scene.problem, time_limit=scene.time_limit, **options)


def write_files() -> dict[str, Any]:
    """Write every file, and return what is in it."""
    FILES.mkdir(exist_ok=True)
    kept: dict[str, Any] = {}
    for name, make in PLANS.items():
        result = make()
        ma.save_plan(result, FILES / f"{name}.json")
        kept[name] = {"status": result.status.value}
        if result.plan is not None:
            kept[name] |= of_plan(result.plan)
    for name, (problem, options) in LOOPS.items():
        whole = simulate(problem, **options)
        begun = simulate(problem, steps=SHORT, **options)
        save_closed_loop(begun, FILES / f"{name}.json")
        kept[name] = {
            "steps": len(whole.steps),
            "cost": whole.cost,
            "end": whole.poses[-1].tolist(),
        }
    for name, library in LIBRARIES.items():
        ma.save_library(library(), FILES / f"{name}.json")
        kept[name] = of_library(library())
    return kept


def of_plan(plan: Plan) -> dict[str, Any]:
    """What a plan is known by, however it is stored."""
    times = np.linspace(0.0, plan.duration, 5)
    return {
        "primitives": [one.name for one in plan.primitives],
        "durations": plan.primitive_durations.tolist(),
        "poses": plan.pose_at(times).round(9).tolist(),
    }


def of_library(library: Automaton) -> dict[str, Any]:
    """What a library is known by."""
    return {
        "model": library.model.name,
        "trims": {trim.name: trim.body_velocity.tolist() for trim in library.trims},
        "maneuvers": {one.name: one.displacement.tolist() for one in library.maneuvers},
    }


def resumed(name: str) -> ClosedLoop:
    """The rest of a loop that was stopped, from its file.

    A library of maneuvers is that of a file too: driven anew, its last digits depend on the
    processor, and the loop would be one of another library.
    """
    problem, options = LOOPS[name]
    if problem.automaton.maneuvers:
        problem = replace(problem, automaton=ma.load_library(FILES / "library_slope.json"))
    steps, poses = load_steps(FILES / f"{name}.json", problem.automaton)
    there = replace(problem, start=poses[-1])
    return simulate(there, last=steps[-1], **options)
