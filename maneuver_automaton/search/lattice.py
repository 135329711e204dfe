"""A* over lattice cells with exact poses: from both ends in turn, on a ladder of resolutions."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2
from maneuver_automaton.search import _kernels_lattice as kernels
from maneuver_automaton.search.cost_to_go import NO_TABLE, CostTable
from maneuver_automaton.search.distance_grid import DistanceGrid, distance_grid
from maneuver_automaton.search.lattice_pass import WEIGHT, Pass, Rung, both_ends
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.words.word import Word

MOST_CHUNK = 8192  # expansions of one pass before it is the next one's turn
LADDER: tuple[tuple[int, tuple[Rung, ...]], ...] = (
    # after so many expansions of all passes together, or when all are exhausted
    (
        300,
        (
            Rung(contact=True, guided=True),
            Rung(scale=0.5, quanta=0.5, contact=True, guided=True),
        ),
    ),
    (1500, (Rung(scale=0.24, quanta=0.25, contact=True, guided=True),)),
    (
        8000,
        (
            Rung(scale=0.5, quanta=0.5, contact=True, fine=0.2, guided=True),
            Rung(scale=0.5, quanta=0.5, contact=True),
            Rung(scale=0.12, quanta=0.17),
        ),
    ),
    (2**62, (Rung(scale=0.24, quanta=0.25, contact=True, margin=0.1, guided=True),)),
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FirstPlan:
    """What the ladder came to."""

    word: Word | None
    expansions: int
    queries: int  # collision queries
    exhausted: bool  # every rung was tried to its end
    enclosed: str  # why no plan can exist, if the plane alone proves it
    nearest: float  # [m] least distance to the goal that was reached
    nodes: Array | None = None  # (n, 4) x, y, heading, cost of what was expanded, if asked for


def first_plan(
    query: LatticeQuery,
    *,
    deadline: float,
    max_expansions: int | None = None,
    table: CostTable = NO_TABLE,
) -> FirstPlan:
    """The first connection from start to a goal, by the first rung that has one."""
    settings = query.problem.search
    grids = distance_grids(query)
    room = max_expansions or 2**62
    base = Rung(weight=settings.weight or WEIGHT)
    passes = both_ends(query, base, grids=grids)
    total, ladder = 0, list(LADDER)
    while True:
        for one in passes:
            if not one.alive or total >= room or time.monotonic() >= deadline:
                continue
            before = one.expansions
            word = one.run(min(one.chunk, room - total), math.inf, deadline=deadline)
            total += one.expansions - before
            one.chunk = min(2 * one.chunk, MOST_CHUNK)
            if word is not None:
                return _outcome(query, passes, total, word, exhausted=False)
        alive = any(one.alive for one in passes)
        enclosed = "" if alive else _enclosed(query, grids)
        if total >= room or time.monotonic() >= deadline or enclosed:
            return _outcome(query, passes, total, None, exhausted=not alive, enclosed=enclosed)
        if ladder and (not alive or total >= ladder[0][0]):
            for rung in ladder.pop(0)[1]:
                guide = table if rung.guided else NO_TABLE
                passes += both_ends(query, rung, grids=grids, table=guide)
        elif not alive:
            return _outcome(query, passes, total, None, exhausted=True)


def distance_grids(query: LatticeQuery) -> tuple[DistanceGrid, DistanceGrid]:
    """Distances to the goals and to the start."""
    to_goal = distance_grid(query.world, query.box, query.goals, query.start)
    to_start = distance_grid(query.world, query.box, query.start[None], query.goals[0])
    return to_goal, to_start


def _enclosed(query: LatticeQuery, grids: tuple[DistanceGrid, DistanceGrid]) -> str:
    """Why no plan can exist: the plane around the goals, or the start, is closed."""
    from maneuver_automaton.search._kernels_distance import distances

    for grid, name, far in (
        (grids[0], "goal", query.start[None]),
        (grids[1], "start", query.goals),
    ):
        if not grid.columns:
            continue
        way = distances(grid, query.world.arrays.field, np.ascontiguousarray(far[:, :2]))
        if np.isinf(way).all() and (query.bounded or not grid.state[2]):
            return f"obstacles enclose the {name}"
    return ""


def _outcome(
    query: LatticeQuery,
    passes: list[Pass],
    expansions: int,
    word: Word | None,
    *,
    exhausted: bool,
    enclosed: str = "",
) -> FirstPlan:
    nearest = math.inf
    if word is None:
        for one in passes:
            poses = one.arrays.nodes[: int(one.arrays.state[kernels.N_NODES]), :2]
            for aim in one.task.aims:
                if len(poses):
                    nearest = min(nearest, float(np.hypot(*(poses - aim[:2]).T).min()))
    return FirstPlan(
        word=word,
        expansions=expansions,
        queries=sum(one.queries for one in passes),
        exhausted=exhausted,
        enclosed=enclosed,
        nearest=nearest,
        nodes=_expanded(query, passes) if query.problem.search.show_nodes else None,
    )


def _expanded(query: LatticeQuery, passes: list[Pass]) -> Array:
    """Poses (n, 4) of the nodes that were expanded, in the problem's frame, and their costs."""
    rows = []
    for one in passes:
        n = int(one.arrays.state[kernels.N_NODES])
        which = one.arrays.links[:n, 5] == 1
        rows.append(one.arrays.nodes[:n][which][:, :4])
    nodes = np.concatenate(rows)
    turned = SE2(np.array([0.0, 0.0, query.world.frame[2]])) @ SE2(nodes[:, :3])
    poses = turned.pose.copy()
    poses[:, :2] += query.world.frame[:2]
    return np.column_stack([poses, nodes[:, 3]])
