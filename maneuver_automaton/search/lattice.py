"""A* over lattice cells with exact poses: from both ends in turn, at several resolutions."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.groups import SE2
from maneuver_automaton.search import _kernels_nodes as layout
from maneuver_automaton.search.cost_to_go import NO_TABLE, CostTable
from maneuver_automaton.search.distance_grid import DistanceGrid, distance_grid
from maneuver_automaton.search.lattice_pass import Pass, both_ends, pass_of
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_schedules import Schedule, schedule_of
from maneuver_automaton.search.lattice_task import Resolution
from maneuver_automaton.search.reversal import forward_word, reversed_query, to_reverse
from maneuver_automaton.words.word import Word

Grids = tuple[DistanceGrid, DistanceGrid]  # distances to the goals and to the start


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
    budget: Budget = UNLIMITED,
    table: CostTable = NO_TABLE,
    grids: Grids | None = None,
) -> FirstPlan:
    """The first connection from start to a goal, at the first resolution that has one.

    Parameters
    ----------
    query : LatticeQuery
        Its library says which resolutions are tried, and when.
    budget : Budget
        Its expansions are those of all searches together.
    table : CostTable
    grids : tuple of DistanceGrid, optional
        Distances to the goals and to the start, if they are known.
    """
    schedule = schedule_of(query.library)
    grids = distance_grids(query) if grids is None else grids
    room = 2**62 if budget.expansions is None else budget.expansions
    (_, coarse), *stages = schedule.stages
    if query.settings.weight is not None:
        coarse = tuple(replace(one, weight=query.settings.weight) for one in coarse)
    passes = _begun(query, schedule, coarse, grids, table)
    if budget.left < min(one.first_takes for one in passes):
        budget = budget.part(0.0)  # nothing is begun that would be late
    word, proof, total, left_out = None, "", 0, False
    while word is None:
        for one in passes:
            if not one.may_expand or total >= room or budget.is_over:
                continue
            before = one.expansions
            word = one.run(min(one.chunk, room - total), math.inf, budget=budget)
            total += one.expansions - before
            one.chunk = min(2 * one.chunk, schedule.most_chunk)
            if word is not None:
                word = forward_word(word) if one.resolution.backwards else word
                break
        alive = any(one.alive for one in passes)
        proof = "" if alive or word is not None else _enclosed(query, grids)
        late = alive and not any(one.may_expand for one in passes)
        if word is not None or total >= room or budget.is_over or proof or late:
            break
        if stages and (not alive or total >= stages[0][0]):
            _, resolutions = stages.pop(0)
            if any(one.backwards for one in resolutions) and budget.left < to_reverse(query):
                left_out = True
                continue
            passes += _begun(query, schedule, resolutions, grids, table)
        elif not alive:
            break
    ahead = [one for one in passes if not one.resolution.backwards]
    return FirstPlan(
        word=word,
        expansions=total,
        queries=sum(one.queries for one in passes),
        exhausted=word is None and not alive and not left_out,
        enclosed=proof,
        nearest=min(one.nearest for one in ahead) if word is None else math.inf,
        nodes=_expanded(query, passes) if query.settings.show_nodes else None,
    )


def _begun(
    query: LatticeQuery,
    schedule: Schedule,
    resolutions: tuple[Resolution, ...],
    grids: Grids,
    table: CostTable,
) -> list[Pass]:
    """Searches at some resolutions; one of the library in reverse only where that can be asked."""
    passes: list[Pass] = []
    for one in resolutions:
        if one.backwards:
            back = reversed_query(query)
            passes += [] if back is None else [pass_of(back, one, grid=grids[1])]
        else:
            guide = table if one.guided else NO_TABLE
            passes += both_ends(query, one, grids=grids, table=guide, ends=schedule.ends)
    for begun in passes:
        begun.chunk = schedule.first_chunk
    return passes


def distance_grids(query: LatticeQuery) -> Grids:
    """Distances to the goals and to the start."""
    grid = functools.partial(distance_grid, query.plane, query.box, prepared=query.prepared)
    return grid(query.goals, query.start), grid(query.start[None], query.goals[0])


def _enclosed(query: LatticeQuery, grids: Grids) -> str:
    """Why no plan can exist: the plane around the goals, or the start, is closed."""
    from maneuver_automaton.search._kernels_distance import distances

    for grid, name, far in (
        (grids[0], "goal", query.start[None]),
        (grids[1], "start", query.goals),
    ):
        if not grid.columns:
            continue
        lengths = distances(grid, query.world.arrays.field, np.ascontiguousarray(far[:, :2]))
        if np.isinf(lengths).all() and (query.bounded or not grid.state[2]):
            return f"obstacles enclose the {name}"
    return ""


def _expanded(query: LatticeQuery, passes: list[Pass]) -> Array:
    """Poses (n, 4) of the nodes that were expanded, in the problem's frame, and their costs."""
    rows = []
    for one in passes:
        n = int(one.arrays.state[layout.N_NODES])
        closed = one.arrays.links[:n, layout.CLOSED] == 1
        shown = [layout.X, layout.Y, layout.HEADING, layout.COST]
        rows.append(one.arrays.nodes[:n][closed][:, shown])
    nodes = np.concatenate(rows)
    turned = SE2(np.array([0.0, 0.0, query.world.frame[2]])) @ SE2(nodes[:, :3])
    poses = turned.pose.copy()
    poses[:, :2] += query.world.frame[:2]
    return np.column_stack([poses, nodes[:, 3]])
