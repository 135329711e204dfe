"""Transitions: the cheapest chain of maneuvers from each class of trims to each other.

Trims of one class switch at will, so what leads from trim to trim depends on their classes alone:
a kinematic vehicle has one class, whose only transition is the identity, however many trims it has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Automaton

SWITCH = -1  # the maneuver of a switch at will: the identity
HOP = 1e-9  # of the costliest maneuver: of equally cheap chains the one with the fewest maneuvers


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Transitions:
    """The cheapest chain of maneuvers between any two of C classes of trims."""

    class_of: IntArray  # (m,) of the automaton's trims
    displacement: Array  # (C, C, 4) a planar one has no height
    cost: Array  # (C, C) of the maneuvers, inf where no chain leads
    time: Array  # (C, C) [s]
    first: IntArray  # (C, C) first maneuver of the chain, -1 where there is none
    sources: IntArray  # (M,) trim before each maneuver
    targets: IntArray  # (M,) and after it

    def chain(self, source: int, target: int) -> tuple[tuple[int, int], ...]:
        """What leads from trim to trim: each (maneuver, trim it leads to), SWITCH for a switch.

        Raises
        ------
        ValueError
            If no chain of maneuvers leads there.
        """
        links: list[tuple[int, int]] = []
        while self.class_of[source] != self.class_of[target]:
            maneuver = int(self.first[self.class_of[source], self.class_of[target]])
            if maneuver < 0:
                raise ValueError(f"no maneuvers lead from trim {source} to trim {target}")
            if self.sources[maneuver] != source:
                links.append((SWITCH, int(self.sources[maneuver])))
            source = int(self.targets[maneuver])
            links.append((maneuver, source))
        if source != target:
            links.append((SWITCH, target))
        return tuple(links)


def transitions_of(automaton: Automaton, prices: Array) -> Transitions:
    """The transitions of an automaton whose maneuvers cost `prices` (M,)."""
    sources = np.array([automaton.index_of(one.source) for one in automaton.maneuvers], dtype=int)
    targets = np.array([automaton.index_of(one.target) for one in automaton.maneuvers], dtype=int)
    class_of = automaton.trim_classes
    n = int(class_of.max()) + 1
    first = _firsts(n, class_of[sources], class_of[targets], prices)
    gained, lasting = np.zeros((len(prices), 4)), np.zeros(len(prices))
    for k, maneuver in enumerate(automaton.maneuvers):
        gained[k, : maneuver.displacement.size] = maneuver.displacement
        lasting[k] = maneuver.duration
    cost, time, displacement = np.full((n, n), np.inf), np.zeros((n, n)), np.zeros((n, n, 4))
    np.fill_diagonal(cost, 0.0)
    # A chain is its first maneuver and the chain from there on, which is how it is followed: of
    # equally cheap chains that lead elsewhere, both are the same one. Short chains come first.
    rows, columns = np.nonzero(first >= 0)
    while rows.size:
        begin = first[rows, columns]
        middle = class_of[targets[begin]]
        known = np.isfinite(cost[middle, columns])
        i, j, k, via = rows[known], columns[known], begin[known], middle[known]
        cost[i, j] = prices[k] + cost[via, j]
        time[i, j] = lasting[k] + time[via, j]
        # Displacements (n, 4), each of `after` done in the frame of `before`.
        before = gained[k]
        after = displacement[via, j]
        c, s = np.cos(before[:, 2]), np.sin(before[:, 2])
        done = before + after
        done[:, 0] = before[:, 0] + c * after[:, 0] - s * after[:, 1]
        done[:, 1] = before[:, 1] + s * after[:, 0] + c * after[:, 1]
        displacement[i, j] = done
        rows, columns = rows[~known], columns[~known]
    return Transitions(
        class_of=class_of,
        displacement=displacement,
        cost=cost,
        time=time,
        first=first,
        sources=np.asarray(sources, dtype=np.int64),
        targets=np.asarray(targets, dtype=np.int64),
    )


@kept_by_first
def identities(automaton: Automaton) -> Transitions:
    """The transitions of a vehicle that switches at will between all trims of an automaton."""
    none = np.zeros(0, dtype=np.int64)
    return Transitions(
        class_of=np.zeros(len(automaton), dtype=np.int64),
        displacement=np.zeros((1, 1, 4)),
        cost=np.zeros((1, 1)),
        time=np.zeros((1, 1)),
        first=np.full((1, 1), SWITCH, dtype=np.int64),
        sources=none,
        targets=none,
    )


def _firsts(n: int, sources: IntArray, targets: IntArray, prices: Array) -> IntArray:
    """First maneuver (n, n) of the cheapest chain from class to class; -1 for none."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    best = np.full((n, n), -1)
    if not prices.size:
        return best
    weights = prices + HOP * max(float(prices.max()), 1.0)
    leads = np.flatnonzero(sources != targets)
    # Between two classes the cheapest maneuver, the first of equals.
    order = leads[np.lexsort((leads, weights[leads], targets[leads], sources[leads]))]
    new = np.ones(order.size, dtype=bool)
    new[1:] = (np.diff(sources[order]) != 0) | (np.diff(targets[order]) != 0)
    direct = order[new]
    graph = csr_array((weights[direct], (sources[direct], targets[direct])), shape=(n, n))
    edge = np.full((n, n), -1)
    edge[sources[direct], targets[direct]] = direct
    # Against the edges, from each class: a predecessor there is the next class along the edges.
    _, after = dijkstra(graph.T.tocsr(), return_predecessors=True)
    rows, columns = np.nonzero(after.T >= 0)
    best[rows, columns] = edge[rows, after.T[rows, columns]]
    return best
