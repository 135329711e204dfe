"""The ten parking cases of TPCAP for the kinematic car, beside the published plans.

``python benchmarks/tpcap_cases.py [--time-limit S] [--direction-price M]``: cost = length,
steering and speed change at once. The published plans keep limits of acceleration and steering
rate, and some touch obstacles: their lengths are a scale.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import cases
from benchmarks.ours import failures, rejected, solve, warm_up
from benchmarks.tables import median, show, verdict
from maneuver_automaton.costs import Cost

FIRST_MS = 100.0


def published(case: int) -> tuple[str, str]:
    """The shortest published length [m] and its planner; the fewest changes and theirs."""
    rows = [row for row in cases.table("tpcap/published-results.csv")
            if row["case"] == str(case) and row["path_length_m"]]  # fmt: skip
    if not rows:
        return "-", "-"
    short = min(rows, key=lambda row: float(row["path_length_m"]))
    few = min(rows, key=lambda row: (int(row["gear_changes"]), float(row["path_length_m"])))
    return (
        f"{float(short['path_length_m']):.2f} ({short['gear_changes']}, {_word(short)})",
        f"{float(few['path_length_m']):.2f} ({few['gear_changes']}, {_word(few)})",
    )


def _word(row: dict[str, str]) -> str:
    return row["planner"].split(" ")[0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=5.0)
    parser.add_argument("--direction-price", type=float, default=0.0,
                        help="[m] per change of direction")  # fmt: skip
    options = parser.parse_args()
    if not cases.present("tpcap"):
        return
    cost = Cost(time=1.0, direction_change=options.direction_price)
    problems = {n: replace(problem, cost=cost) for n, problem in cases.tpcap().items()}
    warm_up(next(iter(problems.values())))
    runs = {n: solve(problem, time_limit=options.time_limit) for n, problem in problems.items()}
    rows = []
    for n, run in runs.items():
        opinion = run.second_opinion()
        rows.append([
            n, run.status, 1e3 * run.first_s, run.improvements[0][1] if run.found else "-",
            run.length_m, run.direction_changes, *published(n), 1e3 * run.check_s,
            "-" if opinion is None else opinion.clearance_m,
            run.audited, opinion is not None and opinion.passes(run.problem, run.goal_index),
        ])  # fmt: skip
    show(["case", "status", "first [ms]", "first cost", "length [m]", "changes",
          "shortest published (changes)", "fewest changes published", "check [ms]", "clear [m]",
          "audit", "sound"], rows)  # fmt: skip
    print(*failures({f"case {n}": run for n, run in runs.items()}), sep="\n")
    solved = sum(run.found and run.sound() for run in runs.values())
    middle = 1e3 * median(run.first_s for run in runs.values())
    print(f"solved and sound: {solved} of {len(runs)}: {verdict(solved == len(runs))}; first plan, "
          f"median {middle:.2f} ms, aim {FIRST_MS:g}: {verdict(middle <= FIRST_MS)}; "
          f"{rejected(list(runs.values()))}")  # fmt: skip


if __name__ == "__main__":
    main()
