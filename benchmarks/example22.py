"""The paper's Example 22: cost and uniform effort on finer and finer grids, and other methods.

``python benchmarks/example22.py``: the example with the trapezoidal rule and with RK4;
`--starts` wild guesses, and what they lead to; the extremals that shooting by Pontryagin's
conditions finds from `--shots` random costates, each also given to the transcription as a guess;
and what the smoothing of the norm does to the cost.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from maneuver_automaton.optimal_control import Guess, TimeGrid, solve, solve_uniform_effort_example
from maneuver_automaton.optimal_control.uniform_effort import (
    DURATION_S,
    END,
    START,
    UniformEffortExample,
    example_problem,
)
from tests.optimal_control import pontryagin


def line(example: UniformEffortExample, rule: str) -> str:
    found = example.solution
    return (
        f"{rule:<12}{len(found.time):>6}  {example.cost:.8f}  {100 * example.spread:8.3f}"
        f"{100 * example.inner_spread:10.4f}{found.iterations:>6}{1e3 * found.build_s:>9.0f}"
        f"{1e3 * found.solve_s:>9.0f}  {found.worst_defect:.1e}  {found.worst_violation:.1e}"
        f"  {example.smoothing_error:.1e}  {found.status.value}"
    )


def grids() -> None:
    print("rule         nodes  J           spread %  inner %    it build ms solve ms  defect   "
          "ends     smoothing")  # fmt: skip
    for rule in ("trapezoidal", "rk4"):
        for nodes in (50, 100, 200, 400, 1000):
            print(line(solve_uniform_effort_example(nodes, rule=rule), rule))


def wild_guess(rng) -> Guess:
    """States that wander by metres and turns, controls that wander as well."""
    share = np.linspace(0.0, 1.0, 7)
    state = np.outer(1.0 - share, START) + np.outer(share, END)
    state[1:-1] += rng.normal(size=(5, 3)) * [1.0, 1.0, 4.0]
    return Guess(state=state, control=rng.normal(size=(5, 2)) * 0.1, duration=DURATION_S)


def starts(n: int) -> None:
    rng = np.random.default_rng(0)
    found: Counter[tuple[str, str]] = Counter()
    for _ in range(n):
        example = solve_uniform_effort_example(100, guess=wild_guess(rng))
        found[f"{example.cost:.5f}", example.solution.status.value] += 1
    print(f"{n} wild guesses on 100 nodes: J, status, how often")
    for (cost, status), times in sorted(found.items()):
        print(f"  {cost}  {status:<14} {times}")


def shots(n: int) -> None:
    rng = np.random.default_rng(0)
    extremals: dict[str, np.ndarray] = {}
    for _ in range(n):
        costates = pontryagin.extremal(0.3 * rng.normal(size=3))
        if costates is not None:
            extremals.setdefault(f"{pontryagin.motion(costates)[0][-1, 3]:.7f}", costates)
    print(f"{n} shots by Pontryagin's conditions: J of the extremals, and after the transcription")
    times = np.linspace(0.0, DURATION_S, 201)
    for cost, costates in sorted(extremals.items()):
        states, _ = pontryagin.motion(costates, times=times)
        controls = pontryagin.controls_along(costates, times)
        guess = Guess(state=states[:, :3], control=controls, duration=DURATION_S)
        again = solve_uniform_effort_example(201, guess=guess)
        print(f"  {cost} -> {again.cost:.7f} ({again.solution.status.value})")


def smoothing() -> None:
    print("smoothing of the norm: J without it, and what it adds")
    for amount in (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 0.0):
        guess = Guess(state=np.array([START, END]), control=np.full((1, 2), -0.02), duration=50.0)
        found = solve(example_problem(smoothing=amount), TimeGrid(n_nodes=200), guess=guess)
        cost = found.integrals["cost"][-1]
        print(f"  {amount:7.0e}  {cost:.10f}  {found.cost - cost:.1e}  {found.iterations} it")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=200)
    parser.add_argument("--shots", type=int, default=30)
    options = parser.parse_args()
    grids()
    smoothing()
    starts(options.starts)
    shots(options.shots)


if __name__ == "__main__":
    main()
