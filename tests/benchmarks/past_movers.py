"""How long one vehicle's query past all others of a fleet takes, each of them a moving obstacle.

``python tests/benchmarks/past_movers.py [--file FILE] [--every N] [--repeats N]``: a published
fleet of 50 cars is planned; then every fifth of its cars anew, past the plans of the 49 others, on
a `Planner` that is prepared. Seconds of one processor: to the first word proven free, and to the
answer that FCL and the audit have passed.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

import maneuver_automaton as ma
from maneuver_automaton.fleet import FleetProblem, FleetResult, plan_fleet
from maneuver_automaton.problem import Problem
from maneuver_automaton.scenario import load_scenario
from maneuver_automaton.scenario.fleet import FleetScenario
from tests.benchmarks.fleets import DATA
from tests.benchmarks.latency import planner_of
from tests.benchmarks.tables import show

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


def main() -> None:
    """Plan the fleet, and some of its vehicles again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--file", type=Path, default=FILE)
    parser.add_argument("--every", type=int, default=5)
    parser.add_argument("--repeats", type=int, default=15)
    arguments = parser.parse_args()
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


if __name__ == "__main__":
    main()
