"""Time per step of the closed loop, side by side with multiple shooting by CasADi and IPOPT.

``python benchmarks/step_times.py [--starts N] [--intervals K ...] [--steps N]``: random
initially feasible starts (|x|, |y| <= 2 m, any heading), |u|^2, the goal at the origin, a step of
1 s; five trims (Table 2 of the paper) with T = 8 and free, 1681 trims with T = 8, the same with
controls between them, and continuous controls in [-2, 2]^2 with T = 8 on K intervals: RK4, exact
derivatives, the solver built once, the start a parameter, all variables and multipliers of the
last solution shifted. All drive from one start before any goes on to the next, so that a busy
machine slows all alike. Then what the first plans cost: IPOPT starts from a straight line, and
again from our plans.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import casadi
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.closed_loops import STEP, T, feasible_starts, libraries
from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.receding_horizon import RecedingHorizon

MOST = 2.0  # of both controls
ARRIVED = 1e-9  # [m, rad]
SAME = 1e-3  # relative, between costs
QUICK, MANY = (1.0, np.inf), (10.0, 30.0)  # [ms] median and 99th percentile asked for
PIECES = 24  # with controls between those of the 1681 trims
EARLY = 8  # steps of a loop that are looked at alone: later ones are near the goal
WARM = {
    "ipopt.warm_start_init_point": "yes",
    "ipopt.mu_init": 1e-4,
    "ipopt.warm_start_bound_push": 1e-6,
    "ipopt.warm_start_bound_frac": 1e-6,
    "ipopt.warm_start_slack_bound_push": 1e-6,
    "ipopt.warm_start_mult_bound_push": 1e-6,
}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Drive:
    """One loop from one start."""

    ms: list[float]  # time of every step
    first_value: float
    cost: float  # of what was driven, and of the plan at the end
    failed: int = 0  # steps without a solution, or that broke a guarantee
    first: Plan | None = None


@dataclass(slots=True, eq=False)
class Contestant:
    """One way to drive, and its loops so far."""

    name: str
    drive: Callable[[np.ndarray], Drive]
    need_ms: tuple[float, float] | None = None  # median, 99th percentile
    drives: list[Drive] = field(default_factory=list)

    @property
    def ms(self) -> np.ndarray:
        return np.concatenate([one.ms for one in self.drives])

    def early(self, steps: int) -> float:
        """Median time of the first steps of every loop [ms]."""
        return float(np.median(np.concatenate([one.ms[:steps] for one in self.drives])))

    @property
    def first_values(self) -> np.ndarray:
        return np.array([one.first_value for one in self.drives])


def by_trims(problem: Problem, start: np.ndarray, steps: int, pieces: int = 0) -> Drive:
    controller = RecedingHorizon(replace(problem, start=start), step=STEP, pieces=pieces)
    pose, logs, ms = start, [], []
    while len(logs) < steps and np.abs(pose).max() > ARRIVED:
        began = time.perf_counter()
        _, log = controller.step(pose)
        ms.append(1e3 * (time.perf_counter() - began))
        logs.append(log)
        pose = log.predicted
    return Drive(
        ms=ms,
        first_value=logs[0].value,
        cost=logs[-1].accumulated_cost + logs[-1].value,
        failed=sum(bool(log.violations) for log in logs),
        first=logs[0].plan,
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Guess:
    """Where IPOPT begins: all variables, and the multipliers of bounds and conditions."""

    x: np.ndarray  # (5 k + 3,) pose and control, interval by interval, then the last pose
    bounds: np.ndarray  # (5 k + 3,)
    conditions: np.ndarray  # (3 k + 3,)


class MultipleShooting:
    """The problem with continuous controls, constant on each of `k` intervals."""

    def __init__(self, k: int) -> None:
        self.k = k
        interval = T / k
        poses, controls = casadi.SX.sym("x", 3, k + 1), casadi.SX.sym("u", 2, k)
        start = casadi.SX.sym("start", 3)
        rows, conditions = [], [poses[:, 0] - start]
        for i in range(k):
            rows += [poses[:, i], controls[:, i]]
            conditions.append(runge_kutta(poses[:, i], controls[:, i], interval) - poses[:, i + 1])
        program = {
            "x": casadi.vertcat(*rows, poses[:, k]),
            "f": interval * casadi.sumsqr(controls),
            "g": casadi.vertcat(*conditions),
            "p": start,
        }
        quiet = {
            "print_time": False,
            "error_on_fail": False,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
        }
        self.solver = casadi.nlpsol("solver", "ipopt", program, quiet | WARM)
        limits = np.tile([np.inf, np.inf, np.inf, MOST, MOST], k)
        self.high = np.append(limits, np.zeros(3))  # it ends at the goal
        self.low = -self.high

    def solve(self, start: np.ndarray, guess: Guess) -> tuple[float, Guess, bool, float]:
        """Cost, solution, whether it is one, and the time of the solver alone [ms]."""
        began = time.perf_counter()
        answer = self.solver(
            x0=guess.x,
            lam_x0=guess.bounds,
            lam_g0=guess.conditions,
            p=start,
            lbx=self.low,
            ubx=self.high,
            lbg=0.0,
            ubg=0.0,
        )
        ms = 1e3 * (time.perf_counter() - began)
        x, bounds, conditions = (answer[n].full().ravel() for n in ("x", "lam_x", "lam_g"))
        found = Guess(x=x, bounds=bounds, conditions=conditions)
        return float(answer["f"]), found, bool(self.solver.stats()["success"]), ms

    def guess(self, poses: np.ndarray, controls: np.ndarray | None = None) -> Guess:
        """From poses (k + 1, 3), and controls (k, 2) that are zero if left out."""
        rows = np.zeros((self.k, 5))
        rows[:, :3] = poses[:-1]
        if controls is not None:
            rows[:, 3:] = controls
        x = np.append(rows.ravel(), poses[-1])
        return Guess(x=x, bounds=np.zeros(x.size), conditions=np.zeros(3 * self.k + 3))

    def straight(self, start: np.ndarray) -> Guess:
        return self.guess(np.outer(np.linspace(1.0, 0.0, self.k + 1), start))

    def along(self, plan: Plan) -> tuple[np.ndarray, Guess]:
        """A plan of trims as a guess, and its start with the heading counted back from the goal.

        Controls are averages over each interval.
        """
        times = np.linspace(0.0, T, self.k + 1)
        controls = np.array([trim.control for trim in plan.trims])
        begins = np.append(0.0, np.cumsum(plan.durations))
        driven = np.vstack([np.zeros(2), np.cumsum(controls * plan.durations[:, None], axis=0)])
        way = np.stack([np.interp(times, begins, column) for column in driven.T], axis=-1)
        poses = np.array(plan.pose_at(plan.start_time + times))
        poses[:, 2] = way[:, 1] - way[-1, 1]
        return poses[0], self.guess(poses, np.diff(way, axis=0) * self.k / T)

    def shifted(self, last: Guess) -> Guess:
        """The rest of a solution; at the goal there is nothing more to do."""
        n = round(self.k * STEP / T)
        x, bounds = np.zeros(last.x.size), np.zeros(last.x.size)
        x[: -5 * n], bounds[: -5 * n] = last.x[5 * n :], last.bounds[5 * n :]
        conditions = np.append(last.conditions[3 * n :], np.tile(last.conditions[-3:], n))
        return Guess(x=x, bounds=bounds, conditions=conditions)

    def drive(self, start: np.ndarray, steps: int) -> Drive:
        n = round(self.k * STEP / T)
        guess, ms, values, failed, spent = self.straight(start), [], [], 0, 0.0
        for _ in range(steps):
            value, found, solved, one_ms = self.solve(start, guess)
            ms.append(one_ms)
            values.append(value)
            failed += not solved
            rows = found.x[: 5 * n].reshape(n, 5)
            left = value - T / self.k * float((rows[:, 3:] ** 2).sum())
            spent += value - left
            start, guess = found.x[5 * n : 5 * n + 3], self.shifted(found)
        return Drive(ms=ms, first_value=values[0], cost=spent + left, failed=failed)


def runge_kutta(pose: casadi.SX, control: casadi.SX, time_s: float) -> casadi.SX:
    def rates(x: casadi.SX) -> casadi.SX:
        ahead = control[0]
        return casadi.vertcat(ahead * casadi.cos(x[2]), ahead * casadi.sin(x[2]), control[1])

    k_1 = rates(pose)
    k_2 = rates(pose + 0.5 * time_s * k_1)
    k_3 = rates(pose + 0.5 * time_s * k_2)
    k_4 = rates(pose + time_s * k_3)
    return pose + time_s / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)


def contestants(intervals: Sequence[int], steps: int) -> tuple[list[Contestant], Problem]:
    """Ours, then the peers; and the problem with five trims and T = 8."""
    library = libraries()
    five = Problem(
        library["Table 2 as printed"],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0],
        cost=Cost(effort=1.0),
        horizon=Horizon(time=T, max_trims=4),
    )
    free = replace(five, cost=Cost(effort=1.0, time=1.0), horizon=Horizon(max_trims=4))
    many = replace(five, automaton=library["1681 trims"], horizon=Horizon(time=T))
    ours = [
        Contestant("five trims, T = 8", lambda start: by_trims(five, start, steps), QUICK),
        Contestant("five trims, free T", lambda start: by_trims(free, start, steps), QUICK),
        Contestant("1681 trims, T = 8", lambda start: by_trims(many, start, steps), MANY),
        Contestant("and between them", lambda start: by_trims(many, start, steps, PIECES)),
    ]
    solvers = [MultipleShooting(k) for k in intervals]
    peers = [
        Contestant(f"IPOPT, {one.k} intervals", lambda start, one=one: one.drive(start, steps))
        for one in solvers
    ]
    return [*ours, *peers], five


def show_times(everyone: Sequence[Contestant], peer: Contestant) -> None:
    print("                                  all steps, ms      first step       first 8 steps")
    print(
        "                           steps  median     p99  median  / IPOPT  median  / IPOPT  broken"
    )
    for one in everyone:
        median, slowest = float(np.median(one.ms)), float(np.percentile(one.ms, 99))
        first, early = one.early(1), one.early(EARLY)
        print(
            f"  {one.name:<22} {len(one.ms):>6} {median:7.2f} {slowest:7.2f}"
            f" {first:7.2f} {first / peer.early(1):8.2f}"
            f" {early:7.2f} {early / peer.early(EARLY):8.2f}"
            f" {sum(drive.failed for drive in one.drives):>7}  {verdict(one, median, slowest)}"
        )


def verdict(one: Contestant, median: float, slowest: float) -> str:
    if one.need_ms is None:
        return ""
    most, tail = one.need_ms
    asked = f"need {most:g} median" + (f", {tail:g} p99" if np.isfinite(tail) else "")
    return f"{asked}: {'met' if median <= most and slowest <= tail else 'MISSED'}"


def show_costs(
    everyone: Sequence[Contestant], peer: Contestant, starts: np.ndarray, k: int
) -> None:
    """First values against the best continuous optimum met from any guess."""
    solver, five, many, between = MultipleShooting(k), everyone[0], everyone[2], everyone[3]
    best, from_line = peer.first_values.copy(), peer.first_values
    for row in range(len(starts)):
        for one in (five, many, between):
            plan = one.drives[row].first
            assert plan is not None
            value, _, solved, _ = solver.solve(*solver.along(plan))
            if solved:
                best[row] = min(best[row], value)
    print(f"  first value / best optimum of IPOPT ({k} intervals) from a line and from our plans:")
    for one in (five, many, between):
        print_ratio(one.name, one.first_values / best)
    print_ratio("IPOPT from a line", from_line / best)
    worse = from_line > many.first_values * (1.0 + SAME)
    print(
        f"  IPOPT from a line is costlier than 1681 trims from {worse.sum()} of {len(starts)} "
        "starts: another local optimum"
    )
    below = many.first_values < best * (1.0 - SAME)
    print(f"  1681 trims below the best of IPOPT: {below.sum()} (its controls change {k} times)")
    print("  cost of the closed loop, with the value left at the end, median and sum:")
    for one in (five, many, between, peer):
        costs = np.array([drive.cost for drive in one.drives])
        print(f"    {one.name:<22} {np.median(costs):9.4f} {costs.sum():9.2f}")


def print_ratio(name: str, ratio: np.ndarray) -> None:
    print(
        f"    {name:<22} median {np.median(ratio):7.4f}, p90 {np.percentile(ratio, 90):7.4f}, "
        f"from {ratio.min():7.4f} to {ratio.max():8.4f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=150)
    parser.add_argument("--intervals", type=int, nargs="+", default=(24, 40))
    parser.add_argument("--steps", type=int, default=30, help="at most, of each loop")
    options = parser.parse_args()
    if any(k % round(T / STEP) for k in options.intervals):
        parser.error(f"--intervals: need multiples of {T / STEP:g}, so that a step ends one")
    everyone, five = contestants(options.intervals, options.steps)
    starts = feasible_starts(five, options.starts)
    for one in everyone:  # compile, load, fill caches
        one.drive(starts[0])
    for start in starts:
        for one in everyone:
            one.drives.append(one.drive(start))
    print(f"{len(starts)} starts, step {STEP:g} s, warm; ours to the goal, IPOPT", end=" ")
    print(f"{options.steps} steps, T = 8, its time that of the solver alone")
    peer = everyone[-1]
    show_times(everyone, peer)
    show_costs(everyone, peer, starts, options.intervals[-1])


if __name__ == "__main__":
    main()
