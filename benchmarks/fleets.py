"""Several vehicles: the published sets of CL-CBS and db-CBS, beside what those planners report.

``python benchmarks/fleets.py [NAME ...] [--seconds S] [--jobs N]``: every file of
``../shared/data/fleet`` whose name holds one of the words. Printed are how many vehicles have a
plan, the sum of their arrivals alone and together, when the last arrives, processor time to the
first feasible fleet and in all, the least distance of two bodies by shapely at 5 ms, and the least
published sum (as reported, or of arrivals on the planner's clock).
"""

from __future__ import annotations

import argparse
import csv
import itertools
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import shapely

from benchmarks import cases
from benchmarks.tables import show
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import carried
from maneuver_automaton.collision.surroundings import ShapePart, parts_of
from maneuver_automaton.fleet import FleetProblem, FleetResult, plan_fleet
from maneuver_automaton.scenario import load_scenario

DATA = cases.DATA / "fleet"
STEP = 0.005  # [s] between two looks at the bodies
BLOCK = 2000  # looks at once


def files(words: list[str]) -> list[Path]:
    """The files of the set whose names hold one of the words; all without any."""
    every = sorted(DATA.glob("*-cbs/*.yaml"))
    return [path for path in every if not words or any(word in path.name for word in words)]


def published() -> dict[str, float]:
    """The least sum that is published for an instance."""
    best: dict[str, float] = {}
    with (DATA / "published.csv").open() as file:
        for row in csv.DictReader(file):
            for text in (row["arrival_sum_s"], row["flowtime_s"]):
                if text and row["solved"] == "True":
                    best[row["instance"]] = min(best.get(row["instance"], math.inf), float(text))
    return best


def bodies(fleet: FleetProblem, result: FleetResult) -> Iterator[list[tuple[ShapePart, Plan]]]:
    """Parts of every vehicle with the plans of their frames."""
    for name, problem in zip(fleet.names, fleet.problems, strict=True):
        plan = result.plans.get(name)
        if plan is None:
            continue
        parts = [(part, plan) for part in parts_of(problem.footprint)]
        for carried_name, shapes in problem.parts.items():
            behind = carried(plan, problem.automaton.model, carried_name)
            parts += [(part, behind) for part in parts_of(shapes)]
        yield parts


def least_distance(fleet: FleetProblem, result: FleetResult) -> float:
    """Least distance [m] of any two bodies at short steps until all have arrived."""
    every = list(bodies(fleet, result))
    times = np.arange(0.0, result.last_s + 1.0, STEP)
    least = math.inf
    for begin in range(0, len(times), BLOCK):
        now = times[begin : begin + BLOCK]
        placed = []
        for parts in every:
            rows = []
            for part, plan in parts:
                clock = np.clip(now, plan.start_time, plan.start_time + plan.duration)
                poses = plan.pose_at(clock)[:, :3]
                core = part.at(poses)
                rows.append((core, part.radius, shapely.bounds(core)))
            placed.append(rows)
        for one, other in itertools.combinations(placed, 2):
            for (a, r_a, box_a), (b, r_b, box_b) in itertools.product(one, other):
                gap = np.maximum(box_a[:, :2] - box_b[:, 2:], box_b[:, :2] - box_a[:, 2:])
                near = np.flatnonzero(gap.max(axis=1) - r_a - r_b <= min(least, 5.0))
                if near.size:
                    apart = shapely.distance(a[near], b[near]) - r_a - r_b
                    least = min(least, float(apart.min()))
    return least


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    if not cases.present("fleet"):
        return
    best, rows = published(), []
    for path in files(given.words):
        fleet = load_scenario(path).fleet
        began, firsts = time.process_time(), []
        result = plan_fleet(
            fleet,
            time_limit=given.seconds,
            seed=given.seed,
            jobs=given.jobs,
            on_better=lambda s, v, b=began, f=firsts: f.append(time.process_time() - b),
        )
        took = time.process_time() - began
        alone = result.lower_bound
        name = path.stem
        rows.append(
            [name, f"{len(result.plans)}/{len(fleet)}", alone, result.alone_cost, result.sum_s,
             result.last_s, firsts[0] if firsts else math.inf, took,
             least_distance(fleet, result), best.get(name, math.inf)]
        )  # fmt: skip
        print(name, *(f"{x:.4g}" if isinstance(x, float) else x for x in rows[-1][1:]), flush=True)
        for who, why in result.reasons.items():
            print(f"  {who}: {why}", flush=True)
    print()
    show(
        ["instance", "planned", "bound", "alone", "sum [s]", "last [s]", "first [s cpu]", "[s cpu]",
         "least [m]", "published"],
        rows,
    )  # fmt: skip


if __name__ == "__main__":
    main()
