"""How long the audit of a plan takes: words of 5, 20, 50 trims among 10 and 150 polygons.

Also of the pieces of a closed loop, one second each, among 150.

``python -m benchmarks.audits [--out FILE] [--against FILE] [--repeats N]``: medians of
processor time over plans and repeats. Run it with ``PYTHONPATH`` at another checkout and ``--out``
first, and here with ``--against`` that file, for the ratio.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import shapely

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.cutting import head_of, tail_of
from maneuver_automaton.collision import Motion, Obstacle, Polygon
from maneuver_automaton.models import Car
from maneuver_automaton.problem import Goal

CAR = Automaton.of_controls(
    Car(wheelbase=2.8, max_steering=0.6),
    {
        f"{way} {side}": (speed, steering)
        for way, speed in (("ahead", 1.0), ("back", -1.0))
        for side, steering in (("left", 0.6), ("straight", 0.0), ("right", -0.6))
    },
)
BODY = Polygon([[-0.95, -0.9], [3.75, -0.9], [3.75, 0.9], [-0.95, 0.9]])
TRIMS, POLYGONS = (5, 20, 50), (10, 150)
PLANS = 8  # of each kind
KEPT = 0.15  # [m] at least from every polygon


def scene(seed: int, trims: int, polygons: int, *, moving: int = 0) -> tuple[Plan, list[Obstacle]]:
    """A random word, and polygons beside where it leads, as near as 0.15 m."""
    rng = np.random.default_rng([7, seed, trims, polygons])
    word = [CAR.trims[k] for k in rng.integers(len(CAR.trims), size=trims)]
    plan = Plan(np.zeros(3), word, durations=rng.uniform(0.3, 3.0, trims))
    return plan, beside(plan, polygons, rng, moving=moving)


def beside(
    plan: Plan, polygons: int, rng: np.random.Generator, *, moving: int = 0
) -> list[Obstacle]:
    """Polygons beside where a plan leads the body, and others that pass far from it."""
    poses = plan.sample(max_step_m=0.1, max_step_rad=0.02).pose
    corners = np.vstack([BODY.corners, BODY.corners[:1]])
    cosine, sine = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    x = poses[:, 0, None] + cosine * corners[:, 0] - sine * corners[:, 1]
    y = poses[:, 1, None] + sine * corners[:, 0] + cosine * corners[:, 1]
    swept = shapely.union_all(shapely.polygons(np.stack([x, y], axis=-1)))
    low, high = np.array(swept.bounds[:2]) - 8.0, np.array(swept.bounds[2:]) + 8.0
    obstacles: list[Obstacle] = []
    while len(obstacles) < polygons:
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, rng.integers(3, 8)))
        shape = rng.uniform(0.3, 1.5) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        shape = shape + rng.uniform(low, high)
        if shapely.Polygon(shape).area > 0.02 and swept.distance(shapely.Polygon(shape)) > KEPT:
            obstacles.append(Obstacle(Polygon(shape)))
    for _ in range(moving):  # they pass far from the way
        aside = rng.uniform(high + 3.0, high + 9.0)
        motion = Motion([0.0, plan.duration], [[*aside, 0.0], [aside[0] + 5.0, aside[1], 0.0]])
        obstacles.append(Obstacle(BODY, motion=motion))
    return obstacles


def timed(plan: Plan, obstacles: list[Obstacle], repeats: int) -> float:
    """Median time of an audit [ms], the map prepared."""
    goal, around = Goal(pose=plan.end), tuple(obstacles)
    times = []
    for _ in range(repeats + 1):
        began = time.process_time()
        audit = audit_plan(plan, goal, CAR.model, footprint=(BODY,), obstacles=around)
        times.append(1e3 * (time.process_time() - began))
    assert audit.passed, audit.reason
    return statistics.median(times[1:])


def pieces(seed: int) -> list[tuple[Plan, list[Obstacle]]]:
    """What a closed loop applies of a word of 20 trims, second by second."""
    plan, obstacles = scene(seed, 20, 150)
    steps = range(0, int(plan.duration), 5)
    return [(head_of(tail_of(plan, float(k)), 1.0), obstacles) for k in steps]


def measured(repeats: int) -> Iterator[tuple[str, float]]:
    """Each kind of scene, and the median time of its audits [ms]."""
    for trims in TRIMS:
        for polygons in POLYGONS:
            for moving in (0, 10):
                yield (
                    f"{trims} trims, {polygons} polygons, {moving} moving",
                    statistics.median(
                        timed(*scene(seed, trims, polygons, moving=moving), repeats)
                        for seed in range(PLANS)
                    ),
                )
    cut = [one for seed in range(2) for one in pieces(seed)]
    yield "pieces of a closed loop", statistics.median(timed(*one, repeats) for one in cut)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--against", type=Path)
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    before = json.loads(options.against.read_text()) if options.against else {}
    found = {}
    for name, ms in measured(options.repeats):
        found[name] = ms
        ratio = f", {before[name] / ms:.1f} times" if name in before else ""
        print(f"{name}: {ms:.2f} ms{ratio}", flush=True)
    if options.out:
        options.out.write_text(json.dumps(found))


if __name__ == "__main__":
    main()
