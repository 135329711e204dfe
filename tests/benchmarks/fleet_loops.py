"""Random fleets in closed loop: does anybody ever collide, or lose its plan, and what does it cost?

``python tests/benchmarks/fleet_loops.py [--fleets N] [--seed N] [--least N] [--most N] [--dense]``:
robots of 0.6 m on a square with a box in the middle, two to thirty at random; the same fleets
undisturbed, with noise of 3 mm and 3 mrad a step, with noise and a breakdown, with answers a step
late, and with every tenth message lost. Seconds are those of one processor.
"""

from __future__ import annotations

import argparse
import collections
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from maneuver_automaton.fleet import (
    FleetGuarantee,
    FleetLog,
    FleetProblem,
    FleetStatus,
    FleetStep,
    Message,
    plan_fleet,
    simulate_fleet,
)
from maneuver_automaton.receding_horizon import Disturbance
from tests.fleet.robots import at_rest, scattered

STEP = 0.5  # [s]
NOISE = Disturbance(position_m=0.003, heading_rad=0.003)
ROOM = (9.0, 4.0)  # [m^2] for each robot; dense


def every_tenth(seed: int) -> Callable[[Message], bool]:
    """Loses a tenth of all messages."""
    rng = np.random.default_rng(seed)
    return lambda _: bool(rng.random() < 0.1)


def cases(fleet: FleetProblem, seed: int) -> dict[str, dict]:
    """What happens to a fleet, by name."""
    rng = np.random.default_rng([seed, 1])
    broken = {str(rng.choice(fleet.names)): float(rng.uniform(1.0, 6.0))}
    return {
        "undisturbed": {},
        "noise": {"disturbance": NOISE},
        "noise, breakdown": {"disturbance": NOISE, "breaks_s": broken},
        "a step late": {"delay_steps": 1},
        "messages lost": {"disturbance": NOISE, "lost": every_tenth(seed)},
    }


class Tally:
    """What became of the loops of one case."""

    def __init__(self) -> None:
        self.loops: list[FleetLog] = []
        self.step_s: list[float] = []
        self.lost_plans = 0
        self.planned_s = 0.0

    def add(self, log: FleetLog, times: list[float], planned: float) -> None:
        """One more loop, the time of its steps, and what the first plans said."""
        self.loops.append(log)
        self.step_s += times
        self.planned_s += planned
        names = set(log.problem.names)
        gone = {name for name in names if log.problem.leaves[log.problem.names.index(name)]}
        self.lost_plans += sum(len(names - gone - set(step.plans)) for step in log.steps)

    def line(self) -> str:
        """A row of the table."""
        count = collections.Counter(
            violation.guarantee for log in self.loops for _, violation in log.violations
        )
        hits = count.pop(FleetGuarantee.NO_COLLISION, 0)
        able = sum(len(log.problem) - len(log.broken_down) for log in self.loops)
        came = sum(len(log.arrived_s) for log in self.loops)
        least = min((log.distance_m for log in self.loops), default=math.inf)
        swaps = sum(log.counts["swaps"] for log in self.loops)
        driven = math.fsum(log.sum_s for log in self.loops)
        median, most = (
            (float(np.percentile(self.step_s, q)) for q in (50, 99)) if self.step_s else (0.0, 0.0)
        )
        flagged = ", ".join(f"{one.value} {n}" for one, n in count.items()) or "none"
        return (
            f"{len(self.loops):6d} {sum(len(log.steps) for log in self.loops):7d} {hits:10d} "
            f"{self.lost_plans:10d} {came:6d}/{able:<6d} {1e3 * least:9.1f} {swaps:6d} "
            f"{self.planned_s:9.1f} {driven:9.1f} {median:8.3f} {most:8.3f}  {flagged}"
        )


def driven(fleet: FleetProblem, seed: int, tally: Tally, **more: object) -> None:
    """One loop, with the processor time of its steps."""
    first = plan_fleet(fleet, time_limit=60.0, max_rounds=0, seed=seed)
    if first.status is not FleetStatus.FOUND:
        first = at_rest(fleet)
    times: list[float] = []
    begun = time.process_time()

    def note(_: FleetStep) -> None:
        nonlocal begun
        times.append(time.process_time() - begun)
        begun = time.process_time()

    log = simulate_fleet(
        fleet, step=STEP, steps=240, first=first, seed=seed, time_limit=60.0, progress=note, **more
    )
    tally.add(log, times, first.sum_s)


def main() -> None:
    """Print a table, and again after every fleet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--least", type=int, default=2)
    parser.add_argument("--most", type=int, default=30)
    parser.add_argument("--dense", action="store_true", help="4 m^2 for each robot, not 9")
    arguments = parser.parse_args()
    tallies: dict[str, Tally] = collections.defaultdict(Tally)
    for seed in range(arguments.seed, arguments.seed + arguments.fleets):
        rng = np.random.default_rng([seed, 2])
        n = int(rng.integers(arguments.least, arguments.most + 1))
        fleet = scattered(n, seed, size=math.sqrt(ROOM[arguments.dense] * n + 4.0))
        for name, more in cases(fleet, seed).items():
            driven(fleet, seed, tallies[name], **more)
        print(f"\nafter fleet {seed} of {n} robots")
        print(
            f"{'case':18s} {'loops':>6s} {'steps':>7s} {'collisions':>10s} {'lost plans':>10s} "
            f"{'arrived':>13s} {'least mm':>9s} {'swaps':>6s} {'planned s':>9s} {'driven s':>9s} "
            f"{'median s':>8s} {'p99 s':>8s}  violations"
        )
        for name, tally in tallies.items():
            print(f"{name:18s} {tally.line()}", flush=True)


if __name__ == "__main__":
    main()
