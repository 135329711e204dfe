"""Least costs on a state lattice without obstacles: by symmetry one table serves all like aims.

They are a consistent lower bound of the cost to go among obstacles, and nearly the cost itself
where few are in the way. A table grows by Dijkstra's algorithm against the edges, from its sources,
as far as a query needs, and stays with its library for the next one.

Source: Likhachev, Ferguson (2009), *Planning long dynamically feasible maneuvers for autonomous
vehicles*, IJRR 28(8), Sec. 5.2.
"""

from __future__ import annotations

import math
import threading

import numpy as np

from maneuver_automaton._arrays import IntArray
from maneuver_automaton.budget import Budget
from maneuver_automaton.search import _kernels_state_lattice as kernels
from maneuver_automaton.search.arrays import CostQueue, FreeCosts, StateLattice

BEYOND = 1.25  # times the cost from the start, up to which costs are known
WIDER = 1.5  # times the cost looked up to, where the start was not met
MOST_ENTRIES = 1 << 23  # of a table, 64 MiB
CHUNK = 1 << 14  # nodes that are settled between two looks at the clock


UNKNOWN = FreeCosts(np.zeros((0, 0, 0)), 0, 0, 0.0)


class FreeTable:
    """The least costs from the nodes of a lattice to some `sources` (R, 3): column, row, state."""

    def __init__(self, lattice: StateLattice, sources: IntArray, per_metre: float) -> None:
        self._lattice = lattice
        self._per_cell = per_metre * lattice.cell
        self._low, self._high = sources[:, :2].min(axis=0), sources[:, :2].max(axis=0)
        self._rim = 0  # cells around the sources that the table has room for
        shape = (*(self._high - self._low + 1).tolist(), len(lattice.heading))
        self._value = np.full(shape, np.inf)
        self._value[tuple((sources - [*self._low, 0]).T)] = 0.0
        first = np.flatnonzero(self._value.ravel() == 0.0)
        spare = np.zeros(max(4096, len(first)), dtype=np.int64)
        self._item = np.append(first, spare)
        self._key = np.zeros(len(self._item))
        self._state = np.array([len(first), 0])  # entries of the heap, nodes settled
        self._limits: dict[int, float] = {}  # least cost of what is not among the first n nodes
        self._lock = threading.Lock()

    def around(self, roots: IntArray, base: IntArray, n: int, budget: Budget) -> FreeCosts:
        """The costs that a search from `roots` (R, 3) needs, of the `n` nearest nodes at most.

        What comes back depends on the query alone, not on what was asked for before: a larger n has
        to follow a smaller one. Roots are seen from the sources, whose place in the lattice of the
        query is `base` (2,). Where the time is over, what is known.
        """
        with self._lock:
            most = max(self._per_cell * float(np.hypot(*roots[:, :2].T).min()), self._per_cell)
            while True:
                known = self._grown(BEYOND * most, n, budget)
                least = self._known(roots)
                if known < BEYOND * most:
                    return self._as_far_as(known, base)
                if least <= known:
                    return self._as_far_as(self._grown(BEYOND * least, n, budget), base)
                most *= WIDER

    def _as_far_as(self, most: float, base: IntArray) -> FreeCosts:
        column, row = (base + self._low - self._rim).tolist()
        return FreeCosts(self._value, column, row, most)

    def _known(self, roots: IntArray) -> float:
        """The least cost from one of the roots, as far as it is known."""
        at = roots - [*(self._low - self._rim), 0]
        inside = ((at >= 0) & (at < self._value.shape)).all(axis=1)
        return float(self._value[tuple(at[inside].T)].min(initial=np.inf))

    def _grown(self, most: float, n: int, budget: Budget) -> float:
        """Grow up to a cost, or to `n` nodes; the cost up to which all are known."""
        # Whatever costs no more lies within the rim, and so does where its edges come from.
        size, states = self._high - self._low + 1, self._value.shape[2]
        edge = int(np.abs(self._lattice.step).max(initial=0))
        widest = (math.isqrt(MOST_ENTRIES // states) - int(size.max())) // 2 - edge
        cells = min(math.ceil(most / self._per_cell), max(widest, 0))
        most, rim = min(most, cells * self._per_cell), cells + edge
        if rim > self._rim:
            wide = np.full((*(size + 2 * rim), states), np.inf)
            by = rim - self._rim
            inner = wide[by : by + self._value.shape[0], by : by + self._value.shape[1]]
            inner[...] = self._value
            listed = self._item[: self._state[0]]
            i, j, at = np.unravel_index(listed, self._value.shape)
            listed[:] = np.ravel_multi_index((i + by, j + by, at), wide.shape)
            self._value, self._rim = wide, rim
        late = False
        while self._state[0] and self._key[0] <= most:
            room = min(CHUNK, n - int(self._state[1]))
            if room <= 0:
                return self._limits.setdefault(n, float(self._key[0]))
            if late:
                return float(self._key[0])
            if self._state[0] + self._lattice.most_links > len(self._key):
                self._key = np.append(self._key, np.zeros_like(self._key))
                self._item = np.append(self._item, np.zeros_like(self._item))
            known = self._as_far_as(0.0, np.zeros(2, dtype=np.int64))
            queue = CostQueue(self._key, self._item, self._state)
            kernels.grow_free_costs(self._lattice, known, queue, float(most), room)
            late = budget.is_over
        return min(most, self._limits.get(n, math.inf))
