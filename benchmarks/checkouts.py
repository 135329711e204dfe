"""This checkout beside another one: first plans, costs, steps and memory, on the same problems.

``python benchmarks/checkouts.py OTHER [--groups car tight ...] [--repeats N] [--every K]``:
a process of each checkout answers in turn, so that a busy machine slows both alike, and the clock
of both is the time of their processor: limits of time mean that, too. Ratios are this checkout over
the other one, by medians over the repeats; OTHER is a folder with another state of the project.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).parents[1]
AT = (0.1, 1.0)  # [s] when costs are read
STEPS = 12  # of a closed loop
Measure = Callable[[float], dict[str, float]]


def served(groups: list[str], every: int) -> dict[str, Measure]:
    """What can be measured in the checkout on `sys.path`, by name."""
    return {
        f"{group} {name}": measure
        for group in groups
        for k, (name, measure) in enumerate(GROUPS[group]())
        if k % every == 0
    }


def plans(problems: dict[Any, Any]) -> Iterator[tuple[str, Measure]]:
    """Plans of problems: time of the first, and costs after a while."""
    import maneuver_automaton as ma

    for name, problem in problems.items():

        def measure(limit: float, problem: Any = problem) -> dict[str, float]:
            result = ma.plan(problem, time_limit=limit)
            found = result.improvements
            costs = {
                f"cost {at:g}": min((cost for s, cost in found if s <= at), default=math.inf)
                for at in AT
                if at <= limit
            }
            return {"first": found[0][0] if found else math.inf} | costs

        yield str(name), measure


def car() -> Iterator[tuple[str, Measure]]:
    from benchmarks import cases

    yield from plans(cases.car_scenarios())


def tight() -> Iterator[tuple[str, Measure]]:
    from benchmarks import tight_places
    from tests import scenes

    yield from plans(tight_places.places())
    yield from plans({f"room {k}": one for k, one in enumerate(scenes.room_queries(12))})


def tpcap() -> Iterator[tuple[str, Measure]]:
    from benchmarks import cases

    yield from plans(cases.tpcap())


def dynobench() -> Iterator[tuple[str, Measure]]:
    from benchmarks import cases

    yield from plans({name: cases.dynobench(name) for name in cases.FIRST_ORDER})


def nav2() -> Iterator[tuple[str, Measure]]:
    from benchmarks import cases, nav2_pairs

    for name in nav2_pairs.MAPS:
        cells = cases.nav2_map(name, unknown_blocked=True)
        body = nav2_pairs.BODIES["0.6 x 0.4 m"]
        pairs = nav2_pairs.pairs(cells, body, 6, 0)
        yield from plans({f"{name} {k}": pair for k, pair in enumerate(pairs)})


def moving() -> Iterator[tuple[str, Measure]]:
    from tests import scenes

    yield from plans({seed: scenes.moving_scene(seed) for seed in range(10)})


def inertia() -> Iterator[tuple[str, Measure]]:
    """Vehicles with inertia on dynobench's maps: a robot, and a car with a trailer."""
    import yaml

    from benchmarks import cases, maneuver_search
    from maneuver_automaton.collision import Box
    from maneuver_automaton.problem import Bounds, Goal, Problem
    from tests.search.automata import inertial_unicycle, truck_with_trailer

    robot, truck = inertial_unicycle(levels=5), truck_with_trailer()
    for name in maneuver_search.PROBLEMS:
        text = (cases.DATA / "dynobench" / "envs" / f"{name}.yaml").read_text()
        given = yaml.safe_load(text)
        world, ends = given["environment"], given["robots"][0]
        trailed = name.startswith("car1")
        low, high = world["min"], world["max"]
        rest = "0 at 0.00" if trailed else "0 0"
        problem = Problem(
            truck if trailed else robot,
            ends["start"][:3],
            Goal(pose=ends["goal"][:3], trim=rest),
            obstacles=[Box(one["size"], one["center"]) for one in world["obstacles"]],
            footprint=Box([0.5, 0.25]),
            parts={"trailer": Box([0.3, 0.25])} if trailed else {},
            bounds=Bounds(x=(low[0], high[0]), y=(low[1], high[1])),
            start_trim=rest,
        )
        yield from plans({name: problem})


def words() -> Iterator[tuple[str, Measure]]:
    """Free space: scenarios of the paper, and vehicles with inertia in it."""
    from maneuver_automaton.problem import Goal, Problem
    from maneuver_automaton.scenario import load_scenario
    from tests.search.automata import inertial_unicycle, truck_with_trailer

    named = ("parking", "table1", "example10", "several_goals", "lane_change", "hovercraft")
    for name in named:
        yield from plans({name: load_scenario(f"scenarios/{name}.yaml").problem})
    for name, automaton, rest in (
        ("robot with inertia", inertial_unicycle(levels=5), "0 0"),
        ("trailer", truck_with_trailer(), "0 at 0.00"),
    ):
        goal = Goal(pose=[4.0, 2.0, 1.0], trim=rest)
        yield from plans({name: Problem(automaton, [0.0, 0.0, 0.0], goal, start_trim=rest)})


def loops() -> Iterator[tuple[str, Measure]]:
    """Steps of closed loops with 5 and 1,681 trims, and among obstacles that move."""
    from dataclasses import replace

    from maneuver_automaton.receding_horizon import RecedingHorizon
    from maneuver_automaton.scenario import load_scenario

    names = {"parking_loop": 1.0, "grid_1681": 0.5, "crossing_traffic": 0.5}
    for name, step in names.items():
        problem = load_scenario(f"scenarios/{name}.yaml").problem
        problem = replace(problem, search=replace(problem.search, max_expansions=2000))

        def measure(_: float, problem: Any = problem, step: float = step) -> dict[str, float]:
            controller, pose = RecedingHorizon(problem, step=step), problem.start
            laps: list[float] = []
            value = math.nan
            for _n in range(STEPS):
                began = time.process_time()
                _plan, log = controller.step(pose)
                laps.append(time.process_time() - began)
                pose, value = log.predicted, log.value
            later = statistics.median(laps[1:])
            return {"first": laps[0], "step": later, "cost at the end": value}

        yield name, measure


def insertion() -> Iterator[tuple[str, Measure]]:
    """Insertion with 40,401 trims."""
    import numpy as np

    from benchmarks.insertion import SIDES, problems
    from maneuver_automaton.automaton import Automaton
    from maneuver_automaton.models import Unicycle

    axis = np.linspace(-2.0, 2.0, SIDES[-1]).round(9)
    library = Automaton.of_grid(Unicycle(), [axis, axis])
    yield from plans(problems(library))


GROUPS: dict[str, Callable[[], Iterator[tuple[str, Measure]]]] = {
    "car": car,
    "tight": tight,
    "tpcap": tpcap,
    "dynobench": dynobench,
    "nav2": nav2,
    "moving": moving,
    "inertia": inertia,
    "words": words,
    "loops": loops,
    "insertion": insertion,
}


def serve(groups: list[str], every: int) -> None:
    """Answer names and limits from standard input, one line of JSON each."""
    time.monotonic = time.process_time  # what the limits of the planner are measured by
    measures = served(groups, every)
    print(json.dumps(sorted(measures)), flush=True)
    for line in sys.stdin:
        name, limit = json.loads(line)
        values = measures[name](limit)
        values["memory [MB]"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        print(json.dumps(values), flush=True)


@dataclass(frozen=True, slots=True, eq=False)
class Checkout:
    """A process of one checkout."""

    process: subprocess.Popen[str]
    names: list[str]

    def ask(self, name: str, limit: float) -> dict[str, float]:
        """Values of one run."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps([name, limit]) + "\n")
        self.process.stdin.flush()
        return dict(json.loads(self.process.stdout.readline()))


def checkout(folder: Path, groups: list[str], every: int) -> Checkout:
    """Start a process in a folder; its kernels are loaded by the first runs."""
    command = [sys.executable, __file__, "--serve", "--groups", *groups, "--every", str(every)]
    process = subprocess.Popen(
        command,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    return Checkout(process, json.loads(process.stdout.readline()))


def compared(pair: tuple[Checkout, Checkout], name: str, repeats: int) -> dict[str, list[float]]:
    """Medians of this checkout and the other over runs in turn, one before them not counted."""
    runs: tuple[list[dict[str, float]], list[dict[str, float]]] = ([], [])
    for one in pair:
        one.ask(name, AT[0])
    for limit, count in ((AT[0], repeats), (AT[-1], max(1, repeats // 3))):
        for _ in range(count):
            for one, found in zip(pair, runs, strict=True):
                found.append(one.ask(name, limit))
    keys = {key for found in runs for run in found for key in run}
    return {
        key: [statistics.median(run[key] for run in found if key in run) for found in runs]
        for key in sorted(keys)
    }


def show(rows: dict[str, dict[str, list[float]]]) -> None:
    """A line for every case, then the median and the worst of every group."""
    ratios: dict[tuple[str, str], list[float]] = {}
    for name, values in rows.items():
        words = []
        for key, (ours, other) in values.items():
            if math.isinf(ours) and math.isinf(other):
                continue
            ratio = ours / other if other else math.nan
            ratios.setdefault((name.split()[0], key), []).append(ratio)
            words.append(f"{key}: {ours:.6g} / {other:.6g} = {ratio:.4f}")
        print(f"{name}: {'; '.join(words)}")
    print("\nratios by group: median, least, greatest, number")
    for (group, key), found in sorted(ratios.items()):
        middle, low, high = statistics.median(found), min(found), max(found)
        print(f"{group:10s} {key:18s} {middle:.4f} {low:.4f} {high:.4f} {len(found)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", nargs="?", type=Path, help="folder of the other checkout")
    parser.add_argument("--groups", nargs="+", choices=list(GROUPS), default=list(GROUPS))
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--every", type=int, default=1, help="only every so many cases of a group")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        sys.path.insert(0, str(Path.cwd()))
        serve(options.groups, options.every)
        return
    if options.other is None:
        parser.error("name the folder of the other checkout")
    for group in options.groups:
        folders = (HERE, options.other.resolve())
        pair = tuple(checkout(folder, [group], options.every) for folder in folders)
        assert len(pair) == 2
        names = [name for name in pair[0].names if name in pair[1].names]
        rows = {name: compared((pair[0], pair[1]), name, options.repeats) for name in names}
        show(rows)
        for one in pair:
            one.process.terminate()


if __name__ == "__main__":
    main()
