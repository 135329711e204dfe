"""Random pairs on two Nav2 maps: a differential robot, round or a rectangle.

``python benchmarks/nav2_pairs.py [--pairs N] [--time-limit S] [--patience S] [--reuse]``:
maps tb3_sandbox and depot, unknown cells blocked and free, a disc of 0.22 m and a rectangle of
0.6 m by 0.4 m; start and goal are free. What is not solved within the limit is tried again with
the patience, here and by OMPL (Reeds-Shepp paths of 5 cm radius, which such a robot can follow);
what nobody solves is listed, and does not count. ``--reuse``: one planner per map for all pairs.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import cases, peers
from benchmarks.ours import Run, rejected, solve, solver_on, warm_up
from benchmarks.tables import show, spread, verdict
from maneuver_automaton.collision import Box, Disc, OccupancyMap, Shape
from maneuver_automaton.problem import Bounds, Goal, Problem
from tests.scenes import differential_robot

MAPS = ("tb3_sandbox", "depot")
BODIES: dict[str, Shape] = {"disc 0.22 m": Disc(0.22), "0.6 x 0.4 m": Box([0.6, 0.4])}
MEDIAN_MS, P99_MS = 20.0, 200.0
PEER_RADIUS = 0.05  # [m]


def pairs(cells: OccupancyMap, body: Shape, n: int, seed: int) -> list[Problem]:
    """Problems from a random free pose of a map to another."""
    robot = differential_robot()
    low, high = cells.origin[:2], cells.origin[:2] + cells.extent
    bounds = Bounds(x=(low[0], high[0]), y=(low[1], high[1]))
    somewhere = Problem(robot, [0, 0, 0], [0, 0, 0], obstacles=cells, footprint=body, bounds=bounds)
    rng = np.random.default_rng([seed, n])
    poses = cases.free_poses(somewhere, 2 * n, low=low, high=high, rng=rng)
    return [
        replace(somewhere, start=start, goals=(Goal(pose=goal),))
        for start, goal in poses.reshape(n, 2, 3)
    ]


def first_tries(problems: list[Problem], *, time_limit: float, reuse: bool) -> list[Run]:
    warm_up(problems[0])
    if not reuse:
        return [solve(problem, time_limit=time_limit) for problem in problems]
    query = solver_on(problems[0])
    return [query(problem.start, problem.goals, time_limit) for problem in problems]


def solvable(problem: Problem, patience: float, *, ompl: bool) -> str:
    """Who solves a problem, given time: 'ours', 'OMPL', or ''."""
    if solve(problem, time_limit=patience).found:
        return "ours"
    if not ompl:
        return ""
    run = peers.solve(problem, "RRTConnect", time_limit=patience, radius=PEER_RADIUS)
    return "OMPL" if run.improvements and run.valid else ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=100)
    parser.add_argument("--time-limit", type=float, default=5.0)
    parser.add_argument("--patience", type=float, default=60.0)
    parser.add_argument("--reuse", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    if not cases.present("nav2-maps"):
        return
    ompl = peers.available()
    rows, everything, notes = [], [], []
    for name in MAPS:
        for unknown in ("blocked", "free"):
            cells = cases.nav2_map(name, unknown_blocked=unknown == "blocked")
            for words, body in BODIES.items():
                problems = pairs(cells, body, options.pairs, options.seed)
                runs = first_tries(problems, time_limit=options.time_limit, reuse=options.reuse)
                late = {k: solvable(problems[k], options.patience, ompl=ompl)
                        for k, run in enumerate(runs) if not run.found}  # fmt: skip
                title = f"{name}, unknown {unknown}, {words}"
                notes += [
                    f"{title}, pair {k}: {runs[k].status} ({runs[k].reason}); with "
                    f"{options.patience:g} s solved by {who or 'nobody'}"
                    for k, who in late.items()
                ]
                n_solvable = len(runs) - sum(not who for who in late.values())
                n_found = sum(run.found for run in runs)
                sound = sum(not run.sound() for run in runs)
                rows.append([title, n_found, n_solvable, verdict(n_found == n_solvable),
                             spread(1e3 * run.first_s for run in runs), sound])  # fmt: skip
                everything += runs
    show(["map and robot", "found", "solvable", "all", "first plan [ms]", "unsound"], rows)
    firsts = [1e3 * run.first_s for run in everything if run.found]
    if firsts:
        middle, p99 = np.percentile(firsts, [50, 99])
        print(f"all: first plan [ms] median {middle:.2f}, aim {MEDIAN_MS:g}: "
              f"{verdict(middle <= MEDIAN_MS)}; p99 {p99:.1f}, aim {P99_MS:g}: "
              f"{verdict(p99 <= P99_MS)}; {rejected(everything)}")  # fmt: skip
    for note in notes:
        print(note)


if __name__ == "__main__":
    main()
