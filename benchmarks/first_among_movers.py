"""First plans among moving obstacles: expansions, processor time, cost.

``python benchmarks/first_among_movers.py [KIND ...] [--scenes N] [--most N]``: by the search
in space and time alone, at most so many expansions, and by the whole planner without improvement.
The kinds are `crossing` (twelve that cross a square), `doors` (three walls with a door each, that
slides to and fro, where waiting is needed) and `files` (scenarios with moving obstacles).
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.latency import planner_of
from benchmarks.tables import show
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.problem import Bounds, Goal, Problem
from maneuver_automaton.scenario import load_scenario
from maneuver_automaton.search.cost_to_go import cost_to_go_table
from maneuver_automaton.search.lattice import first_plan
from maneuver_automaton.search.lattice_query import lattice_query
from tests.scenes import differential_robot, moving_scene

SIDE = 12.0  # [m] of the room with doors
GAP = 1.4  # [m] width of a door
FILES = ("crossing_traffic", "opening_door")


def doors(seed: int) -> Problem:
    """A robot in a room of four parts: a door slides over each gap and back, discs cross two."""
    rng = np.random.default_rng([77, seed])
    obstacles = []
    for x in (3.0, 6.0, 9.0):
        y = rng.uniform(2.0, 10.0)
        low, high = y - 0.5 * GAP, y + 0.5 * GAP
        obstacles.append(Obstacle(Box([0.3, low], [x, 0.5 * low])))
        obstacles.append(Obstacle(Box([0.3, SIDE - high], [x, 0.5 * (SIDE + high)])))
        times, poses, begin = [], [], 0.0
        for n in range(8):  # shut first, open at last
            lasting = rng.uniform(3.0, 8.0)
            times += [begin, begin + lasting]
            poses += 2 * [[x, y + 3.0 * (n % 2), 0.0]]
            begin += lasting + 1.5
        obstacles.append(Obstacle(Box([0.4, 1.6]), motion=Motion(times, poses)))
    for _ in range(4):
        x = rng.uniform(3.6, 8.4)
        ends = [[x, rng.uniform(9.0, SIDE), 0.0], [x, rng.uniform(0.0, 3.0), 0.0]]
        to_and_fro = Motion(6.0 * np.arange(10), 5 * ends)
        obstacles.append(Obstacle(Disc(0.5), motion=to_and_fro))
    return Problem(
        differential_robot(speed=1.0, turn_rate=1.5),
        [1.0, rng.uniform(2.0, 10.0), 0.0],
        Goal(pose=[11.0, rng.uniform(2.0, 10.0), 0.0], free_heading=True),
        obstacles=obstacles,
        footprint=Disc(0.3),
        bounds=Bounds(x=(0.0, SIDE), y=(0.0, SIDE)),
    )


def problems(kind: str, scenes: int) -> Iterator[tuple[str, Problem]]:
    """Problems of a kind, each with a name."""
    if kind == "files":
        for name in FILES:
            path = Path(__file__).parents[1] / "scenarios" / f"{name}.yaml"
            yield name, load_scenario(path).problem
        return
    make = moving_scene if kind == "crossing" else doors
    for seed in range(scenes):
        yield str(seed), make(seed)


def least_time(work: Callable[[], object]) -> float:
    """Processor time [ms] of the quicker of two runs."""
    took = []
    for _ in range(2):
        begun = time.thread_time()
        work()
        took.append(1e3 * (time.thread_time() - begun))
    return min(took)


def measured(problem: Problem, most: int) -> tuple[int, float, float, float, float]:
    """Expansions, time [ms] and cost of the search alone; time [ms] and cost of the planner."""
    goals = range(len(problem.goals))
    table = cost_to_go_table(problem, prepared=lattice_query(problem, goals).prepared)
    found = []

    def search() -> None:
        budget = replace(UNLIMITED, expansions=most)
        found.append(first_plan(lattice_query(problem, goals), budget=budget, table=table))

    took = least_time(search)
    word = found[-1].word
    wanted = replace(problem, search=replace(problem.search, improve=False))
    planner = planner_of(wanted, wanted.search)
    plans = [planner.plan(wanted.start, wanted.goals, time_limit=2.0) for _ in range(2)]
    times = [1e3 * plan.timing_s.get("first_plan", math.inf) for plan in plans]
    cost = plans[-1].cost
    return (found[-1].expansions, took, word.cost if word else math.inf, min(times),
            math.inf if cost is None else cost)  # fmt: skip


def main() -> None:
    """Measure every problem of the kinds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", default=["crossing", "files"])
    parser.add_argument("--scenes", type=int, default=25)
    parser.add_argument("--most", type=int, default=30_000)
    given = parser.parse_args()
    for kind in given.kinds:
        rows = [(name, *measured(one, given.most)) for name, one in problems(kind, given.scenes)]
        show([kind, "expansions", "search [ms]", "cost", "planner [ms]", "its cost"], rows)
        table = np.array([row[1:] for row in rows])
        nodes, search, _, planner, _ = table.sum(axis=0)
        found = np.isfinite(table[:, 2]).sum()
        print(f"in all {nodes:.0f} expansions, {search:.1f} ms by the search alone, which found "
              f"{found} of {len(rows)}; {planner:.1f} ms by the planner\n")  # fmt: skip


if __name__ == "__main__":
    main()
