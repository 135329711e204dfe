"""Plans of vehicles with inertia past moving obstacles: by words of the library, and polished.

``python benchmarks/polishing_movers.py [--scenes N] [--time-limit S]``: every vehicle of the
matrix with inertia drives among one to four discs and boxes that cross its way at random. Each row
has the costs of the polished plans as shares of those by words (median, least, greatest), how many
came out as one motion, the seconds of both, and the least distance to what moves by shapely at 5 ms
steps.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from maneuver_automaton import Plan, plan
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.collision.surroundings import parts_of, surroundings_of
from tests.matrix.measuring import found
from tests.matrix.scenes import base, beside
from tests.matrix.vehicles import VEHICLES, Vehicle


def movers(vehicle: Vehicle, seed: int) -> list[Obstacle]:
    """Some that cross the way between the ends, straight or on arcs."""
    rng = np.random.default_rng([seed, 7])
    lasting = 1.5 * found(base(vehicle)).duration
    around = []
    for _ in range(int(rng.integers(1, 5))):
        side = rng.choice([-1.0, 1.0])
        here, there = (beside(vehicle, sign * side * 0.3 * vehicle.reach) for sign in (1.0, -1.0))
        along = rng.uniform(-0.25, 0.25, 2) * vehicle.reach
        turn = rng.uniform(-1.0, 1.0)
        poses = [[*(here + along[0]), 0.0], [*(there + along[1]), turn]]
        size = vehicle.size * rng.uniform(0.4, 0.9)
        shape = Disc(0.6 * size) if rng.random() < 0.5 else Box([1.4 * size, 0.8 * size])
        first = rng.uniform(-0.3, 0.3) * lasting
        around.append(Obstacle(shape, motion=Motion([first, first + lasting], poses)))
    return around


def distance(vehicle: Vehicle, plan_: Plan, around: list[Obstacle]) -> float:
    """Least distance of the body to what moves [m], at 5 ms steps."""
    times = plan_.start_time + np.arange(0.0, plan_.duration, 0.005)
    poses = plan_.pose_at(times)[:, :3]
    near = surroundings_of(tuple(around), (0.0, 0.0)).nearest(
        parts_of(vehicle.footprint), poses, times
    )
    return float(near.distance.min())


def main() -> None:
    """Plan in all scenes, and print a row for each vehicle."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=8)
    parser.add_argument("--time-limit", type=float, default=10.0)
    arguments = parser.parse_args()
    print(
        f"{'vehicle':24s} scenes  both  polished  median   least    most  words s  all s  apart mm"
    )
    for name, vehicle in VEHICLES.items():
        if not vehicle.inertia:
            continue
        ratios, seconds, motions, least = [], [], 0, np.inf
        for seed in range(arguments.scenes):
            around = movers(vehicle, seed)
            problem = vehicle.problem(obstacles=around)
            costs, took = [], []
            for polish in (False, True):
                asked = replace(problem, search=replace(problem.search, polish=polish))
                begun = time.perf_counter()
                result = plan(asked, time_limit=arguments.time_limit)
                took.append(time.perf_counter() - begun)
                costs.append(np.inf if result.cost is None else result.cost)
                if result.plan is not None:
                    assert result.audit is not None
                    assert result.audit.passed
                    least = min(least, distance(vehicle, result.plan, around))
                    motions += "polished" in result.plan.word
            if max(costs) < np.inf:
                ratios.append(costs[1] / costs[0])
                seconds.append(took)
        if not ratios:
            print(f"{name:24s} {arguments.scenes:6d} {0:5d}")
            continue
        words_s, all_s = np.median(seconds, axis=0)
        print(
            f"{name:24s} {arguments.scenes:6d} {len(ratios):5d} {motions:9d} "
            f"{np.median(ratios):7.3f} {min(ratios):7.3f} {max(ratios):7.3f} {words_s:8.2f} "
            f"{all_s:6.2f} {1e3 * least:9.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
