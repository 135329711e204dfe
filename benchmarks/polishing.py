"""Polished plans of TPCAP and dynobench: duration, time spent, and a check of its own.

``python benchmarks/polishing.py [--tpcap 1,3,...] [--dynobench NAME,...] [--time-limit S]``:
kinematic plans that differ in their gears, then optimal control from each. One setting for all. The
check drives the controls again by small Runge-Kutta steps and measures distances by shapely.
Seconds are those of the process; the limit is one of the clock.
"""

from __future__ import annotations

import argparse
import functools
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
import yaml

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import cases
from benchmarks.tables import show
from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Box
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import CarWithTrailer, Model, SecondOrderCar, SecondOrderUnicycle
from maneuver_automaton.optimal_control import Guess
from maneuver_automaton.optimal_control.polishing import intervals_for
from maneuver_automaton.optimal_control.scene import BodyPart, PolishSettings
from maneuver_automaton.problem import Bounds, Problem
from maneuver_automaton.refinement.closure import PolishedMotion
from maneuver_automaton.refinement.gear_sequences import (
    car_library,
    gear_sequences,
    unicycle_library,
)
from maneuver_automaton.refinement.guesses import (
    PathLimits,
    car_guess,
    pace_of_car,
    pace_of_unicycle,
    path_guesses,
    timed,
    unicycle_guess,
)
from maneuver_automaton.refinement.polish import (
    PolishTask,
    polish_guesses,
)
from tests.reference_dynamics import trailer_pose

SETTINGS = PolishSettings()
STEPS = functools.partial(intervals_for, settings=SETTINGS)
SEARCH = 0.25  # share of the time for the kinematic plans
KEEP = 5  # plans
POSES = 10  # of the check in every interval
CAR = SecondOrderCar(
    wheelbase=2.8, max_steering=0.75, max_speed=2.5, max_acceleration=1.0, max_steering_rate=0.5
)
AIMS = {1: 11.62, 3: 12.52, 4: 11.15, 9: 16.9, 11: 15.0, 13: 12.75, 15: 12.34, 16: 13.6, 18: 8.35}
DYNOBENCH = {
    "unicycle2_v0/parallelpark_0": 5.70,
    "unicycle2_v0/kink_0": 15.9,
    "unicycle2_v0/narrow_passage": 38.5,
    "car1_v0/kink_0": 13.7,
    "car1_v0/bugtrap_double": 32.8,
}
TPCAP_SHARES = (1.0, 0.9, 0.8)
UNICYCLE_SHARES = (1.0, 0.6)


class Vehicle(NamedTuple):
    """A vehicle, the kinematic libraries that stand for it, and how a plan becomes a guess."""

    model: Model
    libraries: Sequence[Any]
    pace: PathLimits
    guess: Any
    parts: tuple[BodyPart, ...]


def tpcap_car() -> Vehicle:
    """The car of the competition."""
    return Vehicle(
        CAR,
        [car_library(wheelbase=2.8, max_steering=0.75, share=share) for share in TPCAP_SHARES],
        pace_of_car(CAR),
        lambda plan: car_guess(CAR, plan, intervals=STEPS),
        (BodyPart(solids=tuple(convex_pieces(cases.TPCAP_BODY))),),
    )


def dynobench_vehicle(name: str, hitches: Sequence[float]) -> Vehicle:
    """The vehicle of a problem's folder."""
    body = BodyPart(solids=tuple(convex_pieces(Box([0.5, 0.25]))))
    if name.startswith("unicycle2"):
        robot = SecondOrderUnicycle(
            max_speed=0.5, max_turn_rate=0.5, max_acceleration=0.25, max_angular_acceleration=0.25
        )
        return Vehicle(
            robot,
            [unicycle_library(max_speed=0.5, max_turn_rate=0.5, share=s) for s in UNICYCLE_SHARES],
            pace_of_unicycle(robot),
            lambda plan: unicycle_guess(robot, plan, intervals=STEPS),
            (body,),
        )
    steering = math.pi / 3
    truck = CarWithTrailer(wheelbase=0.25, hitch_length=0.5, max_steering=steering, max_speed=0.5,
                           min_speed=-0.1, max_hitch=math.pi / 4)  # fmt: skip
    trailer = BodyPart(
        solids=tuple(convex_pieces(Box([0.3, 0.25]))),
        pose=trailer_pose(0.5),
    )
    led = path_guesses(truck)
    assert led is not None
    return Vehicle(
        truck,
        led.libraries,
        led.pace,
        lambda plan: led.guess(plan, np.array([hitches[0]]), np.array([hitches[1]]), STEPS),
        (body, trailer),
    )


def tpcap_task(problem: Problem) -> PolishTask:
    """A parking case from rest to rest."""
    return PolishTask(
        model=CAR,
        start=problem.start,
        start_state=[0.0, 0.0],
        goal=tuple(problem.goals[0].pose.tolist()),
        goal_state=(0.0, 0.0),
        parts=tpcap_car().parts,
        obstacles=tuple(obstacle.shape for obstacle in problem.obstacles),
    )


def dynobench(name: str) -> tuple[Problem, PolishTask, Vehicle]:
    """A problem of dynobench, for the search and for polishing."""
    path = cases.DATA / "dynobench" / "envs" / f"{name}.yaml"
    stated = yaml.safe_load(path.read_text())
    world, robot = stated["environment"], stated["robots"][0]
    first, last = ([float(v) for v in robot[key]] for key in ("start", "goal"))
    trailer = name.startswith("car1")
    states = [[s[2] - s[3]] if trailer else s[3:] for s in (first, last)]
    vehicle = dynobench_vehicle(name, [state[0] for state in states])
    boxes = tuple(Box(one["size"], one["center"]) for one in world["obstacles"])
    low, high = world["min"], world["max"]
    bounds = Bounds(x=(low[0], high[0]), y=(low[1], high[1]))
    problem = Problem(vehicle.libraries[0], first[:3], last[:3], obstacles=boxes,
                      footprint=Box([0.5, 0.25]), bounds=bounds)  # fmt: skip
    task = PolishTask(
        model=vehicle.model,
        start=first[:3],
        start_state=states[0],
        goal=tuple(last[:3]),
        goal_state=tuple(states[1]),
        parts=vehicle.parts,
        obstacles=boxes,
        bounds=bounds,
    )
    return problem, task, vehicle


def row(
    name: str, aim: float, problem: Problem, task: PolishTask, vehicle: Vehicle, limit: float
) -> list[Any]:
    """What one case came to."""
    began, clock = time.process_time(), time.monotonic()

    def estimate(plan: Plan) -> float:
        return timed(plan, vehicle.pace).duration

    budget = Budget.from_now(SEARCH * limit)
    drives = list(gear_sequences(problem, vehicle.libraries, estimate, budget=budget, keep=KEEP))
    searched = time.process_time()
    guesses: list[Guess] = [
        vehicle.guess(replace(drive.plan, start=np.zeros(3))) for drive in drives
    ]
    left = max(limit - (time.monotonic() - clock), 0.1)
    result = polish_guesses(task, guesses, settings=SETTINGS, budget=Budget.from_now(left))
    polished = time.process_time()
    cells = [name, len(drives), searched - began, polished - searched, time.monotonic() - clock]
    if result.motion is None:
        return [*cells, "-", aim, "-", "-", "-", result.reason]
    motion = result.motion
    off, clearance, over = checked(task, motion)
    verdict = "clean" if clearance > 0.0 and over <= 0.0 else "TOUCHES OR EXCEEDS"
    return [*cells, motion.duration, aim, motion.error, off, 1e3 * clearance, verdict]


def checked(task: PolishTask, motion: PolishedMotion) -> tuple[float, float, float]:
    """Miss of the end when driven again, least distance, and worst excess over a limit."""
    model = task.model
    states = driven(task, motion)
    poses = (SE2(task.start) @ SE2(states[:, :3])).pose
    shapes = [shapely.Polygon(shape.corners) for shape in task.obstacles]
    place = task.start[:2]
    around = shapely.union_all(shapely.transform(shapes, lambda points: points - place))
    near = poses - np.array([*place, 0.0])
    clearance = math.inf
    for part in task.parts:
        for pose, state in zip(near, states, strict=True):
            frame = SE2(pose)
            if part.pose is not None:
                frame = frame @ SE2(np.array(part.pose(state[3:]), dtype=np.float64))
            for corners, _ in part.solids:
                clearance = min(clearance, shapely.Polygon(frame.act(corners)).distance(around))
    ends = task.ends(float(states[-1, 2])).end
    off = max(abs(a - b) for a, b in zip(states[-1], ends, strict=True) if b is not None)
    excess = [motion.control - model.control_limits[:, 1],
              model.control_limits[:, 0] - motion.control,
              states[:, 3:] - model.reduced_limits[:, 1] - 1e-9,
              model.reduced_limits[:, 0] - states[:, 3:] - 1e-9]  # fmt: skip
    for axis, pair in enumerate((task.bounds.x, task.bounds.y)):
        if pair is not None:
            excess += [pair[0] - 1e-9 - poses[:, axis], poses[:, axis] - pair[1] - 1e-9]
    return off, clearance, max(float(rows.max()) for rows in excess)


def driven(task: PolishTask, motion: PolishedMotion) -> np.ndarray:
    """States from the identity pose, some in every interval, by Runge-Kutta steps."""
    model = task.model

    def rates(x: np.ndarray, u: np.ndarray) -> np.ndarray:
        ahead, aside, turn = model.velocity(x[3:], u)
        c, s = math.cos(x[2]), math.sin(x[2])
        return np.array([c * ahead - s * aside, s * ahead + c * aside, turn,
                         *model.dynamics(x[3:], u)])  # fmt: skip

    now = np.array([0.0, 0.0, 0.0, *task.start_state])
    states = [now]
    for u, h in zip(motion.control, motion.durations / POSES, strict=True):
        for _ in range(POSES):
            k_1 = rates(now, u)
            k_2 = rates(now + h / 2 * k_1, u)
            k_3 = rates(now + h / 2 * k_2, u)
            now = now + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + rates(now + h * k_3, u))
            states.append(now)
    return np.array(states)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tpcap", default=",".join(map(str, AIMS)))
    parser.add_argument("--dynobench", default=",".join(DYNOBENCH))
    parser.add_argument("--time-limit", type=float, default=10.0, help="[s] of a parking case")
    parser.add_argument("--long-limit", type=float, default=30.0, help="[s] of a dynobench problem")
    options = parser.parse_args()
    head = ["case", "plans", "search [s]", "polish [s]", "clock [s]", "duration [s]", "aim [s]",
            "closed to", "driven again", "clearance [mm]", ""]  # fmt: skip
    rows: list[list[Any]] = []
    if cases.present("tpcap") and options.tpcap:
        problems = cases.tpcap()
        rows += [
            row(f"TPCAP {n}", AIMS.get(n, math.nan), problems[n], tpcap_task(problems[n]),
                tpcap_car(), options.time_limit)
            for n in map(int, options.tpcap.split(","))
        ]  # fmt: skip
    if cases.present("dynobench") and options.dynobench:
        rows += [
            row(name, DYNOBENCH.get(name, math.nan), *dynobench(name), options.long_limit)
            for name in options.dynobench.split(",")
        ]
    show(head, rows)


if __name__ == "__main__":
    main()
