"""How far calls of `plan` exceed their time limit, in processor time.

``python benchmarks/overruns.py FILE [--first SEED] [--count N] [--seconds S] [--kinds ...]``:
random calls by a seed each, for every vehicle of the feature matrix and for scenes of real car
parks; one line of JSON a call. ``--report FILE ...`` prints quantiles of the overrun and the worst
calls, and the share of calls with a plan by the size of the limit. The clock of the package is that
of the processor here, for all threads of the process, so that other work on the machine changes
nothing. Kernels that are compiled or loaded after the call began are named, and their time is not
counted. A call of every vehicle and kind goes before; what these left behind for good, the
compiler's objects above all, is then taken out of the collection of garbage, a full one of which
would look through it all in 0.1 s now and then. What collections take in a call counts, and is
noted. Figures are in docs/guarantees.md.
"""

from __future__ import annotations

import time

time.monotonic = time.process_time  # before the package is imported, which keeps the function

import argparse  # noqa: E402
import gc  # noqa: E402
import importlib  # noqa: E402
import json  # noqa: E402
import math  # noqa: E402
import sys  # noqa: E402
from collections.abc import Iterator, Sequence  # noqa: E402
from contextlib import contextmanager  # noqa: E402
from dataclasses import dataclass, field, replace  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT))

import maneuver_automaton as ma  # noqa: E402
from benchmarks.random_plans import LEFT_OUT, drawn  # noqa: E402
from maneuver_automaton.budget import FIRST_LATE  # noqa: E402
from maneuver_automaton.collision import Motion, Obstacle, OccupancyMap, Polygon  # noqa: E402
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem, SearchSettings  # noqa: E402
from maneuver_automaton.scenario import load_scenario  # noqa: E402
from tests.matrix.vehicles import VEHICLES as ALL  # noqa: E402
from tests.matrix.vehicles import Vehicle  # noqa: E402

LIMITS = (0.02, 2.0)  # [s] drawn evenly on a scale of logarithms
SHARE, CONSTANT = 0.1, 0.02  # of the limit, and [s], by which a call may exceed it with a plan
PARKS = sorted((ROOT.parent / "shared/data/parkbench").glob("*.yaml"))
KINDS = ("free", "obstacles", "map", "moving", "heights", "park")
WORST = 12
VEHICLES = {name: one for name, one in ALL.items() if name not in LEFT_OUT}


@dataclass
class Noted:
    """What a call does beside planning: it loads before the clock starts, and makes kernels."""

    loading: float = 0.0  # [s]
    kernel_seconds: float = 0.0  # [s] after the clock has started
    kernels: list[str] = field(default_factory=list)  # the same
    depth: int = 0
    garbage: float = 0.0  # [s] that was collected
    since: float = 0.0

    def collects(self, phase: str, info: dict[str, int]) -> None:
        """Note how long a collection of garbage takes."""
        now = time.process_time()
        if phase == "start":
            self.since = now
        else:
            self.garbage += now - self.since


@contextmanager
def noted() -> Iterator[Noted]:
    """Note what calls in between load, and which kernels they compile or load from the cache."""
    from numba.core.dispatcher import Dispatcher

    module = importlib.import_module("maneuver_automaton.planning.plan")
    note, compile_one, load = Noted(), Dispatcher.compile, module.load

    def compiled(dispatcher: Any, signature: Any) -> Any:
        began, note.depth = time.process_time(), note.depth + 1
        try:
            return compile_one(dispatcher, signature)
        finally:
            note.depth -= 1
            note.kernels.append(dispatcher.py_func.__name__)
            if note.depth == 0:
                note.kernel_seconds += time.process_time() - began

    def loaded(*arguments: Any) -> None:
        began = time.process_time()
        load(*arguments)
        note.loading += time.process_time() - began
        note.kernel_seconds, note.kernels, note.garbage = 0.0, [], 0.0

    Dispatcher.compile, module.load = compiled, loaded
    gc.callbacks.append(note.collects)
    try:
        yield note
    finally:
        Dispatcher.compile, module.load = compile_one, load
        gc.callbacks.remove(note.collects)


def call_of(seed: int, kinds: Sequence[str]) -> tuple[dict[str, Any], Problem, dict[str, Any]]:
    """What is asked by a seed: a description, the problem, and the options of `plan`."""
    rng = np.random.default_rng([seed, 2011])
    kind = str(rng.choice(kinds))
    limit = float(np.exp(rng.uniform(*np.log(LIMITS))))
    options = {"time_limit": limit, "alternatives": int(rng.choice([0, 0, 0, 2, 5]))}
    said: dict[str, Any] = {"seed": seed, "kind": kind, **options}
    if kind == "park":
        path = PARKS[int(rng.integers(len(PARKS)))]
        return said | {"vehicle": path.stem}, load_scenario(path).problem, options
    flying = [name for name, one in VEHICLES.items() if one.flies]
    vehicle = VEHICLES[str(rng.choice(flying if kind == "heights" else list(VEHICLES)))]
    problem, more = _changed(_scene(vehicle, kind, seed, rng), vehicle, kind, rng)
    return said | {"vehicle": vehicle.name, "more": more}, problem, options


def _scene(vehicle: Vehicle, kind: str, seed: int, rng: np.random.Generator) -> Problem:
    """The vehicle's task with what is in its way."""
    problem = replace(drawn(vehicle, seed)[0], search=SearchSettings())
    solid = [one for one in problem.obstacles if isinstance(one, Obstacle)]
    size, far = vehicle.size, vehicle.reach
    if kind == "free":
        return replace(problem, obstacles=())
    if kind == "map":
        cells = rng.random((40, 40)) < 0.03
        resolution = 2.0 * far / 40.0
        ends = [np.zeros(2), problem.goals[0].pose[:2]]
        at = np.array([-0.5 * far, -far])
        rows, columns = np.indices(cells.shape)
        for end in ends:
            x, y = (columns + 0.5) * resolution + at[0], (rows + 0.5) * resolution + at[1]
            cells &= np.hypot(x - end[0], y - end[1]) > 2.5 * size + resolution
        return replace(
            problem, obstacles=(OccupancyMap(cells, resolution=resolution, origin=[*at, 0.0]),)
        )
    if kind == "moving":
        times = [0.0, float(rng.uniform(1.0, 4.0)) * far / max(vehicle.fastest, 0.1)]
        moved = [
            replace(one, motion=Motion(times, [[0.0, 0.0, 0.0], [*rng.uniform(-far, far, 2), 0.0]]))
            for one in solid[:2]
        ]
        return replace(problem, obstacles=(*moved, *solid[2:]))
    if kind == "heights":
        low = [float(rng.uniform(-2.0, 1.0)) for _ in solid]
        tall = [
            replace(one, height=(z, z + float(rng.uniform(0.5, 4.0))))
            for one, z in zip(solid, low, strict=True)
        ]
        return replace(problem, obstacles=tuple(tall), body_height=(-0.2, 0.2))
    if rng.random() < 0.3:  # many corners
        corners = np.linspace(0.0, 2.0 * math.pi, 25)[:-1]
        star = (
            np.stack([np.cos(corners), np.sin(corners)], axis=1)
            * np.where(np.arange(24) % 2, 1.0, 0.6)[:, None]
        )
        there = [Obstacle(Polygon(size * star + one.shape.center)) for one in solid]
        return replace(problem, obstacles=tuple(there))
    return problem


def _changed(
    problem: Problem, vehicle: Vehicle, kind: str, rng: np.random.Generator
) -> tuple[Problem, list[str]]:
    """The problem with a few features more, and their names."""
    least = vehicle.reach / max(vehicle.fastest, 0.1)
    far, goal = vehicle.reach, problem.goals[0]
    features: dict[str, dict[str, Any]] = {
        "fixed_time": {"horizon": Horizon(time=float(rng.uniform(1.0, 6.0)) * least)},
        "max_time": {"horizon": Horizon(max_time=float(rng.uniform(0.8, 4.0)) * least)},
        "max_trims": {"horizon": Horizon(max_trims=int(rng.integers(2, 7)))},
        "min_coast": {"horizon": Horizon(min_coast=float(rng.uniform(0.01, 0.3)) * least)},
        "several_goals": {"goals": (goal, *(_moved(goal, rng, far) for _ in range(2)))},
        "free_heading": {"goals": (replace(goal, free_heading=True),)},
        "tolerance": {"goals": (replace(goal, tolerance_m=0.1 * vehicle.size, tolerance_rad=0.1),)},
        "direction_price": {"cost": ma.Cost(time=1.0, direction_change=0.2 * least)},
        "switch_price": {"cost": ma.Cost(time=1.0, switch=0.1 * least)},
        "effort": {"cost": ma.Cost(effort=1.0)},
        "length": {"cost": ma.Cost(length=1.0)},
        "bounds": {"bounds": Bounds(x=(-2.0 * far, 2.0 * far), y=(-2.0 * far, 2.0 * far))},
        "words": {"search": SearchSettings(method="words"), "horizon": Horizon(max_trims=4)},
        "insertion": {"search": SearchSettings(method="insertion")},
        "lattice": {"search": SearchSettings(method="lattice")},
        "counted": {"search": SearchSettings(max_expansions=int(rng.integers(50, 5000)))},
        "margin": {"margin": 0.2 * vehicle.size},
    }
    chosen = sorted({str(name) for name in rng.choice(list(features), int(rng.integers(0, 3)))})
    changes: dict[str, Any] = {}
    for name in chosen:
        changes |= features[name]
    if vehicle.inertia and "search" in changes and "words" in chosen:
        changes.pop("search")
    return replace(problem, **changes), chosen


def _moved(goal: Goal, rng: np.random.Generator, far: float) -> Goal:
    pose = goal.pose.copy()
    pose[:2] += rng.uniform(-0.3, 0.3, 2) * far
    return replace(goal, pose=pose)


def asked(seed: int, kinds: Sequence[str]) -> dict[str, Any]:
    """One call and what it took."""
    try:
        said, problem, options = call_of(seed, kinds)
    except ValueError as error:
        return {"seed": seed, "refused": str(error)}
    with noted() as note:
        began = time.process_time()
        try:
            result = ma.plan(problem, **options)
        except ValueError as error:
            return said | {"refused": str(error)}
        took = time.process_time() - began
    return said | {
        "took": took - note.kernel_seconds - note.loading,
        "loading": note.loading,
        "status": result.status.value,
        "cost": result.cost,
        "first": result.timing_s.get("first_plan"),
        "audit": result.timing_s.get("audit"),
        "kernels": note.kernels,
        "kernel_seconds": note.kernel_seconds,
        "garbage": note.garbage,
    }


def warm(kinds: Sequence[str]) -> None:
    """Have libraries, tables and kernels ready that are made once, for whatever vehicle."""
    for vehicle in VEHICLES.values():
        for kind in ("free", "obstacles", "map", "moving"):
            if kind in kinds:
                rng = np.random.default_rng(0)
                ma.plan(_scene(vehicle, kind, 0, rng), time_limit=0.05)
    if "park" in kinds:
        ma.plan(load_scenario(PARKS[0]).problem, time_limit=1.0)
    gc.collect()
    gc.freeze()


def allowed(row: dict[str, Any]) -> float:
    """By how much [s] a call may exceed its limit: more as long as no plan has passed its checks.

    With nothing else to return the check of a plan may be late by a moment of its own.
    """
    limit, first = row["time_limit"], row["first"]
    waits = first is None or first + row["audit"] > limit
    return float(SHARE * limit + CONSTANT + (FIRST_LATE if waits else 0.0))


def report(rows: Sequence[dict[str, Any]]) -> None:
    """Quantiles, the worst calls, and how often there was a plan."""
    refused = [row for row in rows if "took" not in row]
    rows = [row for row in rows if "took" in row]
    print(f"{len(rows)} calls, {len(refused)} refused")
    beyond = np.array([row["took"] - row["time_limit"] - allowed(row) for row in rows])
    over = np.array([row["took"] - row["time_limit"] for row in rows])
    shares = (0.5, 0.9, 0.99, 0.999, 1.0)
    for name, values in (("overrun", over), ("overrun less what is allowed", beyond)):
        quantiles = ", ".join(f"{q:g}: {np.quantile(values, q):+.3f}" for q in shares)
        print(f"{name} [s]  {quantiles}")
    print(f"above what is allowed: {int((beyond > 0.0).sum())}")
    late = sum(bool(row["kernels"]) for row in rows)
    print(f"calls that made kernels: {late}, {sum(row['kernel_seconds'] for row in rows):.2f} s")
    for k in np.argsort(-beyond)[:WORST]:
        row = rows[int(k)]
        keys = ("seed", "kind", "vehicle", "more", "alternatives", "status", "first", "garbage")
        words = ", ".join(f"{key} {row.get(key)}" for key in keys)
        print(f"  {row['took']:.3f} s of {row['time_limit']:.3f} s: {words}")
    for low, high in ((0.02, 0.05), (0.05, 0.1), (0.1, 0.3), (0.3, 2.0)):
        some = [row for row in rows if low <= row["time_limit"] < high]
        found = sum(row["status"] == "found" for row in some)
        print(f"limits from {low} to {high} s: {found} of {len(some)} found")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--report", action="store_true")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seconds", type=float, default=math.inf)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    options = parser.parse_args()
    if options.report:
        lines = [line for file in options.files for line in file.read_text().splitlines()]
        report([json.loads(line) for line in lines])
        return
    warm(options.kinds)
    began = time.process_time()
    with options.files[0].open("w") as lines:
        for seed in range(options.first, options.first + options.count):
            if time.process_time() - began > options.seconds:
                return
            lines.write(json.dumps(asked(seed, options.kinds)) + "\n")
            lines.flush()


if __name__ == "__main__":
    main()
