"""Words and times that exhaustive search leaves out because of bounds: is an optimum among them?

``python benchmarks/words_left_out.py [--goals N]``: random goals, near and far, for the
paper's Table 2, Reeds and Shepp's trims, Dubins's, and trims of all radii, with a free time and at
most four trims. The complete list of solutions, for which nothing is left out, against the search
for the cheapest one: without an upper bound, and with the optimum as the upper bound, as in a
closed loop. An optimum is missed where the search finds none as cheap.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search import search_words
from tests.search.cases import DUBINS, REEDS_SHEPP, REVERSED_SPIN, TABLE_2, robot

EFFORT_AND_TIME = Cost(effort=1.0, time=1.0)
ALL_RADII = {"a": (1.0, 0.4), "b": (-0.7, 1.1), "c": (0.6, -0.9), "d": (0.9, 0.0), "e": (0.5, 1.3)}
CASES = (
    ("Table 2, effort and time", TABLE_2, EFFORT_AND_TIME),
    ("trim 5 reversed", REVERSED_SPIN, EFFORT_AND_TIME),
    ("Table 2, time", TABLE_2, Cost(time=1.0)),
    ("a price of switches", TABLE_2, Cost(effort=1.0, time=1.0, switch=0.3)),
    ("Reeds and Shepp", REEDS_SHEPP, Cost(time=1.0)),
    ("Dubins", DUBINS, Cost(time=1.0)),
    ("all radii", ALL_RADII, Cost(effort=1.0, time=0.5)),
)
SAME = 1e-9  # relative, between costs


def goals(n: int) -> np.ndarray:
    """Random goals: a third of them down to a centimetre away, some straight ahead or abeam."""
    rng = np.random.default_rng(99)
    far = np.column_stack([rng.uniform(-2.0, 2.0, (n, 2)), rng.uniform(-np.pi, np.pi, n)])
    near = rng.random(n) < 0.3
    far[near] *= 10.0 ** rng.uniform(-2.0, 0.0, (int(near.sum()), 3))
    far[rng.random(n) < 0.1, 1] = 0.0
    far[rng.random(n) < 0.1, 2] = 0.0
    return far


def compared(automaton: Automaton, cost: Cost, goal: np.ndarray) -> tuple[int, np.ndarray]:
    """How many of two searches miss the optimum, and the time of the complete one and of these."""
    one = Problem(automaton, np.zeros(3), goal, cost=cost, horizon=Horizon(max_trims=4))
    clock = [time.process_time()]
    everything = search_words(one, one.goals[0], alternatives=None).solutions
    clock.append(time.process_time())
    best = everything[0].cost if everything else np.inf
    missed = 0
    for upper_bound in (np.inf, best):
        found = search_words(one, one.goals[0], upper_bound=upper_bound, ties=True).solutions
        clock.append(time.process_time())
        cost_found = found[0].cost if found else np.inf
        missed += cost_found > best + SAME * (1.0 + best)
    return missed, 1e3 * np.diff(clock)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--goals", type=int, default=250, help="for each library")
    options = parser.parse_args()
    n_missed = n_goals = 0
    print("                             goals  missed  ms, median: all solutions  the best  known")
    for name, controls, cost in CASES:
        automaton = robot(controls)
        rows = [compared(automaton, cost, goal) for goal in goals(options.goals)]
        missed = sum(row for row, _ in rows)
        ms = np.median([times for _, times in rows], axis=0)
        print(f"  {name:<26} {len(rows):>5} {missed:>7} {ms[0]:>26.2f} {ms[1]:9.2f} {ms[2]:6.2f}")
        n_missed, n_goals = n_missed + missed, n_goals + len(rows)
    print(f"{n_goals} goals, {2 * n_goals} searches: {n_missed} optima missed")


if __name__ == "__main__":
    main()
