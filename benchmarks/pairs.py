"""Exact goals and the law of the project, on random pairs of poses.

``python benchmarks/pairs.py``: terminal errors of 10,000 random pairs; words and costs of
1,000 pairs and of the same moved by a random group element, by words and by insertion.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from maneuver_automaton.audit import terminal_error
from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search import search_insertion, search_words
from tests.search.cases import PARKING_COST, TABLE_2, robot

LIBRARY = robot(TABLE_2)


def random_pose(rng: np.random.Generator, reach: float = 5.0) -> np.ndarray:
    return np.array([*rng.uniform(-reach, reach, 2), rng.uniform(-np.pi, np.pi)])


def exactness(pairs: int) -> None:
    rng = np.random.default_rng(11)
    worst, solved = 0.0, 0
    for _ in range(pairs):
        problem = Problem(
            LIBRARY,
            random_pose(rng),
            random_pose(rng),
            cost=PARKING_COST,
            horizon=Horizon(max_trims=4),
        )
        found = search_words(problem, problem.goals[0]).solutions
        if found:
            trims = tuple(LIBRARY.trims[k] for k in found[0].trims)
            plan = Plan(problem.start, trims, durations=found[0].durations)
            error = terminal_error(plan, problem.goals[0])
            worst = max(worst, error.position_m, error.heading_rad)
            solved += 1
    print(f"{solved} of {pairs} pairs solved, largest terminal error {worst:.1e} (need 1e-9)")


def law(pairs: int) -> None:
    cases = (
        ("words, T = 12", search_words, Horizon(time=12.0, max_trims=4), PARKING_COST),
        ("words, free T", search_words, Horizon(max_trims=4), Cost(effort=1.0, time=0.3)),
        ("insertion, T = 15", search_insertion, Horizon(time=15.0), PARKING_COST),
        ("insertion, free T", search_insertion, Horizon(), Cost(effort=1.0, time=0.3)),
    )
    for name, search, horizon, cost in cases:
        rng = np.random.default_rng(5)
        other_words, unsolved, worst = 0, 0, 0.0
        for _ in range(pairs):
            problem = Problem(
                LIBRARY, random_pose(rng, 3.0), random_pose(rng, 3.0), cost=cost, horizon=horizon
            )
            moved = problem.moved(SE2(random_pose(rng, 10.0)))
            one = search(problem, problem.goals[0]).solutions
            two = search(moved, moved.goals[0]).solutions
            if not one or not two:
                unsolved += 1
                other_words += bool(one) != bool(two)
                continue
            other_words += one[0].trims.tolist() != two[0].trims.tolist()
            worst = max(worst, abs(one[0].cost - two[0].cost))
        print(
            f"{name}: {pairs} moved pairs, {other_words} with another word, {unsolved} out of "
            f"reach in the time, largest difference in cost {worst:.1e} (need 1e-9)"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=10_000)
    parser.add_argument("--moved", type=int, default=1_000)
    options = parser.parse_args()
    exactness(options.pairs)
    law(options.moved)


if __name__ == "__main__":
    main()
