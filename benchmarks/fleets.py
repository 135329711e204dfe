"""Several vehicles: the published sets of CL-CBS and db-CBS, beside what those planners report.

``python benchmarks/fleets.py [NAME ...] [--seconds S] [--jobs N]``: every file of
``../shared/data/fleet`` whose name holds one of the words. Printed are how many vehicles have a
plan, the sum of their arrivals alone and together, when the last arrives, processor time to the
first feasible fleet and in all, the least distance of two bodies by shapely at 5 ms, and the least
published sum (as reported, or of arrivals on the planner's clock).

``python benchmarks/fleets.py --folder FOLDER [--limits 1,5,20] [--draw N] [--cpu] [--rounds R]``:
the share that is solved within limits of time, and the medians of what solved ones cost over the
sum alone, for every folder of files below FOLDER, as CSDO's benchmark has them; with --draw N of
each kind are drawn there first. Who is solved within one limit counts as solved within the longer
ones. --cpu counts processor time, which other programs on the machine disturb less; --rounds 0 ends
with first plans.
"""

from __future__ import annotations

import argparse
import csv
import functools
import math
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import shapely

from benchmarks import cases
from benchmarks.drawn_fleets import draw
from benchmarks.tables import median, show
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import carried
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.surroundings import ShapePart, parts_of
from maneuver_automaton.fleet import FleetProblem, FleetResult, plan_fleet, planning
from maneuver_automaton.scenario import load_scenario

DATA = cases.DATA / "fleet"
STEP = 0.005  # [s] between two looks at the bodies
BLOCK = 400  # looks at once


def files(words: list[str]) -> list[Path]:
    """The files of the set whose names hold one of the words; all without any."""
    every = sorted(DATA.glob("*-cbs/*.yaml"))
    return [path for path in every if not words or any(word in path.name for word in words)]


def published() -> dict[str, float]:
    """The least sum that is published for an instance."""
    best: dict[str, float] = {}
    with (DATA / "published.csv").open() as file:
        for row in csv.DictReader(file):
            for text in (row["arrival_sum_s"], row["flowtime_s"]):
                if text and row["solved"] == "True":
                    best[row["instance"]] = min(best.get(row["instance"], math.inf), float(text))
    return best


def bodies(fleet: FleetProblem, result: FleetResult) -> Iterator[tuple[str, ShapePart, Plan]]:
    """Parts of every vehicle with its name and the plans of their frames."""
    for name, problem in zip(fleet.names, fleet.problems, strict=True):
        plan = result.plans.get(name)
        if plan is None:
            continue
        yield from ((name, part, plan) for part in parts_of(problem.footprint))
        for carried_name, shapes in problem.parts.items():
            behind = carried(plan, problem.automaton.model, carried_name)
            yield from ((name, part, behind) for part in parts_of(shapes))


def least_distance(fleet: FleetProblem, result: FleetResult) -> float:
    """Least distance [m] of any two bodies at short steps until all have arrived."""
    every = list(bodies(fleet, result))
    at_zero = [part.at(np.zeros((1, 3))) for _, part, _ in every]
    reach = np.array([np.hypot(*shapely.get_coordinates(core).T).max() for core in at_zero])
    reach += [part.radius for _, part, _ in every]
    owner = np.unique([name for name, *_ in every], return_inverse=True)[1]
    times = np.arange(0.0, result.last_s + 1.0, STEP)
    least = math.inf
    ways = [
        plan.pose_at(np.clip(times, plan.start_time, plan.start_time + plan.duration))[:, :3]
        for _, _, plan in every
    ]
    for begin in range(0, len(times), BLOCK):
        now = [way[begin : begin + BLOCK] for way in ways]
        places = np.array(now).reshape(len(now), -1, 3)[..., :2]
        low, high = places.min(axis=1), places.max(axis=1)
        gaps = np.maximum(low[:, None] - high, low - high[:, None]).max(axis=-1)
        apart = (gaps - reach - reach[:, None] <= least) & (owner[:, None] < owner)
        for one, other in zip(*np.nonzero(apart), strict=True):
            far = np.hypot(*(places[one] - places[other]).T) - reach[one] - reach[other]
            near = np.flatnonzero(far <= least)
            if near.size:
                parts = [(every[k][1], now[k][near]) for k in (one, other)]
                found = shapely.distance(*(part.at(poses) for part, poses in parts))
                least = min(least, float(found.min()) - sum(part.radius for part, _ in parts))
    return least


def solved_shares(folder: Path, limits: list[float], plan: Callable[..., FleetResult]) -> None:
    """A table of the kinds of instances below a folder, and of limits of time [s]."""
    rows, warm = [], False
    for kind in sorted({path.parent for path in folder.rglob("*.yaml")}):
        paths = sorted(kind.glob("*.yaml"))
        every = len(paths)
        for limit in limits:
            unsolved, excess, firsts, least = [], [], [], math.inf
            for path in paths:
                fleet = load_scenario(path).fleet
                if not warm:
                    plan(fleet, time_limit=limit)
                    warm = True
                result = plan(fleet, time_limit=limit)
                least = min(least, least_distance(fleet, result))
                if len(result.plans) < len(fleet):
                    unsolved.append(path)
                    continue
                firsts.append(result.timing_s["first_plan"])
                excess.append(100.0 * (result.sum_s / result.alone_cost - 1.0))
            done = f"{every - len(unsolved)}/{every}"
            name = str(kind.relative_to(folder))
            rows.append([name, limit, done, median(firsts), median(excess), least])
            print(*rows[-1], flush=True)
            paths = unsolved
    print()
    show(["kind", "limit [s]", "solved", "first [s]", "over alone [%]", "least [m]"], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--rounds", type=int)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--limits", default="1,5,20")
    parser.add_argument("--draw", type=int, default=0)
    parser.add_argument("--cpu", action="store_true")
    given = parser.parse_args()
    if given.folder is not None:
        if given.cpu:
            begin = functools.partial(Budget.from_now, clock=time.process_time)
            planning.Budget = SimpleNamespace(from_now=begin)
        if given.draw:
            draw(given.folder, given.draw, given.seed)
        limits = [float(one) for one in given.limits.split(",")]
        settings = {"seed": given.seed, "jobs": given.jobs, "max_rounds": given.rounds}
        solved_shares(given.folder, limits, functools.partial(plan_fleet, **settings))
        return
    if not cases.present("fleet"):
        return
    best, rows = published(), []
    for path in files(given.words):
        fleet = load_scenario(path).fleet
        began, firsts = time.process_time(), []
        result = plan_fleet(
            fleet,
            time_limit=given.seconds,
            seed=given.seed,
            jobs=given.jobs,
            on_better=lambda s, v, b=began, f=firsts: f.append(time.process_time() - b),
        )
        took = time.process_time() - began
        alone = result.lower_bound
        name = path.stem
        rows.append(
            [name, f"{len(result.plans)}/{len(fleet)}", alone, result.alone_cost, result.sum_s,
             result.last_s, firsts[0] if firsts else math.inf, took,
             least_distance(fleet, result), best.get(name, math.inf)]
        )  # fmt: skip
        print(name, *(f"{x:.4g}" if isinstance(x, float) else x for x in rows[-1][1:]), flush=True)
        for who, why in result.reasons.items():
            print(f"  {who}: {why}", flush=True)
    print()
    show(
        ["instance", "planned", "bound", "alone", "sum [s]", "last [s]", "first [s cpu]", "[s cpu]",
         "least [m]", "published"],
        rows,
    )  # fmt: skip


if __name__ == "__main__":
    main()
