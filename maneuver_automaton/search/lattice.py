"""A* over lattice cells with exact poses: from both ends in turn, at several resolutions."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2
from maneuver_automaton.search import _kernels_lattice as kernels
from maneuver_automaton.search.cost_to_go import NO_TABLE, CostTable
from maneuver_automaton.search.distance_grid import DistanceGrid, distance_grid
from maneuver_automaton.search.lattice_pass import Pass, both_ends
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_task import WEIGHT, Resolution
from maneuver_automaton.words.word import Word


class Schedule(NamedTuple):
    """Which resolutions begin after so many expansions of all together, or when none is left.

    They run in turn, each twice as many expansions as in its turn before.
    """

    stages: tuple[tuple[int, tuple[Resolution, ...]], ...]
    first_chunk: int
    most_chunk: int


SCHEDULE = Schedule(
    (
        (0, (Resolution(),)),
        (
            300,
            (
                Resolution(truncated=True, guided=True),
                Resolution(scale=0.5, durations=0.5, truncated=True, guided=True),
            ),
        ),
        (1500, (Resolution(scale=0.24, durations=0.25, truncated=True, guided=True),)),
        (
            8000,
            (
                Resolution(scale=0.5, durations=0.5, truncated=True, fine=0.2, guided=True),
                Resolution(scale=0.5, durations=0.5, truncated=True),
                Resolution(scale=0.12, durations=0.17),
            ),
        ),
        (
            2**62,
            (Resolution(scale=0.24, durations=0.25, truncated=True, margin=0.1, guided=True),),
        ),
    ),
    first_chunk=64,
    most_chunk=8192,
)


class FirstWord(NamedTuple):
    """The result of a schedule of searches."""

    word: Word | None
    passes: list[Pass]
    expansions: int
    exhausted: bool  # every resolution was tried to its end
    enclosed: str = ""  # why no plan can exist, where that is proven
    by: Pass | None = None  # which search found it


def first_word(
    schedule: Schedule,
    passes_of: Callable[[Resolution], list[Pass]],
    *,
    room: int,
    deadline: float,
    enclosed: Callable[[], str] = lambda: "",
) -> FirstWord:
    """The first connection from start to a goal, at the first resolution that has one.

    Parameters
    ----------
    schedule : Schedule
    passes_of : callable
        The searches at a resolution, ready to run.
    room : int
        Expansions of all searches together.
    deadline : float
        Of `time.monotonic()` [s].
    enclosed : callable
        Why no plan can exist; asked where no search has anything left to expand.
    """
    stages = list(schedule.stages)
    passes: list[Pass] = []
    total = 0

    def begin() -> None:
        begun = [one for each in stages.pop(0)[1] for one in passes_of(each)]
        passes.extend(replace(one, chunk=schedule.first_chunk) for one in begun)

    begin()
    while True:
        for one in passes:
            if not one.alive or total >= room or time.monotonic() >= deadline:
                continue
            before = one.expansions
            word = one.run(min(one.chunk, room - total), math.inf, deadline=deadline)
            total += one.expansions - before
            one.chunk = min(2 * one.chunk, schedule.most_chunk)
            if word is not None:
                return FirstWord(word, passes, total, exhausted=False, by=one)
        alive = any(one.alive for one in passes)
        proof = "" if alive else enclosed()
        if total >= room or time.monotonic() >= deadline or proof:
            return FirstWord(None, passes, total, exhausted=not alive, enclosed=proof)
        if stages and (not alive or total >= stages[0][0]):
            begin()
        elif not alive:
            return FirstWord(None, passes, total, exhausted=True)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FirstPlan:
    """The result of the schedule of resolutions."""

    word: Word | None
    expansions: int
    queries: int  # collision queries
    exhausted: bool  # every resolution was tried to its end
    enclosed: str  # why no plan can exist, if the plane alone proves it
    nearest: float  # [m] least distance to the goal that was reached
    nodes: Array | None = None  # (n, 4) x, y, heading, cost of the expanded nodes, if asked for


def first_plan(
    query: LatticeQuery,
    *,
    deadline: float,
    max_expansions: int | None = None,
    table: CostTable = NO_TABLE,
) -> FirstPlan:
    """The first connection from start to a goal, at the first resolution that has one."""
    grids = distance_grids(query)
    base = Resolution(weight=query.settings.weight or WEIGHT)
    schedule = SCHEDULE._replace(stages=((0, (base,)), *SCHEDULE.stages[1:]))
    found = first_word(
        schedule,
        lambda one: both_ends(query, one, grids=grids, table=table if one.guided else NO_TABLE),
        room=max_expansions or 2**62,
        deadline=deadline,
        enclosed=lambda: _enclosed(query, grids),
    )
    missed = found.word is None
    return FirstPlan(
        word=found.word,
        expansions=found.expansions,
        queries=sum(one.queries for one in found.passes),
        exhausted=found.exhausted,
        enclosed=found.enclosed,
        nearest=min(one.nearest for one in found.passes) if missed else math.inf,
        nodes=_expanded(query, found.passes) if query.settings.show_nodes else None,
    )


def distance_grids(query: LatticeQuery) -> tuple[DistanceGrid, DistanceGrid]:
    """Distances to the goals and to the start."""
    to_goal = distance_grid(query.plane, query.box, query.goals, query.start)
    to_start = distance_grid(query.plane, query.box, query.start[None], query.goals[0])
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


def _expanded(query: LatticeQuery, passes: list[Pass]) -> Array:
    """Poses (n, 4) of the nodes that were expanded, in the problem's frame, and their costs."""
    rows = []
    for one in passes:
        n = int(one.arrays.state[kernels.N_NODES])
        closed = one.arrays.links[:n, kernels.CLOSED] == 1
        shown = [kernels.X, kernels.Y, kernels.HEADING, kernels.COST]
        rows.append(one.arrays.nodes[:n][closed][:, shown])
    nodes = np.concatenate(rows)
    turned = SE2(np.array([0.0, 0.0, query.world.frame[2]])) @ SE2(nodes[:, :3])
    poses = turned.pose.copy()
    poses[:, :2] += query.world.frame[:2]
    return np.column_stack([poses, nodes[:, 3]])
