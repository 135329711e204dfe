"""What a larger library gains and what it takes: closed-loop cost and time per step.

``python benchmarks/library_size.py [--grids H ...] [--repeats N] [--most N] [--out FILE]``:
control grids on [-2, 2]^2 from 9 to 6561 trims, cost |u|^2, in closed loop; straight ahead from
(-2, 0, 0) with T = 1 and a step of 0.1 s, and parallel parking from (0, 1, 0) with T = 8 and a step
of 1 s. Every loop is driven once to warm up, then `--repeats` times. With ``--out plot.png`` the
curves are drawn into plot-straight.png and plot-parking.png.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.library_size_figure import LibrarySizes, save_library_size_figure
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.receding_horizon import ClosedLoop, simulate

GRIDS = (2.0, 1.0, 0.5, 0.4, 0.25, 0.2, 0.1, 0.05)
LIMIT = 2.0  # of each control


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A closed loop that every library is to drive."""

    name: str
    what: str
    start: tuple[float, float, float]
    horizon_s: float
    step_s: float


CASES = (
    Case(
        name="straight",
        what="(-2, 0, 0) -> 0, T = 1, step 0.1",
        start=(-2.0, 0.0, 0.0),
        horizon_s=1.0,
        step_s=0.1,
    ),
    Case(
        name="parking",
        what="(0, 1, 0) -> 0, T = 8, step 1",
        start=(0.0, 1.0, 0.0),
        horizon_s=8.0,
        step_s=1.0,
    ),
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Row:
    """One library in one loop."""

    grid: float
    trims: int
    loop: ClosedLoop
    ms: np.ndarray  # time of every step of all repeats

    @property
    def first_value(self) -> float:
        return self.loop.steps[0].value

    @property
    def median_ms(self) -> float:
        return float(np.median(self.ms))

    @property
    def slowest_ms(self) -> float:
        return float(np.percentile(self.ms, 99))


def library(grid: float) -> Automaton:
    n = round(LIMIT / grid)
    values = [round(grid * k, 12) for k in range(-n, n + 1)]
    return Automaton.of_grid(Unicycle(), [values, values])


def measure(case: Case, grid: float, repeats: int, most: int) -> Row:
    automaton = library(grid)
    problem = Problem(
        automaton,
        case.start,
        [0.0, 0.0, 0.0],
        cost=Cost(effort=1.0),
        horizon=Horizon(time=case.horizon_s),
    )
    simulate(problem, step=case.step_s, steps=most, audit=False)
    loops = [simulate(problem, step=case.step_s, steps=most, audit=False) for _ in range(repeats)]
    return Row(
        grid=grid,
        trims=len(automaton),
        loop=loops[0],
        ms=1e3 * np.concatenate([loop.solve_s for loop in loops]),
    )


def show(case: Case, rows: Sequence[Row]) -> None:
    print(f"{case.name}: {case.what}, |u|^2")
    print(
        "    grid  trims  first value  closed loop  steps  replanned  median ms  p99 ms"
        "  broken  goal"
    )
    for row in rows:
        steps = row.loop.steps
        print(
            f"  {row.grid:6.3g} {row.trims:>6} {row.first_value:12.6f} {row.loop.cost:12.6f}"
            f" {len(steps):>6} {sum(step.replanned for step in steps):>10}"
            f" {row.median_ms:10.2f} {row.slowest_ms:7.2f}"
            f" {len({number for number, _ in row.loop.violations}):>7}"
            f"  {'reached' if row.loop.reached else row.loop.reason}"
        )
    way = float(np.linalg.norm(case.start)) ** 2
    print(f"  lower bound |x|^2 / T of the first value: {way / case.horizon_s:.6f}")
    if case.start[1:] == (0.0, 0.0):
        print(
            "  with continuous controls: closed loop "
            f"{continuous_straight(case):.6f}, never quite there"
        )
    for row in rows:
        for other in rows:
            excess = row.first_value / other.first_value - 1.0
            if holds(row.grid, other.grid) and excess > 1e-6:
                print(
                    f"  {row.trims} trims hold all {other.trims}, yet their first value is "
                    f"{excess:.2%} costlier: the search by insertion has not found the best word"
                )


def continuous_straight(case: Case) -> float:
    """Cost of the loop that always drives x / T: a geometric series."""
    kept = 1.0 - case.step_s / case.horizon_s
    first = case.step_s * (case.start[0] / case.horizon_s) ** 2
    return first / (1.0 - kept**2)


def holds(fine: float, coarse: float) -> bool:
    """Whether the finer grid has all trims of the coarser one."""
    return fine < coarse and abs(coarse / fine - round(coarse / fine)) < 1e-9


def sizes_of(rows: Sequence[Row]) -> LibrarySizes:
    return LibrarySizes(
        trims=[row.trims for row in rows],
        costs=[row.loop.cost for row in rows],
        medians_s=[1e-3 * row.median_ms for row in rows],
        slowest_s=[1e-3 * row.slowest_ms for row in rows],
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--grids", type=float, nargs="+", default=GRIDS, metavar="H")
    parser.add_argument("--repeats", type=int, default=10, help="loops that are timed")
    parser.add_argument("--most", type=int, default=100, help="steps of a loop")
    parser.add_argument("--out", type=Path, help="where to draw, one file per loop")
    options = parser.parse_args()
    for case in CASES:
        grids = sorted(options.grids, reverse=True)
        rows = [measure(case, grid, options.repeats, options.most) for grid in grids]
        show(case, rows)
        if options.out is not None:
            path = options.out.with_stem(f"{options.out.stem}-{case.name}")
            save_library_size_figure(sizes_of(rows), path, title=f"{case.name}: {case.what}")
            print(f"  drawn into {path}")


if __name__ == "__main__":
    main()
