"""Two thousand random scenes: no crash, no hang, no plan that shapely rejects, no false verdict.

``python benchmarks/random_scenes.py [--scenes N] [--first N] [--time-limit S]``: any shapes,
bodies, goals, margins and bounds, every tenth scene degenerate. "Blocked" must be said of exactly
those starts and goals of which shapely says it; a body that touches to within 1e-9 m may be either.
The scenes are solved in a process of their own: what raises, crashes or hangs there is "lost".
"""

from __future__ import annotations

import argparse
import collections
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import apart
from benchmarks.ours import Run, rejected, solve, warm_up
from benchmarks.tables import show, spread
from maneuver_automaton.problem import Problem
from tests.scenes import random_scene, room_queries
from tests.solids import World, outside

OVERRUN = 1.1  # times the limit
FREE_SPACE = 9  # a scene without obstacles, which other kernels plan
TOUCHING = 1e-9  # [m]
READY, PATIENCE = 900.0, 10.0  # [s] for compiling; beyond the limit before a call is killed
HEADINGS = 720  # tried where the goal's heading is free


def expected(problem: Problem) -> tuple[str, ...]:
    """Verdicts that agree with shapely: start_blocked, goal_blocked, or other."""
    world = World(problem)

    def blocked(poses: np.ndarray) -> tuple[bool, ...]:
        """Whether none of the poses is free; both answers where it is a matter of rounding."""
        times = np.full(len(poses), problem.start_time)
        clearances = world.clearance(poses - np.append(world.origin, 0.0), times) - problem.margin
        clearances = np.where(outside(problem, poses[:, :2]) > 0.0, -np.inf, clearances)
        best = float(clearances.max())
        return (True, False) if abs(best) <= TOUCHING else (best < 0.0,)

    at_start = blocked(problem.start[None])
    at_goals = []
    for goal in problem.goals:
        poses = np.repeat(goal.pose[None], HEADINGS if goal.free_heading else 1, axis=0)
        if goal.free_heading:
            poses[:, 2] = np.linspace(0.0, 2.0 * np.pi, HEADINGS, endpoint=False)
        at_goals.append(blocked(poses))
    answers = set()
    for start in at_start:
        for all_goals in (True, False):
            possible = (
                all(True in one for one in at_goals)
                if all_goals
                else any(False in one for one in at_goals)
            )
            if possible:
                answers.add("start_blocked" if start else "goal_blocked" if all_goals else "other")
    return tuple(sorted(answers))


def complaints(seed: int, run: Run, limit: float) -> list[tuple[str, str]]:
    """What is wrong with a run: the kind and a line that says it."""
    problem = run.problem
    found = []
    verdict = run.status if run.status.endswith("_blocked") else "other"
    wanted = expected(problem)
    if verdict not in wanted:
        found.append(("verdict", f"scene {seed}: {run.status} ({run.reason}), shapely says "
                      f"{' or '.join(wanted)}"))  # fmt: skip
    if run.search_s > OVERRUN * limit:
        found.append(("overrun", f"scene {seed}: {run.search_s:.3f} s for a limit of {limit:g} s"))
    opinion = run.second_opinion()
    if opinion is not None and not opinion.passes(problem, run.goal_index):
        found.append(("unsound", f"scene {seed}: {opinion}, margin {problem.margin:g} m"))
    if opinion is not None and not run.audited:
        found.append(("unaudited", f"scene {seed}: found, but the audit did not pass"))
    return found


def ready() -> None:
    """Compile and load what the scenes need."""
    for problem in (room_queries(1)[0], random_scene(FREE_SPACE)):
        warm_up(problem)


def solve_scene(seed: int, time_limit: float) -> Run:
    return solve(random_scene(seed), time_limit=time_limit)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--time-limit", type=float, default=0.5)
    options = parser.parse_args()
    apart.call(ready, patience=READY)
    runs: list[Run] = []
    notes: dict[str, list[str]] = collections.defaultdict(list)
    for seed in range(options.first, options.first + options.scenes):
        try:
            run: Run = apart.call(
                solve_scene, seed, options.time_limit, patience=PATIENCE + options.time_limit
            )
        except apart.Lost as lost:
            notes["lost"].append(f"scene {seed} {lost}")
            if not str(lost).startswith("raised"):
                apart.call(ready, patience=READY)
            continue
        runs.append(run)
        for kind, words in complaints(seed, run, options.time_limit):
            notes[kind].append(words)
    statuses = collections.Counter(run.status for run in runs)
    show(["status", "scenes"], statuses.most_common())
    firsts = [1e3 * run.first_s for run in runs if run.found]
    print(f"first plan [ms]: {spread(firsts)}")
    print(f"call less FCL and audit [s], limit {options.time_limit:g}: "
          f"{spread(run.search_s for run in runs)}")  # fmt: skip
    print(rejected(runs))
    kinds = ("lost", "overrun", "unsound", "unaudited", "verdict")
    print("; ".join(f"{kind}: {len(notes[kind])}" for kind in kinds))
    for kind in kinds:
        for words in notes[kind][:20]:
            print(f"{kind}: {words}")


if __name__ == "__main__":
    main()
