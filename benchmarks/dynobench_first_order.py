"""The first-order unicycles of dynobench, least time, beside the best published costs.

``python benchmarks/dynobench_first_order.py [--time-limit S]``: exact goal and body. The
published plans may miss the goal by 0.03 and keep some 0.03 m clear; a column tells the best time
with such a tolerance, and the lower bound says where the exact optimum is above what is published.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import cases
from benchmarks.ours import failures, rejected, solve, warm_up
from benchmarks.tables import show, verdict
from maneuver_automaton.problem import Problem

FIRST_MS = 100.0
TOLERANCE = 0.03  # of their checker: distance, and half the angle


def best_known(name: str) -> float:
    """The lower of the two published costs [s]."""
    row = next(r for r in cases.table("dynobench/best-known-costs.csv") if r["problem"] == name)
    columns = ("best_published_solution_file_cost_s", "best_table_cost_s")
    return min(float(row[column]) for column in columns if row[column])


def tolerant(problem: Problem) -> Problem:
    """The same with the goal's tolerance of their checker."""
    goals = tuple(
        replace(goal, tolerance_m=TOLERANCE, tolerance_rad=2.0 * TOLERANCE)
        for goal in problem.goals
    )
    return replace(problem, goals=goals)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=5.0)
    options = parser.parse_args()
    if not cases.present("dynobench"):
        return
    rows, runs = [], {}
    for name in cases.FIRST_ORDER:
        problem = cases.dynobench(name)
        warm_up(problem)
        run = solve(problem, time_limit=options.time_limit)
        loose = solve(tolerant(problem), time_limit=options.time_limit)
        opinion, known = run.second_opinion(), best_known(name)
        rows.append([
            name, run.status, 1e3 * run.first_s, verdict(1e3 * run.first_s <= FIRST_MS),
            run.cost_at(0.1), run.cost_at(1.0), run.cost, known, verdict(run.cost <= known + 1e-9),
            run.lower_bound, loose.cost if loose.found else loose.status,
            math.nan if opinion is None else opinion.clearance_m,
            run.audited, opinion is not None and opinion.passes(run.problem, run.goal_index),
        ])  # fmt: skip
        runs[name] = run
    show(["problem", "status", "first [ms]", f"<= {FIRST_MS:g}", "at 0.1 s", "at 1 s",
          "final [s]", "published", "aim", "lower bound", "with tolerance", "clear [m]",
          "audit", "sound"], rows)  # fmt: skip
    print(rejected(list(runs.values())))
    print(*failures(runs), sep="\n")


if __name__ == "__main__":
    main()
