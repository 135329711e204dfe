"""Queries between random poses of one map, many of them, and a picture of what they cost.

``python benchmarks/reachable.py --queries 1000000 --jobs 2`` (half an hour) makes first
plans, each checked by FCL and the audit, from pose to pose anywhere on the map, and draws where
goals are reached, and how long the way is over the straight line. Called again after an
interruption it goes on. ``--compare`` plans the first thousand one by one, in two processes and on
a local Dask cluster of two workers: queries a second, and whether all answers are the same to the
last bit.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import cases
from maneuver_automaton.collision import Disc
from maneuver_automaton.planning import Planner, PlanResult
from maneuver_automaton.problem import Bounds, SearchSettings
from tests.scenes import differential_robot

COLUMNS = 160  # of the picture's cells
COMPARED = 1000


def planner_on(name: str) -> Planner:
    """A robot of 0.22 m on a map of the data, cells nobody has seen taken as blocked."""
    cells = cases.nav2_map(name, unknown_blocked=True)
    low, high = cells.origin[:2], cells.origin[:2] + cells.extent
    return Planner(
        differential_robot(),
        obstacles=cells,
        footprint=Disc(0.22),
        bounds=Bounds(x=(low[0], high[0]), y=(low[1], high[1])),
        search=SearchSettings(improve=False, max_expansions=20_000),
    )


def poses_on(planner: Planner, n: int, *, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Starts and goals (n, 3), free or not, drawn over the free cells of the map."""
    (cells,) = planner.obstacles
    free = np.argwhere(~cells.blocked)
    rng = np.random.default_rng(seed)
    rows, columns = free[rng.integers(len(free), size=2 * n)].T
    shift = rng.uniform(0.0, 1.0, (2, 2 * n))
    x = cells.origin[0] + (columns + shift[0]) * cells.resolution
    y = cells.origin[1] + (rows + shift[1]) * cells.resolution
    poses = np.column_stack([x, y, rng.uniform(-np.pi, np.pi, 2 * n)])
    return poses[:n], poses[n:]


def kept(result: PlanResult) -> list[object]:
    """What is kept of an answer: how it ended, its cost, and the time to its first word [s]."""
    return [result.status.value, result.cost, result.timing_s.get("first_plan")]


def word(result: PlanResult) -> tuple[object, ...]:
    """What must be the same wherever an answer is made."""
    if result.plan is None:
        return result.status, result.reason
    return result.cost, result.plan.word, result.plan.durations.tobytes(), result.clearance_m


def compare(planner: Planner, starts: np.ndarray, goals: np.ndarray) -> None:
    """The same queries one by one and in other processes."""
    began = time.perf_counter()
    alone = [word(planner.plan(*query)) for query in zip(starts, goals, strict=True)]
    print(f"one by one: {len(starts) / (time.perf_counter() - began):.0f} queries a second")
    ways = {"plan_many": {}, "two processes": {"jobs": 2}}
    ways["Dask, two workers"] = {"jobs": 2, "scheduler": "local"}
    for name, how in ways.items():
        list(planner.plan_many(starts[:8], goals[:8], **how))  # the processes begin
        began = time.perf_counter()
        found = list(planner.plan_many(starts, goals, take=word, **how))
        rate = len(starts) / (time.perf_counter() - began)
        same = sum(a == b for a, b in zip(found, alone, strict=True))
        print(f"{name}: {rate:.0f} queries a second, {same} of {len(alone)} the same", flush=True)


def draw(planner: Planner, starts: np.ndarray, goals: np.ndarray, rows: list, path: Path) -> None:
    """Where goals are reached, and how long the way is over the straight line."""
    (cells,) = planner.obstacles
    rows_free, columns_free = np.nonzero(~cells.blocked)
    first = np.array([columns_free.min(), rows_free.min()]) - 2
    last = np.array([columns_free.max(), rows_free.max()]) + 3
    low = cells.origin[:2] + first * cells.resolution
    extent = (last - first) * cells.resolution
    size = extent[0] / COLUMNS
    shape = (int(np.ceil(extent[1] / size)), COLUMNS)
    at = np.floor((goals[:, :2] - low) / size).astype(int)
    at = np.clip(at[:, 1], 0, shape[0] - 1) * COLUMNS + np.clip(at[:, 0], 0, COLUMNS - 1)
    open_start = np.array([row[0] != "start_blocked" for row in rows])
    found = np.array([row[0] == "found" for row in rows])
    cost = np.array([row[1] if row[1] is not None else np.nan for row in rows], dtype=float)
    straight = np.hypot(*(goals - starts)[:, :2].T) / 0.5
    far = found & (straight > 2.0)
    n = shape[0] * shape[1]
    asked = np.bincount(at[open_start], minlength=n)
    share = np.bincount(at[found], minlength=n) / np.maximum(asked, 1)
    longer = np.bincount(at[far], cost[far] / straight[far], n) / np.maximum(
        np.bincount(at[far], minlength=n), 1
    )
    tall = shape[0] / shape[1] > 0.7
    figure = Figure(figsize=(11.0, 4.6) if tall else (7.5, 7.8), layout="constrained")
    left, right = figure.subplots(*((1, 2) if tall else (2, 1)), sharex=True, sharey=True)
    most = max(float(np.percentile(longer[longer > 0], 99.5)), 1.05) if far.any() else 2.0
    area = (low[0], low[0] + extent[0], low[1], low[1] + shape[0] * size)
    for axes, values, label, title, known in (
        (left, share, "share of queries", "goals that are reached", asked > 0),
        (right, longer, "cost over straight line [-]", "how long the way is", longer > 0),
    ):
        shown = np.where(known, values, np.nan).reshape(shape)
        limits = {"vmin": 0.0, "vmax": 1.0} if axes is left else {"vmin": 1.0, "vmax": most}
        image = axes.imshow(
            shown, origin="lower", extent=area, cmap="viridis", aspect="equal", **limits
        )
        blocked = np.ma.masked_where(~cells.blocked, cells.blocked)
        far_x, far_y = cells.origin[:2] + cells.extent
        whole = (cells.origin[0], far_x, cells.origin[1], far_y)
        axes.imshow(blocked, origin="lower", extent=whole, cmap="gray_r", aspect="equal", vmin=0)
        axes.set(xlim=area[:2], ylim=area[2:])
        figure.colorbar(image, ax=axes, label=label, fraction=0.024, pad=0.02)
        axes.set(title=title, xlabel="x [m]", ylabel="y [m]")
    figure.savefig(path, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--map", default="depot")
    parser.add_argument("--queries", type=int, default=10_000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/reachable"))
    parser.add_argument("--compare", action="store_true")
    given = parser.parse_args()
    if not cases.present("nav2-maps"):
        return
    planner = planner_on(given.map)
    starts, goals = poses_on(planner, given.queries, seed=1)
    if given.compare:
        compare(planner, starts[:COMPARED], goals[:COMPARED])
        return
    began = time.perf_counter()
    told = itertools.count()
    answers = planner.plan_many(
        starts,
        goals,
        jobs=given.jobs,
        take=kept,
        journal=given.out.with_suffix(".jsonl"),
        progress=lambda done, n: (
            print(f"{done} of {n}", flush=True) if next(told) % 200 == 0 else None
        ),
    )
    rows = list(answers)
    took = time.perf_counter() - began
    status, count = np.unique([row[0] for row in rows], return_counts=True)
    print(dict(zip(status.tolist(), count.tolist(), strict=True)))
    firsts = np.array([row[2] for row in rows if row[2] is not None])
    print(f"{len(rows)} queries in {took:.0f} s: {len(rows) / took:.0f} a second")
    print(f"first word [ms]: median {1e3 * np.median(firsts):.2f}, "
          f"p99 {1e3 * np.percentile(firsts, 99):.2f}")  # fmt: skip
    draw(planner, starts, goals, rows, given.out.with_suffix(".png"))
    print(f"drawn: {given.out.with_suffix('.png')}")


if __name__ == "__main__":
    main()
