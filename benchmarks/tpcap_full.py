"""TPCAP with the full model: duration, weighted cost, gears, time to the first plan.

``python benchmarks/tpcap_full.py [CASE.csv ...] [--time-limit S]``: each case is planned as
``maneuver-automaton plan CASE.csv --with scenarios/tpcap_full.yaml`` does, with one setting for
all; without files, the ten cases beside the repository. Weighted is 100 T + 10 integral of
a^2 + (v w)^2 + 10 integral of phi^2 + 5 per change of gear, with the steering angle phi and its
rate w.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import maneuver_automaton as ma
from benchmarks.cases import DATA, present
from benchmarks.tables import show
from maneuver_automaton.automaton import Plan

ROOT = Path(__file__).parents[1]
CASES = DATA / "tpcap"
STANDING = 1e-3  # [m/s] slower is no gear
HEAD = ("case", "T [s]", "weighted", "gears", "first [s]", "first T", "clearance [mm]", "CPU [s]")


def weighted(plan: Plan) -> tuple[float, int]:
    """The competition's cost, and how often the gear changes."""
    samples = plan.sample()
    steps = np.diff(samples.time)
    speed, steering = samples.reduced_state.T
    acceleration, rate = samples.control[:-1].T
    integral = acceleration**2 * steps
    v, w = speed[:-1], speed[1:]
    integral = integral + rate**2 * steps * (v * v + v * w + w * w) / 3.0
    phi, psi = steering[:-1], steering[1:]
    angles = steps * (phi * phi + phi * psi + psi * psi) / 3.0
    signs = np.sign(speed[np.abs(speed) > STANDING])
    gears = int(np.count_nonzero(np.diff(signs)))
    cost = 100.0 * plan.duration + 10.0 * float(integral.sum() + angles.sum()) + 5.0 * gears
    return cost, gears


def main() -> None:
    """Plan every case and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", type=Path)
    parser.add_argument("--time-limit", type=float, default=10.0)
    options = parser.parse_args()
    if not options.cases and not present("tpcap"):
        return
    files = options.cases or sorted(CASES.glob("Case*.csv"), key=lambda path: int(path.stem[4:]))
    rows = []
    for number, path in enumerate([*files[:1], *files]):  # the first one twice: it loads
        problem = ma.load_scenario(path, beside=ROOT / "scenarios/tpcap_full.yaml").problem
        began = time.process_time()
        result = ma.plan(problem, time_limit=options.time_limit)
        spent = time.process_time() - began
        if number == 0:
            continue
        if result.plan is None:
            rows.append((path.stem, result.reason))
            continue
        cost, gears = weighted(result.plan)
        rows.append(
            (
                path.stem,
                f"{result.plan.duration:.3f}",
                f"{cost:.0f}",
                gears,
                f"{result.timing_s['first_plan']:.3f}",
                f"{result.improvements[0][1]:.1f}",
                f"{1000.0 * (result.clearance_m or 0.0):.2f}",
                f"{spent:.1f}",
            )
        )
    show(HEAD, rows)


if __name__ == "__main__":
    main()
