"""The horizon without terminal constraint: closed loops, neighbourhoods, growth, certificates.

``python benchmarks/unconstrained.py [loops] [reach] [growth] [promises] [search]``; all if
none is named.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.timing import median_ms
from maneuver_automaton.analysis.growth import growth_bound, growth_of_values, ring_poses
from maneuver_automaton.analysis.stability import (
    certified_horizon,
    certified_intervals,
    check_closed_loop,
)
from maneuver_automaton.receding_horizon.unconstrained import search_horizon, simulate_unconstrained
from tests.receding_horizon.unconstrained_cases import (
    MIXED,
    PARKING,
    QUADRATIC,
    even,
    octaves,
    problem_of,
)
from tests.reference_unconstrained import exhausted, interval_costs

COSTS = {"mixed": MIXED, "quadratic": QUADRATIC}
LIBRARIES = {
    "even 9": even(9),
    "even 11": even(11),
    "even 17": even(17),
    "octaves 4": octaves(4),
    "octaves 6": octaves(6),
}
ARRIVED = 0.02  # of `size`: 2 cm to the side, or 14 cm ahead


def size(pose):
    """Root of what a pose costs per second: 1 for a metre to the side."""
    return float(np.sqrt(MIXED.pose_rates(pose)))


def closed_loop(library, cost, intervals, *, interval=0.5, start=PARKING, steps=150):
    problem = problem_of(library, cost, intervals=intervals, interval=interval)
    return simulate_unconstrained(problem, start, steps=steps)


def loops() -> None:
    print("Closed loops from (0, 1, 0), interval 0.5 s; distances at the end")
    print(
        f"{'library':10} {'cost':9} {'T [s]':>5} {'steps':>5} {'arrived':>7} {'|(x, y)|':>9}",
        end="",
    )
    print(f" {'|y|':>8} {'|heading|':>9} {'cost':>8} {'V(start)':>8} {'ms/step':>7}")
    for name, library in LIBRARIES.items():
        for intervals in (2, 3, 4, 5, 6, 8, 12):
            for kind, cost in COSTS.items():
                began = time.perf_counter()
                loop = closed_loop(library, cost, intervals)
                per_step = 1e3 * (time.perf_counter() - began) / len(loop.values)
                end = loop.poses[-1]
                print(
                    f"{name:10} {kind:9} {intervals / 2:5.1f} {len(loop.trims):5d} "
                    f"{'yes' if size(end) < ARRIVED else 'no':>7} {np.hypot(*end[:2]):9.5f} "
                    f"{abs(end[1]):8.5f} {abs(end[2]):9.5f} {loop.cost:8.4f} "
                    f"{loop.values[0]:8.4f} {per_step:7.1f}",
                    flush=True,
                )


def reach() -> None:
    """The neighbourhood that is reached, over finer libraries and shorter intervals."""
    print("Neighbourhood reached with horizon 4 s: worst end over 8 starts on a circle of 1 m")
    print(f"{'library':10} {'interval':>8} {'least speed':>11} {'cost':9} {'|y|':>9}", end="")
    print(f" {'|(x, y)|':>9} {'heading':>8}")
    angles = 2.0 * np.pi * np.arange(8) / 8
    starts = np.column_stack([np.cos(angles), np.sin(angles), 0.3 * np.sin(3 * angles)])
    cases = [(f"even {n}", even(n), 0.5) for n in (5, 9, 17)]
    cases += [(f"octaves {n}", octaves(n), 0.5) for n in (2, 3, 4, 5, 6, 7)]
    cases += [("even 9", even(9), h) for h in (1.0, 0.25)]
    cases += [("octaves 4", octaves(4), h) for h in (1.0, 0.25)]
    for name, library, interval in cases:
        speeds = np.abs(library.controls[:, 0])
        for kind, cost in COSTS.items():
            ends = np.abs(
                [
                    closed_loop(
                        library, cost, round(4 / interval), interval=interval, start=start
                    ).poses[-1]
                    for start in starts
                ]
            )
            print(
                f"{name:10} {interval:8.2f} {speeds[speeds > 0].min():11.4f} {kind:9} "
                f"{ends[:, 1].max():9.5f} {np.hypot(ends[:, 0], ends[:, 1]).max():9.5f} "
                f"{ends[:, 2].max():8.5f}",
                flush=True,
            )


def sampled_growth(library, cost, poses, intervals):
    """Growth counted in intervals, from values found by the search at each pose."""
    problems = [problem_of(library, cost, intervals=n) for n in range(1, intervals + 1)]
    values = [[search_horizon(problem, pose).value for problem in problems] for pose in poses]
    least = [interval_costs(problems[0], pose).min() for pose in poses]
    return growth_of_values(values, least, times=np.arange(1, intervals + 1), poses=poses)


def folded(poses):
    """Poses of which every other is a mirror image, or the same driven backwards."""
    return poses[(poses[:, 0] >= 0.0) & (poses[:, 1] >= 0.0)]


def growth() -> None:
    print("Growth bounds, step 0.5 s: from words (continuous) and from the search (intervals)")
    times = np.arange(1, 161) / 20.0
    for name, cost, levels in (
        ("even 9", MIXED, [1.0]),
        ("even 9", MIXED, [1e-1]),
        ("even 9", MIXED, [1e-2]),
        ("even 9", MIXED, [1e-3]),
        ("octaves 6", MIXED, [1.0]),
        ("octaves 6", MIXED, [1e-1]),
        ("octaves 6", MIXED, [1e-2]),
        ("octaves 6", MIXED, [1e-3]),
        ("octaves 6", MIXED, [1e-4]),
        ("octaves 6", QUADRATIC, [1.0]),
        ("octaves 6", QUADRATIC, [1e-1]),
        ("octaves 6", QUADRATIC, [1e-2]),
    ):
        kind = "mixed" if cost is MIXED else "quadratic"
        poses = folded(ring_poses(cost, levels=levels, parts=4))
        bound = growth_bound(LIBRARIES[name], cost, poses=poses, times=times)
        words = certified_horizon(bound, step=0.5)
        found = certified_intervals(sampled_growth(LIBRARIES[name], cost, poses, 14))
        print(
            f"{name:10} {kind:9} level {levels[0]:7.0e} samples {bound.samples:3d} "
            f"B(1, 2, 5, 8 s) {bound.bounds[[19, 39, 99, 159]].round(2)} worst "
            f"{bound.worst[-1].round(3)} certified {words.horizon} s, "
            f"index(4 s) {words.index_at(4.0):.3f} | gamma(2, 5, 10, 14) "
            f"{found.growth.bounds[[1, 4, 9, 13]].round(2)} certified {found.horizon} intervals, "
            f"index there {found.index_at(found.horizon or 0):.3f}",
            flush=True,
        )


def promises() -> None:
    """Closed loops against the index from the search, where the growth bound was taken."""
    library, inner = LIBRARIES["octaves 6"], 1e-4
    levels = np.geomspace(1.5, inner / 10, 13)
    poses = folded(ring_poses(MIXED, levels=levels, parts=6))
    certificate = certified_intervals(sampled_growth(library, MIXED, poses, 10))
    print(f"octaves 6, mixed, {certificate.growth.samples} samples, levels 1.5 to {inner / 10:g}:")
    print(f"  indices over 2, 3, ... intervals {certificate.indices.round(3)}")
    starts = [PARKING, (-0.5, -0.5, 1.0), (0.8, 0.3, -0.6), (0.0, -0.7, 0.0), (0.9, 0.0, 0.0)]
    for intervals in range(2, 11):
        index = certificate.index_at(intervals)
        checks, ends = [], []
        for start in starts:
            loop = closed_loop(library, MIXED, intervals, start=start)
            outside = MIXED.pose_rates(loop.poses) >= inner
            count = int(np.argmin(outside)) if not outside.all() else len(loop.trims)
            checks.append(
                check_closed_loop(loop.values[: count + 1], loop.stage_costs[:count], index=index)
            )
            ends.append(MIXED.pose_rates(loop.poses[-1]))
        least = min(c.least_decrease for c in checks)
        worst = max(c.cost / c.limit for c in checks)
        print(
            f"  {intervals:2d} intervals: index {index:7.3f}, least decrease {least:6.3f}, cost / "
            f"promise {worst:5.2f}, reach level {max(ends):.1e} "
            f"{'arrives' if max(ends) < inner else 'does not arrive'}, "
            f"{'holds' if all(c.holds for c in checks) else 'BROKEN'}",
            flush=True,
        )


def search() -> None:
    print("The search against all sequences: 40 poses each, least costs 1e-3 to 1")
    rng = np.random.default_rng(7)
    for count, intervals in ((3, 10), (5, 7), (7, 6), (9, 5)):
        library = even(count)
        for kind, cost in COSTS.items():
            problem = problem_of(library, cost, intervals=intervals)
            shares = rng.dirichlet([1.0, 1.0, 1.0], 40) * 10.0 ** rng.uniform(-3, 0, (40, 1))
            poses = (shares / MIXED.pose_weights) ** (1 / MIXED.pose_orders)
            poses *= rng.choice([-1.0, 1.0], poses.shape)
            excess, proven = [], 0
            began = time.perf_counter()
            for pose in poses:
                best = exhausted(problem, pose, max_intervals=300_000_000)
                proven += best.proven
                excess.append(search_horizon(problem, pose).value / best.value - 1.0)
            seconds = (time.perf_counter() - began) / len(poses)
            once = median_ms(lambda p=problem, x=poses[0]: search_horizon(p, x), 20)
            print(
                f"  {count}x{count}, {intervals} intervals, {kind:9}: proven {proven}/40, optimal "
                f"{sum(e < 1e-9 for e in excess)}/40, worst excess {max(excess):.1e}, "
                f"search {once:.1f} ms, proof {1e3 * seconds:.0f} ms",
                flush=True,
            )


def main() -> None:
    parts = {f.__name__: f for f in (loops, reach, growth, promises, search)}
    for name in sys.argv[1:] or parts:
        parts[name]()


if __name__ == "__main__":
    main()
