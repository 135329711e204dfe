"""Random closed loops among moving obstacles, of every kind of vehicle, judged by shapely.

``python benchmarks/moving_loops.py FILE [--vehicles ...] [--count N] [--from SEED]
[--time-limit S] [--changes]``: moving obstacles across the paths of the feature
matrix, and some that stand; one line of JSON a loop. What is driven is looked at every 5 ms: the
distance of the body, and of what it carries, from every obstacle, and whether the vehicle stood
still when it was hit. ``--changes``: every other one is predicted to stand still until it sets
off. ``--report FILE`` prints a table. The clock of the package is that of the processor.
"""

from __future__ import annotations

import time

time.monotonic = time.process_time  # before the package is imported, which keeps the function

import argparse  # noqa: E402
import json  # noqa: E402
import math  # noqa: E402
import sys  # noqa: E402
from collections import Counter  # noqa: E402
from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402
import shapely  # noqa: E402

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT))

from benchmarks.tables import show, spread  # noqa: E402
from maneuver_automaton.automaton import Plan  # noqa: E402
from maneuver_automaton.automaton.cutting import carried  # noqa: E402
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, Shape  # noqa: E402
from maneuver_automaton.problem import Problem, SearchSettings  # noqa: E402
from maneuver_automaton.receding_horizon import ClosedLoop, simulate  # noqa: E402
from tests.matrix.vehicles import VEHICLES, Vehicle  # noqa: E402
from tests.solids import Rounded  # noqa: E402

TICK = 5e-3  # [s] between two looks
STILL = 1e-6  # [m, rad] that a vehicle moves in a tick at most where it stands still
MOVING, STATIC = 4, 2
PIECES = 8  # steps that a drive straight to the goal takes, about
STEPS = 50


def drawn(vehicle: Vehicle, seed: int, *, moving: int = MOVING) -> Problem:
    """A vehicle's task with moving obstacles across its path by a seed, and some static ones."""
    rng = np.random.default_rng([seed, len(vehicle.name), 77])
    far, size = vehicle.reach, vehicle.size
    goal = np.array(vehicle.goal)
    goal[:2] = rng.uniform(0.7, 1.1) * far * np.array([1.0, 0.0]) + [
        0.0,
        rng.uniform(-0.2, 0.2) * far,
    ]
    if vehicle.has_heading:
        goal[2] = rng.uniform(-0.5, 0.5)
    takes = far / vehicle.fastest  # [s] straight to the goal
    found: list[Obstacle] = []
    while len(found) < moving:
        shape = _shape(rng, rng.uniform(0.4, 1.2) * size)
        begin = rng.uniform(0.0, 0.8) * takes
        speeds = rng.uniform(0.15, 0.8, 2) * vehicle.fastest
        through = np.array([rng.uniform(0.15, 1.0) * far, rng.uniform(-0.15, 0.15) * far])
        angle = rng.uniform(-math.pi, math.pi)
        away = rng.uniform(0.3, 0.8) * far * np.array([math.cos(angle), math.sin(angle)])
        turned = through + rng.uniform(0.3, 0.8) * far * np.array(
            [math.cos(angle + 2.2), math.sin(angle + 2.2)]
        )
        legs = np.array([np.hypot(*(through - away - through)), np.hypot(*(turned - through))])
        times = begin + np.concatenate([[0.0], np.cumsum(legs / speeds)])
        places = np.array([through + away, through, turned])
        turn = rng.uniform(-1.0, 1.0, 3)
        motion = Motion(times, np.column_stack([places, turn]))
        reach = 2.0 * size + _radius(shape)
        if np.hypot(*places[0]) > 2.0 * reach and np.hypot(*(places[2] - goal[:2])) > 2.0 * reach:
            found.append(Obstacle(shape, motion=motion))
    while len(found) < moving + STATIC:
        shape = _shape(rng, rng.uniform(0.3, 0.9) * size)
        at = np.array([rng.uniform(0.1, 1.0) * far, rng.uniform(-0.4, 0.4) * far])
        clear = 2.5 * size + _radius(shape)
        if min(np.hypot(*at), np.hypot(*(at - goal[:2]))) > clear:
            found.append(Obstacle(replace(shape, center=at)))
    return vehicle.problem(
        goals=replace(vehicle.target(), pose=goal), obstacles=found, search=SearchSettings()
    )


def _shape(rng: np.random.Generator, size: float) -> Any:
    return Disc(size) if rng.random() < 0.5 else Box([size, 2.0 * size])


def _radius(shape: Any) -> float:
    return float(shape.radius if isinstance(shape, Disc) else np.hypot(*(0.5 * shape.size)))


def seen_later(problem: Problem, step: float) -> Any:
    """What is predicted at a step: every other moving obstacle stands still until it sets off."""

    def seen(number: int) -> list[Any]:
        now, there = number * step, []
        for k, one in enumerate(problem.obstacles):
            motion = one.motion
            if motion is not None and k % 2 and now < motion.time[0]:
                still = Motion([motion.time[0]], motion.pose[:1])
                there.append(replace(one, motion=still))
            else:
                there.append(one)
        return there

    return seen


def driven(vehicle: Vehicle, seed: int, *, time_limit: float, changes: bool) -> dict[str, Any]:
    """A loop by a seed, and what shapely says of it."""
    problem = drawn(vehicle, seed)
    step = vehicle.reach / vehicle.fastest / PIECES
    loop = simulate(
        problem,
        step=step,
        steps=STEPS,
        time_limit=time_limit,
        obstacles=seen_later(problem, step) if changes else None,
    )
    return {
        "vehicle": vehicle.name,
        "seed": seed,
        "status": loop.status,
        "reason": loop.reason,
        "steps": len(loop.steps),
        "took_s": float(loop.times[-1]),
        "solve_s": loop.solve_s.tolist(),
        "decisions": [one.decision.value for one in loop.steps],
        "violations": [
            [n, one.guarantee.value, one.reason] for n, one in (*loop.violations, *loop.disturbed)
        ],
        "audited": [one.passed for one in loop.audits].count(False),
        **judged(problem, loop),
    }


def judged(problem: Problem, loop: ClosedLoop) -> dict[str, Any]:
    """Least distance of the body from everything, and of what it touched while it moved itself."""
    least, hits, still_hits, at = math.inf, 0, 0, None
    for number, piece in enumerate(loop.driven):
        times = piece.start_time + np.linspace(0.0, piece.duration, 2 + int(piece.duration / TICK))
        if not piece.trims:
            continue
        distance, moving = clearances(problem, piece, times)
        least = min(least, float(distance.min()))
        touched = distance <= 0.0
        if touched.any() and at is None:
            at = [number, float(times[touched.argmax()])]
        hits += bool((touched & moving).any())
        still_hits += bool((touched & ~moving).any())
    return {"least_m": least, "hits": hits, "hits_standing": still_hits, "first_hit": at}


def clearances(problem: Problem, piece: Plan, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances (n,) [m] of all bodies from all obstacles, and whether the vehicle moves."""
    poses = piece.pose_at(times)
    far = np.abs(np.diff(poses, axis=0)).max(axis=1) > STILL
    moving = np.concatenate([far[:1], far[1:] | far[:-1], far[-1:]])
    bodies: list[tuple[np.ndarray, tuple[Shape, ...]]] = [(poses, problem.footprint)]
    for name, shapes in problem.parts.items():
        part = carried(piece, problem.automaton.model, name)
        bodies.append((part.pose_at(times), shapes))
    least = np.full(len(times), np.inf)
    for there, shapes in bodies:
        for shape in shapes:
            body = Rounded.of(shape)
            solid = body.at(there[:, :3])
            for one in problem.obstacles:
                other = Rounded.of(one.shape)
                where = np.zeros((len(times), 3)) if one.motion is None else one.motion.at(times)
                gap = shapely.distance(solid, other.at(where)) - body.radius - other.radius
                least = np.minimum(least, gap)
    return least, moving


def report(rows: list[dict[str, Any]]) -> None:
    """A line for each vehicle."""
    lines = []
    for name in dict.fromkeys(row["vehicle"] for row in rows):
        own = [row for row in rows if row["vehicle"] == name]
        broken = Counter(v[1] for row in own for v in row["violations"])
        lines.append([
            name, len(own), sum(row["steps"] for row in own),
            sum(row["status"] == "reached" for row in own),
            sum(row["hits"] > 0 for row in own), sum(row["hits_standing"] > 0 for row in own),
            1e3 * min(row["least_m"] for row in own),
            spread([s for row in own for s in row["solve_s"]]),
            ", ".join(f"{n} {v}" for v, n in broken.most_common()),
        ])  # fmt: skip
    show(["vehicle", "loops", "steps", "reached", "hit", "hit standing", "least [mm]",
          "step [s]", "broken"], lines)  # fmt: skip
    print(Counter(decision for row in rows for decision in row["decisions"]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument(
        "--vehicles", nargs="*", default=[n for n, v in VEHICLES.items() if v.inertia and v.rotates]
    )
    parser.add_argument("--count", type=int, default=5)
    parser.add_argument("--from", dest="first", type=int, default=0)
    parser.add_argument("--time-limit", type=float, default=1.0)
    parser.add_argument("--changes", action="store_true")
    parser.add_argument("--report", action="store_true")
    options = parser.parse_args()
    if options.report:
        report([json.loads(line) for line in options.file.read_text().splitlines()])
        return
    with options.file.open("a") as out:
        for seed in range(options.first, options.first + options.count):
            for name in options.vehicles:
                row = driven(
                    VEHICLES[name], seed, time_limit=options.time_limit, changes=options.changes
                )
                print(json.dumps(row), file=out, flush=True)


if __name__ == "__main__":
    main()
