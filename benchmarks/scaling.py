"""How planning time grows with the size of the map, and with the length of the path.

``python benchmarks/scaling.py [--time-limit S] [--queries N]``: a car in fields of boxes of
one density; 40 m as the crow flies in fields of 60 to 480 m, then 20 to 320 m in one of 400 m.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.ours import Run, solve, warm_up
from benchmarks.tables import median, show
from tests.scenes import field_query

SIDES, APART = (60.0, 120.0, 240.0, 480.0), 40.0  # [m]
LENGTHS, SIDE = (20.0, 40.0, 80.0, 160.0, 320.0), 400.0  # [m]


def measured(side: float, apart: float, *, queries: int, time_limit: float) -> list[Run]:
    problems = [field_query(side, apart, seed=seed) for seed in range(queries)]
    warm_up(problems[0])
    return [solve(problem, time_limit=time_limit) for problem in problems]


def row(words: str, boxes: int, runs: list[Run]) -> list[object]:
    return [
        words, boxes, f"{sum(run.found for run in runs)}/{len(runs)}",
        1e3 * median(run.first_s for run in runs),
        1e3 * max(run.first_s for run in runs),
        median(run.improvements[0][1] for run in runs if run.found),
        median(run.cost for run in runs),
        1e3 * median(run.check_s for run in runs),
        int(median(run.counts.get("expansions", 0) for run in runs)),
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=0.5)
    parser.add_argument("--queries", type=int, default=10)
    options = parser.parse_args()
    header = ["obstacles", "found", "first [ms]", "worst [ms]", "first cost [m]", "final cost [m]",
              "check [ms]", "expansions"]  # fmt: skip
    for title, cases in (
        ("side of the map", [(f"{side:g} m", side, APART) for side in SIDES]),
        ("start to goal", [(f"{apart:g} m", SIDE, apart) for apart in LENGTHS]),
    ):
        rows = []
        for words, side, apart in cases:
            runs = measured(side, apart, queries=options.queries, time_limit=options.time_limit)
            rows.append(row(words, len(runs[0].problem.obstacles), runs))
        show([title, *header], rows)
        print()


if __name__ == "__main__":
    main()
