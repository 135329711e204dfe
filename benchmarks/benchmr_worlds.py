"""The polygon worlds of bench-mr with their robots' outlines, ours beside OMPL's planners.

``python benchmarks/benchmr_worlds.py [--time-limit S] [--repeats N] [--alone]``: one query
each in two car parks and a warehouse, turning radius 4 m, obstacles made convex.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import cases, peers
from benchmarks.side_by_side import run, show_ours, show_theirs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=5.0)
    parser.add_argument("--repeats", type=int, default=1, help="runs of each planner of OMPL")
    parser.add_argument("--alone", action="store_true", help="without OMPL")
    options = parser.parse_args()
    if not cases.present("bench-mr"):
        return
    planners = () if options.alone or not peers.available() else peers.PLANNERS
    pairs = run(
        cases.bench_mr(),
        planners=planners,
        time_limit=options.time_limit,
        repeats=options.repeats,
    )
    show_ours(pairs)
    for planner in planners:
        show_theirs(pairs, planner)


if __name__ == "__main__":
    main()
