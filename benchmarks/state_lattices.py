"""Libraries on a lattice beside an uninformed compiled Dijkstra: costs, processor time of both.

    python -m benchmarks.state_lattices [FILE ...]

FILE holds primitives (.mprim of SBPL, a lattice of Nav2). The peer keeps one number for each node
and tests the cells that the body covers along a primitive, as SBPL and Nav2 do: its cells count as
a whole, so that among solids it may pay more. It knows no bound of the cost to go, and ends at the
goal. What is measured of the plan is the whole call: search, checks, audit; the median of some
calls of both. `same tests` is the search of the package without any bound, with its own tests.
"""

from __future__ import annotations

import functools
import heapq
import math
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import shapely
from shapely.affinity import rotate, translate

from benchmarks.cases import DATA, present
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.collision import Box
from maneuver_automaton.formats.libraries import read_primitives
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning.blocked import blocked_ends
from maneuver_automaton.planning.planner import Planner
from maneuver_automaton.problem import Bounds, Problem
from maneuver_automaton.search.state_lattice import GraphSearch, graph_of

FILES = ("field/nova04.json", "field/carina16.mprim", "sbpl/mprim/pr2.mprim")
SPAN = 100  # cells from side to side of the room
SEEDS = 8
CALLS = 5


@numba.njit  # type: ignore[misc]
def dijkstra(first, target, step, cost, first_cell, cell, blocked, start, goal):
    """Least cost from a node (column, row, heading) to another, and the number of expansions."""
    rows, columns = blocked.shape
    n = len(first) - 1
    best = np.full((columns * rows * n,), np.inf)
    begin = (start[0] * rows + start[1]) * n + start[2]
    end = (goal[0] * rows + goal[1]) * n + goal[2]
    best[begin], expansions = 0.0, 0
    frontier = [(0.0, begin)]
    while frontier:
        spent, node = heapq.heappop(frontier)
        if spent > best[node]:
            continue
        expansions += 1
        if node == end:
            return spent, expansions
        k, place = node % n, node // n
        i, j = place // rows, place % rows
        for e in range(first[k], first[k + 1]):
            a, b = i + step[e, 0], j + step[e, 1]
            if not (0 <= a < columns and 0 <= b < rows):
                continue
            there = (a * rows + b) * n + target[e]
            if best[there] <= spent + cost[e]:
                continue
            free = True
            for c in range(first_cell[e], first_cell[e + 1]):
                u, v = i + cell[c, 0], j + cell[c, 1]
                if not (0 <= u < columns and 0 <= v < rows) or blocked[v, u]:
                    free = False
                    break
            if free:
                best[there] = spent + cost[e]
                heapq.heappush(frontier, (spent + cost[e], there))
    return np.inf, expansions


def tables(automaton, body):
    """The library as arrays: edges by heading, and the cells that the body covers along each."""
    res, names = automaton.model.resolution, automaton.trim_names
    rows = []
    for one in automaton.maneuvers:
        base = np.array([0.0, 0.0, heading_of(automaton[one.source])])
        poses = (SE2(base) @ SE2(one.course.pose)).pose
        ends = np.round(poses[-1, :2] / res).astype(int)
        swept = shapely.union_all(
            [translate(rotate(body, p[2], (0, 0), use_radians=True), *p[:2]) for p in poses]
        )
        low, high = (np.round(np.array(swept.bounds)[s] / res) for s in (slice(2), slice(2, 4)))
        grid = np.stack(
            np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(low, high, strict=True))), axis=-1
        ).reshape(-1, 2)
        half = res / 2.0
        squares = shapely.box(*(grid * res - half).T, *(grid * res + half).T)
        cells = grid[shapely.intersects(squares, swept)].astype(np.int64)
        price = one.duration * one.cost_multiplier
        rows.append((names.index(one.source), names.index(one.target), ends, price, cells))
    rows.sort(key=lambda row: row[0])
    counts = np.bincount([row[0] for row in rows], minlength=len(names))
    return (
        np.concatenate([[0], np.cumsum(counts)]),
        np.array([row[1] for row in rows]),
        np.array([row[2] for row in rows]),
        np.array([row[3] for row in rows]),
        np.concatenate([[0], np.cumsum([len(row[4]) for row in rows])]),
        np.concatenate([row[4] for row in rows]),
    )


def heading_of(trim):
    return math.atan2(trim.reduced_state[1], trim.reduced_state[0])


def drawn(automaton, size, seed):
    """A room with a dozen boxes, or none for seed 0; start and goal are cells of it."""
    res, rng = automaton.model.resolution, np.random.default_rng(seed)
    side = SPAN * res
    boxes = [
        Box(rng.uniform(0.04, 0.2, 2) * side, rng.uniform(0.0, side, 2))
        for _ in range(12 if seed else 0)
    ]
    first = next(trim for trim in automaton.trims if heading_of(trim) == 0.0)
    while True:
        cells = rng.integers(15, SPAN - 15, (2, 2))
        trim = automaton.trims[rng.integers(len(automaton))]
        start, goal = (
            np.append(c * res, h) for c, h in zip(cells, (0.0, heading_of(trim)), strict=True)
        )
        problem = Problem(
            automaton, start, goal, obstacles=boxes, footprint=Box(size), start_trim=first.name,
            bounds=Bounds(x=(0.0, side), y=(0.0, side)),
        )  # fmt: skip
        if blocked_ends(problem) is None:
            names = automaton.trim_names
            ends = (*cells[0], names.index(first.name)), (*cells[1], names.index(trim.name))
            return problem, ends


def timed(call):
    """Processor time [ms] of a call, and what it returns."""
    begin = time.process_time()
    result = call()
    return 1e3 * (time.process_time() - begin), result


def graph_on(problem, planner):
    return graph_of(problem, range(len(problem.goals)), planner.workspace.prepared)


def uninformed(problem, planner):
    """The search of the package without any bound of the cost to go."""
    graph = graph_on(problem, planner)
    nothing = np.where(np.isfinite(graph.aims.offset), 0.0, np.inf)
    aims = graph.aims._replace(slope=np.zeros_like(graph.aims.slope), offset=nothing)
    one = GraphSearch.of(replace(graph, aims=aims), weight=1.0, budget=UNLIMITED)
    while one.alive:
        one.run(1 << 20, math.inf)
    return one.cost


def main(files):
    print(
        "library, seed | plan: cost, bound, expansions, ms "
        "| Dijkstra: cost, expansions, ms | same tests: ms"
    )
    for file in files:
        automaton = read_primitives(file).automaton
        res = automaton.model.resolution
        size = (6.0 * res, 4.0 * res)
        arrays = tables(
            automaton, shapely.box(-size[0] / 2, -size[1] / 2, size[0] / 2, size[1] / 2)
        )
        sums = np.zeros(3)
        for seed in range(SEEDS):
            problem, (start, goal) = drawn(automaton, size, seed)
            centres = np.arange(SPAN + 1) * res
            squares = [
                shapely.box(*(np.array(one.shape.center) - np.array(one.shape.size) / 2),
                            *(np.array(one.shape.center) + np.array(one.shape.size) / 2))
                for one in problem.obstacles
            ]  # fmt: skip
            x, y = np.meshgrid(centres, centres)
            cells = shapely.box(x - res / 2, y - res / 2, x + res / 2, y + res / 2)
            blocked = shapely.intersects(cells, shapely.union_all(squares))
            planner = Planner(
                automaton, obstacles=problem.obstacles, footprint=problem.footprint,
                bounds=problem.bounds, start_trim=problem.start_trim,
            )  # fmt: skip
            ask = functools.partial(planner.plan, problem.start, problem.goals, time_limit=60.0)
            other = functools.partial(dijkstra, *arrays, blocked, start, goal)
            uninformed(problem, planner), other()  # all is compiled
            result = ask()
            ours = statistics.median(timed(ask)[0] for _ in range(CALLS))
            peer, (cost, expansions) = timed(other)
            peer = statistics.median([peer, *(timed(other)[0] for _ in range(CALLS - 1))])
            same = timed(functools.partial(uninformed, problem, planner))[0]
            sums += ours, peer, same
            shown = math.inf if result.cost is None else result.cost
            kind = "" if result.bound is None else f"{result.bound.kind} {result.lower_bound:.4f}"
            done = result.counts["expansions"]
            mine = f"{shown:9.4f} {kind or result.status.value} {done:6}"
            mine += f" {ours:6.1f}"
            peers = f"{cost:9.4f} {expansions:7} {peer:6.1f} | {same:7.1f}"
            print(f"{Path(file).name:16} {seed} | {mine} | {peers}", flush=True)
        ours, peer, same = sums
        print(
            f"{Path(file).name:16} sum: {ours:.0f} ms, Dijkstra {peer:.0f} ms, "
            f"with the same tests {same:.0f} ms"
        )


if __name__ == "__main__":
    main([Path(one) for one in sys.argv[1:]] or [DATA / one for one in FILES if present(one)])
