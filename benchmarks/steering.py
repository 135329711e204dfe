"""The steering function against root finding from many starts, and exact ends for random pairs.

``python benchmarks/steering.py``: microseconds per triple in closed form and by scipy's
``least_squares`` in the same run; terminal errors of ``--pairs`` random starts and goals that the
exhaustive search solves; ``--moves`` random moves of the same problems, which must change nothing.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from maneuver_automaton.groups import SE2
from maneuver_automaton.search import search_words
from maneuver_automaton.words import steer
from maneuver_automaton.words._kernels_steering import steer_batch
from tests import reference
from tests.search.cases import TABLE_2, end_off_goal, names, parking

STARTS = 10  # of the root finding, per triple
MATCH = 1e-4  # [s] between times of the same solution, found by two methods
EXACT = 1e-9  # [m, rad]


def planted(rng, n: int):
    """Random trims (n, 3, 3) and the ends (n, 3) of random times in them."""
    twists = rng.uniform(0.2, 2.0, (n, 3, 3)) * rng.choice([-1.0, 1.0], (n, 3, 3))
    straight = rng.integers(4, size=n)  # one straight in most words, none in the others
    for row, which in enumerate(straight):
        if which < 3:
            twists[row, which, 2] = 0.0
    with np.errstate(divide="ignore"):
        longest = np.minimum(2.0 * np.pi / np.abs(twists[:, :, 2]), 3.0)
    times = rng.uniform(0.05, 0.95, (n, 3)) * longest
    ends = [reference.plain_end(row, known) for row, known in zip(twists, times, strict=True)]
    return twists, times, np.array(ends)


def triples(n: int, repeats: int) -> None:
    """Closed form against root finding on the same random triples."""
    rng = np.random.default_rng(0)
    twists, times, goals = planted(rng, n)
    flat = twists.reshape(3 * n, 3)
    rows = np.arange(3 * n).reshape(n, 3)
    displacements = np.zeros((n, 2, 3))
    steer_batch(flat, rows, displacements, goals, 1e-12)
    laps = []
    for _ in range(repeats):
        began = time.perf_counter()
        steer_batch(flat, rows, displacements, goals, 1e-12)
        laps.append((time.perf_counter() - began) / n)
    kernel = statistics.median(laps)
    found, laps = [], []
    for row, goal in zip(twists, goals, strict=True):
        began = time.perf_counter()
        found.append(steer(row, goal))
        laps.append(time.perf_counter() - began)
    wrapper = statistics.median(laps)
    few = min(n, 60)
    roots, laps = [], []
    for row, goal in zip(twists[:few], goals[:few], strict=True):
        began = time.perf_counter()
        roots.append(reference.steering_roots(row, goal, starts=STARTS, longest=6.0, rng=rng))
        laps.append(time.perf_counter() - began)
    scipy = statistics.median(laps)
    met = sum(
        bool(len(mine)) and np.abs(mine - known).max(axis=1).min() < MATCH
        for mine, known in zip(found, times, strict=True)
    )
    theirs = sum(
        any(np.abs(root - known).max() < MATCH for root in row)
        for row, known in zip(roots, times[:few], strict=True)
    )
    extra = sum(
        not any(np.abs(root - other).max() < MATCH for other in mine)
        for mine, row in zip(found[:few], roots, strict=True)
        for root in row
    )
    print(f"{n} random triples with known times")
    print(f"  closed form, compiled, both branches: {1e6 * kernel:10.3f} us per triple")
    print(f"  steer(), checked and refined:         {1e6 * wrapper:10.1f} us per triple")
    print(f"  least_squares from {STARTS} starts:         {1e6 * scipy:10.1f} us per triple")
    print(f"  ratio to the closed form: {scipy / kernel:.0f}, to steer(): {scipy / wrapper:.0f}")
    print(f"  known times found: steer() {met} of {n}, least_squares {theirs} of {few}")
    print(f"  found by least_squares and not by steer(): {extra}")


def pairs(n: int, moves: int) -> None:
    """Random starts and goals through the exhaustive search; the first ones moved as well."""
    rng = np.random.default_rng(2)
    poses = rng.uniform(-1.0, 1.0, (n, 2, 3)) * [2.0, 2.0, np.pi]
    base = parking(TABLE_2, time=None)
    distances, angles, laps, unsolved = [], [], [], 0
    words, costs, worst_cost = 0, 0, 0.0
    for k, (start, goal) in enumerate(poses):
        problem = replace(base, start=start, goals=(replace(base.goals[0], pose=goal),))
        began = time.perf_counter()
        solutions = search_words(problem, problem.goals[0]).solutions
        laps.append(time.perf_counter() - began)
        if not solutions:
            unsolved += 1
            continue
        distance, angle = end_off_goal(problem, solutions[0])
        distances.append(distance)
        angles.append(angle)
        if k < moves:
            moved = problem.moved(SE2(rng.uniform(-1.0, 1.0, 3) * [100.0, 100.0, 7.0]))
            again = search_words(moved, moved.goals[0]).solutions
            words += not again or names(moved, again[0]) != names(problem, solutions[0])
            change = abs(again[0].cost - solutions[0].cost) if again else np.inf
            costs += change > 1e-9
            worst_cost = max(worst_cost, change)
    print(f"{n} random starts and goals, at most 4 trims of Table 2, free time")
    print(f"  median {1e3 * statistics.median(laps):.1f} ms, without a plan: {unsolved}")
    for what, values in (("position [m]", distances), ("heading [rad]", angles)):
        over = sum(value > EXACT for value in values)
        print(
            f"  end off goal, {what}: median {np.median(values):.1e}, "
            f"largest {np.max(values):.1e}, above {EXACT:g}: {over}"
        )
    print(f"{min(n, moves)} of them moved by up to 100 m and a turn")
    print(f"  other words: {words}, costs off by more than 1e-9: {costs}, most {worst_cost:.1e}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--triples", type=int, default=1000)
    parser.add_argument("--climbs", type=int, default=200)
    parser.add_argument("--pairs", type=int, default=10_000)
    parser.add_argument("--moves", type=int, default=1000)
    parser.add_argument("--repeats", type=int, default=30)
    options = parser.parse_args()
    triples(options.triples, options.repeats)
    pairs(options.pairs, options.moves)


if __name__ == "__main__":
    main()
