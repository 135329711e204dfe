"""Exact search of a state lattice in time: past what moves, and with a longest time.

What stands is known first: the cost to go from every node that a plan of some cost may pass, by a
search from the goals. What is left of the search in time follows that closely.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._kept import Prepared
from maneuver_automaton.budget import Budget
from maneuver_automaton.costs import Cost, terms_of
from maneuver_automaton.problem import Problem
from maneuver_automaton.search import _kernels_nodes as layout
from maneuver_automaton.search import _kernels_timed_lattice as kernels
from maneuver_automaton.search._kernels_state_lattice import SEARCH
from maneuver_automaton.search.arrays import KnownCosts, Tested, TimedArrays, TimedQuery, Timing
from maneuver_automaton.search.lattice_library import LatticeLibrary, library_of_trims
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.lattice_trims import trims_of
from maneuver_automaton.search.scene import for_library
from maneuver_automaton.search.state_lattice import (
    CLOSE,
    MARGIN,
    Graph,
    GraphSearch,
    priced,
    slopes,
)
from maneuver_automaton.words.library import SWITCH
from maneuver_automaton.words.word import Word

TICK = 0.02  # [s] between departures that are tried
FINER = 16  # times shorter ticks for a bound, which is that much closer and takes as long
CHUNK = 1 << 12  # labels and motions between two looks at the clock
FIRST_ROOM = 1 << 12  # labels and places, and eight times as many motions
FREELY = KnownCosts(np.zeros((0, 0, 0)), 0, 0)  # of times, where none is too long


def costs_to_go(graph: Graph, most: float, budget: Budget) -> tuple[KnownCosts, float] | None:
    """Costs to go from all nodes that plans of less than `most` pass among what stands.

    And what a plan costs at least that leaves the window. None if the time is over before, or the
    goals hold too many nodes.
    """
    back = graph.backwards()
    if back is None:
        return None
    no_end = back.aims._replace(admits=np.zeros_like(back.aims.admits))
    one = GraphSearch.of(replace(back, aims=no_end), weight=1.0, budget=budget)
    while one.alive:
        if budget.is_over or one.is_late:
            return None
        one.run(1 << 20, most)
    column, row, state = one.arrays.links[: one.expansions, :3].T
    low = np.array([column.min(initial=0), row.min(initial=0)])
    size = np.array([column.max(initial=0), row.max(initial=0)]) - low + 1
    value = np.full((*size.tolist(), len(graph.lattice.heading)), np.inf)
    value[column - low[0], row - low[1], state] = one.arrays.cost[: one.expansions]
    return KnownCosts(value, int(low[0]), int(low[1])), one.cut


def by_time(graph: Graph) -> Graph:
    """The same graph, where an edge costs its duration."""
    time = graph.query.library.arrays.edges.time[graph.lattice.edge]
    lattice, aims = graph.lattice._replace(cost=time), graph.aims
    aims = priced(aims.place, aims.within, aims.admits, lattice, slopes(lattice))
    return replace(graph, lattice=lattice, aims=aims, surcharge=0.0)


@dataclass(slots=True, eq=False)
class TimedSearch:
    """A search in time, which can be stopped and resumed."""

    graph: Graph  # of all that stands
    query: TimedQuery
    alive: bool = True

    @classmethod
    def of(
        cls,
        graph: Graph,
        problem: Problem,
        free: KnownCosts,
        soon: KnownCosts,
        prepared: Prepared,
        *,
        bounds: bool = False,
    ) -> TimedSearch:
        """A search that is ready to run, of a problem whose goals are those of the graph.

        One that `bounds` the cost takes what moves for so much smaller as it moves in a tick: then
        no plan departs between two ticks at which the way is blocked, and none costs less.
        """
        cost = terms_of(problem.cost)
        assert cost is not None
        there = replace(graph.query.problem, obstacles=problem.obstacles, horizon=problem.horizon)
        query = lattice_query(there, range(len(there.goals)), prepared=prepared)
        fine = prepared.once(_followed, query.library, cost)
        turn = graph.lattice.frame[2] + float(query.start[2] - graph.query.start[2])
        states, n = len(graph.lattice.heading), FIRST_ROOM
        trims = query.library.arrays.library
        horizon, last = problem.horizon, query.world.last_event
        arrays = TimedArrays(
            table=np.zeros((4 * n, 2), dtype=np.int64),
            latest=np.empty((n, states), dtype=np.int32),
            links=np.empty((n, 6), dtype=np.int64),
            times=np.empty((n, 3)),
            cost=np.empty(n),
            heap_key=np.empty(8 * n + graph.lattice.most_links),
            heap_item=np.empty(8 * n + graph.lattice.most_links, dtype=np.int64),
            state=np.zeros(7, dtype=np.int64),
            found=np.full(1, np.inf),
        )
        arrays.state[kernels.AIM] = -1
        quiet = max(last - problem.start_time, 0.0) if query.moves else 0.0
        tick = TICK / FINER if bounds else max(TICK, float(horizon.min_coast))
        tick = max(tick, quiet / kernels.MOST_WAITS)
        scene = for_library(query.scene(min(MARGIN, query.margin)), problem, fine)
        if bounds:
            fastest = float(query.world.arrays.moving.speed.max(initial=0.0))
            scene = scene._replace(keep=scene.keep - fastest * tick)
        return cls(
            graph,
            TimedQuery(
                arrays=arrays,
                lattice=graph.lattice,
                aims=graph.aims,
                free=free,
                soon=soon,
                coarse=graph.coarse,
                fine=graph.fine,
                moving=Tested(fine.arrays, scene),
                frame=(*query.start[:2].tolist(), turn, math.cos(turn), math.sin(turn)),
                directed=states // trims.n_trims,
                timing=Timing(
                    clock=float(problem.start_time),
                    quiet=quiet,
                    most_time=math.inf if horizon.max_time is None else query.most_time,
                    stays=horizon.stay,
                    tick=tick,
                    least_wait=0.0 if bounds else float(horizon.min_coast),
                    rate=float(trims.rates[: trims.n_trims].max(initial=0.0)),
                    pause=float(cost.switch),
                ),
            ),
        )

    @property
    def cost(self) -> float:
        """Cost of the plan that was found; inf if none is."""
        arrays = self.query.arrays
        if arrays.state[kernels.AIM] < 0:
            return math.inf
        cost = float(arrays.cost[arrays.state[kernels.FOUND]])
        return cost - self.graph.surcharge if cost > 0.0 else cost

    @property
    def queries(self) -> int:
        """Motions that were tested among what moves."""
        return int(self.query.arrays.state[kernels.QUERIES])

    @property
    def least_missed(self) -> float:
        """No plan costs less that departs between two ticks at which the way is blocked."""
        return float(self.query.arrays.found[0]) - self.graph.surcharge

    def run(self, upper_bound: float, budget: Budget) -> None:
        """Search for a plan below a cost, until one is found, or the time is over."""
        while self.alive and not budget.is_over:
            self._make_room()
            most = upper_bound + self.graph.surcharge
            self.alive = bool(kernels.expand_in_time(self.query, CHUNK, most))

    def _make_room(self) -> None:
        """Widen the arrays that are full."""
        one = self.query.arrays
        labels, places, queued = one.state[: kernels.HEAP + 1].tolist()
        full = [*one._fields[2:5]] if labels == len(one.cost) else []
        if queued + self.graph.lattice.most_links > len(one.heap_key):
            full += one._fields[5:7]
        if places == len(one.latest):
            full.append("latest")
            table = np.zeros((2 * len(one.table), 2), dtype=np.int64)
            layout.rehash(one.table, SEARCH, table)
            one = one._replace(table=table)
        for name in full:
            array = getattr(one, name)
            room = np.empty((2 * len(array), *array.shape[1:]), dtype=array.dtype)
            room[: len(array)] = array
            one = one._replace(**{name: room})
        self.query = self.query._replace(arrays=one)

    def word(self) -> tuple[Word, int]:
        """The plan that was found, as a word, and the number of the goal where it ends."""
        graph, arrays = self.graph, self.query.arrays
        library, links, steps = graph.query.library, arrays.links, list[tuple[int, int, float]]()
        label, waited = int(arrays.state[kernels.FOUND]), 0.0
        while links[label, kernels.PARENT] >= 0:
            edge = int(graph.lattice.edge[links[label, kernels.EDGE]])
            trim = int(library.trims[library.arrays.edges.target[edge]])
            steps.append((int(library.arrays.edges.maneuver[edge]), trim, waited))
            waited = float(arrays.times[label, kernels.WAITED])
            label = int(links[label, kernels.PARENT])
        steps.append((SWITCH, int(library.trims[graph.query.start_trim]), waited))
        goal = graph.goal_index[int(arrays.state[kernels.AIM])]
        return graph.query.word_of(steps[::-1], 0), goal


def _followed(library: LatticeLibrary, cost: Cost) -> LatticeLibrary:
    """The library with courses that are followed exactly, piece by piece, in time."""
    trims = trims_of(library.priced, cost)
    return library_of_trims(trims, library.parts, waits=True, close=CLOSE)
