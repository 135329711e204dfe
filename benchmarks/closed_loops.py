"""A thousand closed loops: do all arrive, and does any step break a guarantee?

``python benchmarks/closed_loops.py [--starts N] [--jobs N] [--noise]``: random initially
feasible starts (|x|, |y| <= 2 m, any heading), Table 2 of the paper as printed and with its fifth
trim reversed, and the 1681 trims of its Section 5.1; T = 8 and free; with ``--noise`` a normal
shift of 0.02 m per axis and 0.02 rad every step, and the goal a set of 0.15 m and 0.15 rad.
"""

from __future__ import annotations

import argparse
import collections
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.receding_horizon import Disturbance, Statistics, simulate_many
from maneuver_automaton.search.choose import search_goal
from tests.search.cases import TABLE_2, robot

T = 8.0
STEP = 1.0


def libraries() -> dict[str, Automaton]:
    printed = dict(TABLE_2)
    reversed_spin = {**printed, list(printed)[4]: (0.0, -1.0)}
    values = [round(-2.0 + 0.1 * k, 10) for k in range(41)]
    return {
        "Table 2 as printed": robot(printed),
        "Table 2, trim 5 reversed": robot(reversed_spin),
        "1681 trims": Automaton.of_grid(Unicycle(), [values, values]),
    }


def feasible_starts(problem: Problem, n: int) -> np.ndarray:
    """Random starts from which the least time to the goal is at most T."""
    rng = np.random.default_rng(7)
    hurry = replace(problem, cost=Cost(time=1.0), horizon=replace(problem.horizon, time=None))
    found: list[np.ndarray] = []
    while len(found) < n:
        pose = np.array([*rng.uniform(-2.0, 2.0, 2), rng.uniform(-np.pi, np.pi)])
        here = replace(hurry, start=pose)
        for result in search_goal(here, here.goals[0], alternatives=0):
            if result.solutions and result.solutions[0].duration <= T:
                found.append(pose)
                break
    return np.array(found)


def report(name: str, statistics: Statistics, seconds: float, *, noise: bool) -> None:
    outcomes = statistics.outcomes
    ms = 1e3 * statistics.solve_s
    print(
        f"{name}: {sum(one.reached for one in outcomes)} of {len(outcomes)} arrive, "
        f"{statistics.broken} of {len(ms)} steps break a guarantee; per step "
        f"{np.median(ms):.2f} ms median, {np.percentile(ms, 99):.2f} ms p99; "
        f"{np.mean([one.steps for one in outcomes]):.1f} steps a loop; {seconds:.0f} s"
    )
    if noise:
        inside = np.mean([one.share_inside for one in outcomes if one.reached])
        stayed = sum(one.stayed for one in outcomes)
        print(
            f"    {stayed} stay once they have arrived; inside at {inside:.1%} of the steps after"
        )
    causes = collections.Counter(
        violation.guarantee.value for one in outcomes for _, violation in one.violations
    )
    for cause, count in causes.most_common():
        print(f"    {count} x {cause}")
    unhappy = [one for one in outcomes if not one.reached or (noise and not one.stayed)]
    for one in unhappy[:10]:
        print(f"    from {one.start.round(4).tolist()}: {one.reason}")
    if not noise:
        for one in outcomes:
            for number, violation in one.violations[:1]:
                print(f"    from {one.start.tolist()}, step {number}: {violation}")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--starts", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--noise", action="store_true")
    parser.add_argument("--only", type=int, help="number of the library")
    chosen = parser.parse_args()
    for number, (name, automaton) in enumerate(libraries().items()):
        if chosen.only is not None and number != chosen.only:
            continue
        most = 4 if len(automaton) == 5 else None
        fixed = Problem(
            automaton,
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0],
            cost=Cost(effort=1.0),
            horizon=Horizon(time=T, max_trims=most),
        )
        starts = feasible_starts(fixed, chosen.starts)
        free = replace(fixed, cost=Cost(effort=1.0, time=1.0), horizon=Horizon(max_trims=most))
        for kind, problem in (("T = 8", fixed), ("free T", free)):
            disturbance, steps, stay = None, 100, False
            if chosen.noise:
                goal = Goal(pose=np.zeros(3), tolerance_m=0.15, tolerance_rad=0.15)
                problem = replace(problem, goals=(goal,))
                disturbance = Disturbance(position_m=0.02, heading_rad=0.02)
                steps, stay = 60, True
            began = time.perf_counter()
            statistics = simulate_many(
                problem,
                starts=starts,
                step=STEP,
                steps=steps,
                disturbance=disturbance,
                stay=stay,
                jobs=chosen.jobs,
            )
            report(f"{name}, {kind}", statistics, time.perf_counter() - began, noise=chosen.noise)


if __name__ == "__main__":
    main()
