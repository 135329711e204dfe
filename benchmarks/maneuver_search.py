"""The search over trims and maneuvers on dynobench's vehicles with inertia, and with a trailer.

``python benchmarks/maneuver_search.py [--time-limit S]``: exact goal, exact body, rest to
rest; the first word, and the best one at the limit.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import cases
from benchmarks.tables import show
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Box, Obstacle
from maneuver_automaton.problem import Bounds, Goal, Problem
from maneuver_automaton.search.lattice_pass import plan_of_word
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from tests.search.automata import inertial_unicycle, truck_with_trailer
from tests.search.maneuver_searches import search_maneuvers

PROBLEMS = (
    "unicycle2_v0/parallelpark_0",
    "unicycle2_v0/kink_0",
    "unicycle2_v0/narrow_passage",
    "car1_v0/kink_0",
    "car1_v0/bugtrap_double",
)


def vehicles() -> dict[str, tuple[Automaton, dict, str]]:
    """Library, parts and the trim at rest of each vehicle."""
    return {
        "unicycle2_v0": (inertial_unicycle(levels=5), {}, "0 0"),
        "car1_v0": (truck_with_trailer(), {"trailer": Box([0.3, 0.25])}, "0 at 0.00"),
    }


def query_of(name: str, known: dict[str, tuple[Automaton, dict, str]]) -> LatticeQuery:
    given = yaml.safe_load((cases.DATA / "dynobench" / "envs" / f"{name}.yaml").read_text())
    robot, world = given["robots"][0], given["environment"]
    automaton, parts, rest = known[robot["type"]]
    low, high = world["min"], world["max"]
    problem = Problem(
        automaton,
        robot["start"][:3],
        Goal(pose=robot["goal"][:3], trim=rest),
        start_trim=rest,
        footprint=Box([0.5, 0.25]),
        parts=parts,
        obstacles=tuple(Obstacle(Box(one["size"], one["center"])) for one in world["obstacles"]),
        bounds=Bounds(x=(low[0], high[0]), y=(low[1], high[1])),
    )
    return lattice_query(problem, (0,))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=5.0)
    options = parser.parse_args()
    if not cases.present("dynobench"):
        return
    known = vehicles()
    for name in PROBLEMS:  # compile
        search_maneuvers(query_of(name, known), max_expansions=3000)
    rows = []
    for name in PROBLEMS:
        query = query_of(name, known)
        result = search_maneuvers(query, budget=Budget.from_now(options.time_limit))
        first, best = result.words[0], result.words[-1]
        off = plan_of_word(query, best).end - query.goal_poses[best.goal]
        off[2] = np.remainder(off[2] + np.pi, 2.0 * np.pi) - np.pi
        rows.append([
            name, result.found_after[0], 1e3 * result.found_s[0], first.duration,
            best.duration, result.found_s[-1], result.expansions, float(np.abs(off).max()),
        ])  # fmt: skip
    show(["problem", "expansions", "first [ms]", "first [s]", "best [s]", "found at [s]",
          "expansions", "off goal"], rows)  # fmt: skip


if __name__ == "__main__":
    main()
