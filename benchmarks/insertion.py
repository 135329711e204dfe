"""How insertion grows with the library: square grids of controls on [-2, 2] x [-2, 2].

``python benchmarks/insertion.py``: medians for 81 to 40,401 trims, and the exponent of growth
fitted to all sizes and to the two largest; exhaustive search over the smallest grid as the peer.
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

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search.certificate import certificate
from maneuver_automaton.search.choose import search_insertion
from maneuver_automaton.search.words import search_words
from tests.search.cases import end_off_goal

SIDES = (9, 21, 41, 81, 201)


def problems(library):
    """Sideways by a metre: least time, and least effort in eight seconds."""
    sideways = Problem(library, [0.0, 1.0, 0.0], [0.0, 0.0, 0.0])
    return {
        "minimum time": replace(sideways, cost=Cost(time=1.0)),
        "effort, T = 8, max_trims 6": replace(
            sideways, cost=Cost(effort=1.0, norm=0.5), horizon=Horizon(time=8.0, max_trims=6)
        ),
        "effort, T = 8, no limit": replace(
            sideways, cost=Cost(effort=1.0, norm=0.5), horizon=Horizon(time=8.0)
        ),
    }


def exponent(sizes, seconds) -> float:
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--largest", type=int, default=SIDES[-1], help="controls per axis")
    parser.add_argument("--peer", action="store_true", help="exhaustive search over 81 trims too")
    options = parser.parse_args()
    laps: dict[str, list[float]] = {}
    sizes = []
    print(
        f"{'trims':>6}  {'problem':28} {'ms':>9} {'cost':>12} {'certificate':>12} {'off':>8} word"
    )
    for side in (side for side in SIDES if side <= options.largest):
        axis = np.linspace(-2.0, 2.0, side).round(9)
        library = Automaton.of_grid(Unicycle(), [axis, axis])
        sizes.append(len(library))
        for name, problem in problems(library).items():
            goal = problem.goals[0]
            solution = search_insertion(problem, goal).solutions[0]
            times = []
            for _ in range(options.repeats):
                began = time.perf_counter()
                search_insertion(problem, goal)
                times.append(time.perf_counter() - began)
            laps.setdefault(name, []).append(statistics.median(times))
            value = certificate(problem, goal, solution)
            print(
                f"{len(library):6}  {name:28} {1e3 * laps[name][-1]:9.2f} {solution.cost:12.8f} "
                f"{value:12.2e} {max(end_off_goal(problem, solution)):8.1e}"
            )
    for name, seconds in laps.items():
        if len(sizes) > 1:
            print(
                f"{name}: grows like M^{exponent(sizes, seconds):.2f}, between the two largest "
                f"like M^{exponent(sizes[-2:], seconds[-2:]):.2f}"
            )
    if options.peer:
        peer()


def peer() -> None:
    """Exhaustive search over words of three trims of the smallest grid, in least time."""
    axis = np.linspace(-2.0, 2.0, SIDES[0])
    problem = problems(Automaton.of_grid(Unicycle(), [axis, axis]))["minimum time"]
    three = replace(problem, horizon=Horizon(max_trims=3))
    for name, search in (("exhaustive", search_words), ("insertion", search_insertion)):
        began = time.perf_counter()
        solution = search(three, three.goals[0]).solutions[0]
        seconds = time.perf_counter() - began
        print(f"81 trims, 3 at most, {name}: {1e3 * seconds:.0f} ms, cost {solution.cost:.8f}")


if __name__ == "__main__":
    main()
