"""Random plans and closed loops of every kind of vehicle, to be judged by `plan_judge.py`.

``python benchmarks/random_plans.py FILE [--vehicles ...] [--count N] [--seconds S] [--loops]
[--from SEED]``: goals and obstacles by a seed for the vehicles of the feature matrix, planned under
`max_expansions`, or driven in closed loop, every other one with noise; one line of JSON a problem,
with what a judge needs who knows nothing of the package. A vehicle ends after so many problems, or
seconds of the processor. The package is the one that Python finds, so that another checkout can be
asked for the same problems.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parents[1]))

import maneuver_automaton as ma
from maneuver_automaton.collision import Box, Disc, Shape
from maneuver_automaton.formats.closed_loop_json import closed_loop_to_dict
from maneuver_automaton.formats.plan_json import plan_to_dict, trajectory_entry
from maneuver_automaton.problem import Problem, SearchSettings
from maneuver_automaton.receding_horizon import Disturbance, simulate
from tests.matrix.vehicles import VEHICLES, Vehicle

EXPANSIONS = 400
COUNT = 8  # obstacles
STEPS = 60  # of a closed loop, at most
PIECES = 8  # steps that a drive straight to the goal takes, about
LEFT_OUT = ("boat_in_current",)  # its dynamics are no matter of a few formulas


def drawn(vehicle: Vehicle, seed: int) -> tuple[Problem, list[Shape]]:
    """A problem by a seed: anywhere within reach, at any heading, among obstacles."""
    rng = np.random.default_rng([seed, len(vehicle.name)])
    around, far = vehicle.size, vehicle.reach
    goal = np.array(vehicle.goal)
    goal[:2] = rng.uniform(0.4, 1.2) * far * np.array(_direction(rng, vehicle))
    if vehicle.has_heading:
        goal[2] = rng.uniform(-math.pi, math.pi) * (1.0 if vehicle.reverses else 0.3)
    if goal.size > 3:
        goal[3] = rng.uniform(-1.0, 1.0) * vehicle.goal[3]
    shapes: list[Shape] = []
    tries = 0
    while len(shapes) < COUNT and tries < 200:
        tries += 1
        centre = rng.uniform(-0.3, 1.3, 2) * far * np.array([1.0, 1.0])
        centre[1] -= 0.5 * far
        size = rng.uniform(0.3, 1.5) * around
        clear = 2.5 * around + size
        if min(np.hypot(*centre), np.hypot(*(centre - goal[:2]))) < clear:
            continue
        if rng.random() < 0.5:
            shapes.append(Disc(size, centre))
        else:
            shapes.append(Box([size, 2.0 * size], centre, float(rng.uniform(0.0, math.pi))))
    problem = vehicle.problem(
        goals=replace(vehicle.target(), pose=goal),
        obstacles=shapes,
        search=SearchSettings(max_expansions=EXPANSIONS),
    )
    return problem, shapes


def _direction(rng: np.random.Generator, vehicle: Vehicle) -> tuple[float, float]:
    """A unit vector; ahead, for a vehicle that cannot go back."""
    angle = rng.uniform(-math.pi, math.pi) * (1.0 if vehicle.reverses else 0.15)
    return math.cos(angle), math.sin(angle)


def shape_entry(shape: Shape) -> dict[str, Any]:
    """Corners, or centre and radius."""
    if isinstance(shape, Disc):
        return {"center": shape.center.tolist(), "radius": shape.radius}
    return {"corners": shape.corners.tolist()}


def answers(
    vehicle: Vehicle, seeds: range, seconds: float, *, loops: bool
) -> Iterator[dict[str, Any]]:
    """Problems of a vehicle with their plans, or closed loops."""
    began = time.process_time()
    for seed in seeds:
        if time.process_time() - began > seconds:
            return
        problem, shapes = drawn(vehicle, seed)
        at = time.process_time()
        answer = driven(vehicle, problem, seed) if loops else planned(problem)
        yield {
            "vehicle": vehicle.name,
            "seed": seed,
            "seconds": time.process_time() - at,
            "start": problem.start.tolist(),
            "goal": problem.goals[0].pose.tolist(),
            "obstacles": [shape_entry(shape) for shape in shapes],
            "footprint": [shape_entry(shape) for shape in vehicle.footprint],
            "parts": [shape_entry(one) for group in vehicle.parts.values() for one in group],
            **answer,
        }


def planned(problem: Problem) -> dict[str, Any]:
    """The plan of a problem."""
    return {"plan": plan_to_dict(ma.plan(problem, time_limit=30.0))}


def driven(vehicle: Vehicle, problem: Problem, seed: int) -> dict[str, Any]:
    """The closed loop of a problem; of every other seed with noise, and a goal of some size."""
    goal, upset, noisy = problem.goals[0], Disturbance(seed=seed), bool(seed % 2)
    if noisy:
        goal = replace(goal, tolerance_m=0.02 * vehicle.reach, tolerance_rad=0.1)
        turned = 0.003 if vehicle.rotates else 0.0
        upset = replace(upset, position_m=0.001 * vehicle.reach, heading_rad=turned)
    loop = simulate(
        replace(problem, goals=(goal,)),
        step=vehicle.reach / vehicle.fastest / PIECES,
        steps=STEPS,
        disturbance=upset,
        time_limit=30.0,
    )
    return {
        "noisy": noisy,
        "tolerance": [goal.tolerance_m, goal.tolerance_rad],
        "loop": closed_loop_to_dict(loop),
        "pieces": [trajectory_entry(piece) for piece in loop.driven],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    known = [name for name in VEHICLES if name not in LEFT_OUT]
    parser.add_argument("--vehicles", nargs="+", choices=known, default=known)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=math.inf, help="for each vehicle")
    parser.add_argument("--loops", action="store_true", help="closed loops instead of plans")
    parser.add_argument("--from", dest="first", type=int, default=0, help="the first seed")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.count)
    with options.file.open("w") as lines:
        for name in options.vehicles:
            for answer in answers(VEHICLES[name], seeds, options.seconds, loops=options.loops):
                lines.write(json.dumps(answer) + "\n")
                lines.flush()


if __name__ == "__main__":
    main()
