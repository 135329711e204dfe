"""The longest queries of two street maps, for a point that turns on circles of 4 cells.

``python benchmarks/movingai_longest.py [--queries N] [--time-limit S] [--map NAME]``: the
goal's heading free, as in bench-mr, and drawn with a seed; lengths beside those on the grid, which
are a scale and no bound.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import cases
from benchmarks.ours import failures, rejected, solve, warm_up
from benchmarks.tables import show, spread
from maneuver_automaton.problem import Goal, Problem
from tests.scenes import reeds_shepp

MAPS = ("Berlin_0_256", "NewYork_1_512")


def problems(name: str, n: int, *, free_heading: bool) -> list[tuple[Problem, float]]:
    """Queries with their length on the grid; headings drawn with a fixed seed."""
    cells = cases.movingai_map(name)
    rng = np.random.default_rng(4)
    found = []
    for query in cases.movingai_longest(name, n):
        headings = rng.uniform(-math.pi, math.pi, 2)
        goal = Goal(pose=[*query.goal, headings[1]], free_heading=free_heading)
        automaton = reeds_shepp(cases.MOVINGAI_RADIUS)
        start = [*query.start, headings[0]]
        found.append((Problem(automaton, start, goal, obstacles=cells), query.grid_length))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--queries", type=int, default=50)
    parser.add_argument("--time-limit", type=float, default=5.0)
    parser.add_argument("--map", choices=MAPS)
    options = parser.parse_args()
    if not cases.present("movingai"):
        return
    rows, unsolved, everything = [], [], []
    for name in [options.map] if options.map else MAPS:
        for words, free in (("heading free", True), ("heading drawn", False)):
            queries = problems(name, options.queries, free_heading=free)
            warm_up(queries[0][0])
            runs = [solve(problem, time_limit=options.time_limit) for problem, _ in queries]
            ratios = [run.length_m / grid for run, (_, grid) in zip(runs, queries, strict=True)]
            rows.append([
                f"{name}, {words}", f"{sum(run.found for run in runs)}/{len(runs)}",
                spread((1e3 * run.first_s for run in runs), percentiles=(50, 90, 100)),
                spread(ratios, percentiles=(50, 100)),
                spread((run.direction_changes for run in runs if run.found), percentiles=(50, 100)),
                sum(not run.sound(step_m=0.05) for run in runs),
            ])  # fmt: skip
            unsolved += failures({f"{name}, {words}, query {k}": run for k, run in enumerate(runs)})
            everything += runs
    show(["map", "found", "first plan [ms]", "length / grid length", "changes", "unsound"], rows)
    print(rejected(everything))
    print(*unsolved, sep="\n")


if __name__ == "__main__":
    main()
