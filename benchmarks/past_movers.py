"""How long one vehicle's query past all others of a fleet takes, each of them a moving obstacle.

``python benchmarks/past_movers.py [--file FILE] [--every N] [--repeats N]``: a published
fleet of 50 cars is planned; then every fifth of its cars anew, past the plans of the 49 others, on
a `Planner` that is prepared. Seconds of one processor: to the first word proven free, and to the
answer that FCL and the audit have passed. Then the proof of one motion, past ever more of these
plans (those turned about the middle of the place where there are not enough), with every mover
followed one by one and with slabs of time; and what it takes to make a world of them.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import maneuver_automaton as ma
from benchmarks.cases import present
from benchmarks.fleets import DATA
from benchmarks.latency import planner_of
from benchmarks.tables import show
from maneuver_automaton.collision import world
from maneuver_automaton.collision.advancement import free_times
from maneuver_automaton.fleet import FleetProblem, FleetResult, plan_fleet
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Problem
from maneuver_automaton.scenario import load_scenario
from maneuver_automaton.scenario.fleet import FleetScenario

FILE = DATA / "cl-cbs" / "map_100by100_obst50_agents50_ex4.yaml"


def past_others(fleet: FleetProblem, result: FleetResult, name: str) -> Problem:
    """A vehicle's own problem, with all others as moving obstacles; it stays at its goal."""
    rows = dict(zip(fleet.names, fleet.problems, strict=True))
    movers = [
        ma.Obstacle(shape, motion=ma.Motion.of_plan(result.plans[other]))
        for other, one in rows.items()
        if other != name
        for shape in one.footprint
    ]
    own = rows[name]
    return replace(
        own,
        obstacles=(*own.obstacles, *movers),
        search=replace(own.search, improve=False),
        horizon=ma.Horizon(stay=True),
    )


def timed(problem: Problem, repeats: int) -> tuple[float, float, float]:
    """[ms] to the first word and to the answer, medians; and the cost."""
    planner = planner_of(problem, problem.search)
    words, answers = [], []
    for _ in range(repeats + 1):
        begun = time.thread_time()
        result = planner.plan(problem.start, problem.goals)
        answers.append(time.thread_time() - begun)
        words.append(result.timing_s["first_plan"])
    return 1e3 * float(np.median(words[1:])), 1e3 * float(np.median(answers[1:])), result.cost


def turned_plans(fleet: FleetProblem, result: FleetResult) -> list[ma.Obstacle]:
    """All plans as moving obstacles, then a quarter turned about the middle of all, and so on."""
    plans = [
        ma.Obstacle(shape, motion=ma.Motion.of_plan(result.plans[name]))
        for name, one in zip(fleet.names, fleet.problems, strict=True)
        for shape in one.footprint
    ]
    poses = np.concatenate([one.motion.pose for one in plans])
    middle = np.append(0.5 * (poses[:, :2].min(axis=0) + poses[:, :2].max(axis=0)), 0.0)
    turns = [SE2(middle) @ SE2([0.0, 0.0, k * np.pi / 2.0]) @ SE2(-middle) for k in range(4)]
    return [one.moved(by) for by in turns for one in plans]


def of_one_motion(problem: Problem, movers: list[ma.Obstacle], n: int = 4000) -> list[float]:
    """Microseconds of one motion and milliseconds of a world, each without slabs and with them."""
    rng = np.random.default_rng(1)
    poses = np.concatenate([one.motion.pose for one in movers]) if movers else np.zeros((1, 3))
    low, high = poses[:, :2].min(axis=0), poses[:, :2].max(axis=0)
    last = max((one.motion.time[-1] for one in movers), default=1.0)
    begins = np.column_stack([rng.uniform(low, high, (n, 2)), rng.uniform(-np.pi, np.pi, n)])
    twists = problem.automaton.body_velocities[rng.integers(len(problem.automaton.trims), size=n)]
    more = {"durations": rng.uniform(0.2, 2.0, n), "times": rng.uniform(0.0, last, n)}
    found, answers = [], []
    for few in (sys.maxsize, world.FEW_MOVING):
        world.FEW_MOVING = few
        worlds, motions = [], []
        for _ in range(5):
            world.world_of.cache_clear()
            begun = time.thread_time()
            made = world.world_of(tuple(movers), problem.footprint, (0.0, 0.0, 0.0))
            worlds.append(1e3 * (time.thread_time() - begun))
            begun = time.thread_time()
            free = free_times(made, begins, twists=twists[:, :3], margin=0.005, **more)
            motions.append(1e6 / n * (time.thread_time() - begun))
        found += [float(np.median(motions)), float(np.median(worlds))]
        answers.append(free)
    assert (answers[0] == answers[1]).all()
    return found


def main() -> None:
    """Plan the fleet, and some of its vehicles again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--file", type=Path, default=FILE)
    parser.add_argument("--every", type=int, default=5)
    parser.add_argument("--repeats", type=int, default=15)
    arguments = parser.parse_args()
    if arguments.file == FILE and not present("fleet"):
        return
    scenario = load_scenario(arguments.file)
    if not isinstance(scenario, FleetScenario):
        parser.error(f"{arguments.file}: need a file of several vehicles")
    result = plan_fleet(scenario.fleet, time_limit=60.0, max_rounds=0)
    fleet = scenario.fleet
    rows = [
        (name, *timed(past_others(fleet, result, name), arguments.repeats))
        for name in fleet.names[:: arguments.every]
    ]
    show(["vehicle", "word [ms]", "answer [ms]", "cost"], rows)
    words, answers = (np.array([row[k] for row in rows]) for k in (1, 2))
    print(
        f"{len(rows)} queries past {len(fleet) - 1} others: word median "
        f"{np.median(words):.1f}, worst {words.max():.1f} ms; answer median "
        f"{np.median(answers):.1f}, worst {answers.max():.1f} ms"
    )
    movers = turned_plans(fleet, result)
    show(
        ["movers", "a motion [us]", "a world [ms]", "with slabs [us]", "[ms]"],
        [(n, *of_one_motion(fleet.problems[0], movers[:n])) for n in (0, 1, 3, 10, 49, 200)],
    )


if __name__ == "__main__":
    main()
