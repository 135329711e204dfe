"""Expansions per second of processor time of the lattice search, nothing else counted.

``python -m benchmarks.expansions [--expansions N] [--repeats N]``: one search from the start
goes on for so many expansions, whatever it connects, among boxes, in tight places and on occupancy
maps of ``../shared/data``: at the first resolution, at fine ones without and with truncated edges.
The first repeat grows the distances in the plane too; the median of the others does not.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import cases, nav2_pairs
from benchmarks.tables import median, show, verdict
from maneuver_automaton.collision import Box, Disc
from maneuver_automaton.problem import Problem
from maneuver_automaton.search import _kernels_lattice as kernels
from maneuver_automaton.search.cost_to_go import NO_TABLE, cost_to_go_table
from maneuver_automaton.search.distance_grid import distance_grid
from maneuver_automaton.search.lattice_pass import Pass, pass_of, with_room
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.lattice_task import Resolution
from tests import scenes

AIM, AIM_CONTACT = 0.5e6, 0.2e6  # expansions per second, the second with truncated edges
RESOLUTIONS = {
    "first": Resolution(coarse=True, stop=False),
    "fine": Resolution(scale=0.12, durations=0.17, stop=False),
    "contact": Resolution(truncated=True, guided=True, coarse=True, stop=False),
    "contact, fine": Resolution(
        scale=0.24, durations=0.25, truncated=True, guided=True, stop=False
    ),
}


def places() -> Iterator[tuple[str, list[Problem]]]:
    """Problems by the kind of their surroundings."""
    yield "30 m, 25 boxes", scenes.room_queries(4, boxes=25, side=30.0, seed=25)
    yield "60 m, 150 boxes", scenes.room_queries(4, boxes=150, side=60.0, seed=150)
    yield "150 m, 225 boxes", [scenes.field_query(150.0, 100.0, seed=k) for k in range(3)]
    yield "slot 5.3 m", [scenes.parallel_slot(5.3)]
    yield "bay 2.1 m, aisle 4.3 m", [scenes.bay(2.1, 4.3)]
    yield "corridor 3.7 m", [scenes.corridor(3.7)]
    yield "no way in", [scenes.no_way_in()]
    if cases.present("nav2-maps"):
        for name, body in (("100by100_10", Disc(0.22)), ("depot", Box([0.6, 0.4]))):
            cells = cases.nav2_map(name, unknown_blocked=True)
            yield f"map {name}", nav2_pairs.pairs(cells, body, 3, 1)


def seconds(one: Pass, n: int) -> float:
    """Processor time [s] of up to `n` expansions."""
    search = one.search
    most = search.library.most_children * (n + 1) + len(search.task.roots.poses) + 2
    one.search = search = search._replace(arrays=with_room(search.arrays, most))
    began = time.process_time()
    kernels.expand(search, n, math.inf)
    return time.process_time() - began


def measured(problem: Problem, resolution: Resolution, n: int, repeats: int) -> list[float]:
    """How many were expanded, and the time of the first search and of those after it [s]."""
    query = lattice_query(problem, tuple(range(len(problem.goals))))
    table = cost_to_go_table(problem) if resolution.guided else NO_TABLE
    grid = distance_grid(
        query.plane,
        query.box,
        query.window,
        query.goals,
        query.start,
        coarse=resolution.coarse,
    )
    passes = [pass_of(query, resolution, grid=grid, table=table) for _ in range(repeats + 1)]
    times = [seconds(one, n) for one in passes]
    return [passes[0].expansions, times[0], median(times[1:])]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--expansions", type=int, default=8000, help="of each search")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    rows = []
    measured(scenes.corridor(4.1), RESOLUTIONS["contact"], 100, 1)  # loads the kernels
    for place, problems in places():
        for name, resolution in RESOLUTIONS.items():
            runs = [measured(one, resolution, options.expansions, options.repeats)
                    for one in problems]  # fmt: skip
            expanded, first, later = (sum(column) for column in zip(*runs, strict=True))
            aim = AIM_CONTACT if resolution.truncated else AIM
            rows.append([place, name, int(expanded), f"{1e-6 * expanded / first:.3f}",
                         f"{1e-6 * expanded / later:.3f}", f"{1e-6 * aim:g}",
                         verdict(expanded / later >= aim)])  # fmt: skip
    show(["place", "resolution", "expansions", "first [million/s]", "later", "aim", ""], rows)


if __name__ == "__main__":
    main()
