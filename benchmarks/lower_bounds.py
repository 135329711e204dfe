"""How far plans may be from the optimum: bounds proven after 1, 10 and 60 s of processor time.

``python benchmarks/lower_bounds.py [--groups cars slots ...] [--only NAME] [--every K]
[--seconds 1 10 60] [--plan-limit S] [--json FILE]``: cost of the plan found, the bound that needs
no search, and the one that is proven, with the gap to the cost and the kind of bound that won. Each
time is a run of its own. Costs are the length, and the length with a price of 0.5 for each change
of direction; with inertia, and where a case states a cost of its own, the time.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import maneuver_automaton as ma
from benchmarks import cases
from benchmarks.tables import median, show
from maneuver_automaton.planning.proving import POLISHING, known_bound, proofs_of
from maneuver_automaton.problem import Problem
from tests import scenes

PRICE = 0.5  # of a change of direction
SLOTS = (5.2, 5.3, 5.4, 5.5, 5.6, 5.7, 5.8, 5.9)  # [m]
AIMS = {"slots": 0.05, "bays": 0.05, "cars": 0.10, "corridors": 0.10}  # after 10 s, length alone


def by_length(problems: dict[str, Problem]) -> Iterator[tuple[str, Problem]]:
    for name, problem in problems.items():
        yield name, replace(problem, cost=ma.Cost(length=1.0))
        priced = ma.Cost(length=1.0, direction_change=PRICE)
        yield f"{name} +{PRICE}", replace(problem, cost=priced)


def groups() -> dict[str, Iterator[tuple[str, Problem]]]:
    bays = {f"bay {w} m, aisle {a} m": scenes.bay(w, a) for w, a in scenes.BAYS}
    there = {name: cases.present(name) for name in ("car-scenarios", "tpcap", "dynobench")}
    tpcap = {f"TPCAP {k}": one for k, one in (cases.tpcap() if there["tpcap"] else {}).items()}
    dynobench = {name: cases.dynobench(name) for name in cases.FIRST_ORDER if there["dynobench"]}
    return {
        "cars": by_length(cases.car_scenarios() if there["car-scenarios"] else {}),
        "slots": by_length({f"slot {x} m": scenes.parallel_slot(x) for x in SLOTS}),
        "bays": by_length(bays),
        "corridors": by_length({f"corridor {x} m": scenes.corridor(x) for x in scenes.CORRIDORS}),
        "tpcap": by_length(tpcap),
        "dynobench": iter(dynobench.items()),
        "inertia": with_inertia(),
    }


def with_inertia() -> Iterator[tuple[str, Problem]]:
    root = Path(__file__).parents[1] / "scenarios"
    for name in ("hovercraft", "trailer", "robot_with_inertia"):
        if (root / f"{name}.yaml").exists():
            yield name, ma.load_scenario(root / f"{name}.yaml").problem


def proven(problem: Problem, cost: float, seconds: float) -> tuple[float, str]:
    """The bound after so much processor time, and what proves it."""
    began = time.process_time()
    best = known_bound(problem)
    value, kind = best.value, best.kind
    late = POLISHING * seconds
    for proof in proofs_of(
        problem,
        incumbent=lambda: cost,
        ends=lambda _work: time.process_time() - began > late,
    ):
        if proof.value > value:
            value, kind = proof.value, "incumbent" if proof.optimal else "cells"
        if value >= cost or time.process_time() - began >= seconds:
            break
    return min(value, cost), kind


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--groups", nargs="*", default=[])
    parser.add_argument("--only", default="", help="cases whose name begins so")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--seconds", nargs="*", type=float, default=[1.0, 10.0, 60.0])
    parser.add_argument("--plan-limit", type=float, default=10.0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows, records = [], []
    for group, named in groups().items():
        if options.groups and group not in options.groups:
            continue
        chosen = [(name, p) for name, p in named if name.startswith(options.only)]
        for name, problem in chosen[:: options.every]:
            result = ma.plan(problem, time_limit=options.plan_limit)
            cost = math.inf if result.cost is None else result.cost
            known = known_bound(problem)
            found = [proven(problem, cost, seconds) for seconds in options.seconds]
            gaps = [100.0 * (1.0 - value / cost) for value, _ in found]
            first = 100.0 * (1.0 - known.value / cost)
            kinds = "/".join(dict.fromkeys(kind for _, kind in found))
            rows.append([group, name, cost, known.kind, first, *gaps, kinds])
            after = dict(zip(map(str, options.seconds), found, strict=True))
            one = {"group": group, "name": name, "cost": cost, "known": known.value}
            records.append(one | {"proven": after})
            print(*rows[-1], flush=True)
            if options.json:
                options.json.write_text(json.dumps(records, indent=1))
    times = [f"gap {seconds:g} s [%]" for seconds in options.seconds]
    show(["group", "case", "cost", "before", "gap before [%]", *times, "kind"], rows)
    for group in dict.fromkeys(row[0] for row in rows):
        for priced in (False, True):
            of = [r for r in rows if r[0] == group and (f"+{PRICE}" in str(r[1])) == priced]
            if of:
                columns = list(zip(*(row[5:-1] for row in of), strict=True))
                said = ", ".join(f"{median(one):.2f} (at most {max(one):.2f})" for one in columns)
                print(f"{group}{', with a price' if priced else ''}: median gap [%] {said}")


if __name__ == "__main__":
    main()
