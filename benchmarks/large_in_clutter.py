"""Large libraries among obstacles: what 1,681 trims gain over six, and what they take.

``python benchmarks/large_in_clutter.py [--queries N] [--seconds S] [--costs NAME ...]``

A car in fields of 25 and 150 boxes (`scenes.field_query`), with the six trims of Reeds and Shepp
and a rest, and with 41 speeds times 41 steering angles, the two side by side in one run. Costs:
time; time and effort, the effort as costly and four times so; the effort in a fixed time, 1.6
times the shortest. Medians over the queries: time to the first plan; cost, in that of six trims,
with the mean and the largest; when the cost is that of six trims at their end (but for 0.1 %), and
that in the time six trims took. A ratio below 1 is a gain.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import maneuver_automaton as ma
from maneuver_automaton import Automaton, Cost, Horizon, PlanResult, Problem
from maneuver_automaton.models import Car
from tests import scenes

STEERING = 0.6  # [rad]
CAR = Car(wheelbase=2.8, max_steering=STEERING)
FIELDS = {"25 boxes": (50.0, 35.0), "150 boxes": (122.0, 85.0)}  # [m] side, apart
COSTS = {
    "time": Cost(time=1.0),
    "mixed": Cost(time=1.0, effort=1.0),
    "costly effort": Cost(time=1.0, effort=4.0),
    "effort in T": Cost(effort=1.0),
}
LONGER = 1.6  # the fixed time, in that of the shortest plan
AS_GOOD = 1e-3  # share by which a cost may exceed that of six trims


def six() -> Automaton:
    """Full speed ahead and back, straight and as sharp as possible, and rest."""
    angles = (STEERING, 0.0, -STEERING)
    pairs = [(speed, angle) for speed in (1.0, -1.0) for angle in angles]
    return Automaton.of_controls(CAR, {f"{v:g} {a:g}": (v, a) for v, a in [(0.0, 0.0), *pairs]})


def large(count: int = 41) -> Automaton:
    """So many speeds times as many steering angles."""
    axis = np.linspace(-1.0, 1.0, count)
    return Automaton.of_grid(CAR, [np.round(axis, 12), np.round(STEERING * axis, 12)])


LIBRARIES = {"six": six(), "large": large()}


def problems(field: str, what: str, seed: int) -> dict[str, Problem]:
    """One query for both libraries."""
    base = scenes.field_query(*FIELDS[field], seed=seed)
    horizon = Horizon()
    if what == "effort in T":
        quick = ma.plan(replace(base, automaton=LIBRARIES["six"]), time_limit=1.0)
        horizon = Horizon(time=round(LONGER * quick.cost, 1))
    return {
        name: replace(base, automaton=library, cost=COSTS[what], horizon=horizon)
        for name, library in LIBRARIES.items()
    }


def when(result: PlanResult, cost: float) -> float:
    """When a plan of so little cost was found [s]."""
    return next((at for at, found in result.improvements if found <= cost), math.nan)


def measure(field: str, what: str, queries: int, seconds: float) -> None:
    rows = []
    for seed in range(queries):
        asked = problems(field, what, seed)
        order = list(asked) if seed % 2 else list(asked)[::-1]
        for name in order:  # the map is prepared, and everything is loaded
            ma.plan(asked[name], time_limit=0.05)
        found = {name: ma.plan(asked[name], time_limit=seconds) for name in order}
        if any(one.plan is None for one in found.values()):
            print(f"  {field}, {what}, query {seed}: no plan with", end=" ")
            print(", ".join(name for name, one in found.items() if one.plan is None))
            continue
        few, many = found["six"], found["large"]
        goal = few.cost * (1.0 + AS_GOOD)
        firsts = [1e3 * one.timing_s["first_plan"] for one in (few, many)]
        rows.append([*firsts, many.cost / few.cost, when(few, goal), when(many, goal)])
    if not rows:
        return
    table = np.array(rows)
    slower = np.nan_to_num(table[:, 4] / table[:, 3], nan=math.inf)
    ratio = table[:, 2]
    print(
        f"{field:>10} {what:>12} {len(rows):4d}"
        f" {np.median(table[:, 0]):9.2f} {np.median(table[:, 1]):9.2f}"
        f" {np.median(ratio):9.4f} {ratio.mean():9.4f} {ratio.max():9.4f}"
        f" {np.median(table[:, 3]):9.3f} {np.nanmedian(table[:, 4]):9.3f} {np.median(slower):9.3f}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--queries", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--costs", nargs="+", default=list(COSTS), choices=list(COSTS))
    parser.add_argument("--fields", nargs="+", default=list(FIELDS), choices=list(FIELDS))
    options = parser.parse_args()
    print("                              first plan [ms]        cost, of six       as good [s]")
    print("     field         cost    n       six     large    median      mean       max", end="")
    print("       six     large     ratio")
    for field in options.fields:
        for what in options.costs:
            measure(field, what, options.queries, options.seconds)


if __name__ == "__main__":
    main()
