"""Insertion with no formula for them against the shortest Reeds-Shepp and Dubins lengths.

``python benchmarks/steering_vectors.py``: for every pair of the file the excess over the
length computed by OMPL, the certificate, the time; and a list of those missed by 1e-6 or more.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from maneuver_automaton.problem import Problem
from maneuver_automaton.search import search_insertion
from maneuver_automaton.search.certificate import certificate
from maneuver_automaton.words import steer
from tests.search.cases import DUBINS, REEDS_SHEPP, VECTORS, end_off_goal, names, robot, vectors

MISSED = 1e-6  # turning radii


def shortest_triple(library, goal) -> float:
    """Length of the shortest word of three trims, by the steering function alone."""
    twists = library.body_velocities
    lengths = [
        times.sum()
        for a in range(len(twists))
        for b in range(len(twists))
        for c in range(len(twists))
        if a != b != c
        for times in steer(twists[[a, b, c]], goal)
    ]
    return float(min(lengths, default=np.inf))


def compare(name: str, controls, length_of) -> None:
    library = robot(controls)
    above, laps, missed, errors, certificates = [], [], [], [], []
    for vector in vectors():
        problem = Problem(library, [0, 0, 0], vector.goal)
        began = time.perf_counter()
        solutions = search_insertion(problem, problem.goals[0]).solutions
        laps.append(time.perf_counter() - began)
        known = length_of(vector)
        if not solutions:
            missed.append((vector, np.inf, known, ()))
            continue
        best = solutions[0]
        above.append(best.cost - known)
        errors.append(max(end_off_goal(problem, best)))
        value = certificate(problem, problem.goals[0], best)
        certificates.append(0.0 if value is None else value)
        if abs(above[-1]) >= MISSED:
            missed.append((vector, best.cost, known, names(problem, best)))
    print(f"{name}: {len(laps)} pairs, lengths in turning radii")
    print(f"  worst above {max(above):.2e}, worst below {min(above):.2e}")
    print(f"  largest distance of an end from its goal: {max(errors):.1e}")
    print(f"  smallest certificate {min(certificates):.1e}, below -1e-7: "
          f"{sum(value < -1e-7 for value in certificates)}")  # fmt: skip
    print(f"  time: first {laps[0]:.2f} s, median {1e3 * statistics.median(laps):.2f} ms")
    print(f"  missed by {MISSED:g}: {len(missed)}")
    for vector, found, known, word in missed:
        triple = shortest_triple(library, vector.goal)
        print(f"    row {vector.row}, goal {vector.goal}: {found:.9f} {' '.join(word)},")
        print(f"      file {known:.9f}, shortest of three trims in closed form {triple:.9f}")


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    if not VECTORS.exists():
        print(f"nothing to compare with: {VECTORS.name} is not there")
        return
    compare("Reeds-Shepp", REEDS_SHEPP, lambda vector: vector.reeds_shepp)
    compare("Dubins", DUBINS, lambda vector: vector.dubins)


if __name__ == "__main__":
    main()
