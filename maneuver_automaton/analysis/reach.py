"""Poses that words of bounded cost reach from rest, in free space."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray, plain_numbers
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.search.lattice_library import path_length

EVEN = 16  # the number of bins of headings is a multiple: usual headings lie within, not between
MEASURES = ("time", "length")
SHORTEST = 1e-9  # of the greatest cost: steps that cost less are not taken


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachSettings:
    """How far to go, in which steps, and which poses count as one."""

    measure: str = "time"  # time [s] | length [m]
    most: float = 8.0  # greatest cost of a word [s or m]
    edge_cost: float = 0.5  # trims last a multiple of what costs this [s or m]
    same_m: float = 0.02  # poses of one trim in one cell of this side count as one
    same_rad: float = 0.02  # [rad], or a little less
    most_nodes: int = 100_000

    def __post_init__(self) -> None:
        plain_numbers(self)
        if self.measure not in MEASURES:
            raise ValueError(
                f"reach: measure must be one of {', '.join(MEASURES)}, got {self.measure!r}"
            )
        for name in ("most", "edge_cost", "same_m", "same_rad", "most_nodes"):
            if not getattr(self, name) > 0:
                raise ValueError(f"reach: {name} must be positive, got {getattr(self, name)}")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Reached:
    """Poses by rising cost; the first is the start."""

    poses: Array  # (n, 3) [m, m, rad]
    costs: Array  # (n,) [s or m]
    classes: IntArray  # (n,) of trims, in which the vehicle is there
    complete: bool  # whether the search ended before `most_nodes` were found


def reached(automaton: Automaton, *, start: str | None = None, settings: ReachSettings) -> Reached:
    """The poses that words from the origin reach, cheapest first; in the trim `start`, or at rest.

    Nodes are expanded in waves: all that cost less than the cheapest one and its cheapest step; a
    cell that is found again for less is expanded again. A cell keeps the cheapest pose found in it,
    exactly; on a lattice whose points are further apart than the cells nothing is lost, elsewhere
    the costs are upper bounds.

    Source: Dijkstra (1959), *A note on two problems in connexion with graphs*; Barraquand, Latombe
    (1993), *Nonholonomic multibody mobile robots*, for one node a cell.

    Raises
    ------
    ValueError
        If the vehicle does not move in the plane.
    """
    if automaton.model.group is not SE2:
        raise ValueError(f"reach: {automaton.model.name} is no vehicle in the plane")
    index = automaton.rest if start is None else automaton.index_of(start)
    first = int(automaton.trim_classes[index or 0])
    return _searched(first, _steps(automaton, settings), settings)


def rest_classes(automaton: Automaton) -> frozenset[int]:
    """Classes in which the vehicle can stand still; all of them if it never can."""
    still = ~automaton.body_velocities.any(axis=1)
    chosen = automaton.trim_classes[still] if still.any() else automaton.trim_classes
    return frozenset(chosen.tolist())


def _steps(automaton: Automaton, settings: ReachSettings) -> dict[int, _Nodes]:
    """Maneuvers, and every trim for one edge, by class: where they lead, from 0."""
    rows: defaultdict[int, list[tuple[Array, float, int]]] = defaultdict(list)
    for trim, where in zip(automaton.trims, automaton.trim_classes.tolist(), strict=True):
        rate = 1.0 if settings.measure == "time" else float(np.hypot(*trim.body_velocity[:2]))
        if not trim.is_rest and rate > 0.0:
            seconds = min(settings.edge_cost / rate, trim.max_duration)
            there = SE2.exp(seconds * trim.body_velocity).pose
            rows[where].append((there, settings.edge_cost, where))
    for maneuver, (source, target) in zip(
        automaton.maneuvers, automaton.maneuver_classes.tolist(), strict=True
    ):
        cost = maneuver.duration if settings.measure == "time" else path_length(maneuver)
        if maneuver.displacement.any() or source != target:
            rows[source].append((maneuver.displacement, cost, target))
    return {
        where: _Nodes(*map(np.array, zip(*entries, strict=True))) for where, entries in rows.items()
    }


def _searched(first: int, steps: dict[int, _Nodes], settings: ReachSettings) -> Reached:
    least = min(
        (float(table.costs[table.costs > 0.0].min(initial=math.inf)) for table in steps.values()),
        default=math.inf,
    )
    open_ = _Nodes(np.zeros((1, 3)), np.zeros(1), np.array([first], dtype=np.int64))
    closed: list[_Nodes] = []
    known: dict[int, float] = {}
    complete = True
    while open_.costs.size:
        limit = float(open_.costs.min()) + max(least, SHORTEST * settings.most)
        due = open_.costs < limit
        wave, open_ = _cheapest([open_.chosen(due)], settings), open_.chosen(~due)
        fresh = _unknown(wave, known, settings)
        if not fresh.costs.size:
            continue
        closed.append(fresh)
        if len(known) >= settings.most_nodes:
            complete = False
            break
        open_ = _cheapest([open_, *_followers(fresh, steps, settings)], settings)
    nodes = _cheapest(closed, settings)
    nodes = nodes.chosen(np.argsort(nodes.costs, kind="stable"))
    return Reached(**nodes._asdict(), complete=complete)


class _Nodes(NamedTuple):
    poses: Array
    costs: Array
    classes: IntArray

    def chosen(self, rows: IntArray | NDArray[np.bool_]) -> _Nodes:
        return _Nodes(self.poses[rows], self.costs[rows], self.classes[rows])

    def keys(self, settings: ReachSettings) -> IntArray:
        """One number for each cell and class."""
        bins = EVEN * math.ceil(2.0 * math.pi / (EVEN * settings.same_rad))
        x, y = np.round(self.poses[:, :2].T / settings.same_m).astype(np.int64)
        heading = np.mod(np.round(self.poses[:, 2] * bins / (2.0 * math.pi)).astype(np.int64), bins)
        wide = 1 << 20
        keys: IntArray = ((self.classes * bins + heading) * wide + x + wide // 2) * wide + y
        return keys


def _cheapest(parts: Sequence[_Nodes], settings: ReachSettings) -> _Nodes:
    """Of all the nodes one for each cell and class."""
    nodes = _Nodes(*map(np.concatenate, zip(*parts, strict=True)))
    order = np.argsort(nodes.costs, kind="stable")
    _, firsts = np.unique(nodes.keys(settings)[order], return_index=True)
    return nodes.chosen(order[firsts])


def _unknown(nodes: _Nodes, known: dict[int, float], settings: ReachSettings) -> _Nodes:
    """Nodes whose cells were not closed before, or at a higher cost; they are now."""
    fresh = np.zeros(nodes.costs.size, dtype=bool)
    pairs = zip(nodes.keys(settings).tolist(), nodes.costs.tolist(), strict=True)
    for k, (key, cost) in enumerate(pairs):
        if cost < known.get(key, math.inf) - SHORTEST * settings.most:
            known[key] = cost
            fresh[k] = True
    return nodes.chosen(fresh)


def _followers(nodes: _Nodes, steps: dict[int, _Nodes], settings: ReachSettings) -> list[_Nodes]:
    parts = []
    for where in np.unique(nodes.classes).tolist():
        table = steps.get(where)
        if table is None:
            continue
        here = nodes.chosen(nodes.classes == where)
        poses = (SE2(here.poses[:, None]) @ SE2(table.poses)).pose.reshape(-1, 3)
        costs = (here.costs[:, None] + table.costs).ravel()
        targets = np.broadcast_to(table.classes, (here.costs.size, table.costs.size)).ravel()
        parts.append(_Nodes(poses, costs, targets).chosen(costs <= settings.most))
    return parts
