"""Random scenes in which no bound may exceed any plan.

``python benchmarks/random_bounds.py [--scenes N] [--first N] [--work W ...] [--limits S ...]
[--json FILE]``: goals and obstacles by a seed for the vehicles of the feature matrix, with a cost
that is drawn as well (length, time, effort, prices of direction changes). The bound knows no plan
("uncut": what is proven of plans cheaper than an incumbent cannot exceed it), and is proven with
every amount of work; plans are those of every time limit. A bound above a plan is printed.
"""

from __future__ import annotations

import argparse
import collections
import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import maneuver_automaton as ma
from benchmarks.random_plans import LEFT_OUT, drawn
from benchmarks.tables import median, show
from maneuver_automaton.planning.proving import known_bound, proofs_of
from maneuver_automaton.problem import Problem, SearchSettings
from tests.matrix.vehicles import VEHICLES

HEAVY = 8  # every so many scenes is one with inertia, whose plans take longer
ROUNDING = 1e-9  # relative


def scene(seed: int) -> tuple[str, Problem]:
    """A vehicle, its scene and a cost, by a seed."""
    rng = np.random.default_rng([seed, 11])
    kinds = [v for v in VEHICLES.values() if v.name not in LEFT_OUT]
    inert = seed % HEAVY == HEAVY - 1
    vehicle = kinds[int(rng.choice([k for k, v in enumerate(kinds) if v.inertia == inert]))]
    problem, _ = drawn(vehicle, seed)
    drawn_cost = [
        ma.Cost(length=1.0),
        ma.Cost(time=1.0),
        ma.Cost(time=1.0, effort=float(rng.uniform(0.0, 2.0))),
        ma.Cost(length=1.0, direction_change=float(rng.choice([0.3, 1.0, 3.0]))),
        ma.Cost(time=0.5, length=float(rng.uniform(0.1, 2.0)), direction_change=0.5),
    ]
    cost = drawn_cost[int(rng.integers(1, 3) if inert else rng.integers(len(drawn_cost)))]
    return vehicle.name, replace(problem, cost=cost, search=SearchSettings())


def tried(seed: int, works: list[float], limits: list[float]) -> dict[str, Any] | None:
    """Bounds and plans of a scene; None where no plan was found, or nothing is proven."""
    name, problem = scene(seed)
    costs = [ma.plan(problem, time_limit=limit).cost for limit in limits]
    found = [cost for cost in costs if cost is not None]
    if not found:
        return None
    best = min(found)
    bounds = {"formula": known_bound(problem).value}
    for work in works:
        for proof in proofs_of(
            problem, incumbent=lambda: math.inf, ends=lambda done, most=work: done >= most
        ):
            bounds[f"{work:g}"] = proof.value
    return {"seed": seed, "vehicle": name, "cost": best, "bounds": bounds}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--work", nargs="*", type=float, default=[1e6])
    parser.add_argument("--limits", nargs="*", type=float, default=[0.3])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    records: list[dict[str, Any]] = []
    wrong, seed = 0, options.first
    while len(records) < options.scenes:
        one = tried(seed, options.work, options.limits)
        seed += 1
        if one is None:
            continue
        records.append(one)
        if max(one["bounds"].values()) > one["cost"] * (1.0 + ROUNDING):
            wrong += 1
            print(f"wrong: {one}", flush=True)
        if options.json and len(records) % 20 == 0:
            options.json.write_text(json.dumps(records, indent=1))
        if sys.stderr.isatty():
            print(f"\r{len(records)} scenes, {wrong} wrong", end="", file=sys.stderr)
    by = collections.defaultdict(list)
    for one in records:
        by[one["vehicle"]].append(max(one["bounds"].values()) / one["cost"])
    show(
        ["vehicle", "scenes", "bound / cost, median", "most"],
        [[name, len(shares), median(shares), max(shares)] for name, shares in by.items()],
    )
    print(f"{len(records)} scenes, {wrong} bounds above a plan")


if __name__ == "__main__":
    main()
