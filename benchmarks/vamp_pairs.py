"""Random pairs on Nav2 maps, beside OMPL with VAMP's vectorised test of a LoCoBot.

``pip install nav-planning``; ``python benchmarks/vamp_pairs.py [--pairs N] 2>/dev/null``
(OMPL writes a line a call): RRT-Connect in a Reeds-Shepp space, the blocked cells handed over as
points, its motions sampled and not proven between. The LoCoBot's base is 0.18 to 0.20 m in radius;
ours is a disc of 0.20 m among the cells themselves, and turns on the spot where it likes. Medians
of wall time; lengths are those of the path in the plane.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import cases, nav2_pairs
from benchmarks.latency import planner_of
from benchmarks.tables import show
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Disc, OccupancyMap
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Problem

BODY = Disc(0.20)
HEIGHTS = (0.05, 0.15)  # [m] of the points above a cell
REPEATS = 9
BASE = [0, 1, 2]  # joints: x, y, heading


def points_of(cells: OccupancyMap) -> np.ndarray:
    """The middles of blocked cells (n, 3), at every height."""
    row, column = np.nonzero(cells.blocked)
    middles = cells.resolution * np.stack([column + 0.5, row + 0.5], axis=1)
    places = SE2(cells.origin).act(middles)
    return np.concatenate(
        [np.column_stack([places, np.full(len(places), height)]) for height in HEIGHTS]
    ).astype(np.float32)


def robot_on(cells: OccupancyMap) -> object:
    """A planner for the base alone."""
    from nav_planning._ompl_vamp import OmplVampPlanner

    robot = OmplVampPlanner("locobot", BASE, [0.0] * 5)
    robot.add_pointcloud(points_of(cells), 0.5 * cells.resolution)
    return robot


def length(path: np.ndarray) -> float:
    """Length [m] of a path (n, 2 or more) in the plane."""
    return float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum())


def driven(plan: Plan) -> float:
    """Length [m] of a plan."""
    speeds = np.array([np.hypot(*trim.body_velocity[:2]) for trim in plan.trims])
    return float(speeds @ plan.durations)


def theirs(robot: object, problem: Problem, *, simplify: bool) -> tuple[float, float]:
    """Time [ms] and length [m] of a path, medians; infinite without one."""
    ms, lengths = [], []
    goal = np.array(problem.goals[0].pose)
    for _ in range(REPEATS):
        began = time.perf_counter()
        found = robot.plan(np.array(problem.start), goal, "rrtc", 5.0, simplify, False)
        ms.append(1e3 * (time.perf_counter() - began))
        path = robot.interpolate_path(found.path, resolution=64.0) if found.solved else None
        lengths.append(length(path) if path is not None else np.inf)
    return float(np.median(ms)), float(np.median(lengths))


def ours(problem: Problem) -> tuple[float, float, float, float]:
    """Time [ms] and length [m] of the first word, time of the audited answer; length at 0.1 s."""
    planner = planner_of(problem, replace(problem.search, improve=False))
    firsts, answers = [], []
    for _ in range(REPEATS):
        began = time.perf_counter()
        result = planner.plan(problem.start, problem.goals)
        answers.append(1e3 * (time.perf_counter() - began))
        if result.plan is None:
            return np.inf, np.inf, np.inf, np.inf
        firsts.append(1e3 * result.timing_s["first_plan"])
    longer = planner_of(problem, problem.search).plan(problem.start, problem.goals, time_limit=0.1)
    assert longer.plan is not None
    return (
        float(np.median(firsts)),
        driven(result.plan),
        float(np.median(answers)),
        driven(longer.plan),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=20)
    options = parser.parse_args()
    if not cases.present("nav2-maps"):
        return
    rows = []
    for name in nav2_pairs.MAPS:
        cells = cases.nav2_map(name, unknown_blocked=True)
        robot = robot_on(cells)
        low, high = cells.origin[:2], cells.origin[:2] + cells.extent
        turns = [np.pi, 0.1, 0.1]  # of the base and of the camera
        robot.set_joint_limits(np.append(low, np.negative(turns)), np.append(high, turns))
        found = []
        for problem in nav2_pairs.pairs(cells, BODY, options.pairs, 1):
            ends = [np.array(problem.start), np.array(problem.goals[0].pose)]
            if all(robot.validate(end) for end in ends):
                quick = theirs(robot, problem, simplify=False)
                smooth = theirs(robot, problem, simplify=True)
                found.append([*ours(problem), *quick, *smooth])
        medians = np.median(np.array(found), axis=0)
        sooner = sum(row[0] < row[4] for row in found)
        rows.append([name, len(found), *(f"{one:.3g}" for one in medians), f"{sooner}"])
    titles = ["map", "pairs", "first [ms]", "length [m]", "audited [ms]", "at 0.1 s [m]"]
    titles += ["RRT-Connect [ms]", "length [m]", "simplified [ms]", "length [m]", "ours sooner"]
    show(titles, rows)


if __name__ == "__main__":
    main()
