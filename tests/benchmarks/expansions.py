"""Expansions per second of the search alone: slots that cannot be entered.

``python tests/benchmarks/expansions.py [--time-limit S] [--repeats N]``: the car is to enter a slot
2 cm longer than itself, in fields of several sizes, empty or with boxes, so that the search runs
until the limit or until every resolution is exhausted, and nothing is ever improved.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.benchmarks.ours import solve, warm_up
from tests.benchmarks.tables import median, show, verdict
from tests.scenes import no_way_in

AIM = 0.5e6  # expansions per second
FIELDS = ((30.0, 0.0), (100.0, 0.0), (30.0, 0.01), (100.0, 0.01))  # [m], boxes per square metre


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=1.0)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    rows = []
    for side, density in FIELDS:
        problem = no_way_in(side, density=density)
        warm_up(problem)
        runs = [solve(problem, time_limit=options.time_limit) for _ in range(options.repeats)]
        rates = [run.counts["expansions"] / run.search_s for run in runs]
        rows.append([
            f"{side:g} m", len(problem.obstacles), runs[0].status,
            int(median(run.counts["expansions"] for run in runs)),
            median(run.search_s for run in runs), f"{1e-6 * median(rates):.3f}",
            verdict(median(rates) >= AIM),
        ])  # fmt: skip
    show(["field", "obstacles", "status", "expansions", "[s]", "million a second",
          f"aim {1e-6 * AIM:g}"], rows)  # fmt: skip


if __name__ == "__main__":
    main()
