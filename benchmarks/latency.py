"""How soon a prepared planner answers, and how good its answer is then; OMPL in the same run.

``pip install ompl``; ``python benchmarks/latency.py`` (all groups, ten minutes), or some of
``car room tight nav2 movingai``. Ours: `Planner` with ``search.improve`` off, many times over:
until there is a word proven free, until the checks of FCL and the audit have passed it too; then
one run with a second of time, of which costs are read. RRT-Connect and BIT* of OMPL get the same
footprint by a compiled test, sampled every 0.1 m and not proven between, in a process of its own.
(AORRTC of the wheel 2.0.1 crashes or hangs with it.)
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import cases, movingai_longest, nav2_pairs, peers, tight_places
from benchmarks.tables import show
from maneuver_automaton.collision import Disc
from maneuver_automaton.planning import Planner
from maneuver_automaton.problem import Problem, SearchSettings
from tests.scenes import room_queries

AT = (0.001, 0.01, 0.1, 1.0)  # [s] when costs are read
PEERS = ("RRTConnect", "BITstar")
REPEATS = 31


def groups() -> dict[str, Callable[[], Mapping[str, Problem]]]:
    """Problems by name, group by group; those whose data is missing are left out."""
    return {
        "car": cases.car_scenarios,
        "room": lambda: {f"room {k}": one for k, one in enumerate(room_queries(8, boxes=25))},
        "tight": tight_places.places,
        "nav2": lambda: dict(_nav2()),
        "movingai": lambda: {
            f"{name} {k}": problem
            for name in movingai_longest.MAPS
            for k, (problem, _) in enumerate(movingai_longest.problems(name, 3, free_heading=False))
        },
    }


def _nav2() -> Iterator[tuple[str, Problem]]:
    for name in (*nav2_pairs.MAPS, "100by100_10"):
        cells = cases.nav2_map(name, unknown_blocked=True)
        for k, one in enumerate(nav2_pairs.pairs(cells, Disc(0.22), 6, 1)):
            yield f"{name} {k}", one


def planner_of(problem: Problem, search: SearchSettings) -> Planner:
    """A planner for the map and the vehicle of a problem."""
    return Planner(
        problem.automaton,
        cost=problem.cost,
        horizon=problem.horizon,
        bounds=problem.bounds,
        search=search,
        obstacles=problem.obstacles,
        footprint=problem.footprint,
        margin=problem.margin,
    )


def ours(problem: Problem) -> list[float]:
    """[ms] to a first word, median and p99, and to the audited answer; then costs."""
    planner = planner_of(problem, replace(problem.search, improve=False))
    firsts, answers = [], []
    for _ in range(REPEATS):
        began = time.perf_counter()
        result = planner.plan(problem.start, problem.goals)
        answers.append(time.perf_counter() - began)
        firsts.append(result.timing_s.get("first_plan", math.inf))
    best = planner_of(problem, problem.search).plan(problem.start, problem.goals, time_limit=1.0)
    costs = [
        min((cost for at, cost in best.improvements if at <= limit), default=math.inf)
        for limit in AT
    ]
    times = [np.median(firsts), np.percentile(firsts, 99)]
    times += [np.median(answers), np.percentile(answers, 99)]
    return [1e3 * float(one) for one in times] + costs


def theirs(problem: Problem, planner: str, repeats: int) -> list[float]:
    """[ms] to a first path, median; then the median length after a second."""
    runs = [peers.solve(problem, planner, time_limit=1.0) for _ in range(repeats)]
    last = [one.cost_at(1.0) for one in runs]
    return [1e3 * float(np.median([one.first_s for one in runs])), float(np.median(last))]


def main() -> None:
    every = groups()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=f"of {', '.join(every)}")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each peer")
    parser.add_argument("--most", type=int, default=100, help="problems of a group")
    given = parser.parse_args()
    if unknown := set(given.groups) - set(every):
        parser.error(f"no group {', '.join(sorted(unknown))}: there are {', '.join(every)}")
    there = PEERS if peers.available() else ()
    print(f"ours: median and p99 of {REPEATS}; theirs: medians of {given.repeats} runs")
    for group in given.groups or every:
        try:
            problems = dict(itertools.islice(every[group]().items(), given.most))
        except FileNotFoundError as missing:
            print(f"{group}: left out, {missing}")
            continue
        rows = []
        for name, problem in problems.items():
            rows.append([name, *ours(problem)])
            for peer in there:
                rows[-1] += theirs(problem, peer, given.repeats)
        show(
            [group, "first [ms]", "p99", "audited [ms]", "p99",
             *(f"{1e3 * at:g} ms" for at in AT),
             *(text for one in there for text in (f"{one} [ms]", "1 s"))],
            rows,
        )  # fmt: skip
        first = np.array([row[1] for row in rows])
        print(f"first plan: median {np.median(first):.2f} ms, worst {first.max():.2f} ms")
        for k, one in enumerate(there):
            peer = np.array([row[9 + 2 * k] for row in rows])
            ahead = int((first < peer).sum())
            print(f"{one}: ours is sooner in {ahead} of {len(rows)}")
        print(flush=True)


if __name__ == "__main__":
    main()
