"""Exhaustive search over words against multi-start SLSQP over the same words, in one run.

``python benchmarks/words.py``: times of the best word and the complete list, with
the ratio to SLSQP; and whether both agree on the complete list (``--starts`` per word).
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.timing import median_ms
from maneuver_automaton.search.words import search_words
from tests.reference import Word, brute_force
from tests.search.cases import REVERSED_SPIN, TABLE_2, parking

MATCH = 1e-4  # [s] between times of the same solution, found by two methods
AGREE = 1e-6  # between their costs


def moving(problem):
    """Twists, rates and names of the trims that move."""
    rows = [k for k, trim in enumerate(problem.automaton.trims) if not trim.is_rest]
    return problem.automaton.body_velocities[rows], problem.rates[rows], rows


def all_optima(problem, starts: int):
    """(word, times, cost) of every local optimum by SLSQP: padded by rest, and exactly in time."""
    twists, rates, rows = moving(problem)
    goal = problem.goals[0].pose - problem.start  # the start's heading is zero
    limit, most = problem.horizon.time, problem.horizon.max_trims
    rng = np.random.default_rng(0)
    optima = brute_force(
        twists, rates, goal, lengths=range(1, most), at_most=limit, starts=starts, rng=rng
    )
    exact = brute_force(
        twists, rates, goal, lengths=range(1, most + 1), total=limit, starts=starts, rng=rng
    )
    # a padded solution that fills the time to the end is found in both ways
    padded = [row for row in optima if row[1].sum() < limit - 1e-6]
    return [(tuple(rows[k] for k in word), times, cost) for word, times, cost in padded + exact]


def agreement(problem, starts: int) -> None:
    """Print how the complete list and the brute force compare."""
    rest = problem.automaton.rest
    listed = [
        (
            tuple(k for k in s.trims if k != rest),
            s.durations[: len(s.trims) - (rest in s.trims)],
            s.cost,
        )
        for s in search_words(problem, problem.goals[0], alternatives=None).solutions
    ]
    began = time.perf_counter()
    brute = all_optima(problem, starts)
    seconds = time.perf_counter() - began

    def same(a, b):
        return a[0] == b[0] and np.abs(np.array(a[1]) - b[1]).max() < MATCH * (1 + max(a[1]))

    missing = [row for row in brute if not any(same(row, other) for other in listed)]
    costs = [abs(row[2] - other[2]) for row in brute for other in listed if same(row, other)]
    unconfirmed = [row for row in listed if not confirmed(problem, row)]
    unseen = [row for row in listed if not any(same(row, other) for other in brute)]
    print(f"  listed {len(listed)}, brute force {len(brute)} in {seconds:.0f} s")
    print(f"  in the brute force but not listed: {len(missing)}")
    for row in missing:
        print("   ", row)
    print(f"  listed but not confirmed by SLSQP from its own point: {len(unconfirmed)}")
    for row in unconfirmed:
        print("   ", row)
    print(f"  listed but not met by random starts: {len(unseen)}")
    print(f"  largest difference in cost: {max(costs, default=0.0):.2e} (need {AGREE:g})")


def confirmed(problem, row) -> bool:
    """Whether SLSQP, pushed off a listed solution, comes back to its cost.

    One or two trims have fewer times than conditions, which SLSQP cannot take: Gauss-Newton then.
    """
    word, times, cost = row
    rows = list(word)
    limit = problem.horizon.time
    exact = times.sum() > limit - 1e-6
    one = Word(
        problem.automaton.body_velocities[rows],
        problem.rates[rows],
        problem.goals[0].pose - problem.start,
        total=limit if exact else None,
        at_most=None if exact else limit,
    )
    pushed = np.array(times) * (1.0 + 1e-3)
    back = one.feasible(pushed) if len(rows) < 3 else one.slsqp(pushed)
    return back is not None and abs(one.cost(back) - cost) < AGREE


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=30, help="random starts per word")
    parser.add_argument("--repeats", type=int, default=30)
    options = parser.parse_args()
    for name, controls in (("Table 2", TABLE_2), ("trim 5 reversed", REVERSED_SPIN)):
        print(f"{name}, (0, 1, 0) -> (0, 0, 0), T = 8, |u|^2 + |u|/2")
        speed(parking(controls), options.repeats)
        agreement(parking(controls), options.starts)


def speed(four, repeats: int) -> None:
    """Print times for at most four trims, and of SLSQP."""
    goal = four.goals[0]
    best = median_ms(lambda: search_words(four, goal), repeats)
    full = median_ms(lambda: search_words(four, goal, alternatives=None), repeats)
    began = time.perf_counter()
    all_optima(four, 1)
    slsqp = 1e3 * (time.perf_counter() - began)
    print(f"  best word of at most 4 trims: {best:.2f} ms (need 2)")
    print(f"  complete list, at most 4:     {full:.2f} ms (need 20)")
    print(f"  SLSQP, one start per word:    {slsqp:.0f} ms, {slsqp / full:.0f} times the list")


if __name__ == "__main__":
    main()
