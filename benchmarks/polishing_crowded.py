"""Polishing among 45 obstacles, by seed: whether free planes finish, and what an iteration takes.

``python benchmarks/polishing_crowded.py [--seeds N] [--time-limit S]``: the car of
`scenarios/tpcap_full.yaml` drives from rest to rest through boxes at random. Seconds are those of
the processor, so that other work on the machine changes nothing.
"""

from __future__ import annotations

import time

time.monotonic = time.process_time  # before the package is imported, which keeps the function

import argparse  # noqa: E402
import sys  # noqa: E402
from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

import maneuver_automaton as ma  # noqa: E402
from benchmarks.tables import show  # noqa: E402
from maneuver_automaton.collision import Box, Obstacle  # noqa: E402
from maneuver_automaton.problem import Goal, Problem  # noqa: E402
from maneuver_automaton.refinement import polish as polishing  # noqa: E402

COUNT = 45
END = (26.0, 8.0, 0.5)
CLEAR = 4.5  # [m] around both ends
HEAD = ("seed", "status", "kinematic [s]", "T [s]", "free planes", "finished", "iterations",
        "ms each", "CPU [s]", "audit")  # fmt: skip


def crowded(seed: int) -> Problem:
    """A scene: boxes between and around both ends, none near them."""
    rng = np.random.default_rng([seed, 45])
    boxes: list[Obstacle] = []
    while len(boxes) < COUNT:
        at = rng.uniform([-6.0, -10.0], [34.0, 18.0])
        if min(np.hypot(*(at - end)) for end in ((1.4, 0.0), END[:2])) > CLEAR:
            boxes.append(Obstacle(Box(rng.uniform(0.4, 2.0, 2), at, rng.uniform(0.0, 3.0))))
    base = ma.load_scenario(ROOT / "scenarios/tpcap_full.yaml").problem
    return replace(base, start=np.zeros(3), goals=(Goal(pose=END),), obstacles=tuple(boxes))


def main() -> None:
    """Plan every scene and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--time-limit", type=float, default=10.0)
    options = parser.parse_args()
    solve, solved = polishing.polish, []

    def noted(*given: Any, **how: Any) -> Any:
        found = solve(*given, **how)
        solved.append((not how.get("fixed_planes") and not how.get("elastic"), found))
        return found

    polishing.polish = noted  # type: ignore[assignment]
    rows = []
    for seed in [0, *range(options.seeds)]:  # the first one twice: it loads
        solved.clear()
        began = time.process_time()
        result = ma.plan(crowded(seed), time_limit=options.time_limit)
        spent = time.process_time() - began
        free = [found for is_free, found in solved if is_free]
        iterations = sum(found.iterations for _, found in solved)
        each = 1e3 * sum(found.solve_s for _, found in solved) / max(iterations, 1)
        ended = sum(found.status.value == "solved" for found in free)
        first = result.improvements[0][1] if result.improvements else float("nan")
        rows.append((seed, result.status.value, f"{first:.2f}", f"{result.cost or 0.0:.3f}",
                     len(free), ended, iterations, f"{each:.1f}", f"{spent:.1f}",
                     bool(result.audit and result.audit.passed)))  # fmt: skip
    show(HEAD, rows[1:])


if __name__ == "__main__":
    main()
